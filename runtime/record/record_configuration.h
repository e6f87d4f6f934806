#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/sequence_toml.h"
#include "firmware_interface/drives/drives_toml.h"
#include "runtime/core/executor.h"
#include "runtime/core/run_procedure.h"
#include "runtime/linux/machine.h"
#include "runtime/record/record_blocks.h"

namespace tumbler {

/// A file as it was loaded.
struct RecordedFile {
  std::string path;  ///< As the program was given it, or found it.
  std::string text;
};

/// A record, or a part of it, that cannot be used; the message names the file.
class RecordError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// All that a run was configured with: enough to do it again.
struct RecordConfiguration {
  std::string program;                    ///< Name and version.
  std::vector<std::string> command_line;  ///< For people.
  std::string kernel;                     ///< Of the machine: system, release, version, processor.
  Machine machine;                        ///< The same for people, and the adapter of the bus.
  std::string bus;                        ///< `sim` or the interface.
  bool dry_run = false;
  bool virtual_time = false;
  std::int64_t utime_at_zero_us = 0;  ///< Time since 1970 at time 0 of the loop's clock; 0 in
                                      ///< virtual time.
  std::int64_t period_ns = 0;
  std::vector<std::string> joints;  ///< In the order of the executor.
  std::string motion_file;          ///< One of `files`, like those that it names.
  std::string drives_file;          ///< One of `files`; empty: DefaultDrives.
  ExecutorConfig executor;
  RunProcedureConfig procedure;
  std::vector<RecordedFile> files;
};

/// System, release, version and processor of this machine, as uname says.
std::string DescribeKernel();

/// The blocks of a configuration: itself as JSON, with the size and hash of every file, and a block
/// for each file.
RecordBytes EncodeConfiguration(const RecordConfiguration& configuration);

/// Reads the JSON; `files` are those that it names, still without their texts.
/// @throws RecordError naming the key.
RecordConfiguration ParseConfiguration(std::string_view json);

/// Takes part in loading: hands out texts of files and keeps them for the record.
class FileKeeper {
 public:
  /// For loaders; refers to this object.
  [[nodiscard]] FileReader reader();
  [[nodiscard]] const std::vector<RecordedFile>& files() const { return files_; }

 private:
  std::vector<RecordedFile> files_;
};

/// Everything between a configuration and an executor that is ready for its first tick.
class ConfiguredExecutor {
 public:
  /// Loads the recorded files, and checks them as tumbler-run does.
  /// @throws FileError or RecordError about what cannot be used.
  explicit ConfiguredExecutor(const RecordConfiguration& configuration);
  ConfiguredExecutor(const ConfiguredExecutor&) = delete;
  ConfiguredExecutor& operator=(const ConfiguredExecutor&) = delete;

  [[nodiscard]] Executor& executor() { return *executor_; }
  [[nodiscard]] const DrivesConfig& drives() const { return drives_; }
  [[nodiscard]] const Sequence<float>& motions() const { return *motions_; }

 private:
  DrivesConfig drives_;
  std::unique_ptr<const Sequence<float>> motions_;
  std::unique_ptr<DriveBank> bank_;
  std::unique_ptr<Executor> executor_;
};

}  // namespace tumbler
