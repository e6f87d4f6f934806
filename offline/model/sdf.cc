#include "offline/model/sdf.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string_view>

#include "common/files/toml_reader.h"

namespace tumbler {

bool IsSdf(const std::string& path) {
  const std::string text = ReadTextFile(path);
  std::string_view rest = text;
  for (;;) {
    const std::size_t at = rest.find('<');
    if (at == std::string_view::npos) return false;
    rest.remove_prefix(at);
    const bool comment = rest.starts_with("<!--");
    if (!comment && !rest.starts_with("<?") && !rest.starts_with("<!")) break;
    const std::string_view end = comment ? "-->" : ">";
    const std::size_t after = rest.find(end);
    if (after == std::string_view::npos) return false;
    rest.remove_prefix(after + end.size());
  }
  return rest.starts_with("<sdf") && rest.find_first_of(" \t\r\n/>") == 4;
}

}  // namespace tumbler

#ifdef TUMBLER_WITH_SDFORMAT

#include <console_bridge/console.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <sdf/sdf.hh>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "offline/model/pose.h"

namespace tumbler {
namespace {

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
      std::string line;
      std::istringstream words(message);
      for (std::string word; words >> word;) line += (line.empty() ? "" : " ") + word;
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

/// A file of SDF, as the library has it. What is wrong is thrown.
class SdfFile {
 public:
  explicit SdfFile(const std::string& path)
      : path_(path), absolute_(std::filesystem::absolute(path)) {
    sdf::ParserConfig config;
    config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::WARN);
    config.SetFindCallback([this](const std::string& uri) { return Find(uri); });
    const SdfConsole console;
    int includes = 0;
    CheckIncludes(absolute_, config, {}, includes);
    // A path that is not absolute is one of the library's own files, if it has such a one.
    const sdf::Errors errors = root_.Load(absolute_.string(), config);
    const std::vector<std::string> said = console.Messages();
    Refuse(errors, said);
    for (const std::string& message : said) notes.push_back(WithPlaceFirst(message));
    FindModel();
  }

  [[nodiscard]] const sdf::Model& model() const { return *model_; }
  [[nodiscard]] const std::filesystem::path& absolute() const { return absolute_; }

  [[noreturn]] void Fail(const sdf::ElementPtr& at, const std::string& key,
                         const std::string& problem) const {
    throw FileError(NameOf(at), LineOf(at), key, problem);
  }
  /// As the caller named it, where it is the same.
  [[nodiscard]] std::string NameOf(const sdf::ElementPtr& at) const {
    return at == nullptr ? path_ : NameOf(at->FilePath());
  }
  static std::uint32_t LineOf(const sdf::ElementPtr& at) {
    return at == nullptr ? 0
                         : static_cast<std::uint32_t>(std::max(0, at->LineNumber().value_or(0)));
  }

  std::vector<std::string> notes;

 private:
  [[nodiscard]] std::string NameOf(const std::string& file) const {
    return file.empty() || file == absolute_ ? path_ : file;
  }

  /// The library reads files that include themselves until its stack is full, and those that
  /// include many that include many until the memory is.
  /// @param above  the files that include this one.
  /// @param total  is counted up.
  void CheckIncludes(const std::filesystem::path& file,  // NOLINT(misc-no-recursion)
                     const sdf::ParserConfig& config, std::vector<std::filesystem::path> above,
                     int& total) const {
    constexpr int kMostIncludes = 1000;
    std::error_code none;
    above.push_back(std::filesystem::weakly_canonical(file, none));
    const std::string text = ReadTextFile(file.string());
    // A URDF may have as many, for 900 of which the library takes 2 s.
    constexpr int kMostLinks = 1000;
    int links = 0;
    for (std::size_t at = text.find("<link "); at != std::string::npos;
         at = text.find("<link ", at + 1))
      ++links;
    if (links > kMostLinks) {
      throw FileError(NameOf(file.string()), 0, "",
                      fmt::format("has {} links; allowed: at most {}", links, kMostLinks));
    }
    for (const auto& [line, uri] : IncludesOf(text)) {
      std::string found = sdf::findFile(uri, true, true, config);
      if (std::filesystem::is_directory(found, none)) found = sdf::getModelFilePath(found);
      if (!std::filesystem::is_regular_file(found, none)) continue;  // The library says so.
      if (std::find(above.begin(), above.end(), std::filesystem::weakly_canonical(found, none)) !=
          above.end()) {
        throw FileError(NameOf(file.string()), line, "<include>",
                        fmt::format("'{}' leads back to this file; allowed: files that do not "
                                    "include themselves",
                                    uri));
      }
      if (++total > kMostIncludes) {
        throw FileError(NameOf(file.string()), line, "<include>",
                        fmt::format("there are more than {} of them in all", kMostIncludes));
      }
      CheckIncludes(found, config, above, total);
    }
  }

