#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "runtime/assembly/run_parts.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/picture_source.h"
#include "runtime/record/run_exports.h"
#include "runtime/record/run_mcap.h"

namespace tumbler {

/// The robot of a run and its plan, as an McapExport draws them.
struct McapPictures {
  std::optional<RobotPicture> robot;    ///< None: the file has no frames and no scene.
  std::unique_ptr<RunPlanner> planner;  ///< Null: there is no plan.
};

/// The pictures of a run.
/// @param about     the run, as its flight record has it.
/// @param pictures  null: none are made.
/// @param parts     motion and drives of the run.
/// @param path      of the MCAP file, for messages.
/// @throws FileError  when the robot cannot be drawn; std::runtime_error  when its plan cannot.
McapPictures PicturesOf(const RecordConfiguration& about, const PictureSource* pictures,
                        const RunParts& parts, const std::string& path);

/// A run as MCAP (RunMcap), with what is in its flight record.
class McapExport final : public FileExport, private MessageStream {
 public:
  /// @param about      the run, as its flight record has it.
  /// @param has_truth  whether true states come.
  /// @throws std::runtime_error or FileError  naming the file that cannot be written.
  McapExport(const std::string& path, const RunExportConfig& config,
             const RecordConfiguration& about, bool has_truth, McapPictures pictures);

  void Take(const TickEntry& entry, const TimedRecord& timed) override;
  /// @throws RecordError  when it is of another version.
  void TakeTruth(std::span<const std::uint8_t> truth) override;
  void Finish() override;

 private:
  void Put(const state_t& message, std::int64_t time_ns) override;
  void Put(const event_t& message, std::int64_t time_ns) override;
  void Put(const run_t& message, std::int64_t time_ns) override;
  void TakePlan(const std::optional<PlannedInstant>& plan);
  [[nodiscard]] std::uint64_t TimeOf(std::int64_t time_ns) const;

  std::int64_t zero_ns_;  // of the loop's clock
  std::unique_ptr<RunPlanner> planner_;
  std::optional<RunMcap> mcap_;
  space_truth_t truth_;
};

/// Writes a flight record as MCAP.
/// @param pictures  of its robot; null: the file has no frames and no scene.
/// @returns the number of ticks.
/// @throws RecordError or FileError  naming the file that cannot be used or written. There is no
/// new file then.
std::int64_t ExportMcap(FlightRecord& record, const std::string& path,
                        const PictureSource* pictures);

}  // namespace tumbler
