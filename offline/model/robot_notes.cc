#include "offline/model/robot_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>

namespace tumbler {
namespace {

/// A note, what others like it say, too, and what it calls its link, joint or shape.
struct NamedNote {
  RobotFinding note;
  std::string kind, name;
};

std::vector<RobotFinding> OneOfEachKind(const std::vector<NamedNote>& notes) {
  constexpr std::size_t kNamed = 3;
  std::vector<RobotFinding> firsts;
  std::vector<std::string> kinds;
  std::vector<std::vector<std::string>> others;  // of each kind
  for (const NamedNote& note : notes) {
    const auto known = std::ranges::find(kinds, note.kind);
    if (known != kinds.end()) {
      others[static_cast<std::size_t>(known - kinds.begin())].push_back(note.name);
      continue;
    }
    firsts.push_back(note.note);
    kinds.push_back(note.kind);
    others.emplace_back();
  }
  for (std::size_t i = 0; i < firsts.size(); ++i) {
    std::vector<std::string>& names = others[i];
    if (names.empty()) continue;
    const std::size_t count = names.size();
    names.resize(std::min(count, kNamed));
    firsts[i].problem += fmt::format(" (as of {} more: {}{})", count, fmt::join(names, ", "),
                                     count > kNamed ? ", ..." : "");
  }
  return firsts;
}

}  // namespace

std::vector<RobotFinding> NotesOf(const UrdfSource& source) {
  std::vector<NamedNote> notes;
  const auto add = [&notes](const RobotFinding& note) {
    notes.push_back({note, note.problem, note.key});
  };
  for (const RoundedAngle& angle : source.rounded_angles())
    add({angle.line, angle.key, Describe(angle)});
  for (const RobotFinding& note : source.notes()) add(note);
  return OneOfEachKind(notes);
}

std::vector<RobotFinding> NotesOf(const std::vector<IgnoredShape>& ignored) {
  std::vector<NamedNote> notes;
  for (const IgnoredShape& shape : ignored) {
    notes.push_back(
        {{shape.line, fmt::format("link '{}'", shape.link),
          fmt::format("collision shape {} {}: contact ignores it", shape.shape, shape.reason)},
         shape.reason,
         shape.shape});
  }
  return OneOfEachKind(notes);
}

}  // namespace tumbler