  /// Lines and URIs of `<include>` elements.
  static std::vector<std::pair<std::uint32_t, std::string>> IncludesOf(const std::string& text) {
    constexpr std::string_view kComment = "<!--", kInclude = "<include", kUri = "<uri>";
    std::vector<std::pair<std::uint32_t, std::string>> found;
    std::uint32_t line = 1;
    bool included = false;
    for (std::size_t at = 0; at < text.size(); ++at) {
      const std::string_view rest = std::string_view(text).substr(at);
      if (rest.front() == '\n') ++line;
      if (rest.front() != '<') continue;
      if (rest.starts_with(kComment)) {
        const std::size_t end = std::min(text.find("-->", at), text.size());
        line += static_cast<std::uint32_t>(
            std::count(text.begin() + static_cast<std::ptrdiff_t>(at),
                       text.begin() + static_cast<std::ptrdiff_t>(end), '\n'));
        at = end;
      } else if (rest.starts_with(kInclude)) {
        included = true;
      } else if (included && rest.starts_with(kUri)) {
        const std::string_view uri = rest.substr(kUri.size(), rest.find('<', 1) - kUri.size());
        const std::size_t first = uri.find_first_not_of(" \t\r\n");
        if (first != std::string_view::npos) {
          found.emplace_back(
              line, std::string(uri.substr(first, uri.find_last_not_of(" \t\r\n") + 1 - first)));
        }
        included = false;
      }
    }
    return found;
  }

  /// A file or folder of a URI; empty: there is none.
  [[nodiscard]] std::string Find(const std::string& uri) const {
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
  [[nodiscard]] std::string WithPlaceFirst(const std::string& message) const {
    const std::string file = absolute_.string() + ":L";
    const std::size_t at = message.find(file), end = message.find("]: ");
    if (!message.starts_with('[') || end == std::string::npos || at > end) return message;
    const std::size_t line = at + file.size();
    return fmt::format("{}:{}: {}", path_, message.substr(line, end - line),
                       message.substr(end + 3));
  }

  /// @param said  by the library on its console, which has alone why it cannot read a file.
  void Refuse(const sdf::Errors& errors, const std::vector<std::string>& said) const {
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
      // FindModel takes the first, and says so.
      if (error.Message().starts_with("Root object can only contain one model")) continue;
      if (!file) file = NameOf(error.FilePath().value_or(""));
      if (line == 0) line = static_cast<std::uint32_t>(std::max(0, error.LineNumber().value_or(0)));
      if (line == 0) line = LineIn(lines, error.Message());
      add(error.Message());
    }
    if (!file) return;
    constexpr std::size_t kShown = 4;
    const std::size_t shown = std::min(kShown, problems.size()), more = problems.size() - shown;
    problems.resize(shown);
    throw FileError(*file, line, "",
                    fmt::format("libsdformat does not take it: {}{}", fmt::join(problems, "; "),
                                more > 0 ? fmt::format(" (and {} more)", more) : ""));
  }

  static void AddLines(const sdf::ElementPtr& element,  // NOLINT(misc-no-recursion)
                       std::map<std::string, std::uint32_t>& lines) {
    if (element->HasAttribute("name"))
      lines.emplace(element->Get<std::string>("name"), LineOf(element));
    for (sdf::ElementPtr e = element->GetFirstElement(); e != nullptr; e = e->GetNextElement())
      AddLines(e, lines);
  }

