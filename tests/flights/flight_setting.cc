#include "tests/flights/flight_setting.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "runtime/assembly/run_settings.h"
#include "tests/flights/flight_random.h"

namespace tumbler::testing {
namespace {

using Spline = JointMotion<float>::Spline;

bool LeavesOut(std::uint32_t left_out, std::string_view part) {
  for (std::size_t i = 0; i < kFlightParts.size(); ++i) {
    if (kFlightParts[i] == part) return (left_out >> i & 1U) != 0;
  }
  throw std::logic_error("no such part of a flight");
}

void Assign(Spline& spline, int degree, float duration_s, const std::vector<float>& points) {
  std::array<float, Spline::kMaxKnots> knots{};
  if (Spline::ClampedUniformKnots(degree, static_cast<int>(points.size()), duration_s, knots) !=
          Status::kOk ||
      spline.Assign(degree,
                    std::span(knots.data(), points.size() + static_cast<std::size_t>(degree) + 1),
                    points) != Status::kOk) {
    throw std::logic_error("no spline");
  }
}

float Largest(const Interval<float>& bounds) { return std::max(-bounds.min, bounds.max); }

/// A pose from which primitives start and in which they end. Partners have the same position, so
/// that it stays the same when roles are exchanged.
using Pose = std::array<float, kMaxJoints>;

struct Roles {
  int joint_count = 2;
  std::array<std::uint8_t, kMaxJoints> partner{};
};

/// The most joints that a robot is drawn with, whatever the build could hold: the same numbers are
/// the same flights.
constexpr std::size_t kMostDrawn = 8;

Pose RandomPose(const Roles& roles, FlightRandom& random) {
  Pose pose{};
  for (std::size_t j = 0; j < kMostDrawn; ++j) pose[j] = random.Real(-0.8, 0.8);
  for (std::size_t j = 0; j < kMostDrawn; ++j)
    pose[j] = pose[std::min<std::size_t>(j, roles.partner[j])];
  return pose;
}

JointMotion<float> RandomMotion(float from, float to, float duration_s, bool spike,
                                FlightRandom& random) {
  JointMotion<float> motion;
  const int count = random.Within(8, 14);
  std::vector<float> points(static_cast<std::size_t>(count));
  const double bump = random.Uniform(0, 0.15);
  for (int i = 0; i < count; ++i) {
    const double share = std::clamp((i - 2.0) / (count - 5.0), 0.0, 1.0);
    const bool end = i < 3 || i >= count - 3;
    points[static_cast<std::size_t>(i)] =
        static_cast<float>(from + share * (to - from) + (end ? 0 : random.Uniform(-bump, bump)));
  }
  Assign(motion.position, 5, duration_s, points);
  std::vector<float> torques(static_cast<std::size_t>(random.Within(4, 12)));
  const double torque = random.Uniform(0.1, 3);
  for (float& t : torques) t = random.Real(-torque, torque);
  Assign(motion.torque, 3, duration_s, torques);
  JointLimits<float>& limits = motion.limits;
  const Interval<float> position = motion.position.Bounds(0);
  const double spare = random.Uniform(0.02, 0.5);
  limits.position_min_rad = position.min - static_cast<float>(spare);
  limits.position_max_rad = position.max + static_cast<float>(spare);
  limits.velocity_max_rad_s =
      std::max(random.Real(1.02, 1.5) * Largest(motion.position.Bounds(1)), random.Real(0.5, 3));
  limits.acceleration_max_rad_s2 =
      std::max(random.Real(1.02, 1.5) * Largest(motion.position.Bounds(2)), random.Real(5, 50));
  limits.torque_max_nm = random.Real(1.02, 1.5) * Largest(motion.torque.Bounds(0));
  // Sometimes the gate has to work: a motion that asks for more than its limits.
  const int tight = random.Below(40);
  if (tight == 0) limits.velocity_max_rad_s *= 0.7F;
  if (tight == 1) limits.torque_max_nm *= 0.6F;
  if (tight == 2) limits.acceleration_max_rad_s2 *= 0.5F;
  if (spike) {  // Finite, but its derivatives are not. No loader lets this pass.
    points[static_cast<std::size_t>(count / 2)] = random.Chance(0.5) ? 3e38F : -3e38F;
    Assign(motion.position, 5, duration_s, points);
  }
  return motion;
}

AbortTable<float> MakeAborts(const Primitive<float>& primitive, FlightRandom& random) {
  AbortTable<float> aborts;
  const int spans = random.Within(1, 5);
  for (int i = 0; i < spans; ++i) {
    AbortSpan<float>& span = aborts.span_storage[static_cast<std::size_t>(i)];
    span.until_s = i + 1 == spans ? primitive.duration_s
                                  : primitive.duration_s * static_cast<float>(i + 1) /
                                        static_cast<float>(spans);
    span.way = static_cast<AbortWay>(random.Below(kAbortWayCount));
    const float late = random.Real(0, 0.05);
    const float share = random.Real(0.02, 1);
    if (span.way == AbortWay::kRollOut) span.late_max_s = late;
    for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
      const JointLimits<float>& limits = primitive.joints[j].limits;
      const float at = random.Real(0.01, 0.99);
      if (span.way != AbortWay::kFold) continue;
      span.limits_share = share;
      span.position_rad[j] =
          limits.position_min_rad + at * (limits.position_max_rad - limits.position_min_rad);
    }
  }
  aborts.span_count = spans;
  return aborts;
}

Feedback<float> MakeFeedback(const Primitive<float>& primitive, float first_pitch, float last_pitch,
                             FlightRandom& random) {
  Feedback<float> feedback;
  feedback.link = FixedString<32>("root");
  feedback.knot_count = random.Within(2, 6);
  for (int i = 0; i < feedback.knot_count; ++i) {
    feedback.knots_s[static_cast<std::size_t>(i)] =
        primitive.duration_s * static_cast<float>(i) / static_cast<float>(feedback.knot_count - 1);
  }
  const bool of_torque = random.Chance(0.5);
  const auto count =
      of_torque ? static_cast<int>(primitive.joints[0].torque.control_points().size()) : 8;
  std::vector<float> points(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const float share =
        std::clamp((static_cast<float>(i) - 1) / (static_cast<float>(count) - 3), 0.0F, 1.0F);
    points[static_cast<std::size_t>(i)] = first_pitch + share * (last_pitch - first_pitch);
  }
  Assign(feedback.angle, 3, primitive.duration_s, points);
  feedback.error_min_rad = random.Real(0, 0.05);
  feedback.error_full_rad = feedback.error_min_rad + random.Real(0.01, 0.1);
  feedback.error_max_rad = feedback.error_full_rad + random.Real(0.1, 1);
  feedback.start_error_max_rad = random.Real(0.1, 0.6);
  feedback.fade_in_s = random.Real(0.01, 0.2);
  feedback.fade_out_s = random.Real(0.01, 0.3);
  for (int j = 0; j < primitive.joint_count; ++j) {
    JointFeedback<float>& joint = feedback.joints[static_cast<std::size_t>(j)];
    for (std::size_t k = 0; k < static_cast<std::size_t>(feedback.knot_count); ++k) {
      joint.angle_gain[k] = random.Real(-2, 2);
      joint.rate_gain[k] = random.Real(-0.3, 0.3);
    }
    joint.correction_max_rad = random.Real(0.005, 0.1);
    joint.correction_rate_max_rad_s = random.Real(0.5, 6);
  }
  return feedback;
}

/// The poses where a primitive begins and ends, by their numbers.
struct Ends {
  int from = 0, to = 0;
};

// The primitives of the graph. @returns the ends of each.
std::vector<Ends> MakePrimitives(FlightSetting& setting, const Roles& roles, FlightRandom& random,
                                 std::uint32_t left_out) {
  const int poses = random.Within(1, 3);
  std::vector<Pose> pose;
  for (int i = 0; i < poses; ++i) pose.push_back(RandomPose(roles, random));

  const int primitives = random.Within(1, 4);
  const float entry = random.Real(0.02, 0.2);
  const float following = random.Real(0.1, 0.5);
  const bool misfits = random.Chance(0.12);
  std::vector<Ends> ends;
  for (int p = 0; p < primitives; ++p) {
    Primitive<float> primitive;
    primitive.name = FixedString<48>("primitive" + std::to_string(p));
    const int from = p == 0 ? 0 : random.Below(poses);
    const int to = random.Below(poses);
    ends.push_back({from, to});
    primitive.duration_s = random.Real(0.15, 0.7);
    primitive.settle_s = random.Chance(0.3) ? 0 : random.Real(0, 0.1);
    primitive.entry_tolerance_rad = entry;
    primitive.following_tolerance_rad = following;
    primitive.joint_count = roles.joint_count;
    const bool spike = random.Chance(0.04) && !LeavesOut(left_out, "spikes");
    for (std::size_t j = 0; j < static_cast<std::size_t>(roles.joint_count); ++j) {
      // A primitive that does not begin where the one before has ended.
      const float off = misfits && p > 0 ? random.Real(-0.5, 0.5) : 0;
      primitive.joints[j] = RandomMotion(pose[static_cast<std::size_t>(from)][j] + off,
                                         pose[static_cast<std::size_t>(to)][j],
                                         primitive.duration_s, spike && j == 0, random);
      primitive.joints[j].name = FixedString<32>("joint" + std::to_string(j + 1));
    }
    FlightRandom aborts = FlightRandom(random.Bits());
    if (aborts.Chance(0.6) && !LeavesOut(left_out, "aborts"))
      primitive.aborts = MakeAborts(primitive, aborts);
    setting.primitives.push_back(primitive);
  }
  return ends;
}

void MakeNodes(SequenceGraph<float>& graph, int primitives, FlightRandom& random) {
  graph.node_count = random.Within(1, 6);
  for (int i = 0; i < graph.node_count; ++i) {
    SequenceNode& node = graph.node_storage[static_cast<std::size_t>(i)];
    node.name = FixedString<48>("node" + std::to_string(i));
    node.primitive = i == 0 ? 0 : random.Below(primitives);
    node.swapped = random.Chance(0.3);
    node.safe = random.Chance(0.4);
    node.ends_cycle = random.Chance(0.4);
    if (random.Chance(0.4)) {
      const int other = random.Below(graph.node_count);
      if (other != i) node.after_fall = other;
    }
    graph.last_pitch_rad[static_cast<std::size_t>(i)] = random.Real(-3, 3);
  }
}

const Ends& EndsOf(const SequenceGraph<float>& graph, int node, const std::vector<Ends>& ends) {
  return ends[static_cast<std::size_t>(graph.node(node).primitive)];
}

// Edges to nodes that begin where the one before has ended.
void MakeEdges(SequenceGraph<float>& graph, const std::vector<Ends>& ends, FlightRandom& random) {
  const auto next_of = [&](int node) {
    std::vector<int> next;
    for (int i = 0; i < graph.node_count; ++i) {
      if (EndsOf(graph, i, ends).from == EndsOf(graph, node, ends).to) next.push_back(i);
    }
    return next;
  };
  const auto add = [&](int node, const std::vector<int>& next, EdgeCondition when,
                       std::string_view branch) {
    if (next.empty() || graph.edge_count == kMaxSequenceEdges) return;
    SequenceEdge<float>& edge = graph.edge_storage[static_cast<std::size_t>(graph.edge_count++)];
    edge.from = node;
    edge.to = next[static_cast<std::size_t>(random.Below(static_cast<int>(next.size())))];
    edge.settle_s = random.Chance(0.3) ? 0 : random.Real(0, 0.15);
    edge.when = when;
    edge.branch = FixedString<32>(branch);
  };
  for (int i = 0; i < graph.node_count; ++i) {
    const std::vector<int> next = next_of(i);
    if (random.Chance(0.8)) add(i, next, EdgeCondition::kAlways, "");
    if (random.Chance(0.3)) add(i, next, EdgeCondition::kCyclesDone, "");
    if (random.Chance(0.4)) add(i, next, EdgeCondition::kBranch, "left");
    if (random.Chance(0.2)) add(i, next, EdgeCondition::kBranch, "right");
  }
}

// Where a robot may lie when a run begins: at the start, and at nodes with the start's first pose.
void MakeBeginnings(SequenceGraph<float>& graph, const std::vector<Ends>& ends,
                    FlightRandom& random) {
  if (!random.Chance(0.6)) return;
  graph.beginning_within_rad = random.Real(0.2, 0.7);
  for (int i = 0; i < graph.node_count; ++i) {
    const float pitch = random.Real(-3, 3);
    if (i != graph.start && (EndsOf(graph, i, ends).from != 0 || !random.Chance(0.6))) continue;
    graph.beginning_storage[static_cast<std::size_t>(graph.beginning_count++)] = {i, pitch};
  }
}

// The plan's angle from where the robot lies before to where it lies after.
void MakeFeedbacks(FlightSetting& setting, FlightRandom& random, std::uint32_t left_out) {
  const SequenceGraph<float>& graph = setting.graph;
  for (std::size_t p = 0; p < setting.primitives.size(); ++p) {
    FlightRandom feedback = FlightRandom(random.Bits());
    if (!feedback.Chance(0.5) || LeavesOut(left_out, "feedback")) continue;
    float first = feedback.Real(-1, 1), last = feedback.Real(-1, 1);
    for (int i = 0; i < graph.node_count; ++i) {
      if (graph.node(i).primitive != static_cast<int>(p)) continue;
      last = graph.last_pitch_rad[static_cast<std::size_t>(i)];
      if (graph.node(i).swapped) last -= graph.swap_pitch_rad;
    }
    Primitive<float>& primitive = setting.primitives[p];
    primitive.feedback = MakeFeedback(primitive, first, last, feedback);
  }
}

void MakeGraph(FlightSetting& setting, const Roles& roles, FlightRandom& random,
               std::uint32_t left_out) {
  SequenceGraph<float>& graph = setting.graph;
  graph.name = FixedString<48>("flight");
  graph.partner = roles.partner;
  graph.swap_pitch_rad = random.Real(-3.1, 3.1);
  const std::vector<Ends> ends = MakePrimitives(setting, roles, random, left_out);
  MakeNodes(graph, static_cast<int>(ends.size()), random);
  MakeEdges(graph, ends, random);
  MakeBeginnings(graph, ends, random);
  MakeFeedbacks(setting, random, left_out);
}

JointMap RandomMap(FlightRandom& random) {
  JointMap map;
  map.direction = random.Chance(0.5) ? 1.0F : -1.0F;
  map.gear_ratio = random.Chance(0.5) ? 1.0F : random.Real(0.5, 2);
  map.zero_offset_rad = random.Chance(0.5) ? 0.0F : random.Real(-0.5, 0.5);
  return map;
}

// Ranges wide enough for every motion here at every gear.
constexpr ShaftRanges kWideShaft = {{-12.5F, 12.5F}, {-150.0F, 150.0F}, {-18.0F, 18.0F}};
constexpr ImpedanceRanges kWide = {
    {-12.5F, 12.5F}, {-150.0F, 150.0F}, {0.0F, 500.0F}, {0.0F, 20.0F}, {-18.0F, 18.0F}};

MitConfig RandomMit(int joint, bool damiao, FlightRandom& random) {
  MitConfig mit = MitProtocol::Example(joint);
  mit.dialect = damiao ? MitDialect::kDamiao : MitDialect::kMiniCheetah;
  mit.command = mit.reply = kWide;
  if (random.Chance(0.3)) mit.reply.torque_nm = {-30.0F, 30.0F};
  if (random.Chance(0.3)) mit.temperature_encoding = MitTemperature::kOffset40;
  return mit;
}

Cia402Config RandomCia402(int joint, const FlightSetting& setting, double watchdog_s,
                          FlightRandom& random) {
  Cia402Config node = Cia402Protocol::Example(joint);
  node.range = kWideShaft;
  node.period_us = static_cast<std::uint32_t>(setting.period_ns / 1000);
  node.position_units_per_turn = random.Chance(0.5) ? 65536.0F : 16384.0F;
  node.velocity_units_per_turn_s = random.Chance(0.5) ? 65536.0F : 6000.0F;
  node.heartbeat_ms = static_cast<std::uint16_t>(random.Within(5, 60));
  node.watchdog_ms = static_cast<std::uint16_t>(std::lround(watchdog_s * 1e3));
  node.watchdog_reaction = static_cast<std::int16_t>(random.Within(0, 3));
  node.quick_stop_option = static_cast<std::int16_t>(random.Within(1, 7));
  node.feed_forward = random.Chance(0.8);
  node.status_every = static_cast<std::uint8_t>(random.Within(1, 6));
  if (random.Chance(0.3)) node.following_window_rad = random.Real(0.2, 2);
  return node;
}

CanSimpleConfig RandomCanSimple(int joint, const FlightSetting& setting, FlightRandom& random) {
  const double period_s = static_cast<double>(setting.period_ns) * 1e-9;
  CanSimpleConfig can = CanSimpleProtocol::Example(joint);
  can.range = kWideShaft;
  can.messages.heartbeat_s = random.Uniform(0.005, 0.03);
  can.messages.estimates_s = std::max(period_s * random.Within(1, 2), 0.001);
  can.messages.torques_s = random.Chance(0.3) ? 0.02 : 0;
  can.messages.temperature_s = random.Chance(0.9) ? random.Uniform(0.02, 0.1) : 0;
  can.heartbeat_ticks_max =
      static_cast<int>(std::ceil((3.5 * can.messages.heartbeat_s + 0.01) / period_s)) + 1;
  can.estimates_per_tick_max =
      static_cast<int>(std::ceil(period_s / can.messages.estimates_s - 1e-9)) + 1;
  return can;
}

AkV3Config RandomAkV3(int joint, const FlightSetting& setting, FlightRandom& random) {
  const double period_s = static_cast<double>(setting.period_ns) * 1e-9;
  AkV3Config ak = AkV3Protocol::Example(joint);
  ak.range = kWide;
  ak.status_s = std::max(period_s, 0.002);
  ak.torque_constant_nm_per_a = random.Chance(0.5) ? 0.0F : 0.57F;
  ak.status_per_tick_max = static_cast<int>(std::ceil(period_s / ak.status_s - 1e-9)) + 1;
  return ak;
}

// The drives, with a period in which all their frames fit on the bus.
void MakeDrives(FlightSetting& setting, int joint_count, FlightRandom& random) {
  constexpr std::array<int, 6> kPeriods_ms = {1, 2, 4, 5, 8, 10};
  constexpr double kMostLoad = 0.9;
  constexpr double kSensorBits = 3 * 135;
  const bool damiao = random.Chance(0.3);
  const double watchdog_s = random.Chance(0.1) ? 0 : random.Logarithmic(0.015, 0.4);
  const std::uint64_t seed = random.Bits();
  for (const int period_ms : kPeriods_ms) {
    setting.period_ns = std::int64_t{period_ms} * 1'000'000;
    setting.drives = {};
    setting.drives.rate_hz = 1000.0 / period_ms;
    FlightRandom each(seed);
    for (int i = 0; i < joint_count; ++i) {
      DriveEntry entry;
      entry.joint = "joint" + std::to_string(i + 1);
      entry.watchdog_s = watchdog_s == 0 ? 0 : std::max(watchdog_s, 4e-3 * period_ms);
      const JointMap map = RandomMap(each);
      switch (setting.protocol) {
        case 0:
          entry.config = RandomMit(i, damiao, each);
          break;
        case 1:
          // Its watchdogs count milliseconds.
          entry.watchdog_s = std::floor(entry.watchdog_s * 1e3) * 1e-3;
          entry.config = RandomCia402(i, setting, entry.watchdog_s, each);
          break;
        case 2:
          entry.config = RandomCanSimple(i, setting, each);
          break;
        default:
          entry.config = RandomAkV3(i, setting, each);
          break;
      }
      std::visit([&map](auto& config) { config.joint = map; }, entry.config);
      entry.kp_nm_per_rad = each.Real(30, 120);
      entry.kd_nm_s_per_rad = each.Real(0.5, 4);
      entry.temperature_max_c = each.Real(60, 90);
      setting.drives.drives.push_back(entry);
      FlightJoint& joint = setting.joints[static_cast<std::size_t>(i)];
      joint.reply_size = each.Chance(0.7) ? 8 : each.Within(6, 7);
    }
    const double sensor = setting.has_sensor ? kSensorBits * setting.drives.rate_hz / 1e6 : 0;
    if (setting.drives.WorstCaseLoad() + sensor <= kMostLoad) return;
  }
  throw std::logic_error("these drives fit on no bus");
}

void MakeReactions(FlightSetting& setting, FlightRandom& random, bool can_collapse,
                   std::uint32_t left_out) {
  const double share = random.Chance(0.4) ? 0 : random.Uniform(0.02, 0.5);
  const bool senses = random.Chance(0.5);
  FaultTable& table = setting.executor.reactions;
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    for (std::size_t s = 1; s < kExecutorStateCount; ++s) {
      const auto fault = static_cast<Fault>(f);
      const auto state = static_cast<ExecutorState>(s);
      const auto reaction = static_cast<Reaction>(random.Below(static_cast<int>(kReactionCount)));
      const bool sensor = fault == Fault::kSensorLost && senses;
      if (!random.Chance(sensor ? 0.7 : share) || LeavesOut(left_out, "reactions")) continue;
      if (reaction == Reaction::kCollapse && !can_collapse) continue;
      if (reaction == Reaction::kIgnore && random.Chance(0.5)) continue;
      static_cast<void>(table.Set(fault, state, reaction));
    }
  }
}

