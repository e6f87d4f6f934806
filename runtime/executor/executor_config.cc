#include "runtime/executor/executor_config.h"

#include <algorithm>

#include "runtime/executor/numbers.h"

// All of this is cold: called once, its loops need not be unrolled into a small board's flash.
namespace tumbler {
namespace {

[[gnu::cold]] bool IsValid(const ExecutorConfig& config, int joint_count) noexcept {
  if (!(InRange(config.period_s, 1e-5F, 1.0F) && InRange(config.speed, 0.1F, 1.0F) &&
        InRange(config.move_fraction, 0.001F, 1.0F) && InRange(config.torque_rise_s, 1e-6F, 1e3F) &&
        config.stale_ticks_max >= 1 && config.sequence_errors_max >= 1 &&
        config.late_ticks_max >= 0 && config.late_ticks_max <= 1000 &&
        config.pause_ticks_max >= 1 && config.get_ups_max >= 0 && config.start_way_max_rad >= 0 &&
        config.moved_max_rad >= 0 && config.arming_ticks_max >= 1)) {
    return false;
  }
  if (config.collapse.configured ? !InRange(config.collapse.stiffness, 0.01F, 1.0F)
                                 : config.reactions.Has(Reaction::kCollapse)) {
    return false;
  }
  for (int i = 0; i < joint_count; ++i) {
    const JointConfig& joint = config.joints[static_cast<std::size_t>(i)];
    const KnownPosition& known = config.last_known[static_cast<std::size_t>(i)];
    if (known.known && !(IsFinite(known.position_rad) && IsPositive(known.turn_rad))) return false;
    if (!(InRange(joint.kp_nm_per_rad, 0, 1e6F) && InRange(joint.kd_nm_s_per_rad, 0, 1e6F) &&
          InRange(joint.damping_nm_s_per_rad, 0, 1e6F) && IsFinite(joint.temperature_max_c))) {
      return false;
    }
  }
  return true;
}

[[gnu::cold]] bool IsValid(const SequenceGraph<float>& graph, int primitive_count) noexcept {
  const auto within = [](int i, int count) { return i >= 0 && i < count; };
  if (graph.node_count > kMaxSequenceNodes || graph.edge_count > kMaxSequenceEdges ||
      !within(graph.start, graph.node_count) || graph.edge_count < 0 || graph.beginning_count < 0 ||
      graph.beginning_count > kMaxSequenceNodes) {
    return false;
  }
  for (const SequenceBeginning<float>& beginning : graph.beginnings()) {
    if (!within(beginning.node, graph.node_count) || !IsFinite(beginning.pitch_rad) ||
        !InRange(graph.beginning_within_rad, 0, 3.2F)) {
      return false;
    }
  }
  if (!std::ranges::all_of(graph.last_pitch_rad, [](float pitch) { return IsFinite(pitch); }))
    return false;
  for (const SequenceNode& node : graph.nodes()) {
    if (!within(node.primitive, primitive_count)) return false;
    if (node.after_fall >= graph.node_count) return false;
  }
  for (const SequenceEdge<float>& edge : graph.edges()) {
    if (!within(edge.from, graph.node_count) || !within(edge.to, graph.node_count) ||
        !InRange(edge.settle_s, 0, 1e6F)) {
      return false;
    }
  }
  return true;
}

[[gnu::cold]] bool IsValid(const JointMotion<float>& motion,
                           const ExecutorConfig& config) noexcept {
  const JointLimits<float>& limits = motion.limits;
  if (!(IsFinite(limits.position_min_rad) && IsFinite(limits.position_max_rad) &&
        limits.position_min_rad < limits.position_max_rad &&
        IsPositive(limits.velocity_max_rad_s) && IsPositive(limits.acceleration_max_rad_s2) &&
        IsPositive(limits.torque_max_nm))) {
    return false;
  }
  // The path is clamped: it begins with its first control points.
  const float start = motion.position.control_points(0)[0];
  const float start_rate = motion.position.control_points(1)[0];
  return Magnitude(start_rate) * config.speed <= limits.acceleration_max_rad_s2 * config.period_s &&
         InRange(start, limits.position_min_rad, limits.position_max_rad);
}

// Whether the pose of kCollapse is within the limits of every path that its joints may follow.
[[gnu::cold]] bool IsValid(const CollapseConfig& collapse,
                           const Primitive<float>& primitive) noexcept {
  if (!collapse.configured) return true;
  for (int i = 0; i < primitive.joint_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const JointLimits<float>& limits = primitive.joints[index].limits;
    if (!InRange(collapse.position_rad[index], limits.position_min_rad, limits.position_max_rad)) {
      return false;
    }
  }
  return true;
}

[[gnu::cold]] bool IsValid(const Feedback<float>& feedback,
                           const Primitive<float>& primitive) noexcept {
  if (!feedback.present()) return feedback.knot_count == 0;
  if (feedback.knot_count < 2 || feedback.knot_count > kMaxGainKnots ||
      !InRange(feedback.error_min_rad, 0, feedback.error_full_rad) ||
      !InRange(feedback.error_full_rad, 0, feedback.error_max_rad) ||
      !IsPositive(feedback.error_max_rad) || !IsPositive(feedback.start_error_max_rad) ||
      !IsPositive(feedback.fade_in_s) || !IsPositive(feedback.fade_out_s)) {
    return false;
  }
  const std::span<const float> knots = feedback.knots();
  for (std::size_t i = 1; i < knots.size(); ++i) {
    if (!(IsFinite(knots[i]) && IsFinite(knots[i - 1]) && knots[i] > knots[i - 1])) return false;
  }
  for (int j = 0; j < primitive.joint_count; ++j) {
    const JointFeedback<float>& joint = feedback.joints[static_cast<std::size_t>(j)];
    const auto finite = [](float x) { return IsFinite(x); };
    if (!(std::ranges::all_of(joint.angle_gain, finite) &&
          std::ranges::all_of(joint.rate_gain, finite) && IsFinite(joint.chain) &&
          InRange(joint.correction_max_rad, 0, 1e3F) &&
          IsPositive(joint.correction_rate_max_rad_s))) {
      return false;
    }
  }
  return true;
}

[[gnu::cold]] bool IsValid(const AbortTable<float>& aborts,
                           const Primitive<float>& primitive) noexcept {
  if (aborts.span_count < 0 || aborts.span_count > kMaxAbortSpans) return false;
  float from_s = 0;
  for (const AbortSpan<float>& span : aborts.spans()) {
    if (!(span.until_s > from_s) || span.way > AbortWay::kDamp) return false;
    from_s = span.until_s;
    if (span.way == AbortWay::kRollOut && !InRange(span.late_max_s, 0, 1e4F)) return false;
    if (span.way != AbortWay::kFold) continue;
    if (!IsPositive(span.limits_share) || span.limits_share > 1) return false;
    for (int j = 0; j < primitive.joint_count; ++j) {
      const auto index = static_cast<std::size_t>(j);
      const JointLimits<float>& limits = primitive.joints[index].limits;
      if (!InRange(span.position_rad[index], limits.position_min_rad, limits.position_max_rad))
        return false;
    }
  }
  return !aborts.present() || from_s == primitive.duration_s;
}

[[gnu::cold]] bool IsValid(const Primitive<float>& primitive,
                           const ExecutorConfig& config) noexcept {
  if (!IsPositive(primitive.duration_s) || primitive.duration_s > 1e4F ||
      !InRange(primitive.settle_s, 0, 1e6F) || !IsPositive(primitive.entry_tolerance_rad) ||
      !IsPositive(primitive.following_tolerance_rad)) {
    return false;
  }
  return std::ranges::all_of(primitive.motions(), [&](const JointMotion<float>& motion) {
    return IsValid(motion, config);
  });
}

}  // namespace

[[gnu::cold]] bool IsPlayable(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                              std::span<const Primitive<float>> primitives,
                              int joint_count) noexcept {
  if (!IsFinite(graph.swap_pitch_rad)) return false;
  if (joint_count < 1 || joint_count > kMaxJoints || !IsValid(config, joint_count) ||
      !IsValid(graph, static_cast<int>(primitives.size())) || config.branch >= graph.edge_count ||
      (config.begin >= 0 && !graph.MayBegin(config.begin))) {
    return false;
  }
  return std::ranges::all_of(primitives, [&](const Primitive<float>& primitive) {
    return primitive.joint_count == joint_count && IsValid(primitive, config) &&
           IsValid(primitive.feedback, primitive) && IsValid(primitive.aborts, primitive) &&
           IsValid(config.collapse, primitive);
  });
}

}  // namespace tumbler
