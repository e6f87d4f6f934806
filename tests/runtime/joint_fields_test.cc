// Compares the messages of a tick, a joint and a run, the table's columns and docs/formats.md with
// the description of their fields.

#include "runtime/executor/joint_fields.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <type_traits>
#include <utility>

#include "common/files/json.h"
#include "runtime/executor/tick_fields.h"
#include "runtime/record/live_view.h"
#include "runtime/record/messages.h"
#include "runtime/record/run_fields.h"
#include "runtime/record/state_csv.h"
#include "runtime/record/truth_csv.h"
#include "tests/support/docs_tables.h"

namespace tumbler {
namespace {

/// The type of messages that holds every value of this type.
template <typename Type>
std::string LcmType() {
  if constexpr (std::is_same_v<Type, float>) return "float";
  if constexpr (std::is_same_v<Type, double>) return "double";
  if constexpr (std::is_same_v<Type, bool>) return "boolean";
  if constexpr (std::is_enum_v<Type> || std::is_same_v<Type, std::int8_t>) return "int8_t";
  if constexpr (std::is_same_v<Type, std::int32_t>) return "int32_t";
  if constexpr (std::is_same_v<Type, std::uint32_t> || std::is_same_v<Type, std::int64_t>)
    return "int64_t";
  if constexpr (std::is_same_v<Type, std::string> || std::is_same_v<Type, std::vector<std::string>>)
    return "string";
}

/// A line of a message type.
std::string MessageLine(std::string type, const char* name, const char* meaning) {
  type.resize(8, ' ');
  return fmt::format("    {}{};{}{}\n", type, name, *meaning == '\0' ? "" : "  // ", meaning);
}

std::string JointMessage() {
  std::string text =
      "package tumbler;\n\n"
      "// One joint in one tick, at the joint (after gear, direction and zero).\n"
      "struct joint_state_t\n{\n";
  std::string said;
  ForEachJointField([&](const JointField& field, auto in_record, auto /*in_message*/) {
    text += MessageLine(LcmType<JointFieldType<decltype(in_record)>>(), field.column,
                        said != field.meaning ? field.meaning : "");
    said = field.meaning;
  });
  ForEachDerivedJointField([&](const JointField& field, auto /*of_tick*/, auto /*in_message*/) {
    text += MessageLine("float", field.column, field.meaning);
  });
  return text + "}\n";
}

std::string TickMessage() {
  std::string text =
      "package tumbler;\n\n"
      "// One control tick on channel TUMBLER_STATE: the planned setpoints, the same after the "
      "limits "
      "and after\n// rounding for the wire, and the measurements, all under one tick number.\n"
      "struct state_t\n{\n";
  state_t none;
  ForEachRowBy<kTickFields, &TickField::message_place>([&]<typename Row>(const Row& row) {
    if constexpr (Row::kInMessage) {
      using Type = std::remove_cvref_t<decltype(row.in_message(none))>;
      text += MessageLine(LcmType<Type>(), row.field.message, row.field.meaning);
    }
  });
  text +=
      "    joint_state_t joints[joint_count];\n\n"
      "    const int8_t STATE_DISARMED = 0, STATE_ARMING = 1, STATE_HOLDING = 2, "
      "STATE_MOVING_TO_START = 3;\n"
      "    const int8_t STATE_RUNNING = 4, STATE_SETTLING = 5, STATE_STOPPING = 6, STATE_FAULT = "
      "7;\n";
  return text + "}\n";
}

std::string RunMessageText() {
  std::string text =
      "package tumbler;\n\n"
      "// A run, its machine and its times, on channel TUMBLER_RUN four times a second, and at the "
      "end.\n"
      "struct run_t\n{\n";
  run_t none;
  ForEachRowBy<kRunFields, &RunField::message_place>([&]<typename Row>(const Row& row) {
    using Type = std::remove_cvref_t<decltype(row.in_message(none))>;
    std::string name = row.field.name;
    if constexpr (Row::kList) name += fmt::format("[{}]", row.field.dimension);
    // A boolean is one byte in messages, as int8_t is.
    const bool flag =
        std::is_same_v<std::invoke_result_t<decltype(row.value), const RunSoFar&>, bool>;
    text += MessageLine(flag ? "boolean" : LcmType<Type>(), name.c_str(), row.field.meaning);
  });
  return text + "}\n";
}

/// A name as code; nothing where there is none.
std::string Code(const char* name) { return *name == '\0' ? "" : "`" + std::string(name) + "`"; }

std::string JointTable() {
  std::string text = testing::MarkdownHead({"field", "bytes", "unit", "meaning", "status"});
  ForEachJointField([&](const JointField& field, auto in_record, auto /*in_message*/) {
    text += testing::MarkdownRow(
        {Code(field.column), std::to_string(sizeof(JointFieldType<decltype(in_record)>)),
         field.unit, field.meaning, field.status == nullptr ? "" : Code(field.status)});
  });
  ForEachDerivedJointField([&](const JointField& field, auto /*of_tick*/, auto /*in_message*/) {
    text += testing::MarkdownRow({Code(field.column), "", field.unit, field.meaning, ""});
  });
  return text;
}

std::string TickTable() {
  std::string text =
      testing::MarkdownHead({"in a record", "bytes", "in `state_t`", "column", "meaning"});
  TickRecord record;
  ForEachRow(kTickFields, [&]<typename Row>(const Row& row) {
    std::string bytes;
    if constexpr (Row::kRecorded) bytes = std::to_string(sizeof(row.in_record(record)));
    text += testing::MarkdownRow({Code(row.field.record), bytes, Code(row.field.message),
                                  Code(row.field.column), row.field.meaning});
  });
  return text;
}

TEST(JointFields, TheTablesOfTheDocumentAndTheMessageAreThoseOfTheCode) {
  testing::ExpectText("runtime/record/lcm/joint_state_t.lcm", JointMessage());
  testing::ExpectText("runtime/record/lcm/state_t.lcm", TickMessage());
  testing::ExpectText("runtime/record/lcm/run_t.lcm", RunMessageText());
  testing::ExpectTables(
      "docs/formats.md",
      std::vector<testing::DocsTable>{{"runtime/executor/joint_fields.h", "fields", JointTable()},
                                      {"runtime/executor/tick_fields.h", "fields", TickTable()}});
}

/// A tick of one joint that has another value in every field, and its message.
struct FilledTick {
  FilledTick() {
    timed.record.joint_count = 1;
    int value = 0;
    ForEachJointField([&](const JointField& /*field*/, auto in_record, auto /*in_message*/) {
      using Type = JointFieldType<decltype(in_record)>;
      in_record(timed.record.joints[0]) = static_cast<Type>(++value);
    });
    timed.record.joints[0].drive_error = 0xffffffffU;
    timed.reply_sampled_us[0] = -21;
    timed.record.sensor = {3, 4, 5, 6, 7, 2, SensorStatus::kOk};
    FillState(timed, message);
  }