  /// The line of what a message names, as `[a::NAME]` or `named NAME`; 0: of nothing.
  static std::uint32_t LineIn(const std::map<std::string, std::uint32_t>& lines,
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

  void FindModel() {
    model_ = root_.Model();
    std::vector<std::string> others;
    if (model_ != nullptr) {
      const sdf::ElementPtr first = root_.Element()->FindElement("model");
      for (sdf::ElementPtr e = first; e != nullptr; e = e->GetNextElement("model")) {
        if (e != first) others.push_back(e->Get<std::string>("name"));
      }
    }
    for (std::uint64_t w = 0; w < root_.WorldCount(); ++w) {
      const sdf::World& world = *root_.WorldByIndex(w);
      for (std::uint64_t k = 0; k < world.ModelCount(); ++k) {
        const sdf::Model* const model = world.ModelByIndex(k);
        if (model_ != nullptr) {
          others.push_back(model->Name());
          continue;
        }
        model_ = model;
        const auto g = world.Gravity();
        if (std::abs(g.X()) + std::abs(g.Y()) > 1e-9 || std::abs(g.Z() + 9.8) > 0.05) {
          notes.push_back(fmt::format(
              "the world's gravity of {} {} {} is left out: that of a robot is 9.81 m/s^2 down",
              g.X(), g.Y(), g.Z()));
        }
      }
    }
    if (model_ == nullptr) {
      Fail(nullptr, "",
           "there is no <model> in it; a robot is one <model>, in <sdf> or in its first <world>");
    }
    if (!others.empty()) {
      notes.push_back(
          fmt::format("the model '{}' is taken, and not '{}': put another one into a file of its "
                      "own to have it",
                      model_->Name(), fmt::join(others, "', '")));
    }
  }

  static constexpr std::string_view kLineOfXml = "Line number=";

  std::string path_;
  std::filesystem::path absolute_;
  sdf::Root root_;
  const sdf::Model* model_ = nullptr;
};

Pose InverseOf(const Pose& pose) {
  return {pose.rotation.transpose(), -pose.rotation.TransposeTimes(pose.translation)};
}

SpaceVector ToVector(const ignition::math::Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }

/// Elements that a URDF has not, or a robot here.
constexpr std::array kSdfLeftOut = {
    std::pair{"plugin", "plugins"},
    std::pair{"sensor", "sensors"},
    std::pair{"light", "lights"},
    std::pair{"particle_emitter", "particle emitters"},
    std::pair{"projector", "projectors"},
    std::pair{"gripper", "grippers"},
    std::pair{"audio_source", "sources of sound"},
    std::pair{"battery", "batteries"},
    std::pair{"material", "materials"},
    std::pair{"surface", "surfaces of shapes (a task has the friction)"},
    std::pair{"velocity_decay", "dampings of links (velocity_decay)"},
    std::pair{"physics", "settings of the physics of joints"},
};

class SdfConverter {
 public:
  SdfConverter(SdfFile& file, std::optional<double> velocity)
      : file_(file), velocity_(velocity), urdf_(file.model().Name()) {}

  TranslatedRobot Convert() {
    const sdf::Model& model = file_.model();
    Collect(model, "", Pose{});
    const bool on_world = CheckTree();
    const sdf::ElementPtr at = model.Element();
    ignition::math::Pose3d in_world;
    CheckPose(model.SemanticPose().Resolve(in_world), at, "model");
    const Pose world = InverseOf(ToPose(in_world, at, "model"));
    if (on_world || model.Static()) urdf_.Add(UrdfLink{.name = kSdfWorld});
    for (const LinkOfSdf& link : links_) AddLink(link);
    if (model.Static() && !on_world) {
      const LinkOfSdf& root = links_[root_];
      urdf_.Add({.name = fmt::format("{}_mount", root.name),
                 .parent = kSdfWorld,
                 .child = root.name,
                 .place = InverseOf(world) * root.frame});
    }
    if (model.Static() && !joints_.empty()) {
      Note(
          "the model is <static>, of which Gazebo moves nothing: here its root is fixed to the "
          "world, and its joints move");
    }
    for (const JointOfSdf& joint : joints_) {
      const Pose parent = joint.parent == kSdfWorld ? world : links_[index_.at(joint.parent)].frame;
      AddJoint(joint, InverseOf(parent) * joint.in_model);
    }
    NoteWhatIsLeftOut(at);
    for (const auto& [kind, names] : left_out_) {
      const std::string named = Named(names);
      Note(fmt::format("left out: {} ({}){}{}", kind, names.size(), named.empty() ? "" : ": ",
                       named));
    }
    if (!without_inertial_.empty()) {
      Note(fmt::format("without <inertial>, for which SDF has 1 kg and 1 kg m^2: {}",
                       Named(without_inertial_)));
    }
    if (without_velocity_ > 0 && !velocity_) {
      Note(
          fmt::format("{} of {} joints have no limit of velocity, which a task needs: --velocity "
                      "gives it",
                      without_velocity_, joints_.size()));
    }
    return {urdf_.Finish(), std::move(file_.notes)};
  }

