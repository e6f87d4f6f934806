#include "common/files/motion_header.h"
#include "common/files/primitive_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string_view>

namespace tumbler {
namespace {

bool IsLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// Whether the text is identifiers joined by `::`, none of them of the reserved kind. Keywords are
/// not looked for: the compiler will refuse them.
bool IsNamespace(std::string_view name) {
  while (true) {
    const std::size_t end = name.find("::");
    const std::string_view part = name.substr(0, end);
    const bool identifier =
        !part.empty() && IsLetter(part.front()) && part.front() != '_' &&
        part.find("__") == std::string_view::npos &&
        std::ranges::all_of(part, [](char c) { return IsLetter(c) || IsDigit(c); });
    if (!identifier) return false;
    if (end == std::string_view::npos) return true;
    name.remove_prefix(end + 2);
  }
}

std::string DefaultNamespace(std::string_view motion) {
  std::string name = "motion_";
  for (const char c : motion) {
    const bool fits = (IsLetter(c) && c != '_') || IsDigit(c);
    if (fits) {
      name += c;
    } else if (name.back() != '_') {
      name += '_';
    }
  }
  return name;
}

/// The text as a C++ string literal. Escapes are octal, because those end after three digits,
/// whatever follows.
std::string StringLiteral(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c < ' ' || c > '~' || c == '?') {  // ?\?/ would be a trigraph to some compilers.
      out += fmt::format("\\{:03o}", static_cast<unsigned char>(c));
    } else {
      if (c == '"' || c == '\\') out += '\\';
      out += c;
    }
  }
  return out + '"';
}

/// A float literal in hexadecimal, which keeps every bit.
std::string Exact(float value) { return fmt::format("{:a}F", static_cast<double>(value)); }

/// Appends `  constexpr float NAME[] = {...};`, broken into lines of at most 96 columns.
void AppendFloats(std::string& out, const char* name, std::span<const float> values) {
  out += fmt::format("  constexpr float {}[] = {{", name);
  constexpr std::size_t kLine = 96;
  std::size_t column = kLine;
  for (const float value : values) {
    const std::string text = Exact(value) + ",";
    if (column + text.size() + 1 > kLine) {
      out += "\n     ";
      column = 5;
    }
    out += " " + text;
    column += text.size() + 1;
  }
  out += "};\n";
}

using RuntimeSpline = JointMotion<float>::Spline;

void AppendSpline(std::string& out, const std::string& member, const RuntimeSpline& spline) {
  out += fmt::format("  {{\n");
  AppendFloats(out, "knots", spline.knots());
  AppendFloats(out, "points", spline.control_points());
  out += fmt::format(
      "  p.{} = tumbler::JointMotion<float>::Spline::Constant({}, knots, points);\n  "
      "}}\n",
      member, spline.degree());
}

/// Throws unless all control points of the spline and its derivatives are finite: the compiler
/// could not make them constants.
void RequireFinite(const std::string& part, const RuntimeSpline& spline, const char* what) {
  for (int d = 0; d <= RuntimeSpline::kMaxDerivative; ++d) {
    for (const float point : spline.control_points(d)) {
      if (std::isfinite(point)) continue;
      throw std::invalid_argument(
          fmt::format("{}: derivative {} of its {} does not fit single precision", part, d, what));
    }
  }
}

/// The floats as an initializer list.
std::string List(std::span<const float> values) {
  std::string out;
  for (const float value : values) out += (out.empty() ? "" : ", ") + Exact(value);
  return "{" + out + "}";
}

std::string FeedbackText(const Primitive<float>& primitive) {
  const Feedback<float>& feedback = primitive.feedback;
  const std::size_t knots = feedback.knots().size();
  RequireFinite("the feedback", feedback.angle, "angle");
  std::string out = fmt::format("  p.feedback.link = tumbler::FixedString<32>({});\n",
                                StringLiteral(feedback.link.view())) +
                    fmt::format("  p.feedback.knot_count = {};\n  p.feedback.knots_s = {};\n",
                                feedback.knot_count, List(feedback.knots()));
  AppendSpline(out, "feedback.angle", feedback.angle);
  out += fmt::format(
      "  p.feedback.error_min_rad = {};\n  p.feedback.error_full_rad = {};\n"
      "  p.feedback.error_max_rad = {};\n  p.feedback.start_error_max_rad = {};\n"
      "  p.feedback.fade_in_s = {};\n  p.feedback.fade_out_s = {};\n",
      Exact(feedback.error_min_rad), Exact(feedback.error_full_rad), Exact(feedback.error_max_rad),
      Exact(feedback.start_error_max_rad), Exact(feedback.fade_in_s), Exact(feedback.fade_out_s));
  for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
    const JointFeedback<float>& joint = feedback.joints[j];
    out += fmt::format("  p.feedback.joints[{}] = {{{},\n      {},\n      {},\n      {}, {}}};\n",
                       j, Exact(joint.chain), List({joint.angle_gain.data(), knots}),
                       List({joint.rate_gain.data(), knots}), Exact(joint.correction_max_rad),
                       Exact(joint.correction_rate_max_rad_s));
  }
  return out;
}

