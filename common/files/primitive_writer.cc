#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_keys.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_writer.h"

namespace tumbler {
namespace {

using Motion = JointMotion<double>;

SplineEntry EntryOf(const Motion::Spline& spline) {
  return {spline.degree(),
          {spline.knots().begin(), spline.knots().end()},
          {spline.control_points().begin(), spline.control_points().end()}};
}

void WriteJoint(TomlWriter& writer, const Motion& motion) {
  writer.Line("\n[[joint]]");
  WriteKeys(writer, kJointKeys, motion);
  writer.Line("[joint.limits]");
  WriteKeys(writer, kJointLimitKeys, motion.limits);
  writer.Line("[joint.position]");
  WriteKeys(writer, kPositionKeys, EntryOf(motion.position));
  writer.Line("[joint.torque]  # feed-forward");
  WriteKeys(writer, kTorqueKeys, EntryOf(motion.torque));
}

void WriteFeedback(TomlWriter& writer, const PrimitiveFile& file) {
  const Feedback<double>& feedback = file.primitive.feedback;
  if (!feedback.present()) return;
  const auto knots = feedback.knots();
  const auto gains = [&knots](const auto& gain) {
    return std::vector<double>(gain.begin(),
                               gain.begin() + static_cast<std::ptrdiff_t>(knots.size()));
  };
  writer.Line("\n[feedback]");
  WriteKeys(writer, kFeedbackKeys,
            {std::string(feedback.link.view()), feedback.error_min_rad, feedback.error_full_rad,
             feedback.error_max_rad, feedback.start_error_max_rad, feedback.fade_in_s,
             feedback.fade_out_s, std::vector<double>(knots.begin(), knots.end())});
  writer.Line("[feedback.angle]  # of the link, in the plan");
  WriteKeys(writer, kFeedbackAngleKeys, EntryOf(feedback.angle));
  for (std::size_t j = 0; j < file.primitive.motions().size(); ++j) {
    const JointFeedback<double>& joint = feedback.joints[j];
    writer.Line("[[feedback.joint]]");
    WriteKeys(writer, kJointFeedbackKeys,
              {std::string(file.primitive.joints[j].name.view()), gains(joint.angle_gain),
               gains(joint.rate_gain), joint.correction_max_rad, joint.correction_rate_max_rad_s});
  }
  for (const LinkChain& chain : file.chains) {
    writer.Line("[[feedback.chain]]");
    WriteKeys(writer, kLinkChainKeys, chain);
  }
}

void WriteAborts(TomlWriter& writer, const PrimitiveFile& file) {
  const Primitive<double>& primitive = file.primitive;
  double from_s = 0;
  for (const AbortSpan<double>& span : primitive.aborts.spans()) {
    const auto& position = span.position_rad;
    const AbortEntry entry = {from_s,
                              span.until_s,
                              span.way,
                              span.late_max_s,
                              span.limits_share,
                              {position.begin(), position.begin() + primitive.joint_count}};
    from_s = span.until_s;
    writer.Line("\n[[abort]]");
    WriteKeys(writer, kAbortKeys, entry);
    if (span.way == AbortWay::kRollOut) WriteKeys(writer, kRollOutKeys, entry);
    if (span.way == AbortWay::kFold) WriteKeys(writer, kFoldKeys, entry);
  }
  if (!primitive.aborts.present() || !file.abort_figure) return;
  writer.Line("\n[abort_figure]");
  WriteKeys(writer, kAbortFigureKeys, *file.abort_figure);
}

void WriteProvenance(TomlWriter& writer, const Provenance& provenance) {
  if (provenance.seed > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
    throw std::invalid_argument(
        fmt::format("seed is {}; allowed: below 2^63, the integers of TOML", provenance.seed));
  }
  writer.Line("\n[provenance]");
  WriteKeys(writer, kProvenanceKeys, provenance);
  if (!provenance.start_file.empty()) WriteKeys(writer, kStartFileKeys, provenance);
  if (!provenance.guess_file.empty()) WriteKeys(writer, kGuessFileKeys, provenance);
  if (!provenance.complement_files.empty()) WriteKeys(writer, kComplementFileKeys, provenance);
  if (!provenance.edited.empty()) WriteKeys(writer, kEditedKeys, provenance);
  WriteKeys(writer, kSourceTextKeys, provenance);
}

void WritePose(TomlWriter& writer, const char* header, const PrimitivePose& pose) {
  writer.Line(header);
  WriteKeys(writer, kPoseKeys, pose);
  if (pose.is_in_space()) WriteKeys(writer, kSpacePoseKeys, pose);
  if (pose.root_moves()) WriteKeys(writer, kPoseRateKeys, pose);
  if (!pose.passive_positions_rad.empty()) WriteKeys(writer, kPassivePoseKeys, pose);
}

/// The file's text with this hash, whatever the file's own is.
std::string WriteWith(const std::string& content_hash, const PrimitiveFile& file) {
  TomlWriter writer("a primitive");
  writer.Line(
      "# A motion primitive: B-spline paths of a robot's joints, and what was verified about "
      "them.");
  writer.Line(
      "# Written by a program; a changed number or word makes the hashes disagree and the file is "
      "refused.");
  writer.Line(fmt::format("format = \"{}\"", kPrimitiveHeader.format));
  writer.Line(fmt::format("version = {}", kPrimitiveHeader.version));
  WriteKeys(writer, kContentHashKeys, {content_hash});
  WriteKeys(writer, kPrimitiveKeys, file.primitive);
  for (const Motion& motion : file.primitive.motions()) WriteJoint(writer, motion);
  WriteFeedback(writer, file);
  WriteAborts(writer, file);
  if (file.drives) {
    writer.Line("\n[drives]  # through which it was found");
    WriteKeys(writer, kDriveGainsKeys, *file.drives);
  }
  WritePose(writer, "\n[entry]", file.entry);
  WritePose(writer, "\n[exit]", file.exit);
  for (const ContactInterval& contact : file.contacts) {
    writer.Line("\n[[contact]]");
    WriteKeys(writer, kContactKeys, contact);
  }
  for (const PurposeFigure& figure : file.purpose) {
    writer.Line("\n[[purpose]]");
    WriteKeys(writer, kPurposeKeys, figure);
    if (figure.at_time()) WriteKeys(writer, kPurposeTimeKeys, figure);
    if (figure.is_in_space()) WriteKeys(writer, kPurposeSpaceKeys, figure);
    if (figure.of_point()) WriteKeys(writer, kPurposePointKeys, figure);
  }
  writer.Line("\n[certificate]");
  WriteKeys(writer, kCertificateFileKeys, file.certificate);
  for (const RobustnessFigure& figure : file.robustness) {
    writer.Line("\n[[robustness]]");
    WriteKeys(writer, kRobustnessKeys, figure);
  }
  if (file.window) {
    writer.Line("\n[window]  # of the ground, in which the model is as asked");
    WriteKeys(writer, kWindowKeys, *file.window);
  }
  WriteProvenance(writer, file.provenance);
  return writer.Take();
}

}  // namespace

std::string ContentHash(const PrimitiveFile& file) {
  const std::string name(file.primitive.name.view());
  return HashOfText(
      TomlTable::Parse(WriteWith("", file), name).CanonicalText(kContentHashKeys[0].text.name));
}

std::string ToToml(const PrimitiveFile& file) {
  const int count = file.primitive.joint_count;
  if (count < 1 || count > kMaxJoints) {
    throw std::invalid_argument(
        fmt::format("a primitive has {} joints; allowed: from 1 ... {}", count, kMaxJoints));
  }
  if (file.primitive.feedback.knot_count < 0 ||
      file.primitive.feedback.knot_count > kMaxGainKnots) {
    throw std::invalid_argument(fmt::format("the feedback has {} knots; allowed: up to {}",
                                            file.primitive.feedback.knot_count, kMaxGainKnots));
  }
  if (file.primitive.aborts.span_count < 0 || file.primitive.aborts.span_count > kMaxAbortSpans) {
    throw std::invalid_argument(fmt::format("the table of aborts has {} spans; allowed: up to {}",
                                            file.primitive.aborts.span_count, kMaxAbortSpans));
  }
  std::string text = WriteWith(ContentHash(file), file);
  try {
    // A text that no program would load must not be written.
    ParsePrimitive(text, std::string(file.primitive.name.view()));
  } catch (const FileError& error) {
    throw std::invalid_argument(fmt::format("the primitive is inconsistent: {}", error.what()));
  }
  return text;
}

}  // namespace tumbler
