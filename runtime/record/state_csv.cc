#include "runtime/record/state_csv.h"

#include <fmt/format.h>

#include <cmath>
#include <type_traits>

#include "common/files/csv_field.h"
#include "runtime/record/state_columns.h"

namespace tumbler {
namespace {

/// Appends a value and a comma.
class AppendColumn {
 public:
  explicit AppendColumn(std::string& csv) : out_(csv) {}

  template <typename Value>
  void operator()(const char* /*name*/, const Value& value) {
    out_ += fmt::format("{},", value);
  }
  void operator()(const char* /*name*/, const ColumnTime& time) {
    out_ += fmt::format("{:.6f},", static_cast<double>(time.ns) * 1e-9);
  }
  void operator()(const char* /*name*/, const ColumnFaultNumber& number) {
    if (number.integer) {
      out_ += fmt::format("{:.0f},", number.value);
    } else {
      out_ += fmt::format("{},", static_cast<float>(number.value));
    }
  }

 private:
  std::string& out_;
};

}  // namespace

std::string StateCsvHeader(const std::vector<std::string>& joint_names) {
  std::string header;
  const auto append = [&header](const char* name, const auto& /*value*/) {
    header += fmt::format("{},", name);
  };
  ForEachTickColumn(state_t{}, append);
  for (const std::string& joint : joint_names) {
    ForEachJointColumn([&](const JointField& field, auto /*in_message*/) {
      header += CsvField(fmt::format("{}_{}", joint, field.column)) + ',';
    });
  }
  ForEachSensorColumn(state_t{}, append);
  header.pop_back();
  return header;
}

void AppendStateCsvRow(const state_t& state, std::string& csv) {
  AppendColumn append(csv);
  ForEachTickColumn(state, append);
  for (const joint_state_t& joint : state.joints) {
    ForEachJointColumn([&](const JointField& field, auto in_message) {
      const auto& value = in_message(joint);
      if constexpr (std::is_floating_point_v<std::remove_cvref_t<decltype(value)>>) {
        if (field.empty_if_nan && std::isnan(value)) {
          csv += ',';
          return;
        }
      }
      append(field.column, value);
    });
  }
  ForEachSensorColumn(state, append);
  csv.back() = '\n';
}

}  // namespace tumbler