 private:
  static constexpr const char* kSdfWorld = "world";

  struct LinkOfSdf {
    const sdf::Link* link = nullptr;
    std::string name;
    Pose in_model;  ///< In the frame of the outermost model.
    Pose frame;     ///< Of the URDF's link, there: at the joint that carries it.
    const sdf::Joint* carrier = nullptr;
    std::string parent;
  };
  struct JointOfSdf {
    const sdf::Joint* joint = nullptr;
    std::string name, parent, child;
    Pose in_model;
  };

  void Note(std::string note) { file_.notes.push_back(std::move(note)); }

  /// The first names of a list; those that are empty are none.
  static std::string Named(std::vector<std::string> names) {
    constexpr std::size_t kShown = 8;
    names.erase(std::remove(names.begin(), names.end(), ""), names.end());
    const std::size_t shown = std::min(kShown, names.size()), more = names.size() - shown;
    names.resize(shown);
    if (names.empty()) return "";
    return fmt::format("'{}'{}", fmt::join(names, "', '"),
                       more > 0 ? fmt::format(" and {} more", more) : "");
  }

  void CheckPose(const sdf::Errors& errors, const sdf::ElementPtr& at,
                 const std::string& key) const {
    if (!errors.empty()) file_.Fail(at, key, errors.front().Message());
  }

  double Finite(double value, const sdf::ElementPtr& at, const std::string& key,
                const char* what) const {
    if (!std::isfinite(value))
      file_.Fail(at, key, fmt::format("{} is {}; allowed: a finite number", what, value));
    return value;
  }

  [[nodiscard]] Pose ToPose(const ignition::math::Pose3d& pose, const sdf::ElementPtr& at,
                            const std::string& key) const {
    const auto& q = pose.Rot();
    for (const double value :
         {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z(), q.X(), q.Y(), q.Z(), q.W()})
      Finite(value, at, key, "a number of a <pose>");
    return {Pose::RotationOf(q.X(), q.Y(), q.Z(), q.W()), ToVector(pose.Pos())};
  }

  /// Links and joints of a model, and of those in it.
  void Collect(const sdf::Model& model,  // NOLINT(misc-no-recursion)
               const std::string& prefix, const Pose& in_top) {
    for (std::uint64_t k = 0; k < model.LinkCount(); ++k) {
      const sdf::Link& link = *model.LinkByIndex(k);
      const std::string name = prefix + link.Name(), key = fmt::format("link '{}'", name);
      ignition::math::Pose3d pose;
      CheckPose(link.SemanticPose().Resolve(pose, "__model__"), link.Element(), key);
      const Pose at = in_top * ToPose(pose, link.Element(), key);
      index_.emplace(name, links_.size());
      links_.push_back({&link, name, at, at, nullptr, ""});
    }
    for (std::uint64_t k = 0; k < model.JointCount(); ++k) {
      const sdf::Joint& joint = *model.JointByIndex(k);
      const std::string name = prefix + joint.Name(), key = fmt::format("joint '{}'", name);
      ignition::math::Pose3d pose;
      std::string parent, child;
      CheckPose(joint.SemanticPose().Resolve(pose, "__model__"), joint.Element(), key);
      CheckPose(joint.ResolveParentLink(parent), joint.Element(), key);
      CheckPose(joint.ResolveChildLink(child), joint.Element(), key);
      if (parent != kSdfWorld) parent.insert(0, prefix);
      joints_.push_back(
          {&joint, name, parent, prefix + child, in_top * ToPose(pose, joint.Element(), key)});
    }
    for (std::uint64_t k = 0; k < model.ModelCount(); ++k) {
      const sdf::Model& inner = *model.ModelByIndex(k);
      const std::string key = fmt::format("model '{}'", inner.Name());
      ignition::math::Pose3d pose;
      CheckPose(inner.SemanticPose().Resolve(pose, "__model__"), inner.Element(), key);
      Collect(inner, fmt::format("{}{}::", prefix, inner.Name()),
              in_top * ToPose(pose, inner.Element(), key));
    }
  }

