#include "firmware_interface/devices/eds.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <limits>
#include <vector>

#include "common/files/toml_reader.h"

namespace tumbler {

namespace {

std::string_view Trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin);
}

std::string InSmallLetters(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return small;
}

/// What a message shows of a text that may be anything.
std::string Shown(std::string_view text) {
  constexpr std::size_t kMost = 40;
  std::string shown;
  for (const char c : text.substr(0, kMost)) shown += c >= ' ' && c <= '~' ? c : '?';
  return text.size() > kMost ? shown + "..." : shown;
}

struct Value {
  std::uint32_t line = 0;
  std::string text;
};
struct Section {
  std::uint32_t line = 0;
  std::map<std::string, Value> values;  // by keys in small letters
};

/// The sections of a file, by their names in small letters.
using Sections = std::map<std::string, Section>;

Sections ReadSections(std::string_view text, const std::string& name) {
  Sections sections;
  Section* section = nullptr;
  std::uint32_t line = 0;
  while (!text.empty()) {
    ++line;
    const std::size_t end = text.find('\n');
    const std::string_view row = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (row.find('\0') != std::string_view::npos)
      throw FileError(name, line, "", "holds a byte of zero: this is no text");
    if (row.empty() || row.front() == ';') continue;
    if (row.front() == '[') {
      const std::size_t close = row.find(']');
      if (close == std::string_view::npos)
        throw FileError(name, line, Shown(row), "is a section without its ]");
      const auto [at, is_new] =
          sections.try_emplace(InSmallLetters(Trimmed(row.substr(1, close - 1))));
      if (!is_new) {
        throw FileError(name, line, Shown(row.substr(0, close + 1)),
                        fmt::format("occurs twice; the first is in line {}", at->second.line));
      }
      section = &at->second;
      section->line = line;
      continue;
    }
    const std::size_t equals = row.find('=');
    if (equals == std::string_view::npos || section == nullptr) {
      throw FileError(name, line, Shown(row),
                      section == nullptr ? "stands before every section"
                                         : "is neither [section] nor Key=Value nor ;comment");
    }
    const std::string_view key = Trimmed(row.substr(0, equals));
    const auto [at, is_new] = section->values.try_emplace(
        InSmallLetters(key), Value{line, std::string(Trimmed(row.substr(equals + 1)))});
    if (!is_new) {
      throw FileError(name, line, Shown(key),
                      fmt::format("occurs twice; the first is in line {}", at->second.line));
    }
  }
  return sections;
}

/// What is larger is none, whatever is added. (No object that is written has more than 32 bits.)
constexpr std::int64_t kLargestNumber = std::int64_t{1} << 56;

std::optional<std::int64_t> OneNumber(std::string_view text, std::uint8_t node_id) {
  text = Trimmed(text);
  if (InSmallLetters(text) == "$nodeid") return node_id;
  const bool negative = !text.empty() && text.front() == '-';
  if (negative) text.remove_prefix(1);
  int base = 10;
  if (text.size() > 2 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X')) {
    base = 16;
    text.remove_prefix(2);
  } else if (text.size() > 1 && text[0] == '0') {
    base = 8;
    text.remove_prefix(1);
  }
  if (text.empty()) return std::nullopt;
  std::int64_t number = 0;
  for (const char c : text) {
    const int small = std::tolower(static_cast<unsigned char>(c));
    const int digit = small >= '0' && small <= '9'   ? small - '0'
                      : small >= 'a' && small <= 'f' ? small - 'a' + 10
                                                     : 99;
    if (digit >= base || number > kLargestNumber) return std::nullopt;
    number = base * number + digit;
  }
  return negative ? -number : number;
}

std::optional<std::int64_t> NumberIn(std::string_view text, std::uint8_t node_id) {
  std::int64_t sum = 0;
  for (;;) {
    const std::size_t plus = text.find('+');
    const std::optional<std::int64_t> term = OneNumber(text.substr(0, plus), node_id);
    if (!term || std::abs(sum) > kLargestNumber) return std::nullopt;
    sum += *term;
    if (plus == std::string_view::npos) return sum;
    text.remove_prefix(plus + 1);
  }
}

/// Reads the values of one section.
class SectionReader {
 public:
  SectionReader(const Section& section, const std::string& file, std::uint8_t node_id)
      : section_(section), file_(file), node_id_(node_id) {}

  [[nodiscard]] const Value* Find(const char* key) const {
    const auto found = section_.values.find(InSmallLetters(key));
    // A key without a value is as good as none, as many tools write them.
    return found == section_.values.end() || found->second.text.empty() ? nullptr : &found->second;
  }
  [[nodiscard]] std::optional<std::int64_t> Number(const char* key, std::int64_t min,
                                                   std::int64_t max) const {
    const Value* const value = Find(key);
    if (value == nullptr) return std::nullopt;
    const std::optional<std::int64_t> number = NumberIn(value->text, node_id_);
    if (!number || *number < min || *number > max) {
      throw FileError(file_, value->line, key,
                      fmt::format("is '{}'; allowed: a number from {} ... {}, also with $NODEID",
                                  Shown(value->text), min, max));
    }
    return number;
  }

 private:
  const Section& section_;
  const std::string& file_;
  std::uint8_t node_id_;
};

