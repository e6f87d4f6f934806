#ifdef TUMBLER_WITH_SDFORMAT

#include "offline/model/sdf_file.h"

#include <console_bridge/console.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

constexpr std::string_view kLineOfXml = "Line number=";

/// What the library says on its console, while this lives. It would also open a log in the home
/// folder, when the console is first asked for.
class SdfConsole {
 public:
  SdfConsole() : console_(First()), before_(console_->GetMsgStream().GetStream()) {
    console_->GetMsgStream().SetStream(&said_);
    // It tries a file that is no SDF as a URDF, too, whose reader would complain.
    console_bridge::noOutputHandler();
  }
  ~SdfConsole() {
    console_bridge::restorePreviousOutputHandler();
    console_->GetMsgStream().SetStream(before_);
  }
  SdfConsole(const SdfConsole&) = delete;
  SdfConsole& operator=(const SdfConsole&) = delete;

  /// Each message in a line, without colours and the place in the library's source.
  [[nodiscard]] std::vector<std::string> Messages() const {
    constexpr std::string_view kColour = "\033[1;", kPlain = "\033[0m";
    std::vector<std::string> messages;
    const std::string text = said_.str();
    for (std::size_t at = text.find(kColour); at < text.size();) {
      const std::size_t next = std::min(text.find(kColour, at + 1), text.size());
      std::string message = text.substr(at, next - at);
      at = next;
      if (const std::size_t head = message.find(kPlain); head != std::string::npos)
        message.erase(0, head + kPlain.size());
      std::istringstream text_of(message);
      const std::vector<std::string> words{std::istream_iterator<std::string>(text_of), {}};
      const std::string line = fmt::format("{}", fmt::join(words, " "));
      if (std::find(messages.begin(), messages.end(), line) == messages.end())
        messages.push_back(line);
    }
    return messages;
  }

 private:
  static sdf::ConsolePtr First() {
    const char* const home = std::getenv("HOME");  // NOLINT(concurrency-mt-unsafe)
    const std::optional<std::string> kept =
        home == nullptr ? std::nullopt : std::optional<std::string>(home);
    setenv("HOME", "/dev/null", 1);  // NOLINT(concurrency-mt-unsafe)
    sdf::ConsolePtr console = sdf::Console::Instance();
    if (kept) {
      setenv("HOME", kept->c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
    } else {
      unsetenv("HOME");  // NOLINT(concurrency-mt-unsafe)
    }
    return console;
  }

  sdf::ConsolePtr console_;
  std::ostream* before_;
  std::ostringstream said_;
};

void AddLines(const sdf::ElementPtr& element,  // NOLINT(misc-no-recursion)
              std::map<std::string, std::uint32_t>& lines) {
  if (element->HasAttribute("name"))
    lines.emplace(element->Get<std::string>("name"), SdfFile::LineOf(element));
  for (sdf::ElementPtr e = element->GetFirstElement(); e != nullptr; e = e->GetNextElement())
    AddLines(e, lines);
}

/// The line of what a message names, as `[a::NAME]` or `named NAME`; 0: of nothing.
std::uint32_t LineIn(const std::map<std::string, std::uint32_t>& lines,
                     const std::string& message) {
  const auto line_of = [&lines](const std::string& name) {
    const std::size_t scope = name.rfind("::");
    const auto found = lines.find(scope == std::string::npos ? name : name.substr(scope + 2));
    return found == lines.end() ? 0U : found->second;
  };
  for (std::size_t at = 0; at < message.size(); ++at) {
    std::size_t first = std::string::npos, end = first;
    if (message[at] == '[') {
      first = at + 1;
      end = message.find(']', first);
    } else if (message.compare(at, 6, "named ") == 0) {
      first = at + 6;
      end = message.find(' ', first);
    }
    if (end == std::string::npos) continue;
    if (const std::uint32_t line = line_of(message.substr(first, end - first)); line > 0)
      return line;
  }
  return 0;
}

/// Whether anything in the model moves.
bool HasJoints(const sdf::Model& model) {  // NOLINT(misc-no-recursion)
  for (std::uint64_t k = 0; k < model.JointCount(); ++k) {
    if (model.JointByIndex(k)->Type() != sdf::JointType::FIXED) return true;
  }
  for (std::uint64_t k = 0; k < model.ModelCount(); ++k) {
    if (HasJoints(*model.ModelByIndex(k))) return true;
  }
  return false;
}

}  // namespace

