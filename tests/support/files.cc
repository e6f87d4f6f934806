#include "tests/support/files.h"

#include <regex.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace tumbler::testing {

std::string SourcePath(const std::string& name) { return TUMBLER_SOURCE_DIR "/" + name; }
std::string BuildPath(const std::string& name) { return TUMBLER_BINARY_DIR "/" + name; }
std::string ProgramPath(const std::string& name) { return BuildPath("bin/" + name); }

std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot read " + path.string());
  std::ostringstream
      text;  // as a whole: byte by byte takes most of a test's time without optimisation
  text << stream.rdbuf();
  return std::move(text).str();
}

void WriteFile(const std::filesystem::path& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  if (!stream.flush()) throw std::runtime_error("cannot write " + path.string());
}

std::string Replaced(std::string text, const std::string& from, const std::string& to,
                     const std::string& after) {
  const std::size_t start = text.find(after);
  const std::size_t at = start == std::string::npos ? start : text.find(from, start);
  if (at == std::string::npos) throw std::runtime_error("the text lacks '" + from + "'");
  return text.replace(at, from.size(), to);
}

std::string ReplacedAll(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

int LineOf(const std::string& text, const std::string& part) {
  const std::size_t at = text.find(part);
  if (at == std::string::npos) throw std::runtime_error("the text lacks '" + part + "'");
  return 1 + static_cast<int>(
                 std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

std::vector<std::vector<std::string>> MatchesOf(const std::string& pattern,
                                                const std::string& text) {
  regex_t compiled;
  if (regcomp(&compiled, pattern.c_str(), REG_EXTENDED) != 0) {
    throw std::runtime_error("not a regular expression: " + pattern);
  }
  std::vector<std::vector<std::string>> matches;
  std::vector<regmatch_t> groups(compiled.re_nsub + 1);
  const char* at = text.c_str();
  while (regexec(&compiled, at, groups.size(), groups.data(),
                 at == text.c_str() ? 0 : REG_NOTBOL) == 0 &&
         groups[0].rm_eo > groups[0].rm_so) {
    std::vector<std::string>& match = matches.emplace_back();
    for (const regmatch_t& group : groups) {
      match.emplace_back(group.rm_so < 0 ? std::string()
                                         : std::string(at + group.rm_so, at + group.rm_eo));
    }
    at += groups[0].rm_eo;
  }
  regfree(&compiled);
  return matches;
}

std::span<const std::uint8_t> AsBytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::string TemporaryFolder::operator/(const std::string& name) const {
  return (path() / name).string();
}

std::set<std::string> TemporaryFolder::Listing() const {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path())) {
    names.insert(std::filesystem::relative(entry.path(), path()).string());
  }
  return names;
}

}  // namespace tumbler::testing
