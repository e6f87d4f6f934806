// The JSON Schemas of the files that people write, docs/schemas/input/, are made from the same
// lists of keys as their readers. scripts/docs-tables writes them.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "common/files/key_table.h"
#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drive_models.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/protocols.h"
#include "offline/problem/space_task.h"
#include "offline/problem/task_toml.h"
#include "offline/twin/twin_toml.h"
#include "tests/support/docs_tables.h"

namespace tumbler {
namespace {

using Rows = std::vector<KeyRow>;
using Tables = std::map<std::string, Rows>;  ///< Rows of the tables of a file, by name.

Tables ByName(const std::vector<KeyTable>& tables) {
  Tables by_name;
  for (const KeyTable& table : tables) by_name[table.name] = table.rows;
  return by_name;
}

/// The rows in front of whose key this table stands.
Rows RowsIn(const Rows& rows, const std::string& table) {
  Rows found;
  for (const KeyRow& row : rows) {
    if (row.table == table) found.push_back(row);
  }
  return found;
}

/// An object of a schema under construction: a table that holds nothing but its keys.
class TableSchema {
 public:
  explicit TableSchema(const Rows& rows = {}) {
    for (const KeyRow& row : rows) {
      if (row.name.empty()) continue;  // It is about several keys, or a table.
      Json schema = Json::Parse(row.schema).value();
      std::string description = row.meaning;
      if (!row.required && !row.absent.empty())
        description += (description.empty() ? "default: " : "; default: ") + row.absent;
      if (!description.empty()) schema["description"] = description;
      Add(row.name, schema, row.required);
    }
  }
  TableSchema& Add(const std::string& key, const Json& schema, bool required = false) {
    properties_[key] = schema;
    return required ? Require(key) : *this;
  }
  TableSchema& Require(const std::string& key) {
    if (std::ranges::find(required_, key) == required_.end()) required_.push_back(key);
    return *this;
  }
  /// Keys that are names, such as those of joints.
  TableSchema& Others(const Json& schema) {
    others_ = schema;
    return *this;
  }
  [[nodiscard]] Json Done() const {
    Json object = {
        {"type", "object"}, {"additionalProperties", others_}, {"properties", properties_}};
    if (!required_.empty()) object["required"] = Json(required_);
    return object;
  }