SdfFile::SdfFile(const std::string& path)
    : path_(path), absolute_(std::filesystem::absolute(path)) {
  sdf::ParserConfig config;
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::WARN);
  config.SetFindCallback([this](const std::string& uri) { return Find(uri); });
  const SdfConsole console;
  CheckSources(absolute_, config, {}, SdfTaken::kFirst);
  // A path that is not absolute is one of the library's own files, if it has such a one.
  const sdf::Errors errors = root_.Load(absolute_.string(), config);
  const std::vector<std::string> said = console.Messages();
  Refuse(errors, said);
  for (const std::string& message : said) notes.push_back(WithPlaceFirst(message));
  FindModel();
}

void SdfFile::Fail(const sdf::ElementPtr& at, const std::string& key,
                   const std::string& problem) const {
  throw FileError(at == nullptr ? path_ : NameOf(at->FilePath()), LineOf(at), key, problem);
}

std::uint32_t SdfFile::LineOf(const sdf::ElementPtr& at) {
  return at == nullptr ? 0 : static_cast<std::uint32_t>(std::max(0, at->LineNumber().value_or(0)));
}

std::string SdfFile::NameOf(const std::string& file) const {
  return file.empty() || file == absolute_ ? path_ : file;
}

/// The library reads files that include themselves until its stack is full, and those that
/// include many that include many until the memory is.
/// @param above  the files that include this one.
/// @param taken  which of its models can be part of the robot.
void SdfFile::CheckSources(const std::filesystem::path& file,  // NOLINT(misc-no-recursion)
                           const sdf::ParserConfig& config,
                           std::vector<std::filesystem::path> above, SdfTaken taken) {
  constexpr int kMostIncludes = 1000;
  constexpr int kMostFrames = 3000;
  std::error_code none;
  above.push_back(std::filesystem::weakly_canonical(file, none));
  const std::string name = NameOf(file.string());
  const SdfSource source = ReadSdfSource(file.string(), name, taken);
  frames_ += source.frames;
  if (frames_ > kMostFrames) {
    throw FileError(name, 0, "",
                    fmt::format("there are {} links, joints, frames and models in all; allowed: at "
                                "most {}",
                                frames_, kMostFrames));
  }
  if (!source.newer_version.empty()) {
    notes.push_back(
        fmt::format("{}: its version {} is newer than 1.9, the last that libsdformat 12 knows: "
                    "what only newer ones have may be lost, such as <mimic>, <density>, <cone> and "
                    "<screw_thread_pitch>",
                    name, source.newer_version));
  }
  for (const auto& [line, uri, included] : source.includes) {
    std::string found = sdf::findFile(uri, true, true, config);
    if (std::filesystem::is_directory(found, none)) found = sdf::getModelFilePath(found);
    if (!std::filesystem::is_regular_file(found, none)) continue;  // The library says so.
    if (std::find(above.begin(), above.end(), std::filesystem::weakly_canonical(found, none)) !=
        above.end()) {
      throw FileError(name, line, "<include>",
                      fmt::format("'{}' leads back to this file; allowed: files that do not "
                                  "include themselves",
                                  uri));
    }
    if (++includes_ > kMostIncludes) {
      throw FileError(name, line, "<include>",
                      fmt::format("there are more than {} of them in all", kMostIncludes));
    }
    CheckSources(found, config, above, included);
  }
}

/// A file or folder of a URI; empty: there is none.
std::string SdfFile::Find(const std::string& uri) const {
  const std::size_t scheme = uri.find("://");
  const std::string_view kind = std::string_view(uri).substr(0, std::min(scheme, uri.size()));
  if (scheme != std::string::npos && kind != "model" && kind != "package" && kind != "file")
    return "";
  const std::string name = scheme == std::string::npos ? uri : uri.substr(scheme + 3);
  std::error_code none;
  for (std::filesystem::path folder = absolute_.parent_path();; folder = folder.parent_path()) {
    if (!name.empty() && std::filesystem::exists(folder / name, none))
      return (folder / name).string();
    if (folder == folder.parent_path()) return "";
  }
}

/// The library's `[PATH OF XML:FILE:LLINE]: MESSAGE` as others write it.
std::string SdfFile::WithPlaceFirst(const std::string& message) const {
  const std::string file = absolute_.string() + ":L";
  const std::size_t at = message.find(file), end = message.find("]: ");
  if (!message.starts_with('[') || end == std::string::npos || at > end) return message;
  const std::size_t line = at + file.size();
  return fmt::format("{}:{}: {}", path_, message.substr(line, end - line), message.substr(end + 3));
}

