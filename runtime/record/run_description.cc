#include "runtime/record/run_description.h"

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/error_texts.h"

namespace tumbler {

RunDescription DescribeMotion(const SequenceGraph<float>& graph, const DrivesConfig& drives) {
  RunDescription run;
  run.motion = std::string(graph.name.view());
  run.rate_hz = drives.rate_hz;
  run.bit_rate = drives.bit_rate;
  for (const DriveEntry& entry : drives.drives) run.joints.push_back(entry.joint);
  run.error_codes = ErrorCodesOf(drives);
  for (const SequenceNode& node : graph.nodes()) run.nodes.emplace_back(node.name.view());
  run.branches = BranchNames(graph);
  return run;
}

}  // namespace tumbler
