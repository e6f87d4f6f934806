#include "offline/programs/hybrid_states.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <system_error>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

/// The degree of freedom with this name. A joint goes before a coordinate of the root.
int FindCoordinate(const Robot& robot, std::string_view name) {
  const int joint = robot.FindDof(name);
  if (joint >= 0) return joint;
  for (int j = 0; j < robot.root_dofs; ++j) {
    if (robot.tree.dofs[Index(j)].name == name) return j;
  }
  return -1;
}

}  // namespace

void Prescribe(Robot& robot, const std::string& list) {
  for (std::size_t begin = 0; begin < list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string name = list.substr(begin, end - begin);
    begin = end + 1;
    const int j = FindCoordinate(robot, name);
    if (j < 0) {
      std::string names;
      for (const int dof : robot.file_order)
        names += (names.empty() ? "" : ", ") + robot.tree.dofs[Index(dof)].name;
      throw std::invalid_argument(
          fmt::format("--prescribed: '{}' is no joint that moves; allowed, separated by commas: {}",
                      name, names));
    }
    if (robot.root == RootKind::kHingeY && j < 2) {
      throw std::invalid_argument(fmt::format(
          "--prescribed: '{}' is held by the bar and always prescribed; leave it out", name));
    }
    if (robot.tree.dofs[Index(j)].prescribed)
      throw std::invalid_argument(fmt::format("--prescribed: '{}' is there twice", name));
    robot.tree.dofs[Index(j)].prescribed = true;
  }
  for (const int j : robot.file_order) {
    const Dof<Spatial>& dof = robot.tree.dofs[Index(j)];
    if (dof.prescribed || robot.MovesMass(j)) continue;
    const std::string& link = robot.joints[Index(j)].link;
    throw FileError(robot.file, robot.FindLink(link)->line, fmt::format("link '{}'", link),
                    fmt::format("degree of freedom '{}' moves no mass; give the link, or one that "
                                "it carries, an <inertial>, or prescribe it (--prescribed)",
                                dof.name));
  }
}

std::vector<std::string_view> PartsOfState(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r\f\v";
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t begin = line.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos || line[begin] == '#') return parts;
    line.remove_prefix(begin);
    const std::size_t end = std::min(line.find_first_of(kBlanks), line.size());
    parts.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

HybridStates::HybridStates(Robot robot, bool derivatives)
    : robot_(std::move(robot)), derivatives_wanted_(derivatives), dynamics_(robot_.tree) {
  const std::size_t n = robot_.tree.dofs.size();
  q_.resize(n);
  qd_.resize(n);
  qdd_.resize(n);
  tau_.resize(n);
  for (const int j : robot_.file_order) {
    if (!robot_.tree.dofs[Index(j)].prescribed) outputs_.push_back(j);
  }
  for (const int j : robot_.file_order) {
    if (robot_.tree.dofs[Index(j)].prescribed) prescribed_.push_back(j);
  }
  outputs_.insert(outputs_.end(), prescribed_.begin(), prescribed_.end());
}

std::string HybridStates::Evaluate(const std::vector<std::string_view>& parts) {
  Read(parts);
  dynamics_.SetState(q_, qd_);
  for (const Force& force : forces_) {
    if (force.body < 0) continue;
    dynamics_.AddWrench(force.body,
                        Spatial::ForceAt(force.point - dynamics_.origin(), force.force));
  }
  dynamics_.Solve(qdd_, tau_);
  if (const int j = dynamics_.FindUndetermined(kUndetermined); j >= 0) FailUndetermined(j);
  std::string out;
  for (const int j : outputs_) {
    const bool given = robot_.tree.dofs[Index(j)].prescribed;
    Append(out, given ? tau_[Index(j)] : qdd_[Index(j)]);
  }
  if (derivatives_wanted_) {
    Differentiate();
    for (const auto* block : {&derivatives_.q, &derivatives_.qd, &derivatives_.input}) {
      for (const int i : outputs_) {
        for (const int j : robot_.file_order) Append(out, (*block)[Index(i)][Index(j)]);
      }
    }
  }
  out.push_back('\n');
  return out;
}

const std::string& HybridStates::NameOf(int dof) const { return robot_.tree.dofs[Index(dof)].name; }