struct TypeSize {
  std::uint16_t type;
  int bits;
  bool is_signed;
};
// CiA 301, numbers of data types.
constexpr std::array kTypes = {
    TypeSize{0x01, 1, false},  TypeSize{0x02, 8, true},   TypeSize{0x03, 16, true},
    TypeSize{0x04, 32, true},  TypeSize{0x05, 8, false},  TypeSize{0x06, 16, false},
    TypeSize{0x07, 32, false}, TypeSize{0x10, 24, true},  TypeSize{0x12, 40, true},
    TypeSize{0x13, 48, true},  TypeSize{0x14, 56, true},  TypeSize{0x15, 64, true},
    TypeSize{0x16, 24, false}, TypeSize{0x18, 40, false}, TypeSize{0x19, 48, false},
    TypeSize{0x1a, 56, false}, TypeSize{0x1b, 64, false},
};

EdsObject ReadObject(const Section& section, const SectionReader& reader, const std::string& file) {
  EdsObject object;
  object.line = section.line;
  const auto type = reader.Number("DataType", 0, 0xffff);
  if (!type) throw FileError(file, section.line, "DataType", "is missing in this section");
  object.type = static_cast<std::uint16_t>(*type);
  for (const TypeSize& size : kTypes) {
    if (size.type != object.type) continue;
    object.bits = size.bits;
    object.is_signed = size.is_signed;
  }
  const Value* const access = reader.Find("AccessType");
  if (access == nullptr)
    throw FileError(file, section.line, "AccessType", "is missing in this section");
  object.access = InSmallLetters(access->text);
  constexpr std::array<std::string_view, 6> kAccess = {"ro", "wo", "rw", "rwr", "rww", "const"};
  if (std::ranges::find(kAccess, object.access) == kAccess.end()) {
    throw FileError(
        file, access->line, "AccessType",
        fmt::format("is '{}'; allowed: ro, wo, rw, rwr, rww, const", Shown(access->text)));
  }
  object.mappable = reader.Number("PDOMapping", 0, 1).value_or(0) == 1;
  if (object.bits != 0) {
    constexpr std::int64_t kMost = std::int64_t{1} << 57;
    object.low = reader.Number("LowLimit", -kMost, kMost);
    object.high = reader.Number("HighLimit", -kMost, kMost);
  }
  return object;
}

std::optional<std::uint32_t> HexNumber(std::string_view text, std::size_t most) {
  if (text.empty() || text.size() > most) return std::nullopt;
  return NumberIn("0x" + std::string(text), 0);
}

}  // namespace

ElectronicDataSheet ElectronicDataSheet::Parse(std::string_view text, const std::string& name,
                                               std::uint8_t node_id) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (text.substr(0, kByteOrderMark.size()) == kByteOrderMark)
    text.remove_prefix(kByteOrderMark.size());
  const Sections sections = ReadSections(text, name);
  ElectronicDataSheet sheet;
  sheet.name_ = name;
  for (const auto& [title, section] : sections) {
    const SectionReader reader(section, name, node_id);
    if (title == "devicecomissioning" || title == "devicecommissioning") {
      if (const auto node = reader.Number("NodeID", 1, 127))
        sheet.node_id_ = static_cast<int>(*node);
      continue;
    }
    const std::optional<std::uint32_t> index = HexNumber(std::string_view(title).substr(0, 4), 4);
    if (!index || title.size() < 4 || (*index < 0x1000)) continue;
    const std::string_view rest = std::string_view(title).substr(4);
    const auto number = static_cast<std::uint16_t>(*index);
    if (rest.empty()) {
      constexpr std::int64_t kVariable = 7;
      const auto compact = reader.Number("CompactSubObj", 0, 254);
      if (compact && *compact > 0) {
        sheet.compact_[number] = static_cast<int>(*compact);
      } else if (reader.Number("ObjectType", 0, 0xff).value_or(kVariable) != kVariable) {
        continue;  // Its parts have sections of their own.
      }
      sheet.objects_[{number, 0}] = ReadObject(section, reader, name);
    } else if (rest.substr(0, 3) == "sub") {
      const std::optional<std::uint32_t> sub = HexNumber(rest.substr(3), 2);
      if (!sub) continue;  // E.g. [1003subX], of no meaning.
      sheet.objects_[{number, static_cast<std::uint8_t>(*sub)}] = ReadObject(section, reader, name);
    }
  }
  for (const char* list : {"mandatoryobjects", "optionalobjects", "manufacturerobjects"}) {
    const auto found = sections.find(list);
    if (found == sections.end()) continue;
    const SectionReader reader(found->second, name, node_id);
    const auto count = reader.Number("SupportedObjects", 0, 0xffff);
    for (std::int64_t i = 1; count && i <= *count; ++i) {
      const std::string key = std::to_string(i);
      const auto index = reader.Number(key.c_str(), 0, 0xffff);
      if (!index) throw FileError(name, found->second.line, key, "is missing in this list");
      if (sections.count(fmt::format("{:04x}", *index)) != 0) continue;
      throw FileError(name, reader.Find(key.c_str())->line, key,
                      fmt::format("lists {:04X}h, which has no section", *index));
    }
  }
  if (sheet.objects_.empty())
    throw FileError(name, 1, "", "holds no object: this is no electronic data sheet (CiA 306)");
  return sheet;
}

std::optional<EdsObject> ElectronicDataSheet::Find(std::uint16_t index, std::uint8_t sub) const {
  const auto compact = compact_.find(index);
  if (compact != compact_.end()) {
    if (sub > compact->second) return std::nullopt;
    EdsObject object = objects_.at({index, 0});
    if (sub != 0) return object;
    constexpr std::uint16_t kUnsigned8 = 5;  // The number of parts.
    object.type = kUnsigned8;
    object.bits = 8;
    object.is_signed = object.mappable = false;
    object.low = object.high = std::nullopt;
    // A mapping's number of entries is written wherever its entries are.
    return object;
  }
  const auto found = objects_.find({index, sub});
  if (found == objects_.end()) return std::nullopt;
  return found->second;
}

}  // namespace tumbler