 private:
  Json properties_ = Json::Object();
  Json others_ = false;
  std::vector<std::string> required_;
};

Json ArrayOf(const Json& items) { return {{"type", "array"}, {"items", items}}; }
Json TableOf(const Rows& rows) { return TableSchema(rows).Done(); }
Json Any(const char* type) { return {{"type", type}}; }
/// A table of joints, links and the like, which have this value.
Json NamesOf(const Json& value) { return TableSchema().Others(value).Done(); }

/// The whole file. The row about its `format` and `version` says what they are.
TableSchema FileOf(const Rows& rows) {
  TableSchema file(rows);
  const std::string& allowed = rows.front().allowed;  // `"tumbler-task"`, 1
  const std::size_t end = allowed.find("\"`, ");
  file.Add("format", {{"const", allowed.substr(2, end - 2)}}, true);
  file.Add("version",
           {{"type", "integer"}, {"minimum", 1}, {"maximum", std::stoi(allowed.substr(end + 4))}},
           true);
  return file;
}

/// Fails unless the file of this name has the schema.
void ExpectSchema(const std::string& name, const std::string& title, const TableSchema& schema) {
  Json json = {{"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", title}};
  json.Merge(schema.Done());
  testing::ExpectText("docs/schemas/input/" + name + ".schema.json", json.Dump(2) + "\n");
}

/// An obstacle is of one kind; the first one named is the default.
Json Obstacle(const Rows& rows, const Rows& besides = {}) {
  Json kinds = Json::Array();
  bool is_default = true;
  std::vector<std::string> names;
  for (const KeyRow& row : rows) {
    if (!row.table.empty() && std::ranges::find(names, row.table) == names.end())
      names.push_back(row.table);
  }
  for (const std::string& kind : names) {
    TableSchema table(Joined({RowsIn(rows, ""), RowsIn(rows, kind), besides}));
    table.Add("kind", {{"const", kind}});
    if (!is_default) table.Require("kind");
    is_default = false;
    kinds.Append(table.Done());
  }
  return {{"oneOf", kinds}};
}

TEST(InputSchemas, TheTablesOfTheDocumentOfATask) {
  const Tables t = ByName(TaskKeyTables());
  const Json joints = NamesOf(Any("number"));
  TableSchema start(t.at("start")), end;
  for (TableSchema* const ends : {&start, &end})
    ends->Add("joints_rad", joints, true).Add("joints_rad_s", joints);
  TableSchema robust(t.at("robust"));
  robust.Add("feedback", TableOf(t.at("robust feedback")));
  TableSchema task = FileOf(t.at("task"));
  task.Add("start", start.Done(), true).Add("end", end.Done(), true);
  for (const char* name : {"limits", "motor"})  // of all joints, and of each
    task.Add(name, TableSchema(t.at(name)).Others(TableOf(t.at(name))).Done());
  task.Add("passive", NamesOf(TableOf(t.at("passive"))))
      .Add("cost", ArrayOf(TableOf(t.at("cost"))), true)
      .Add("obstacle", ArrayOf(Obstacle(t.at("obstacle"))))
      .Add("locked", joints)
      .Add("tied", NamesOf(Any("string")))
      .Add("robust", robust.Done());
  for (const char* name : {"bar", "spline", "contact", "self_contact", "tolerances", "drives",
                           "mirror", "search", "solver"})
    task.Add(name, TableOf(t.at(name)));
  ExpectSchema("tumbler-task", "Tumbler: a task", task);
}

TEST(InputSchemas, TheTablesOfTheDocumentOfATaskInSpace) {
  const Tables t = ByName(TaskKeyTables()), space = ByName(SpaceTaskKeyTables());
  const Json joints = NamesOf(Any("number"));
  TableSchema start(space.at("start")), end;
  for (TableSchema* const ends : {&start, &end})
    ends->Add("joints_rad", joints, true).Add("joints_rad_s", joints);
  TableSchema task = FileOf(t.at("task"));
  task.Add("start", start.Done(), true).Add("end", end.Done(), true);
  for (const char* name : {"limits", "motor"})
    task.Add(name, TableSchema(t.at(name)).Others(TableOf(t.at(name))).Done());
  task.Add("cost", ArrayOf(TableOf(space.at("cost"))), true)
      .Add("obstacle", ArrayOf(Obstacle(space.at("obstacle"))));
  for (const char* name :
       {"spline", "contact", "self_contact", "tolerances", "drives", "search", "solver"})
    task.Add(name, TableOf(t.at(name)));
  task.Add("robust", TableOf(space.at("robust_in_space")))
      .Add("locked", joints)
      .Add("tied", NamesOf(Any("string")));
  ExpectSchema("tumbler-task-in-space", "Tumbler: a task of a robot in space", task);
}

std::vector<DriveModel> ModelsOf(std::string_view protocol) {
  if (protocol == MitProtocol::kName) return MitModels();
  if (protocol == AkV3Protocol::kName) return AkV3Models();
  return {};
}

TEST(InputSchemas, TheTablesOfTheDocumentOfDrives) {
  const Rows rows = DrivesKeyTable().rows;
  Json protocols = Json::Array();
  DriveProtocols::ForEach([&](auto protocol) {
    using Protocol = decltype(protocol);
    const Rows own = Protocol::Keys().rows;
    // `unfinished` is the file's.
    Rows shared = RowsIn(rows, "");
    std::erase_if(shared, [](const KeyRow& row) { return row.name == "unfinished"; });
    TableSchema drive(Joined({shared, RowsIn(own, "")}));
    drive.Add("protocol", {{"const", std::string(Protocol::kName)}}, true);
    Json models = Json::Array();
    for (const DriveModel& model : ModelsOf(Protocol::kName)) models.Append(model.name);
    if (models.size() > 0) drive.Add("model", {{"enum", models}});
    for (const char* const table : {"range", "reply_range"}) {
      const std::string name = std::string("`[drive.") + table + "]`";
      // Where the protocol has no keys of its own there, those of all protocols count.
      Rows inner = RowsIn(own, name);
      const bool no_keys =
          std::ranges::none_of(inner, [](const KeyRow& row) { return !row.name.empty(); });
      if (no_keys) inner = RowsIn(rows, name);
      if (!inner.empty()) drive.Add(table, TableOf(inner), no_keys);
    }
    protocols.Append(drive.Done());
  });
  Rows root = {rows.front()};
  for (const KeyRow& row : rows) {
    if (row.name == "unfinished") root.push_back(row);
  }
  TableSchema drives = FileOf(root);
  drives.Add("bus", TableOf(RowsIn(rows, "`[bus]`")), true)
      .Add("drive", ArrayOf({{"oneOf", protocols}}), true)
      .Add("sensor", TableOf(RowsIn(rows, "`[sensor]`")));
  ExpectSchema("tumbler-drives", "Tumbler: drives and their bus", drives);
}

/// @param start, push, obstacle  the rows that depend on where the robot moves.
TableSchema TwinSchema(const Rows& start_rows, const Rows& push, const Rows& obstacle) {
  const Tables t = ByName(TwinKeyTables());
  const Tables of_task = ByName(TaskKeyTables());
  Rows contact;  // A twin has other forces and friction, not another law.
  for (const KeyRow& row : of_task.at("contact")) {
    for (const char* name : {"stiffness_n_per_m", "damping_n_s_per_m", "v_max_m_per_s", "mu"}) {
      if (row.name == name) contact.push_back(row);
    }
  }
  TableSchema start(start_rows);
  start.Add("joints_rad", NamesOf(Any("number")));
  TableSchema twin = FileOf(t.at("twin"));
  twin.Add("start", start.Done())
      .Add("motor", TableSchema(t.at("motor")).Others(TableOf(t.at("motor"))).Done())
      .Add("mass_factor", NamesOf(Any("number")))
      .Add("contact", TableOf(contact))
      .Add("obstacle", ArrayOf(Obstacle(obstacle, t.at("obstacle"))))
      .Add("patch", ArrayOf(TableOf(t.at("patch"))))
      .Add("push", ArrayOf(TableOf(push)));
  for (const char* name : {"stop", "fall"}) twin.Add(name, TableOf(t.at(name)));
  return twin;
}

TEST(InputSchemas, TheTablesOfTheDocumentOfATwin) {
  const Tables t = ByName(TwinKeyTables()), space = ByName(SpaceTwinKeyTables());
  TableSchema plane =
      TwinSchema(t.at("start"), t.at("push"), ByName(TaskKeyTables()).at("obstacle"));
  plane.Add("sensor_failure", ArrayOf(TableOf(t.at("sensor_failure"))))
      .Add("sensor", TableOf(t.at("sensor")));
  ExpectSchema("tumbler-twin", "Tumbler: a simulated robot", plane);
  Rows push = t.at("push");
  std::erase_if(push,
                [](const KeyRow& row) { return row.name == "force_n" || row.name == "point_m"; });
  for (const KeyRow& row : space.at("push_in_space")) push.push_back(row);
  const TableSchema in_space =
      TwinSchema(space.at("start_in_space"), push, ByName(SpaceTaskKeyTables()).at("obstacle"));
  ExpectSchema("tumbler-twin-in-space", "Tumbler: a simulated robot in space", in_space);
}

TEST(InputSchemas, TheTablesOfTheDocumentOfASequence) {
  const Tables t = ByName(SequenceKeyTables());
  TableSchema sequence = FileOf(t.at("sequence"));
  sequence.Add("primitives", NamesOf(Any("string")), true)
      .Add("node", ArrayOf(TableOf(t.at("node"))), true)
      .Add("edge", ArrayOf(TableOf(t.at("edge"))));
  for (const char* name : {"swap", "begin", "tolerances"}) sequence.Add(name, TableOf(t.at(name)));
  ExpectSchema("tumbler-sequence", "Tumbler: a sequence of primitives", sequence);
}

TEST(InputSchemas, TheTablesOfTheDocumentOfAPrimitive) {
  const Rows rows = PrimitiveKeyTables().front().rows;
  const auto table = [&rows](const std::string& name) { return TableSchema(RowsIn(rows, name)); };
  const auto pose = table("`[entry]`, `[exit]`").Done();
  TableSchema joint = table("`[[joint]]`");
  joint.Add("limits", table("`[joint.limits]`").Done(), true)
      .Add("position", table("`[joint.position]`").Done(), true)
      .Add("torque", table("`[joint.torque]`").Done(), true);
  TableSchema feedback = table("`[feedback]`");
  feedback.Add("angle", table("`[feedback.angle]`").Done(), true)
      .Add("joint", ArrayOf(table("`[[feedback.joint]]`").Done()), true)
      .Add("chain", ArrayOf(table("`[[feedback.chain]]`").Done()), true);
  // What is required of an entry only where it is of some kind is there or not.
  const auto some_of = [&rows](const std::string& name,
                               const std::vector<std::string>& not_always) {
    Rows of = RowsIn(rows, name);
    for (KeyRow& row : of)
      row.required = row.required && std::ranges::find(not_always, row.name) == not_always.end();
    return TableSchema(of).Done();
  };
  TableSchema primitive = FileOf(RowsIn(rows, ""));
  primitive.Add("joint", ArrayOf(joint.Done()), true)
      .Add("feedback", feedback.Done())
      .Add("abort",
           ArrayOf(some_of("`[[abort]]`", {"late_max_s", "limits_share", "joint_positions_rad"})))
      .Add("abort_figure", table("`[abort_figure]`").Done())
      .Add("drives", table("`[drives]`").Done())
      .Add("entry", pose, true)
      .Add("exit", pose, true)
      .Add("contact", ArrayOf(table("`[[contact]]`").Done()))
      .Add("purpose",
           ArrayOf(some_of("`[[purpose]]`", {"time_s", "link", "point_m", "in_space", "along"})))
      .Add("certificate", TableOf(CertificateKeyTable().rows), true)
      .Add("robustness", ArrayOf(table("`[[robustness]]`").Done()))
      .Add("window", table("`[window]`").Done())
      .Add("provenance",
           some_of("`[provenance]`", {"start_file", "start_hash", "guess_file", "guess_hash",
                                      "complement_files", "complement_hashes", "edited"}),
           true);
  ExpectSchema("tumbler-primitive", "Tumbler: a primitive", primitive);
}

}  // namespace
}  // namespace tumbler