std::string HybridStates::Meaning(std::size_t place) const {
  const std::size_t n = q_.size();
  if (place < n) return fmt::format("position of '{}'", NameOf(robot_.file_order[place]));
  if (place < 2 * n) return fmt::format("velocity of '{}'", NameOf(robot_.file_order[place - n]));
  place -= 2 * n;
  if (place < prescribed_.size())
    return fmt::format("acceleration of '{}'", NameOf(prescribed_[place]));
  place -= prescribed_.size();
  return fmt::format("{} of force {}", kForceNames[place % kForceParts], place / kForceParts + 1);
}

double HybridStates::Number(const std::vector<std::string_view>& parts, std::size_t place) const {
  std::string_view text = parts[place];
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    throw StateError(fmt::format("value {}, the {}, is '{}'; expected a finite number", place + 1,
                                 Meaning(place), parts[place]));
  }
  return value;
}

void HybridStates::Read(const std::vector<std::string_view>& parts) {
  const std::size_t n = q_.size();
  const std::size_t state = 2 * n + prescribed_.size();
  if (parts.size() < state || (parts.size() - state) % kForceParts != 0) {
    throw StateError(fmt::format(
        "has {} values; expected {}: {} positions, {} velocities, {} prescribed accelerations; "
        "and 7 more for each force: fx fy fz px py pz link",
        parts.size(), state, n, n, prescribed_.size()));
  }
  std::size_t place = 0;
  for (std::vector<double>* values : {&q_, &qd_}) {
    for (const int j : robot_.file_order) (*values)[Index(j)] = Number(parts, place++);
  }
  std::fill(tau_.begin(), tau_.end(), 0.0);
  for (const int j : prescribed_) qdd_[Index(j)] = Number(parts, place++);
  forces_.clear();
  while (place < parts.size()) {
    Force force{};
    for (SpaceVector* vector : {&force.force, &force.point}) {
      for (int i = 0; i < 3; ++i) (*vector)[i] = Number(parts, place++);
    }
    const RobotLink* const link = robot_.FindLink(parts[place]);
    if (link == nullptr) {
      std::string names;
      for (const RobotLink& known : robot_.links) names += (names.empty() ? "" : ", ") + known.name;
      throw StateError(fmt::format("value {}, the link of force {}, is '{}'; expected one of: {}",
                                   place + 1, forces_.size() + 1, parts[place], names));
    }
    force.body = link->body;
    ++place;
    forces_.push_back(force);
  }
}

void HybridStates::Differentiate() {
  for (const Force& force : forces_) {
    if (force.body < 0) continue;
    const SpaceVector point = force.point - dynamics_.origin();
    const Spatial::Wrench wrench = Spatial::ForceAt(point, force.force);
    Spatial::WrenchMap stiffness;
    for (std::size_t m = 0; m < stiffness.columns.size(); ++m) {
      const Spatial::Motion u = Spatial::BasisMotion(m);
      Spatial::Wrench change;
      change.n = Spatial::Moment(u.At(point), force.force);
      stiffness.columns[m] = change - Spatial::Cross(u, wrench);
    }
    dynamics_.AddWrenchDerivative(force.body, stiffness, {});
  }
  dynamics_.Differentiate(derivatives_);
}

void HybridStates::FailUndetermined(int j) const {
  constexpr int kRoll = 4, kYaw = 5;
  if (robot_.root == RootKind::kFloating && j == kYaw &&
      std::abs(portable::Cos(q_[kRoll])) < 1e-4) {
    throw StateError(fmt::format(
        "roll = {:.9g} rad is too near to +-pi/2, where yaw turns about the axis of pitch and "
        "the root's coordinates are singular; expected |cos(roll)| above about 1e-6: describe "
        "this "
        "attitude with another frame of the root link",
        q_[kRoll]));
  }
  throw StateError(fmt::format(
      "the acceleration of '{}' is not determined in this state: with the free degrees of "
      "freedom before it, it moves no mass of its own; prescribe one of them, or give the links "
      "between them an <inertial>",
      NameOf(j)));
}

void HybridStates::Append(std::string& out, double value) const {
  if (!std::isfinite(value))
    throw StateError("its result is not a finite number; expected smaller values");
  if (!out.empty()) out.push_back(' ');
  out += fmt::format("{:.17g}", value);
}

}  // namespace tumbler
