#include "runtime/record/truth_csv.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/files/csv_field.h"

namespace tumbler {

std::string TruthCsvHeader(const std::vector<std::string>& joint_names, TruthKind kind) {
  std::string header;
  ForEachTruthColumn(space_truth_t{}, kind, [&header](const char* name, const auto& /*value*/) {
    header += fmt::format("{},", name);
  });
  for (const std::string& joint : joint_names) {
    for (const char* of : {"position_rad", "velocity_rad_s", "torque_nm"})
      header += CsvField(fmt::format("{}_{}", joint, of)) + ',';
  }
  header.pop_back();
  return header;
}

void AppendTruthCsvRow(const space_truth_t& state, const std::vector<std::string>& joint_names,
                       std::string& csv) {
  const truth_t& truth = state.truth;
  ForEachTruthColumn(state, KindOf(state), [&csv](const char* /*name*/, const auto& value) {
    csv += fmt::format("{},", value);
  });
  for (const std::string& name : joint_names) {
    const auto joint = std::find_if(truth.joints.begin(), truth.joints.end(),
                                    [&name](const joint_truth_t& j) { return j.name == name; });
    if (joint == truth.joints.end()) {
      csv += ",,,";
    } else {
      csv += fmt::format("{},{},{},", joint->position_rad, joint->velocity_rad_s, joint->torque_nm);
    }
  }
  csv.back() = '\n';
}

}  // namespace tumbler
