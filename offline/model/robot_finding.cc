#include "offline/model/robot_finding.h"

#include <fmt/format.h>

#include <utility>

namespace tumbler {
namespace {

std::string WithCount(const std::vector<RobotFinding>& findings) {
  const std::string& first = findings.front().problem;
  if (findings.size() == 1) return first;
  return fmt::format("{} (and {} more: `tumbler model check` lists all)", first,
                     findings.size() - 1);
}

}  // namespace

RobotFileError::RobotFileError(const std::string& file, std::vector<RobotFinding> findings)
    : FileError(file, findings.front().line, findings.front().key, WithCount(findings)),
      findings_(std::move(findings)) {}

}  // namespace tumbler