  /// Finds what carries each link, and the root. Returns whether that is the world.
  bool CheckTree() {
    bool on_world = false;
    for (const JointOfSdf& joint : joints_) {
      const std::string key = fmt::format("joint '{}'", joint.name);
      const auto child = index_.find(joint.child);
      if (child == index_.end() ||
          (joint.parent != kSdfWorld && index_.find(joint.parent) == index_.end())) {
        file_.Fail(
            joint.joint->Element(), key,
            fmt::format("'{}' is no link of the model; allowed: any link of it, or 'world' as the "
                        "parent",
                        child == index_.end() ? joint.child : joint.parent));
      }
      on_world = on_world || joint.parent == kSdfWorld;
      LinkOfSdf& link = links_[child->second];
      if (link.carrier != nullptr) {
        file_.Fail(
            joint.joint->Element(), key,
            fmt::format("its <child> '{}' is already that of joint '{}' (line {}); allowed: a "
                        "tree, in which a link hangs on one joint. Take out the joint that closes "
                        "a loop, or swap the <parent> and <child> of one that is the wrong way "
                        "round",
                        link.name, link.carrier->Name(), SdfFile::LineOf(link.carrier->Element())));
      }
      link.carrier = joint.joint;
      link.parent = joint.parent;
      link.frame = joint.in_model;
    }
    CheckRoots(on_world);
    return on_world;
  }

  /// There is one root, and every link leads up to it.
  void CheckRoots(bool on_world) {
    std::string root = on_world ? kSdfWorld : "";
    for (std::size_t k = 0; k < links_.size(); ++k) {
      const LinkOfSdf& link = links_[k];
      if (link.carrier != nullptr) continue;
      if (root.empty()) {
        root = link.name;
        root_ = k;
        continue;
      }
      file_.Fail(link.link->Element(), fmt::format("link '{}'", link.name),
                 fmt::format("no joint carries it, and {}; a robot has one such root link. Give it "
                             "a joint, or take it out",
                             on_world ? "others hang on the world"
                                      : fmt::format("none carries '{}'", root)));
    }
    for (const LinkOfSdf& link : links_) {
      const LinkOfSdf* at = &link;
      for (std::size_t steps = 0; at->carrier != nullptr && at->parent != kSdfWorld; ++steps) {
        if (steps > links_.size()) {
          file_.Fail(at->link->Element(), fmt::format("link '{}'", at->name),
                     "the joints above it lead back to itself; allowed: a tree");
        }
        at = &links_[index_.at(at->parent)];
      }
    }
  }

  void AddLink(const LinkOfSdf& from) {
    UrdfLink link{.name = from.name};
    const std::string key = fmt::format("link '{}'", from.name);
    const sdf::ElementPtr at = from.link->Element();
    const Pose placed = InverseOf(from.frame) * from.in_model;
    const auto& inertial = from.link->Inertial();
    const auto moments = inertial.MassMatrix().Moi();
    if (!at->HasElement("inertial")) without_inertial_.push_back(from.name);
    UrdfInertial& made = link.inertial.emplace();
    made.pose = placed * ToPose(inertial.Pose(), at, key);
    made.mass_kg = Finite(inertial.MassMatrix().Mass(), at, key, "its mass");
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        made.moments(row, column) =
            Finite(moments(static_cast<std::size_t>(row), static_cast<std::size_t>(column)), at,
                   key, "a moment of inertia");
      }
    }
    for (std::uint64_t k = 0; k < from.link->CollisionCount(); ++k)
      AddShape(*from.link->CollisionByIndex(k), true, placed, key, link);
    for (std::uint64_t k = 0; k < from.link->VisualCount(); ++k)
      AddShape(*from.link->VisualByIndex(k), false, placed, key, link);
    if (at->HasElement("gravity") && !at->Get<bool>("gravity"))
      Note(fmt::format("{} has no <gravity> in Gazebo; here all links have", key));
    if (at->HasElement("kinematic") && at->Get<bool>("kinematic"))
      Note(fmt::format("{} is <kinematic> in Gazebo; here it moves as the others do", key));
    urdf_.Add(link);
  }