// The pose of a collapse within the limits of every path, if there is one.
bool MakeCollapse(FlightSetting& setting, FlightRandom& random) {
  CollapseConfig& collapse = setting.executor.collapse;
  collapse.stiffness = random.Real(0.05, 1);
  for (std::size_t j = 0; j < static_cast<std::size_t>(setting.joint_count()); ++j) {
    float low = -1e9F, high = 1e9F;
    for (const Primitive<float>& primitive : setting.primitives) {
      for (const JointMotion<float>& motion : primitive.motions()) {
        low = std::max(low, motion.limits.position_min_rad);
        high = std::min(high, motion.limits.position_max_rad);
      }
    }
    const float at = random.Real(0, 1);
    if (!(low < high)) return false;
    collapse.position_rad[j] = low + at * (high - low);
  }
  return true;
}

void MakeExecutor(FlightSetting& setting, std::uint32_t left_out, FlightRandom& random) {
  ExecutorConfig& config = setting.executor;
  config.period_s = static_cast<float>(setting.period_ns) * 1e-9F;
  const float speed = random.Real(0.3, 1);
  if (random.Chance(0.25) && !LeavesOut(left_out, "speed")) config.speed = speed;
  config.move_fraction = random.Real(0.1, 1);
  config.torque_rise_s = static_cast<float>(random.Logarithmic(1e-3, 0.1));
  config.stale_ticks_max = random.Within(2, 10);
  config.sequence_errors_max = random.Within(3, 15);
  config.late_ticks_max = random.Within(0, 5);
  config.pause_ticks_max = PauseTicksMax(setting.drives);
  // Sometimes nobody could arm as fast as is asked for.
  config.arming_ticks_max = random.Chance(0.12) ? random.Within(1, 10) : random.Within(200, 600);
  config.start_way_max_rad = random.Chance(0.3) ? random.Real(0.2, 1) : 1e9F;
  const float moved = random.Real(0.05, 1);
  const bool known = random.Chance(0.1) && !LeavesOut(left_out, "last-known");
  for (std::size_t j = 0; j < static_cast<std::size_t>(setting.joint_count()); ++j) {
    const float off = random.Real(-0.3, 0.3);
    if (known) {
      config.moved_max_rad = moved;
      config.last_known[j] = {true, setting.StartOf(static_cast<int>(j)) + off, 6.2831853F};
    }
    const DriveEntry& entry = setting.drives.drives[j];
    config.joints[j] = {entry.kp_nm_per_rad, entry.kd_nm_s_per_rad, random.Real(0.2, 4),
                        entry.temperature_max_c};
  }
  config.cycles = random.Chance(0.5) ? 0 : random.Within(1, 3);
  const int branch = random.Below(4) == 0 ? setting.graph.FindBranch("left") : -1;
  config.branch = branch;
  const int get_ups = random.Within(1, 3);
  const bool rises = random.Chance(0.7);
  if (rises && setting.has_sensor && !LeavesOut(left_out, "get-ups")) config.get_ups_max = get_ups;
  const auto beginnings = setting.graph.beginnings();
  const int said = random.Below(8);
  if (said < static_cast<int>(beginnings.size()))
    config.begin = beginnings[static_cast<std::size_t>(said)].node;
  const bool collapses = MakeCollapse(setting, random);
  config.collapse.configured = collapses && !LeavesOut(left_out, "collapse");
  MakeReactions(setting, random, config.collapse.configured, left_out);
}

