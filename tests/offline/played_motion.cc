#include "tests/offline/played_motion.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "common/core/index.h"
#include "common/files/sequence_toml.h"
#include "offline/programs/setpoints.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler::testing {

PlayedMotion::PlayedMotion(const std::string& file, int cycles)
    : motion_(LoadMotion(SourcePath("primitives/" + file))),
      gains_(motion_.ProblemAt(motion_.file().graph.start).drive_gains()) {
  SetpointOptions options;
  options.cycles = cycles;
  rows_ = ParseCsv(SetpointsCsv(motion_.file(), gains_, options),
                   Index(motion_.file().primitives.front().primitive.joint_count));
}

std::vector<PlayedMotion::Row> PlayedMotion::ParseCsv(const std::string& text, std::size_t joints) {
  std::vector<Row> rows;
  std::size_t at = text.find('\n') + 1;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    std::vector<std::string> cells(1);
    bool quoted = false;
    for (const char c : text.substr(at, end - at)) {
      if (c == '"') {
        quoted = !quoted;
      } else if (c == ',' && !quoted) {
        cells.emplace_back();
      } else {
        cells.back() += c;
      }
    }
    EXPECT_EQ(cells.size(), 2 + 4 * joints);
    Row row{std::stod(cells[0]), cells[1], {}};
    for (std::size_t j = 0; j < joints; ++j) row.ctrl.push_back(std::stod(cells[5 + 4 * j]));
    rows.push_back(row);
    at = end + 1;
  }
  return rows;
}

std::string PlayedMotion::Play(Engine& engine) const {
  constexpr double kPitch_rad = 0.15, kHeight_m = 0.03;
  const SequenceFile& file = motion_.file();
  engine.Begin();
  int cycle = 1;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const bool last = i + 1 == rows_.size();
    engine.PlayTo(last ? rows_[i].time_s + 1e-3 : rows_[i + 1].time_s, rows_[i].ctrl);
    if (!last && rows_[i + 1].node == rows_[i].node) continue;
    const int node = file.graph.FindNode(rows_[i].node);
    const PrimitivePose& exit = file.PrimitiveOf(node).exit;
    const double pitch =
        NearestTurn(engine.Position("pitch") - file.RobotPitch(node, exit.root_pitch_rad));
    const double height = engine.Position("z") - exit.root_z_m;
    if (!(std::abs(pitch) < kPitch_rad && std::abs(height) < kHeight_m)) {
      return fmt::format("{}{}", rows_[i].node,
                         file.graph.node_count > 1 ? fmt::format(" of cycle {}", cycle) : "");
    }
    if (file.graph.node(node).ends_cycle) ++cycle;
  }
  return "";
}

std::vector<RobotFactors> AHundredRobots(int links, std::uint64_t seed) {
  constexpr std::size_t kRobots = 100;
  std::mt19937_64 random(seed);
  std::vector<RobotFactors> robots(kRobots);
  for (RobotFactors& robot : robots) {
    std::normal_distribution<double> normal;
    const auto factor = [&](double spread) { return std::max(1 + spread * normal(random), 0.05); };
    robot.mu = factor(0.2);
    robot.stiffness = factor(0.2);
    robot.damping = factor(0.2);
    for (int link = 0; link < links; ++link) robot.masses.push_back(factor(0.05));
  }
  return robots;
}

std::span<const Shipped> ShippedMotions() {
  static constexpr std::array kMotions = {
      Shipped{"handstand.toml", 1},      Shipped{"handstand_wide.toml", 1},
      Shipped{"downstand.toml", 1},      Shipped{"downstand_back.toml", 1},
      Shipped{"roll.toml", 1},           Shipped{"rise.toml", 1},
      Shipped{"rise_from_leg1.toml", 1}, Shipped{"rise_from_leg2.toml", 1},
      Shipped{"stand.toml", 1}};
  return kMotions;
}

std::span<const Shipped> ShippedGaits() {
  static constexpr std::array kGaits = {Shipped{"gait.toml", 10}, Shipped{"gait_wide.toml", 10},
                                        Shipped{"cartwheel.toml", 10}};
  return kGaits;
}

std::string CellOf(const std::vector<std::pair<std::string, std::string>>& amiss) {
  std::string fails;
  for (const auto& [ground, after] : amiss) {
    if (!after.empty())
      fails += fmt::format("{}{} ({})", fails.empty() ? "no: " : ", ", ground, after);
  }
  return fails.empty() ? "yes" : fails;
}

void ExpectDocumented(std::span<const Shipped> all, const std::string& source,
                      const std::string& name, const std::vector<std::string>& heads,
                      const std::function<std::vector<std::string>(const PlayedMotion&)>& cells) {
  std::vector<std::string> head = {"motion"};
  head.insert(head.end(), heads.begin(), heads.end());
  std::string table = MarkdownHead(head);
  for (const Shipped& shipped : all) {
    std::vector<std::string> row = {fmt::format("`{}`", shipped.file)};
    for (std::string& cell : cells(PlayedMotion(shipped.file, shipped.cycles)))
      row.push_back(std::move(cell));
    table += MarkdownRow(row);
  }
  ExpectTables("docs/other-simulators.md", std::vector<DocsTable>{{source, name, table}});
}

}  // namespace tumbler::testing