  template <class Shape>
  void AddShape(const Shape& shape, bool collides, const Pose& placed, const std::string& key,
                UrdfLink& link) {
    const sdf::ElementPtr at = shape.Element();
    ignition::math::Pose3d pose;
    CheckPose(shape.SemanticPose().Resolve(pose), at, key);
    const std::optional<std::string> form = FormOf(*shape.Geom(), at, key);
    if (!form) {
      const sdf::ElementPtr what =
          shape.Geom()->Element() == nullptr ? nullptr : shape.Geom()->Element()->GetFirstElement();
      Note(fmt::format("{}: the shape '{}' is left out: a URDF has no <{}>", key, shape.Name(),
                       what == nullptr ? "geometry" : what->GetName()));
      return;
    }
    link.shapes.push_back(
        {.collides = collides, .pose = placed * ToPose(pose, at, key), .form = *form});
  }

  /// None, where a URDF has no such form.
  [[nodiscard]] std::optional<std::string> FormOf(const sdf::Geometry& shape,
                                                  const sdf::ElementPtr& at,
                                                  const std::string& key) {
    const auto size = [&](double value) { return Finite(value, at, key, "a size of a shape"); };
    const auto sizes = [&](const ignition::math::Vector3d& v) {
      return SpaceVector(size(v.X()), size(v.Y()), size(v.Z()));
    };
    switch (shape.Type()) {
      case sdf::GeometryType::SPHERE:
        return SphereForm(size(shape.SphereShape()->Radius()));
      case sdf::GeometryType::CYLINDER:
        return CylinderForm(size(shape.CylinderShape()->Radius()),
                            size(shape.CylinderShape()->Length()));
      case sdf::GeometryType::CAPSULE:
        return CapsuleForm(size(shape.CapsuleShape()->Radius()),
                           size(shape.CapsuleShape()->Length()));
      case sdf::GeometryType::BOX:
        return BoxForm(sizes(shape.BoxShape()->Size()));
      case sdf::GeometryType::MESH: {
        const sdf::Mesh& mesh = *shape.MeshShape();
        if (!mesh.Submesh().empty()) {
          Note(fmt::format("{}: of a mesh its part '{}' is named; the URDF has the whole", key,
                           mesh.Submesh()));
        }
        return MeshForm(MeshFile(mesh), sizes(mesh.Scale()));
      }
      default:
        return std::nullopt;
    }
  }

  /// A URDF beside the SDF finds it.
  [[nodiscard]] std::string MeshFile(const sdf::Mesh& mesh) const {
    constexpr std::string_view kModel = "model://";
    std::string uri = mesh.Uri();
    if (uri.starts_with(kModel)) return "package://" + uri.substr(kModel.size());
    const std::filesystem::path folder = std::filesystem::path(mesh.FilePath()).parent_path();
    const bool relative = uri.find("://") == std::string::npos && !uri.starts_with('/');
    if (!relative || folder.empty() || folder == file_.absolute().parent_path()) return uri;
    return (folder / uri).string();
  }

  void AddJoint(const JointOfSdf& from, const Pose& place) {
    const std::string key = fmt::format("joint '{}'", from.name);
    const sdf::ElementPtr at = from.joint->Element();
    UrdfJoint made{.name = from.name, .parent = from.parent, .child = from.child, .place = place};
    switch (from.joint->Type()) {
      case sdf::JointType::REVOLUTE:
      case sdf::JointType::CONTINUOUS:
      case sdf::JointType::PRISMATIC:
        made.motion = MotionOf(*from.joint, key);
        break;
      case sdf::JointType::FIXED:
        break;
      default:
        made.type = at->Get<std::string>("type");
        Note(fmt::format("{} is of the type {}, of which a robot here has none: it is held", key,
                         made.type));
    }
    urdf_.Add(made);
  }

