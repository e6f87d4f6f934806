#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "runtime/assembly/file_keeper.h"
#include "runtime/core/executor_config.h"
#include "runtime/core/run_procedure.h"
#include "runtime/linux/machine.h"
#include "runtime/record/record_blocks.h"

namespace tumbler {

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
  std::vector<LoadedFile> files;
};

/// System, release, version and processor of this machine, as uname says.
std::string DescribeKernel();

/// The blocks of a configuration: itself as JSON, with the size and hash of every file, and a block
/// for each file.
RecordBytes EncodeConfiguration(const RecordConfiguration& configuration);

/// Reads the JSON; `files` are those that it names, still without their texts.
/// @throws RecordError naming the key.
RecordConfiguration ParseConfiguration(std::string_view json);

}  // namespace tumbler
