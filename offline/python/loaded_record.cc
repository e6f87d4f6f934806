#include "offline/python/loaded_record.h"

#include <memory>

#include <tumbler/space_truth_t.hpp>

#include "runtime/record/flight_record.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/messages.h"
#include "runtime/record/record_export.h"
#include "runtime/record/truth_csv.h"

namespace tumbler {
namespace {

void AddTick(const state_t& state, const std::vector<std::string>& joints, ColumnTable& table) {
  const auto append = [&table](const char* name, const auto& value) { table.Append(name, value); };
  table.BeginRow();
  ForEachTickColumn(state, append);
  for (std::size_t j = 0; j < joints.size() && j < state.joints.size(); ++j) {
    ForEachJointColumn([&](const JointField& field, auto in_message) {
      table.Append(joints[j] + "_" + field.column, in_message(state.joints[j]));
    });
  }
  ForEachSensorColumn(state, append);
}

void AddTruth(const space_truth_t& state, ColumnTable& table) {
  const truth_t& truth = state.truth;
  const TruthKind kind = KindOf(state);
  table.BeginRow();
  table.Append("time_s", ColumnTime{truth.time_ns});
  ForEachTruthRootColumn(state, kind,
                         [&table](const char* name, double value) { table.Append(name, value); });
  table.Append("held", truth.held);
  table.Append("fallen", truth.fallen);
  table.Append("falls", truth.falls);
  table.Append("push_x_n", truth.push_x_n);
  if (kind == TruthKind::kInSpace) table.Append("push_y_n", state.push_y_n);
  table.Append("push_z_n", truth.push_z_n);
  table.Append("peak_penetration_m", truth.peak_penetration_m);
  for (const joint_truth_t& joint : truth.joints) {
    const auto append = [&](const char* column, const auto& value) {
      table.Append(joint.name + "_" + column, value);
    };
    append("position_rad", joint.position_rad);
    append("velocity_rad_s", joint.velocity_rad_s);
    append("torque_nm", joint.torque_nm);
    append("temperature_c", joint.temperature_c);
    append("enabled", joint.enabled);
    append("limp", joint.limp);
  }
}

void AddTruths(const FlightRecord& record, ColumnTable& table) {
  space_truth_t truth;
  for (const auto bytes : record.truths()) {
    if (ReadMessage(bytes, truth)) AddTruth(truth, table);
  }
}

}  // namespace

LoadedRecord LoadRecord(const std::string& path) {
  const MappedFile file(path);
  FlightRecord record(file.bytes(), path);
  LoadedRecord loaded;
  loaded.name = path;
  loaded.joints = record.configuration().joints;
  loaded.period_s = static_cast<double>(record.configuration().period_ns) * 1e-9;
  TimedRecords records = TimedRecordsOf(record.configuration());
  const auto entry = std::make_unique<TickEntry>();
  state_t state{};
  while (record.Next(*entry)) {
    AddTruths(record, loaded.truths);
    FillState(records.Next(*entry), state);
    AddTick(state, loaded.joints, loaded.ticks);
  }
  AddTruths(record, loaded.truths);
  loaded.remarks = record.Remarks();
  loaded.complete = record.end() && record.end()->lost == 0 && record.damages().empty() &&
                    record.lost().empty() && !record.cut_off();
  loaded.summary = Summary(record);
  return loaded;
}

}  // namespace tumbler
