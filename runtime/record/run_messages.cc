#include "runtime/record/run_messages.h"

#include <fmt/format.h>

#include <limits>
#include <type_traits>
#include <utility>

#include "runtime/record/foxglove_messages.h"
#include "runtime/record/run_fields.h"
#include "runtime/record/state_columns.h"
#include "runtime/record/truth_csv.h"

namespace tumbler {
namespace {

/// The field number of the time, with which every message begins.
constexpr int kTimeField = 1;

template <typename Value>
constexpr ProtoKind KindOf() {
  if constexpr (std::is_same_v<Value, const char*> || std::is_same_v<Value, std::string>)
    return ProtoKind::kString;
  if constexpr (std::is_same_v<Value, float>) return ProtoKind::kFloat;
  if constexpr (std::is_same_v<Value, std::int64_t>) return ProtoKind::kInt64;
  if constexpr (std::is_same_v<Value, std::uint32_t>) return ProtoKind::kUint32;
  if constexpr (std::is_integral_v<Value> && sizeof(Value) <= 4) return ProtoKind::kInt32;
  return ProtoKind::kDouble;
}

/// Appends fields with the numbers 2, 3, ...
class FieldAppender {
 public:
  explicit FieldAppender(std::string& message) : out_(message) {}

  template <typename Value>
  void operator()(const char* /*name*/, const Value& value) {
    ++number_;
    if constexpr (std::is_same_v<Value, ColumnTime>) {
      out_.Double(number_, static_cast<double>(value.ns) * 1e-9);
    } else if constexpr (std::is_same_v<Value, ColumnFaultNumber>) {
      out_.Double(number_, value.value);
    } else if constexpr (KindOf<Value>() == ProtoKind::kString) {
      out_.Bytes(number_, value);
    } else if constexpr (std::is_same_v<Value, float>) {
      out_.Float(number_, value);
    } else if constexpr (std::is_same_v<Value, double>) {
      out_.Double(number_, value);
    } else {
      out_.Integer(number_, std::int64_t{value});
    }
  }

 private:
  ProtoWriter out_;
  int number_ = kTimeField;
};

/// Notes the fields of a type in place of their values.
class FieldLister {
 public:
  explicit FieldLister(ProtoType& type) : type_(type) {
    type_.fields = {{"timestamp", ProtoKind::kMessage, "google.protobuf.Timestamp"}};
  }
  template <typename Value>
  void operator()(const char* name, const Value& /*value*/) {
    type_.fields.push_back({name, KindOf<Value>()});
  }