  TimedRecord timed;
  state_t message;
};

TEST(JointFields, AMessageHoldsEachOfThemUnchanged) {
  const FilledTick tick;
  ForEachJointField([&](const JointField& field, auto in_record, auto in_message) {
    EXPECT_EQ(static_cast<double>(in_record(tick.timed.record.joints[0])),
              static_cast<double>(in_message(tick.message.joints[0])))
        << field.name;
  });
  EXPECT_EQ(tick.message.joints[0].planned_velocity_rad_s, 2.0F);
  EXPECT_EQ(tick.message.joints[0].measured_torque_nm, 13.0F);
  EXPECT_EQ(tick.message.joints[0].drive_error, 0xffffffffLL);
  EXPECT_EQ(tick.message.joints[0].reply_sampled_us, -21.0F);
}

TEST(TickFields, NoTwoOfThemHaveTheSamePlaceAndEachIsWhereItHasOne) {
  std::set<int> in_messages, in_tables;
  std::set<std::string> in_records;
  ForEachRow(kTickFields, [&]<typename Row>(const Row& row) {
    const TickField& field = row.field;
    EXPECT_EQ(Row::kInMessage, in_messages.insert(field.message_place).second &&
                                   *field.message != '\0' && field.message_place > 0)
        << field.message;
    EXPECT_EQ(Row::kShown, in_tables.insert(field.column_place).second && *field.column != '\0' &&
                               field.column_place > 0)
        << field.column;
    EXPECT_EQ(Row::kRecorded, *field.record != '\0' && in_records.insert(field.record).second)
        << field.record;
  });
}

/// How many fields a line of CSV has, by its commas outside quotes.
std::size_t FieldsOf(const std::string& line) {
  std::size_t fields = 1;
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') quoted = !quoted;
    if (c == ',' && !quoted) ++fields;
  }
  return fields;
}

TEST(JointFields, ANameWithACommaIsOneFieldOfTheTable) {
  EXPECT_EQ(FieldsOf(StateCsvHeader({"leg, left"})), FieldsOf(StateCsvHeader({"leg"})));
  EXPECT_NE(StateCsvHeader({"a \"b\", c"}).find(",\"a \"\"b\"\", c_planned_position_rad\","),
            std::string::npos);
  for (const TruthKind kind : {TruthKind::kInPlane, TruthKind::kInSpace}) {
    EXPECT_EQ(FieldsOf(TruthCsvHeader({"leg, left"}, kind)),
              FieldsOf(TruthCsvHeader({"leg"}, kind)));
  }
}

TEST(JointFields, AColumnOfTheTableStaysWhereReadersOfItExpectIt) {
  const std::string header = StateCsvHeader({"leg"});
  EXPECT_EQ(header.substr(0, header.find(",leg_")),
            "number,tick,time_s,state,node,cycles,primitive_time_s,faults,fault,fault_joint"
            ",fault_tick,fault_value,fault_limit,command,refusal,request_id,request"
            ",request_refusal,wake_up_us,tick_us,bus_bits");
  EXPECT_EQ(header.substr(header.find(",bus_bits") + 9),
            ",leg_planned_position_rad,leg_planned_velocity_rad_s,leg_planned_torque_nm"
            ",leg_limited_position_rad,leg_limited_velocity_rad_s,leg_limited_torque_nm"
            ",leg_encoded_position_rad,leg_encoded_velocity_rad_s,leg_encoded_torque_nm"
            ",leg_measured_position_rad,leg_measured_velocity_rad_s,leg_measured_torque_nm"
            ",leg_planned_acceleration_rad_s2,leg_temperature_c,leg_reply_age_ticks"
            ",leg_drive_state,leg_reply_status,leg_drive_error,leg_limit_active,leg_correction_rad"
            ",leg_reply_sampled_us"
            ",sensor_status,sensor_age_ticks,sensor_pitch_rad,sensor_rate_rad_s"
            ",feedback_error_rad,feedback_rate_error_rad_s,feedback_share");
  std::string row;
  AppendStateCsvRow(FilledTick().message, row);
  EXPECT_EQ(row.substr(row.find(",1,2,3,")),
            ",1,2,3,5,6,7,8,9,10,11,12,13,4,14,15,16,17,4294967295,1,20,-21,1,2,3,4,5,6,7\n");
}

TEST(JointFields, ATorqueThatWasNotMeasuredIsEmptyInTablesAndNullInTheStatus) {
  FilledTick tick;
  tick.timed.record.joints[0].measured.torque_nm = std::numeric_limits<float>::quiet_NaN();
  FillState(tick.timed, tick.message);
  EXPECT_TRUE(std::isnan(tick.message.joints[0].measured_torque_nm));
  std::string row;
  AppendStateCsvRow(tick.message, row);
  EXPECT_EQ(row.substr(row.find(",1,2,3,")),
            ",1,2,3,5,6,7,8,9,10,11,12,,4,14,15,16,17,4294967295,1,20,-21,1,2,3,4,5,6,7\n");
  LiveView view;
  view.Take(tick.message);
  const Json status = Json::Parse(view.ToJson()).value();
  EXPECT_TRUE(status["joints"][0]["measured_nm"].is_null());
  EXPECT_EQ(status["joints"][0]["measured_rad"], 11);
  EXPECT_NE(view.Line().find("torque not measured"), std::string::npos) << view.Line();
  EXPECT_EQ(view.Screen().find("nan"), std::string::npos) << view.Screen();
}

TEST(JointFields, WhatNoReplyHasToldIsNotShownAsZero) {
  FilledTick tick;
  JointRecord& joint = tick.timed.record.joints[0];
  joint.measured = {};
  joint.temperature_c = 0;
  joint.reply_age_ticks = -1;
  tick.timed.record.sensor = {};
  tick.timed.record.sensor.status = SensorStatus::kNoData;
  FillState(tick.timed, tick.message);
  LiveView view;
  view.Take(tick.message);
  const Json status = Json::Parse(view.ToJson()).value();
  for (const char* key : {"measured_rad", "measured_rad_s", "measured_nm", "temperature_c"})
    EXPECT_TRUE(status["joints"][0][key].is_null()) << key;
  EXPECT_EQ(status["joints"][0]["setpoint_rad"], 5) << "asked for, whether it is answered or not";
  EXPECT_EQ(status["joints"][0]["reply_age_ticks"], -1);
  EXPECT_TRUE(status["sensor"]["pitch_rad"].is_null());
  EXPECT_TRUE(status["sensor"]["rate_rad_s"].is_null());
  EXPECT_NE(view.Line().find("joint 0 has not replied yet; sensor no data"), std::string::npos)
      << view.Line();
  for (const int columns : {60, 120}) {
    EXPECT_EQ(view.Screen(columns).find("0.00"), view.Screen(columns).find("0.000 s"))
        << view.Screen(columns);
  }
}

TEST(SensorFields, TheStatusNamesTheSensorWhereThereIsOne) {
  FilledTick tick;
  tick.timed.record.sensor.status = SensorStatus::kStale;
  tick.timed.record.sensor.pitch_rad = 1.5F;
  tick.timed.record.sensor.share = 0.25F;
  FillState(tick.timed, tick.message);
  LiveView view;
  view.Take(tick.message);
  const Json status = Json::Parse(view.ToJson()).value();
  EXPECT_EQ(status["sensor"]["status"], "stale");
  EXPECT_EQ(status["sensor"]["pitch_rad"], 1.5);
  EXPECT_EQ(status["sensor"]["feedback_share"], 0.25);
  EXPECT_NE(view.Line().find("sensor stale, 1.5000 rad"), std::string::npos) << view.Line();
  EXPECT_NE(view.Screen().find("feedback 25 %"), std::string::npos) << view.Screen();
  tick.timed.record.sensor.status = SensorStatus::kNone;
  FillState(tick.timed, tick.message);
  view.Take(tick.message);
  EXPECT_EQ(view.ToJson().find("sensor"), std::string::npos);
  EXPECT_EQ(view.Line().find("sensor"), std::string::npos);
}

}  // namespace
}  // namespace tumbler