void MakeSensor(FlightSetting& setting, std::uint32_t left_out, FlightRandom& random) {
  setting.has_sensor = random.Chance(0.65) && !LeavesOut(left_out, "sensor");
  setting.sensor_every = random.Chance(0.7) ? 1 : random.Within(2, 4);
  setting.sensor_has_time = random.Chance(0.5);
  setting.sensor_ids = {0x441, 0x442, 0x443};  // no drive's of any protocol
  setting.sensor.age_ticks_max = setting.sensor_every + random.Within(1, 8);
  setting.sensor.repeats_max = static_cast<std::uint32_t>(random.Within(0, 30));
  if (random.Chance(0.2)) setting.sensor.chain[0] = random.Chance(0.5) ? 1.0F : -1.0F;
}

void MakeProcedure(FlightSetting& setting, std::uint32_t left_out, FlightRandom& random) {
  setting.by_procedure = random.Chance(0.4) && !LeavesOut(left_out, "procedure");
  RunProcedureConfig& procedure = setting.procedure;
  procedure.hold_ticks = random.Within(1, 150);
  procedure.reply_ticks_max = random.Within(100, 800);
  procedure.start_ticks_max = random.Within(10, 400);
  procedure.stop_hold_ticks = random.Within(1, 150);
  procedure.fault_ticks = random.Within(1, 300);
  procedure.disarmed_ticks = random.Within(1, 20);
  procedure.clear_ticks = random.Chance(0.5) ? 0 : random.Within(1, 20);
  procedure.attended = random.Chance(0.3);
  procedure.lower_ticks = random.Chance(0.4) ? random.Within(1, 300) : 0;
  procedure.end_hold_ticks = random.Chance(0.5) ? random.Within(-1, 300) : 0;
  procedure.go_home = random.Chance(0.6);
  for (int i = 0; i < setting.graph.node_count; ++i) {
    if (setting.graph.node(i).safe) procedure.safe_nodes |= 1U << static_cast<unsigned>(i);
  }
}

