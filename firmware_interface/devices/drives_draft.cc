#include "firmware_interface/devices/drives_draft.h"

#include <fmt/format.h>

#include <filesystem>
#include <sstream>
#include <utility>
#include <vector>

#include "common/files/toml_reader.h"
#include "common/files/toml_writer.h"

namespace tumbler {
namespace {

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string Joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) (text += line) += '\n';
  return text;
}

/// Where the value of a line `key = value  # comment` ends.
std::size_t EndOfValue(const std::string& line, std::size_t begin) {
  std::size_t end = begin;
  for (char quote = 0; end < line.size(); ++end) {
    const char c = line[end];
    if (quote != 0) {
      if (c == '\\' && quote == '"') ++end;
      if (c == quote) quote = 0;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#') {
      break;
    }
  }
  while (end > begin && (line[end - 1] == ' ' || line[end - 1] == '\t' || line[end - 1] == '\r'))
    --end;
  return end;
}

}  // namespace

DrivesDraft::DrivesDraft(std::string text, std::string name)
    : name_(std::move(name)), text_(std::move(text)), config_(Parsed()) {}

DrivesConfig DrivesDraft::Parsed() const {
  return ParseDrives(text_, name_, DrivesUse::kCommission);
}

void DrivesDraft::Check() { config_ = Parsed(); }

void DrivesDraft::Set(std::size_t drive, std::string_view key, const std::string& value) {
  TomlTable root = TomlTable::Parse(text_, name_);
  const TomlTable table = root.Tables("drive")[drive];
  std::vector<std::string> lines = LinesOf(text_);
  // Every drive has its joint, so a new key can stand below.
  const bool has = table.Has(key);
  const std::size_t at = table.LineOf(has ? key : "joint") - 1;
  std::string& line = lines[at];
  const std::size_t name = line.find_first_not_of(" \t");
  const std::size_t equals = line.find('=');
  const std::string_view expected = has ? key : std::string_view("joint");
  if (name == std::string::npos || equals == std::string::npos ||
      line.compare(name, expected.size(), expected) != 0) {
    table.Fail(key, "stands in a table of one line; write it on a line of its own");
  }
  if (!has) {
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(at) + 1,
                 fmt::format("{}{} = {}", line.substr(0, name), key, value));
  } else {
    const std::size_t begin = line.find_first_not_of(" \t", equals + 1);
    line.replace(begin, EndOfValue(line, begin) - begin, value);
  }
  text_ = Joined(lines);
}

void DrivesDraft::SetNote(std::string_view note) {
  constexpr std::string_view kHead = "# tumbler bench: ";
  std::vector<std::string> lines = LinesOf(text_);
  if (!lines.empty() && lines.front().compare(0, kHead.size(), kHead) == 0)
    lines.erase(lines.begin());
  lines.insert(lines.begin(), std::string(kHead).append(note));
  text_ = Joined(lines);
}

void DrivesDraft::SetUnfinished(std::string_view what) {
  constexpr std::string_view kKey = "unfinished";
  const TomlTable root = TomlTable::Parse(text_, name_);
  std::vector<std::string> lines = LinesOf(text_);
  std::size_t at = root.LineOf("version");  // The key follows: it has to come before every table.
  if (root.Has(kKey)) {
    at = root.LineOf(kKey) - 1;
    const std::size_t name = lines[at].find_first_not_of(" \t");
    const bool plain =
        name != std::string::npos && lines[at].compare(name, kKey.size(), kKey) == 0 &&
        lines[at].find("\"\"\"") == std::string::npos && lines[at].find("'''") == std::string::npos;
    if (!plain) root.Fail(kKey, "is a text of several lines, or has its name in quotes");
    lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(at));
  }
  if (!what.empty()) {
    TomlWriter writer("a drives file");
    writer.Text(kKey, what);
    std::string line = writer.Take();
    if (!line.empty() && line.back() == '\n') line.pop_back();
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(at), line);
  }
  text_ = Joined(lines);
}

std::string DrivesDraft::TextFor(const std::string& path) const {
  constexpr std::string_view kKey = "eds";
  const auto folder_of = [](const std::string& file) {
    return std::filesystem::absolute(file).parent_path().lexically_normal();
  };
  const std::filesystem::path from = folder_of(name_);
  const std::filesystem::path to = folder_of(path);
  if (from == to) return text_;
  DrivesDraft moved = *this;
  TomlTable root = TomlTable::Parse(text_, name_);
  std::vector<TomlTable> drives = root.Tables("drive");
  for (std::size_t i = 0; i < drives.size(); ++i) {
    if (!drives[i].Has(kKey)) continue;
    const std::filesystem::path sheet = drives[i].String(kKey);
    if (sheet.is_relative())
      moved.SetText(i, kKey, (from / sheet).lexically_normal().lexically_relative(to).string());
  }
  return moved.text();
}

void DrivesDraft::SetText(std::size_t drive, std::string_view key, std::string_view value) {
  TomlWriter writer("a drives file");
  writer.Text(key, value);
  const std::string line = writer.Take();
  const std::size_t begin = key.size() + std::string_view(" = ").size();
  Set(drive, key, line.substr(begin, line.size() - begin - 1));
}

void DrivesDraft::SetNumber(std::size_t drive, std::string_view key, double value) {
  Set(drive, key, ExactDecimal(value));
}

void DrivesDraft::SetInteger(std::size_t drive, std::string_view key, int value) {
  Set(drive, key, fmt::format("{}", value));
}

}  // namespace tumbler
