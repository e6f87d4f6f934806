#include "offline/studies/work_file.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <optional>

#include "common/files/json.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

/// The lines that are whole.
std::string_view WholeLines(std::string_view text) {
  const std::size_t last = text.rfind('\n');
  return last == std::string_view::npos ? std::string_view() : text.substr(0, last + 1);
}

/// The lines behind the first, which is checked.
std::string_view LinesOf(std::string_view text, const std::string& path,
                         const WorkFile::Work& work) {
  const std::size_t end = text.find('\n');
  const std::optional<Json> head = Json::Parse(text.substr(0, end));
  const Json* format = head ? head->Find("format") : nullptr;
  const Json* version = head ? head->Find("version") : nullptr;
  const Json* study = head ? head->Find("study") : nullptr;
  if (end == std::string_view::npos || format == nullptr || !(*format == Json(work.format)) ||
      version == nullptr || study == nullptr || !study->is_text()) {
    throw FileError(
        path, 1, "",
        fmt::format("is no checkpoint of {}; name another file, or remove this one", work.program));
  }
  if (!(*version == Json(work.version))) {
    throw FileError(
        path, 1, "version",
        fmt::format("is {}, and this build reads {} only", version->Dump(-1), work.version));
  }
  if (study->text() != work.identity) {
    throw FileError(path, 1, "study",
                    fmt::format("{}; name another file, or remove this one", work.differs));
  }
  return text.substr(end + 1);
}

/// The first line of a file, with its line feed.
std::string HeadOf(const WorkFile::Work& work) {
  return Json({{"format", work.format}, {"version", work.version}, {"study", work.identity}})
             .Dump(-1) +
         "\n";
}

}  // namespace

std::string WorkFile::Read(const std::string& path, const Work& work) {
  const std::string text = ReadTextFile(path);
  return std::string(LinesOf(WholeLines(text), path, work));
}

WorkFile::WorkFile(const std::string& path, const Work& work, std::string& lines)
    : path_(path), lock_(std::make_unique<WriterLock>(path)) {
  const std::string text = ReadTextFile(path);
  const std::string_view whole = WholeLines(text);
  if (!whole.empty()) {
    lines = LinesOf(whole, path, work);
    if (whole.size() != text.size()) std::filesystem::resize_file(path, whole.size());
    return;
  }
  const std::string head = HeadOf(work);
  if (!text.empty() && head.rfind(text, 0) != 0) {
    throw FileError(path, 1, "",
                    fmt::format("is no checkpoint of {}; name another file", work.program));
  }
  std::filesystem::resize_file(path, 0);
  Add(head);
}

void WorkFile::Add(const std::string& lines) {
  std::FILE* const file = std::fopen(path_.c_str(), "a");
  if (file == nullptr) throw FileError(path_, 0, "", "cannot be written");
  const bool whole = std::fwrite(lines.data(), 1, lines.size(), file) == lines.size();
  if (std::fclose(file) != 0 || !whole) throw FileError(path_, 0, "", "cannot be written whole");
}

}  // namespace tumbler
