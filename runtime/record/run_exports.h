#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <tumbler/state_t.hpp>

#include "common/files/result_file.h"
#include "firmware_interface/can/frame.h"
#include "runtime/record/messages.h"
#include "runtime/record/output_file.h"
#include "runtime/record/run_description.h"
#include "runtime/record/run_export.h"

namespace tumbler {

/// What run_t says besides what follows from ticks. Exports share it with whoever runs the loop; a
/// thread that was left behind still has it.
struct LiveFigures {
  std::atomic<std::int64_t> lost{0};         ///< Ticks for which an output had no room.
  std::atomic<std::int64_t> unpublished{0};  ///< Messages that LCM did not take.
  std::mutex mutex;                          ///< Guards the rest; the loop never asks for it.
  std::string scheduling;
  bool checking = false;
  std::int64_t check_request = 0;
};

struct RunExportConfig {
  RunDescription run;
  /// The log's time at time 0 of the loop: 0 for virtual time, else microseconds since 1970.
  std::int64_t utime_at_zero_us = 0;
  /// Whether files appear only when they are whole, by Commit: where what they are made of is kept
  /// elsewhere. Else a run that is ended leaves what it has written.
  bool whole_files = false;
  std::shared_ptr<LiveFigures> figures = std::make_shared<LiveFigures>();
};

/// An export into a file.
class FileExport : public RunExport {
 public:
  /// @param whole  as RunExportConfig::whole_files.
  /// @throws std::runtime_error  naming the file that cannot be opened.
  FileExport(const std::string& path, bool whole);

  void Idle() override { out_.Flush(); }
  void Finish() override { out_.Flush(); }
  void Commit() override {
    if (pending_) pending_->Commit();
  }
  [[nodiscard]] bool failed() const override { return out_.failed(); }
  [[nodiscard]] std::int64_t progress() const noexcept override { return out_.taken(); }

 protected:
  [[nodiscard]] OutputFile& out() { return out_; }

 private:
  std::string NameToOpen(const std::string& path, bool whole);

  std::optional<PendingName> pending_;
  std::optional<WriterLock> lock_;
  OutputFile out_;
};

/// The messages about a run, whatever becomes of them.
class MessageStream {
 public:
  explicit MessageStream(const RunExportConfig& config);
  virtual ~MessageStream() = default;
  MessageStream(const MessageStream&) = delete;
  MessageStream& operator=(const MessageStream&) = delete;

 protected:
  void TakeTick(const TimedRecord& timed);
  void EmitRun(std::int64_t time_ns);
  /// The last run_t, where there was a tick.
  void EmitLast() {
    if (ticked_) EmitRun(last_time_ns_);
  }
  [[nodiscard]] bool ticked() const { return ticked_; }
  [[nodiscard]] LiveFigures& figures() const { return *figures_; }

 private:
  // Each with its time, on the clock of the loop.
  virtual void Put(const state_t& message, std::int64_t time_ns) = 0;
  virtual void Put(const event_t& message, std::int64_t time_ns) = 0;
  virtual void Put(const run_t& message, std::int64_t time_ns) = 0;

  std::int64_t number_;
  std::shared_ptr<LiveFigures> figures_;
  state_t message_;
  EventWatch events_;
  RunMessage run_;
  std::int64_t next_run_ns_ = 0;  // time of the next run_t, on the loop's clock
  std::int64_t last_time_ns_ = 0;
  bool ticked_ = false;
  std::int64_t next_number_ = 0;
  std::int64_t missing_ = 0;  // ticks that did not come
};

/// The same, encoded for LCM.
class LcmStream : public MessageStream {
 protected:
  using MessageStream::MessageStream;

 private:
  void Put(const state_t& message, std::int64_t time_ns) final;
  void Put(const event_t& message, std::int64_t time_ns) final;
  void Put(const run_t& message, std::int64_t time_ns) final;
  template <typename Message>
  void Encode(const char* channel, const Message& message, std::int64_t time_ns);
  virtual void Emit(const char* channel, std::span<const std::uint8_t> bytes,
                    std::int64_t time_ns) = 0;

  std::vector<std::uint8_t> buffer_;
};

/// Appends events to a file as lcm_eventlog_write_event writes them. That one needs a stream of the
/// C library.
class LcmEvents {
 public:
  explicit LcmEvents(std::int64_t utime_at_zero_us) : utime_at_zero_us_(utime_at_zero_us) {}
  void Append(std::string_view channel, std::span<const std::uint8_t> bytes, std::int64_t time_ns,
              OutputFile& out);

 private:
  void AppendNumber(std::uint64_t number, int size);

  std::int64_t utime_at_zero_us_;
  std::int64_t count_ = 0;
  std::string event_;
};

/// All ticks, events and run_t as an LCM log, for lcm-logplayer and lcm-spy.
class LogExport final : public FileExport, private LcmStream {
 public:
  LogExport(const std::string& path, const RunExportConfig& config);
  void Take(const TickEntry& entry, const TimedRecord& timed) override;
  void Finish() override;

 private:
  void Emit(const char* channel, std::span<const std::uint8_t> bytes,
            std::int64_t time_ns) override {
    events_.Append(channel, bytes, time_ns, out());
  }
  LcmEvents events_;
};

/// All ticks as CSV, one row a tick.
class CsvExport final : public FileExport {
 public:
  CsvExport(const std::string& path, const RunExportConfig& config);
  void Take(const TickEntry& entry, const TimedRecord& timed) override;

 private:
  std::int64_t number_;
  state_t message_;
  std::string row_;
};

/// All true states of a simulated robot as an LCM log.
class TruthLogExport final : public FileExport {
 public:
  TruthLogExport(const std::string& path, const RunExportConfig& config);
  void Take(const TickEntry& /*entry*/, const TimedRecord& /*timed*/) override {}
  void TakeTruth(std::span<const std::uint8_t> truth) override;

 private:
  LcmEvents events_;
};

/// All frames by time, as `candump -l` logs them. Sent frames have the time at which they were
/// handed to the bus, received frames that of their arrival.
class CandumpExport final : public FileExport {
 public:
  CandumpExport(const std::string& path, const RunExportConfig& config);
  void Take(const TickEntry& entry, const TimedRecord& timed) override;
  void Finish() override;
  [[nodiscard]] std::int64_t frames() const { return count_; }

 private:
  void WriteBefore(std::int64_t time_ns);

  std::string bus_;
  std::int64_t utime_at_zero_us_;
  std::vector<ReceivedFrame> frames_;  ///< Those before which an older one may still come.
  std::int64_t awake_before_ns_;
  std::int64_t count_ = 0;
};

}  // namespace tumbler
