#include "firmware_interface/devices/drives_dbc.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "firmware_interface/devices/dbc_texts.h"

namespace tumbler {
namespace {

/// Takes the next word of a line, up to a space.
std::string_view TakeWord(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  const std::size_t end = std::min(line.find(' '), line.size());
  const std::string_view word = line.substr(0, end);
  line.remove_prefix(end);
  return word;
}

std::optional<std::uint32_t> Number(std::string_view word) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

/// A joint's name as an identifier of C, which DBC files ask for.
std::string Identifier(std::string_view name) {
  std::string identifier;
  for (const char c : name)
    identifier += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  if (identifier.empty() || std::isdigit(static_cast<unsigned char>(identifier.front())) != 0)
    identifier.insert(0, 1, '_');
  return identifier;
}

/// The lines of a DBC file about several drives, by the sections that have to follow each other.
class DbcFile {
 public:
  template <class Protocol>
  void Add(const std::string& joint, const typename Protocol::Config& config) {
    std::string node = Identifier(joint);
    while (!nodes_.insert(node).second) node += '_';
    order_.push_back(node);
    std::string_view text = DbcText(Protocol::kDbc);
    std::optional<std::string> message;  // the one that signals belong to; none: is left out
    std::set<std::uint32_t> left_out;
    std::set<std::string, std::less<>> gone;  // signals that the drive does not have
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = text.substr(0, end);
      text.remove_prefix(std::min(end + 1, text.size()));
      std::string_view rest = line;
      const std::string_view kind = TakeWord(rest);
      if (kind == "BO_") {
        const std::optional<std::uint32_t> of_example = Number(TakeWord(rest));
        if (!of_example) continue;
        std::string_view name = TakeWord(rest);
        name.remove_suffix(1);  // the colon
        message = BeginMessage<Protocol>(*of_example, std::string(name), node, rest, config);
        if (!message) left_out.insert(*of_example);
      } else if (kind == "SG_" && message) {
        const std::string_view signal = TakeWord(rest);
        const std::string own = SignalOf<Protocol>(*message, signal, line, config);
        if (!own.starts_with(fmt::format(" SG_ {} ", signal))) gone.emplace(signal);
        messages_ += ForNode(own, node) + '\n';
      } else if (kind == "CM_" || kind == "VAL_" || kind == "SIG_VALTYPE_") {
        AddRemark<Protocol>(kind, rest, left_out, gone, config);
      }
    }
  }

  [[nodiscard]] std::string Text() const {
    std::string nodes;
    for (const std::string& node : order_) nodes += ' ' + node;
    return fmt::format("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: HOST{}\n{}\n{}{}{}", nodes, messages_,
                       comments_, values_, types_);
  }

 private:
  /// @returns the protocol's name of the message, or nothing when it is there already.
  template <class Protocol>
  std::optional<std::string> BeginMessage(std::uint32_t of_example, const std::string& name,
                                          const std::string& node, std::string_view rest,
                                          const typename Protocol::Config& config) {
    const std::uint32_t id = Protocol::DbcId(of_example, config);
    if (!ids_.insert(id).second) return std::nullopt;
    // What is the same for two drives is all drives'.
    const bool shared = Protocol::DbcId(of_example, Protocol::Example(0)) ==
                        Protocol::DbcId(of_example, Protocol::Example(1));
    messages_ += fmt::format("\nBO_ {} {}{}:{}\n", id, shared ? "" : node + '_', name,
                             ForNode(std::string(rest), node));
    return name;
  }

  template <class Protocol>
  static std::string SignalOf(std::string_view message, std::string_view signal,
                              std::string_view line, const typename Protocol::Config& config) {
    if constexpr (requires { Protocol::DbcSignal(message, signal, line, config); })
      return Protocol::DbcSignal(message, signal, line, config).text;
    return std::string(line);
  }

  /// A line about a message or a signal; those about the example as a whole are left out.
  template <class Protocol>
  void AddRemark(std::string_view kind, std::string_view rest,
                 const std::set<std::uint32_t>& left_out,
                 const std::set<std::string, std::less<>>& gone,
                 const typename Protocol::Config& config) {
    std::string begin(kind);
    begin += ' ';
    std::string_view word = TakeWord(rest);
    bool of_signal = true;
    if (kind == "CM_") {
      of_signal = word == "SG_";
      if (!of_signal && word != "BO_") return;
      begin += std::string(word) + ' ';
      word = TakeWord(rest);
    }
    std::string_view after = rest;
    if (of_signal && gone.contains(TakeWord(after))) return;
    const std::optional<std::uint32_t> of_example = Number(word);
    if (!of_example || left_out.contains(*of_example)) return;
    std::string& section = kind == "CM_" ? comments_ : kind == "VAL_" ? values_ : types_;
    section += fmt::format("{}{}{}\n", begin, Protocol::DbcId(*of_example, config), rest);
  }

  /// A line in which the drive is called by its node's name.
  static std::string ForNode(std::string line, const std::string& node) {
    constexpr std::string_view kDrive = " DRIVE";
    for (std::size_t at = 0; (at = line.find(kDrive, at)) != std::string::npos;) {
      line.replace(at + 1, kDrive.size() - 1, node);
      at += node.size();
    }
    return line;
  }

  std::set<std::string> nodes_;
  std::vector<std::string> order_;
  std::set<std::uint32_t> ids_;
  std::string messages_, comments_, values_, types_;
};

}  // namespace

std::string WithScale(std::string_view line, const DriveRange& range, double steps) {
  const std::size_t begin = line.find('('), end = line.find(']', begin);
  if (end == std::string_view::npos) return std::string(line);
  const double min = range.min, max = range.max;
  return fmt::format("{}({:.15g},{:.9g}) [{:.9g}|{:.9g}]{}", line.substr(0, begin),
                     (max - min) / steps, min, min, max, line.substr(end + 1));
}

std::string DrivesDbc(const DrivesConfig& drives) {
  DbcFile file;
  for (const DriveEntry& drive : drives.drives) {
    DriveProtocols::With(drive.config, [&](auto protocol, const auto& config) {
      file.Add<decltype(protocol)>(drive.joint, config);
    });
  }
  return file.Text();
}

}  // namespace tumbler