void MakeWorld(FlightSetting& setting, std::uint32_t left_out, FlightRandom& random) {
  for (std::size_t j = 0; j < static_cast<std::size_t>(setting.joint_count()); ++j) {
    FlightJoint& joint = setting.joints[j];
    joint.inertia_kg_m2 = random.Uniform(0.02, 0.08);
    joint.friction_nm_s_per_rad = random.Uniform(0.01, 0.2);
    const double stiffness = static_cast<double>(setting.drives.drives[j].kp_nm_per_rad);
    const double tolerance = static_cast<double>(setting.primitives[0].entry_tolerance_rad);
    const double gravity = random.Uniform(-1, 1) * std::min(2.0, 0.6 * tolerance * stiffness);
    if (!LeavesOut(left_out, "gravity")) joint.gravity_nm = gravity;
    const double reach = random.Uniform(0.5, 1.5);
    joint.stop_min_rad = static_cast<double>(setting.StartOf(static_cast<int>(j))) - 1.5 - reach;
    joint.stop_max_rad = static_cast<double>(setting.StartOf(static_cast<int>(j))) + 1.5 + reach;
  }
  setting.patience_ticks = static_cast<int>(random.Logarithmic(5, 150));
  setting.repairs = random.Chance(0.85);
  // As a Linux host has: 10 frames in the queue of an interface, which gives way where more joints
  // than that are written in a tick, and hundreds in the buffer of a socket.
  const int frames = 4 * setting.joint_count() + 2;
  setting.transmit_capacity = frames + random.Within(0, 20);
  setting.receive_capacity = random.Within(64, 2000);
}

}  // namespace