const char* NameOf(AbortWay way) {
  switch (way) {
    case AbortWay::kCatch:
      return "kCatch";
    case AbortWay::kFold:
      return "kFold";
    case AbortWay::kRollOut:
      return "kRollOut";
    case AbortWay::kDamp:
      return "kDamp";
  }
  throw std::invalid_argument("a span of the table of aborts has no way");
}

std::string AbortsText(const Primitive<float>& primitive) {
  std::string out = fmt::format("  p.aborts.span_count = {};\n", primitive.aborts.span_count);
  for (std::size_t i = 0; i < primitive.aborts.spans().size(); ++i) {
    const AbortSpan<float>& span = primitive.aborts.span_storage[i];
    out += fmt::format(
        "  p.aborts.span_storage[{}] = {{{}, tumbler::AbortWay::{}, {}, {},\n      {}}};\n", i,
        Exact(span.until_s), NameOf(span.way), Exact(span.late_max_s), Exact(span.limits_share),
        List({span.position_rad.data(), primitive.motions().size()}));
  }
  return out;
}

std::string PrimitiveText(const Primitive<float>& primitive) {
  std::string out = "  tumbler::Primitive<float> p;\n";
  const auto line = [&out](auto format, const auto&... values) {
    out += fmt::format(fmt::runtime(format), values...);
  };
  line("  p.name = tumbler::FixedString<48>({});\n", StringLiteral(primitive.name.view()));
  line("  p.duration_s = {};\n", Exact(primitive.duration_s));
  line("  p.settle_s = {};\n", Exact(primitive.settle_s));
  line("  p.entry_tolerance_rad = {};\n", Exact(primitive.entry_tolerance_rad));
  line("  p.following_tolerance_rad = {};\n", Exact(primitive.following_tolerance_rad));
  line("  p.joint_count = {};\n", primitive.joint_count);
  for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
    const JointMotion<float>& motion = primitive.joints[j];
    const JointLimits<float>& limits = motion.limits;
    line("  p.joints[{}].name = tumbler::FixedString<32>({});\n", j,
         StringLiteral(motion.name.view()));
    const std::string part = fmt::format("joint '{}'", motion.name.view());
    RequireFinite(part, motion.position, "position");
    RequireFinite(part, motion.torque, "feed-forward");
    AppendSpline(out, fmt::format("joints[{}].position", j), motion.position);
    AppendSpline(out, fmt::format("joints[{}].torque", j), motion.torque);
    line("  p.joints[{}].limits = {{{}, {}, {}, {}, {}}};\n", j, Exact(limits.position_min_rad),
         Exact(limits.position_max_rad), Exact(limits.velocity_max_rad_s),
         Exact(limits.acceleration_max_rad_s2), Exact(limits.torque_max_nm));
  }
  if (primitive.feedback.present()) out += FeedbackText(primitive);
  if (primitive.aborts.present()) out += AbortsText(primitive);
  return out + "  return p;\n";
}

const char* NameOf(EdgeCondition condition) {
  switch (condition) {
    case EdgeCondition::kAlways:
      return "kAlways";
    case EdgeCondition::kBranch:
      return "kBranch";
    case EdgeCondition::kCyclesDone:
      return "kCyclesDone";
  }
  throw std::invalid_argument("an edge has no condition");
}

const char* NameOf(RunEnd end) {
  switch (end) {
    case RunEnd::kSafe:
      return "kSafe";
    case RunEnd::kLower:
      return "kLower";
    case RunEnd::kHold:
      return "kHold";
    case RunEnd::kTorqueOff:
      return "kTorqueOff";
  }
  throw std::invalid_argument("a sequence has no end");
}