  UrdfMotion MotionOf(const sdf::Joint& joint, const std::string& key) {
    const sdf::JointAxis* const axis = joint.Axis();
    if (axis == nullptr) file_.Fail(joint.Element(), key, "lacks <axis>");
    const sdf::ElementPtr at = axis->Element();
    ignition::math::Vector3d xyz;
    CheckPose(axis->ResolveXyz(xyz), at, key);
    UrdfMotion motion{.slides = joint.Type() == sdf::JointType::PRISMATIC, .axis = ToVector(xyz)};
    for (int i = 0; i < 3; ++i) Finite(motion.axis[i], at, key, "a number of <xyz>");
    // Numbers as large as these stand for no end in SDF.
    constexpr double kNoEnd = 1e15, kFarEnd = 1000;
    const double lower = axis->Lower(), upper = axis->Upper();
    if (std::isnan(lower) || std::isnan(upper))
      file_.Fail(at, key, "an end of <limit> is NaN; allowed: a number");
    if (joint.Type() != sdf::JointType::CONTINUOUS && (lower > -kNoEnd || upper < kNoEnd))
      motion.range = {std::max(lower, -kFarEnd), std::min(upper, kFarEnd)};
    const auto limit = [&](double value, const char* what) -> std::optional<double> {
      if (std::isnan(value)) Finite(value, at, key, what);
      if (value >= kNoEnd) return std::nullopt;
      return value;
    };
    motion.effort = limit(axis->Effort(), "<effort>");
    motion.velocity = limit(axis->MaxVelocity(), "<velocity>");
    if (!motion.velocity) {
      ++without_velocity_;
      motion.velocity = velocity_;
    }
    motion.damping = Finite(axis->Damping(), at, key, "<damping>");
    motion.friction = Finite(axis->Friction(), at, key, "<friction>");
    if (axis->SpringStiffness() != 0) {
      Note(fmt::format("{}: its spring of {} is left out ([passive] has springs)", key,
                       axis->SpringStiffness()));
    }
    return motion;
  }

  void NoteWhatIsLeftOut(const sdf::ElementPtr& element) {  // NOLINT(misc-no-recursion)
    for (sdf::ElementPtr e = element->GetFirstElement(); e != nullptr; e = e->GetNextElement()) {
      const auto kind = std::find_if(kSdfLeftOut.begin(), kSdfLeftOut.end(),
                                     [&](const auto& row) { return e->GetName() == row.first; });
      if (kind == kSdfLeftOut.end()) {
        NoteWhatIsLeftOut(e);
      } else if (e->GetExplicitlySetInFile()) {
        left_out_[kind->second].push_back(e->HasAttribute("name") ? e->Get<std::string>("name")
                                                                  : "");
      }
    }
  }

  SdfFile& file_;
  std::optional<double> velocity_;
  UrdfWriter urdf_;
  std::vector<LinkOfSdf> links_;
  std::map<std::string, std::size_t> index_;  // of links, by name
  std::vector<JointOfSdf> joints_;
  std::size_t root_ = 0;  // the link that nothing carries, where the world is not the root
  std::size_t without_velocity_ = 0;
  std::map<std::string, std::vector<std::string>> left_out_;  // names, by kind
  std::vector<std::string> without_inertial_;
};

}  // namespace

TranslatedRobot ReadSdf(const std::string& path, std::optional<double> velocity) {
  static_cast<void>(ReadTextFile(path));  // says what is wrong with a file that is none
  SdfFile file(path);
  return SdfConverter(file, velocity).Convert();
}

}  // namespace tumbler

#else

namespace tumbler {

TranslatedRobot ReadSdf(const std::string& path, std::optional<double> /*velocity*/) {
  throw std::runtime_error(fmt::format(
      "{}: this build cannot read SDF; build it where libsdformat-dev is installed, with "
      "-DTUMBLER_WITH_SDFORMAT=ON",
      path));
}

}  // namespace tumbler

#endif