FlightSetting MakeSetting(std::uint64_t seed, std::uint32_t left_out) {
  FlightSetting setting;
  FlightRandom random(seed, 0);
  setting.protocol = static_cast<int>(seed % DriveProtocols::kCount);
  Roles roles;
  const int size = random.Below(20);
  roles.joint_count =
      size < 14 ? 2
                : (size < 16 ? 1
                             : (size < 19 ? random.Within(3, 4)
                                          : random.Within(5, static_cast<int>(kMostDrawn))));
  const bool pairs = random.Chance(0.7);
  for (std::size_t j = 0; j < kMaxJoints; ++j) {
    const bool paired = pairs && static_cast<int>(j | 1U) < roles.joint_count;
    roles.partner[j] = static_cast<std::uint8_t>(paired ? j ^ 1U : j);
  }
  FlightRandom motions(seed, 1), sensor(seed, 2), drives(seed, 3), executor(seed, 4),
      procedure(seed, 5), world(seed, 6);
  MakeGraph(setting, roles, motions, left_out);
  MakeSensor(setting, left_out, sensor);
  MakeDrives(setting, roles.joint_count, drives);
  MakeExecutor(setting, left_out, executor);
  MakeProcedure(setting, left_out, procedure);
  MakeWorld(setting, left_out, world);
  return setting;
}

}  // namespace tumbler::testing
