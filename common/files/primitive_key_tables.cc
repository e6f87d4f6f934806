#include "common/files/primitive_keys.h"
#include "common/files/primitive_toml.h"

namespace tumbler {

std::vector<KeyTable> PrimitiveKeyTables() {
  const char* const source = "common/files/primitive_keys.h";
  return {{source,
           "primitive",
           Joined({{RowOf(kPrimitiveHeader)},
                   RowsOf(kContentHashKeys),
                   RowsOf(kPrimitiveKeys),
                   RowsOf(kJointKeys, "`[[joint]]`"),
                   RowsOf(kJointLimitKeys, "`[joint.limits]`"),
                   RowsOf(kPositionKeys, "`[joint.position]`"),
                   RowsOf(kTorqueKeys, "`[joint.torque]`"),
                   RowsOf(kFeedbackKeys, "`[feedback]`"),
                   RowsOf(kFeedbackAngleKeys, "`[feedback.angle]`"),
                   RowsOf(kJointFeedbackKeys, "`[[feedback.joint]]`"),
                   RowsOf(kLinkChainKeys, "`[[feedback.chain]]`"),
                   RowsOf(kAbortKeys, "`[[abort]]`"),
                   RowsOf(kRollOutKeys, "`[[abort]]`"),
                   RowsOf(kFoldKeys, "`[[abort]]`"),
                   RowsOf(kAbortFigureKeys, "`[abort_figure]`"),
                   RowsOf(kDriveGainsKeys, "`[drives]`"),
                   RowsOf(kPoseKeys, "`[entry]`, `[exit]`"),
                   RowsOf(kSpacePoseKeys, "`[entry]`, `[exit]`"),
                   RowsOf(kPoseRateKeys, "`[entry]`, `[exit]`"),
                   RowsOf(kPassivePoseKeys, "`[entry]`, `[exit]`"),
                   RowsOf(kContactKeys, "`[[contact]]`"),
                   RowsOf(kPurposeKeys, "`[[purpose]]`"),
                   RowsOf(kPurposeTimeKeys, "`[[purpose]]`"),
                   RowsOf(kPurposePointKeys, "`[[purpose]]`"),
                   RowsOf(kPurposeSpaceKeys, "`[[purpose]]`"),
                   {{"", "`[certificate]`", "", "", "see [method.md](method.md#certificate)"}},
                   RowsOf(kRobustnessKeys, "`[[robustness]]`"),
                   RowsOf(kWindowKeys, "`[window]`"),
                   RowsOf(kProvenanceKeys, "`[provenance]`"),
                   RowsOf(kStartFileKeys, "`[provenance]`"),
                   RowsOf(kGuessFileKeys, "`[provenance]`"),
                   RowsOf(kComplementFileKeys, "`[provenance]`"),
                   RowsOf(kEditedKeys, "`[provenance]`"),
                   RowsOf(kSourceTextKeys, "`[provenance]`")}),
           {"key", "", "allowed", "meaning"}}};
}

KeyTable CertificateKeyTable() {
  return {"common/files/certificate_keys.h",
          "certificate",
          RowsOf(kCertificateFileKeys),
          {"key", "", "", "how it is obtained"}};
}

}  // namespace tumbler