/// @param said  by the library on its console, which has alone why it cannot read a file.
void SdfFile::Refuse(const sdf::Errors& errors, const std::vector<std::string>& said) const {
  std::vector<std::string> problems;
  const auto add = [&problems](const std::string& problem) {
    if (std::find(problems.begin(), problems.end(), problem) == problems.end())
      problems.push_back(problem);
  };
  std::optional<std::string> file;
  std::uint32_t line = 0;
  std::map<std::string, std::uint32_t> lines;  // of the elements that have a name
  if (!errors.empty() && root_.Element() != nullptr) AddLines(root_.Element(), lines);
  for (const sdf::Error& error : errors) {
    if (error.Code() != sdf::ErrorCode::FILE_READ) continue;
    for (const std::string& message : said) {
      add(message);
      if (const std::size_t at = message.find(kLineOfXml); at != std::string::npos) {
        line = static_cast<std::uint32_t>(
            std::strtoul(message.c_str() + at + kLineOfXml.size(), nullptr, 10));
      }
    }
  }
  for (const sdf::Error& error : errors) {
    // FindModel looks at them.
    if (error.Message().starts_with("Root object can only contain one model")) continue;
    if (!file) file = NameOf(error.FilePath().value_or(""));
    if (line == 0) line = static_cast<std::uint32_t>(std::max(0, error.LineNumber().value_or(0)));
    if (line == 0) line = LineIn(lines, error.Message());
    add(error.Message());
  }
  if (!file) return;
  // Those after the first are mostly what follows from it.
  const std::size_t more = problems.size() - 1;
  throw FileError(*file, line, "",
                  fmt::format("libsdformat does not take it: {}{}", problems.front(),
                              more > 0 ? fmt::format(" (and {} more)", more) : ""));
}

/// The ground, a table or a lamp is a model, too, in a world: the robot is the one that has joints
/// that move, or the first where none has.
void SdfFile::FindModel() {
  std::vector<std::pair<const sdf::Model*, const sdf::World*>> models;
  std::vector<std::string> names, with_joints;
  const auto add = [&](const sdf::Model& model, const sdf::World* world) {
    models.emplace_back(&model, world);
    names.push_back(model.Name());
    if (!HasJoints(model)) return;
    if (with_joints.empty()) model_ = &model;
    with_joints.push_back(model.Name());
  };
  if (root_.Model() != nullptr) {
    add(*root_.Model(), nullptr);
    // The library has no others beside it.
    const sdf::ElementPtr first = root_.Element()->FindElement("model");
    for (sdf::ElementPtr e = first; e != nullptr; e = e->GetNextElement("model")) {
      if (e == first) continue;
      names.push_back(e->Get<std::string>("name"));
      if (!e->HasElement("joint")) continue;
      if (with_joints.empty()) {
        Fail(e, fmt::format("model '{}'", names.back()),
             fmt::format("has joints, but libsdformat takes the first model of <sdf> alone, '{}'; "
                         "put it into a file of its own",
                         names.front()));
      }
      with_joints.push_back(names.back());
    }
  }
  for (std::uint64_t w = 0; w < root_.WorldCount(); ++w) {
    const sdf::World& world = *root_.WorldByIndex(w);
    for (std::uint64_t k = 0; k < world.ModelCount(); ++k) add(*world.ModelByIndex(k), &world);
  }
  if (models.empty()) {
    Fail(nullptr, "",
         "there is no <model> in it; a robot is one <model>, in <sdf> or in a <world>");
  }
  if (with_joints.size() > 1) {
    Fail(nullptr, "",
         fmt::format("several models have joints, and a robot is one of them: '{}'; put the one "
                     "that is meant into a file of its own",
                     fmt::join(with_joints, "', '")));
  }
  if (model_ == nullptr) model_ = models.front().first;
  const auto taken = std::ranges::find(models, model_, [](const auto& pair) { return pair.first; });
  if (taken->second != nullptr) {
    const auto g = taken->second->Gravity();
    if (std::abs(g.X()) + std::abs(g.Y()) > 1e-9 || std::abs(g.Z() + 9.8) > 0.05) {
      notes.push_back(fmt::format(
          "the world's gravity of {} {} {} is left out: that of a robot is 9.81 m/s^2 down", g.X(),
          g.Y(), g.Z()));
    }
  }
  std::erase(names, model_->Name());
  if (!names.empty()) {
    notes.push_back(fmt::format(
        "the model '{}' is taken, {}, and not '{}': put another one into a file of its "
        "own to have it",
        model_->Name(), with_joints.empty() ? "the first, as none has joints" : "which has joints",
        fmt::join(names, "', '")));
  }
}

}  // namespace tumbler

#endif
