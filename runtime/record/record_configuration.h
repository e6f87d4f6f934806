#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "runtime/assembly/file_keeper.h"
#include "runtime/assembly/machine.h"
#include "runtime/executor/executor_config.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/record/record_blocks.h"

namespace tumbler {

/// Thrown when a record, or a part of it, cannot be used. The message names the file.
class RecordError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The whole configuration of a run: enough to repeat it.
struct RecordConfiguration {
  std::string program;                    ///< Name and version.
  std::vector<std::string> command_line;  ///< For people.
  std::string kernel;                     ///< System, release, version and processor.
  Machine machine;                        ///< The same for people, and the adapter of the bus.
  std::string bus;                        ///< `sim` or the interface.
  bool dry_run = false;
  bool virtual_time = false;
  /// Time since 1970 at time 0 of the loop's clock; 0 in virtual time.
  std::int64_t utime_at_zero_us = 0;
  std::int64_t period_ns = 0;
  std::vector<std::string> joints;  ///< Names in the order of the executor.
  std::string motion_file;          ///< One of `files`; so are the files that it names.
  std::string drives_file;          ///< One of `files`; empty: DefaultDrives.
  ExecutorConfig executor;
  RunProcedureConfig procedure;
  std::vector<LoadedFile> files;
  /// Of a record that was read: keys of numbers and names of faults that it does not have, since
  /// runs did not know them then.
  std::vector<std::string> lacks;
};

/// System, release, version and processor of this machine, by uname.
std::string DescribeKernel();

/// The blocks of a configuration: one of JSON, with the size and hash of every file, and one for
/// each file.
RecordBytes EncodeConfiguration(const RecordConfiguration& configuration);

/// Reads the JSON. The result's `files` are those that it names, without their texts.
/// @throws RecordError  naming the key.
RecordConfiguration ParseConfiguration(std::string_view json);

}  // namespace tumbler