 private:
  ProtoType& type_;
};

/// Calls `visit(name, value)` for what is said of a run in progress.
template <typename Visit>
void ForEachRunField(const run_t& run, Visit&& visit) {
  ForEachRowBy<kRunFields, &RunField::mcap_place>([&]<typename Row>(const Row& row) {
    if constexpr (!Row::kList) {
      if (row.field.mcap_place > 0) visit(row.field.name, row.in_message(run));
    }
  });
}

/// Calls `visit(name, value)` for the true state of a simulated robot, without its joints.
template <typename Visit>
void ForEachTruthField(const space_truth_t& state, TruthKind kind, Visit&& visit) {
  ForEachTruthColumn(state, kind, visit);
  visit("resting_as", state.truth.resting_as);
}

ProtoType TickType() {
  ProtoType type{"Tick", {}, {}, "One tick of the control loop, without its joints."};
  FieldLister list(type);
  ForEachTickColumn(state_t{}, list);
  ForEachSensorColumn(state_t{}, list);
  return type;
}

ProtoType JointType() {
  ProtoType type{"Joint", {}, {}, "One joint in one tick, after gear, direction and zero."};
  FieldLister list(type);
  const joint_state_t none{};
  ForEachJointColumn([&](const JointField& field, auto in_message) {
    list(field.column, in_message(none));
    const std::string unit = *field.unit != '\0' ? fmt::format("[{}] ", field.unit) : "";
    type.fields.back().comment = unit + field.meaning;
  });
  list("following_error_rad", double{});
  type.fields.back().comment =
      "[rad] measured less the limited setpoint that it answers; NaN where there is none";
  return type;
}

ProtoType RunType() {
  ProtoType type{"Run", {}, {}, "A run so far: load of the bus, latencies and losses."};
  ForEachRunField(run_t{}, FieldLister(type));
  return type;
}

ProtoType TrueJointType() {
  ProtoType type{"TrueJoint", {{"name", ProtoKind::kString}}, {}, "A joint of a simulated robot."};
  for (const char* name : {"position_rad", "velocity_rad_s", "torque_nm"})
    type.fields.push_back({name, ProtoKind::kDouble});
  return type;
}

ProtoType TruthType(TruthKind kind) {
  ProtoType type{kind == TruthKind::kInSpace ? "TruthInSpace" : "Truth",
                 {},
                 {},
                 kind == TruthKind::kInSpace
                     ? "The true state of a simulated robot in space. World: x right, z up; the "
                       "quaternion turns the root's frame in it, and angular velocities are in its "
                       "axes. The root is the robot's root link."
                     : "The true state of a simulated robot. World: x right, z up; the pitch turns "
                       "+x towards +z. The root is the robot's root link."};
  ForEachTruthField(space_truth_t{}, kind, FieldLister(type));
  type.fields.push_back({"joints", ProtoKind::kMessage, "tumbler.TrueJoint", true});
  return type;
}

}  // namespace

std::vector<ProtoFile> RunFiles() {
  std::vector<ProtoFile> files = WellKnownFiles();
  files.push_back({"tumbler.proto",
                   "tumbler",
                   {files.front().name},
                   {TickType(), JointType(), RunType(), TrueJointType(),
                    TruthType(TruthKind::kInPlane), TruthType(TruthKind::kInSpace)}});
  return files;
}

std::string EncodeTick(std::uint64_t time_ns, const state_t& state) {
  std::string message;
  ProtoWriter out(message);
  AppendTime(out, kTimeField, time_ns);
  FieldAppender append(message);
  ForEachTickColumn(state, append);
  ForEachSensorColumn(state, append);
  return message;
}

std::string EncodeJoint(std::uint64_t time_ns, const joint_state_t& joint, bool measured,
                        double following_error_rad) {
  std::string message;
  ProtoWriter out(message);
  AppendTime(out, kTimeField, time_ns);
  FieldAppender append(message);
  ForEachJointColumn([&](const JointField& field, auto in_message) {
    auto value = in_message(joint);
    if constexpr (std::is_floating_point_v<decltype(value)>) {
      if (!measured && field.origin == JointField::Origin::kDrive)
        value = std::numeric_limits<decltype(value)>::quiet_NaN();
    }
    append(field.column, value);
  });
  append("following_error_rad", following_error_rad);
  return message;
}

std::string EncodeRun(std::uint64_t time_ns, const run_t& run) {
  std::string message;
  ProtoWriter out(message);
  AppendTime(out, kTimeField, time_ns);
  ForEachRunField(run, FieldAppender(message));
  return message;
}

std::string EncodeTruth(std::uint64_t time_ns, const space_truth_t& state) {
  const TruthKind kind = KindOf(state);
  std::string message;
  ProtoWriter out(message);
  AppendTime(out, kTimeField, time_ns);
  ForEachTruthField(state, kind, FieldAppender(message));
  static const std::array joints_numbers{
      static_cast<int>(TruthType(TruthKind::kInPlane).fields.size()),
      static_cast<int>(TruthType(TruthKind::kInSpace).fields.size())};
  const int joints_number = joints_numbers[static_cast<std::size_t>(kind)];
  for (const joint_truth_t& joint : state.truth.joints) {
    out.Message(joints_number, [&joint](ProtoWriter& w) {
      w.Bytes(1, joint.name);
      w.Double(2, joint.position_rad);
      w.Double(3, joint.velocity_rad_s);
      w.Double(4, joint.torque_nm);
    });
  }
  return message;
}

}  // namespace tumbler