std::string GraphText(const SequenceGraph<float>& graph, std::size_t joints) {
  std::string out = "  tumbler::SequenceGraph<float> g;\n";
  const auto line = [&out](auto format, const auto&... values) {
    out += fmt::format(fmt::runtime(format), values...);
  };
  line("  g.name = tumbler::FixedString<48>({});\n", StringLiteral(graph.name.view()));
  line("  g.start = {};\n  g.node_count = {};\n", graph.start, graph.node_count);
  for (int i = 0; i < graph.node_count; ++i) {
    const SequenceNode& node = graph.node(i);
    line("  g.node_storage[{}] = {{tumbler::FixedString<48>({}), {}, {}, {}, {}, {}}};\n", i,
         StringLiteral(node.name.view()), node.primitive, node.swapped, node.safe, node.ends_cycle,
         node.after_fall);
  }
  line("  g.edge_count = {};\n", graph.edge_count);
  for (int i = 0; i < graph.edge_count; ++i) {
    const SequenceEdge<float>& edge = graph.edge(i);
    line(
        "  g.edge_storage[{}] = {{{}, {}, {}, tumbler::EdgeCondition::{}, "
        "tumbler::FixedString<32>({})}};\n",
        i, edge.from, edge.to, Exact(edge.settle_s), NameOf(edge.when),
        StringLiteral(edge.branch.view()));
  }
  // The rest of the room, of which another build may have more or less, exchanges nothing.
  line(
      "  for (std::size_t j = 0; j < g.partner.size(); ++j)\n"
      "    g.partner[j] = static_cast<std::uint8_t>(j);\n");
  for (std::size_t j = 0; j < joints; ++j)
    if (graph.partner[j] != j) line("  g.partner[{}] = {};\n", j, graph.partner[j]);
  line("  g.swap_pitch_rad = {};\n", Exact(graph.swap_pitch_rad));
  line("  g.end = tumbler::RunEnd::{};\n", NameOf(graph.end));
  line("  g.beginning_count = {};\n  g.beginning_within_rad = {};\n", graph.beginning_count,
       Exact(graph.beginning_within_rad));
  for (int b = 0; b < graph.beginning_count; ++b) {
    const SequenceBeginning<float>& beginning = graph.beginnings()[static_cast<std::size_t>(b)];
    line("  g.beginning_storage[{}] = {{{}, {}}};\n", b, beginning.node,
         Exact(beginning.pitch_rad));
  }
  for (int i = 0; graph.beginning_count > 0 && i < graph.node_count; ++i) {
    line("  g.last_pitch_rad[{}] = {};\n", i,
         Exact(graph.last_pitch_rad[static_cast<std::size_t>(i)]));
  }
  return out + "  return g;\n";
}

}  // namespace

std::string ToHeader(const SequenceFile& file, const std::string& source_text,
                     const std::string& namespace_name) {
  const std::string name =
      namespace_name.empty() ? DefaultNamespace(file.graph.name.view()) : namespace_name;
  if (!IsNamespace(name)) {
    throw std::invalid_argument(fmt::format(
        "'{}' is not a namespace: identifiers of letters, digits and single underscores, each "
        "beginning with a letter, joined by ::",
        name));
  }
  const auto sequence = std::make_unique<const Sequence<float>>(ToRuntime(file));

  const std::size_t joints = sequence->primitives[0].motions().size();  // The same in all.

  const std::string source = std::filesystem::path(file.path).filename().string();
  std::string out = fmt::format(
      "// Written by tumbler export; do not edit.\n"
      "//   source {}, {}\n",
      StringLiteral(source), HashOfText(source_text));
  for (std::size_t i = 0; i < file.primitives.size(); ++i) {
    out += fmt::format("//   primitive {}: {}, content {}\n", i,
                       StringLiteral(file.primitive_names[i]), ContentHash(file.primitives[i]));
  }
  out += fmt::format(
      "#pragma once\n\n"
      "#include <array>\n#include <cstddef>\n#include <cstdint>\n#include <string_view>\n\n"
      "#include \"common/core/primitive.h\"\n#include \"common/core/sequence.h\"\n\n"
      "namespace {} {{\n\n"
      "static_assert(tumbler::kMaxJoints >= {},\n"
      "              \"this motion has {} joints: give CMake a TUMBLER_MAX_JOINTS of as "
      "many\");\n\n"
      "inline constexpr std::string_view kSource = {};\n"
      "inline constexpr std::string_view kSourceHash = {};\n\n",
      name, joints, joints, StringLiteral(source), StringLiteral(HashOfText(source_text)));
  out += fmt::format("inline constexpr std::array<tumbler::Primitive<float>, {}> kPrimitives = {{",
                     file.primitives.size());
  for (std::size_t i = 0; i < file.primitives.size(); ++i)
    out += fmt::format("\n[] {{\n{}}}(),", PrimitiveText(sequence->primitives[i]));
  out += fmt::format(
      "}};\n\n"
      "inline constexpr tumbler::SequenceGraph<float> kGraph = [] {{\n{}}}();\n\n"
      "}}  // namespace {}\n",
      GraphText(sequence->graph, joints), name);
  return out;
}

}  // namespace tumbler
