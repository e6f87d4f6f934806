#include "common/files/toml_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <set>
#include <system_error>
#include <utility>

#include <toml++/toml.h>

#include "common/files/file_kind.h"

namespace tumbler {

FileError::FileError(const std::string& file, std::uint32_t line, const std::string& key,
                     const std::string& problem)
    : std::runtime_error(fmt::format("{}{}: {}{}{}", file, line > 0 ? fmt::format(":{}", line) : "",
                                     key, key.empty() ? "" : ": ", problem)) {}

std::string ExactDecimal(double value) {
  char buffer[40];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  std::string text(buffer, end);
  if (text.find_first_of(".enif") == std::string::npos) text += ".0";
  return text;
}

std::string MessageNumber(double value) { return fmt::format("{:.6g}", value); }

std::pair<std::string, std::string> DistinctNumbers(double a, double b) {
  std::pair<std::string, std::string> texts{MessageNumber(a), MessageNumber(b)};
  if (texts.first == texts.second && a != b) texts = {ExactDecimal(a), ExactDecimal(b)};
  return texts;
}

std::string ReadTextFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw FileError(path, 0, "", "is a directory, not a file");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    throw FileError(path, 0, "",
                    fmt::format("cannot be opened: {}", std::generic_category().message(errno)));
  }
  std::string text;
  std::array<char, 65536> part;
  while (stream.read(part.data(), part.size()), stream.gcount() > 0) {
    text.append(part.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kLargestFile) {
      const std::string_view kind = KindOfRunFile(text);
      throw FileError(
          path, 0, "",
          kind.empty()
              ? fmt::format("is too large; allowed: up to {} bytes", kLargestFile)
              : fmt::format("is {}; here a text of up to {} bytes is read", kind, kLargestFile));
    }
  }
  return text;
}

namespace {

std::string Describe(const Range& range) {
  constexpr double kLargest = std::numeric_limits<double>::max();
  const bool lower = range.min > -kLargest;
  const bool upper = range.max < kLargest;
  const char* relation = range.min_excluded ? ">" : ">=";
  if (lower && upper) {
    return fmt::format("allowed: {} {} ... {}", range.min_excluded ? "above" : "from",
                       MessageNumber(range.min), MessageNumber(range.max));
  }
  if (lower) return fmt::format("allowed: {} {}", relation, MessageNumber(range.min));
  if (upper) return fmt::format("allowed: <= {}", MessageNumber(range.max));
  return "allowed: any finite number";
}

/// The most dots of a key. Each part of a key is a table in a table, and a key of many more parts
/// would exhaust the parser's stack.
constexpr int kMostDots = 1000;

/// The line of a key with more dots than that, or 0. Quoted text is searched too, which is
/// harmless: no honest text has so many dots without a line end, a comma or an equals sign between
/// them.
std::uint32_t LineOfEndlessKey(std::string_view text) {
  std::uint32_t line = 1;
  int dots = 0;
  for (const char c : text) {
    if (c == '\n') ++line;
    if (c == '\n' || c == ',' || c == '=') dots = 0;
    if (c == '.' && ++dots > kMostDots) return line;
  }
  return 0;
}

/// Edit distance in insertions, deletions and substitutions [Levenshtein 1966].
std::size_t Distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t change = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({change, diagonal + 1, row[j] + 1});
    }
  }
  return row.back();
}

/// How near the key in a file is to the one that may be meant by it: 0 where its unit or half of
/// its word was left out, else their distance; none where it is too far for a slip.
std::optional<std::size_t> Nearness(std::string_view written, std::string_view meant) {
  const bool begins =
      meant.starts_with(written) && (written.size() >= 3 || meant[written.size()] == '_');
  if (begins) return 0;
  const std::size_t distance = Distance(written.substr(0, 64), meant);
  if (distance > std::max<std::size_t>(1, written.size() / 3)) return std::nullopt;
  return distance;
}

/// Advice about an unknown key: the key that was probably meant, or all keys that can be there.
std::string KeyAdvice(std::string_view key, const toml::table& table,
                      const std::set<std::string, std::less<>>& known) {
  std::vector<std::string> free;
  for (const std::string& candidate : known) {
    if (!table.contains(candidate)) free.push_back(candidate);
  }
  const std::string* nearest = nullptr;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const std::string& candidate : free) {
    const std::optional<std::size_t> distance = Nearness(key, candidate);
    if (distance && *distance < least) {
      least = *distance;
      nearest = &candidate;
    }
  }
  if (nearest != nullptr) return fmt::format("did you mean '{}'?", *nearest);
  if (free.empty()) return "nothing more can be here";
  return fmt::format("also allowed here: {}", fmt::join(free, ", "));
}

/// What was probably meant to be the missing key: the nearest one of the table that nothing is
/// known of, and its line, as a beginning of the advice. Empty where there is none.
std::string MisspeltAdvice(std::string_view missing, const toml::table& table,
                           const std::function<bool(std::string_view)>& is_known) {
  std::string advice;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const auto& [key, node] : table) {
    const std::optional<std::size_t> distance = Nearness(key.str(), missing);
    if (!distance || *distance >= least || is_known(key.str())) continue;
    least = *distance;
    advice =
        fmt::format("did you mean it by '{}' in line {}? ", key.str(), key.source().begin.line);
  }
  return advice;
}

const char* TypeName(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "a boolean";
    default:
      return "a date or time";
  }
}

std::string CanonicalNumber(double value) {
  constexpr double kEnd = 0x1p63;  // of the integers
  const bool whole = value > -kEnd && value < kEnd && value == std::trunc(value);
  if (whole && !(value == 0 && std::signbit(value)))
    return fmt::format("{}", static_cast<std::int64_t>(value));
  return fmt::format("0x{:016x}", std::bit_cast<std::uint64_t>(value));
}

/// Appends the lines of a value for TomlTable::CanonicalText.
void AppendCanonical(std::string& text, const std::string& path, const toml::node& node) {
  const auto line = [&text, &path](const std::string& value) {
    text += fmt::format("{} = {}\n", path, value);
  };
  if (const auto* table = node.as_table()) {
    line(fmt::format("{{{}}}", table->size()));
    for (const auto& [key, value] : *table)
      AppendCanonical(text, fmt::format("{}.{}", path, key.str()), value);
  } else if (const auto* array = node.as_array()) {
    line(fmt::format("[{}]", array->size()));
    for (std::size_t i = 0; i < array->size(); ++i)
      AppendCanonical(text, fmt::format("{}[{}]", path, i), *array->get(i));
  } else if (const auto* integer = node.as_integer()) {
    line(fmt::format("{}", integer->get()));
  } else if (const auto* real = node.as_floating_point()) {
    line(CanonicalNumber(real->get()));
  } else if (const auto* string = node.as_string()) {
    line(fmt::format("{}:{}", string->get().size(), string->get()));
  } else if (const auto* boolean = node.as_boolean()) {
    line(boolean->get() ? "true" : "false");
  } else {
    line(TypeName(node));  // No key of our files holds a date or a time.
  }
}

/// A parsed file, and the keys that were asked for.
struct Document {
  std::string file;
  toml::table root;
  std::set<const toml::node*> taken;
  /// For each table, every key that was asked for: these are the keys that it can hold.
  std::map<const toml::table*, std::set<std::string, std::less<>>> known;
  /// Likewise, keys that are somewhere in the lists of keys that were read of it.
  std::map<const toml::table*, std::set<std::string, std::less<>>> described;
};

}  // namespace

/// One table of a document.
class TomlTable::Place {
 public:
  Place(std::shared_ptr<Document> document, const toml::table* table, std::string path)
      : document_(std::move(document)), table_(table), path_(std::move(path)) {}

  [[nodiscard]] Document& document() const { return *document_; }
  [[nodiscard]] const toml::table& table() const { return *table_; }
  [[nodiscard]] const std::string& path() const { return path_; }

  /// A table in this one, of the same document.
  [[nodiscard]] TomlTable Within(const toml::table& table, std::string path) const {
    return TomlTable(std::make_shared<const Place>(document_, &table, std::move(path)));
  }

  /// Notes that this table can hold the key.
  void Know(std::string_view key) const { document_->known[table_].emplace(key); }
  /// Notes that a list of keys of this table has the key.
  void Expect(std::string_view key) const { document_->described[table_].emplace(key); }
  /// @param allowed  for the message when the key is missing.
  const toml::node& Take(std::string_view key, const std::string& allowed) const;
  [[nodiscard]] double ToNumber(const toml::node& node, std::string_view key, Range range) const;
  [[noreturn]] void FailType(std::string_view key, const toml::node& node,
                             const std::string& expected) const;
  [[nodiscard]] std::string FullKey(std::string_view key) const;

 private:
  std::shared_ptr<Document> document_;
  const toml::table* table_;
  std::string path_;
};

std::string TomlTable::Place::FullKey(std::string_view key) const {
  if (key.empty()) return path_;
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

void TomlTable::Place::FailType(std::string_view key, const toml::node& node,
                                const std::string& expected) const {
  throw FileError(document_->file, node.source().begin.line, FullKey(key),
                  fmt::format("is {}; expected {}", TypeName(node), expected));
}

const toml::node& TomlTable::Place::Take(std::string_view key, const std::string& allowed) const {
  Know(key);
  const toml::node* node = table_->get(key);
  if (node == nullptr) {
    const auto is_known = [this](std::string_view other) {
      return document_->known[table_].contains(other) ||
             document_->described[table_].contains(other);
    };
    throw FileError(document_->file, table_->source().begin.line, FullKey(key),
                    fmt::format("is missing and has no default; {}{}",
                                MisspeltAdvice(key, *table_, is_known), allowed));
  }
  document_->taken.insert(node);
  return *node;
}

double TomlTable::Place::ToNumber(const toml::node& node, std::string_view key, Range range) const {
  double value = 0;
  if (const auto* real = node.as_floating_point()) {
    value = real->get();
  } else if (const auto* integer = node.as_integer()) {
    value = static_cast<double>(integer->get());
  } else {
    FailType(key, node, fmt::format("a number; {}", Describe(range)));
  }
  const bool above = range.min_excluded ? value > range.min : value >= range.min;
  if (!std::isfinite(value) || !above || value > range.max) {
    throw FileError(document_->file, node.source().begin.line, FullKey(key),
                    fmt::format("is {}; {}", MessageNumber(value), Describe(range)));
  }
  return value;
}

TomlTable::TomlTable(std::shared_ptr<const Place> place) : place_(std::move(place)) {}

TomlTable TomlTable::ParseFile(const std::string& path) { return Parse(ReadTextFile(path), path); }

TomlTable TomlTable::Parse(std::string_view text, const std::string& name) {
  auto document = std::make_shared<Document>();
  document->file = name;
  if (const std::string_view kind = KindOfRunFile(text); !kind.empty())
    throw FileError(name, 0, "", fmt::format("is {}; here a TOML file is read", kind));
  if (const std::size_t at = text.find('\0'); at != std::string_view::npos) {
    const auto line =
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    throw FileError(name, static_cast<std::uint32_t>(line), "",
                    "not valid TOML: there is a byte 0, so this is no text");
  }
  if (const std::uint32_t line = LineOfEndlessKey(text); line > 0)
    throw FileError(name, line, "", fmt::format("a key has more than {} parts", kMostDots));
  try {
    document->root = toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    throw FileError(name, error.source().begin.line, "",
                    fmt::format("not valid TOML: {}", error.description()));
  }
  const toml::table* root = &document->root;
  return TomlTable(std::make_shared<const Place>(std::move(document), root, ""));
}

const std::string& TomlTable::file() const { return place_->document().file; }

const std::string& TomlTable::path() const { return place_->path(); }

bool TomlTable::Has(std::string_view key) const {
  place_->Know(key);
  return place_->table().contains(key);
}

void TomlTable::Expect(std::string_view key) const { place_->Expect(key); }

bool TomlTable::IsTable(std::string_view key) const {
  const toml::node* node = place_->table().get(key);
  return node != nullptr && node->is_table();
}

std::uint32_t TomlTable::LineOf(std::string_view key) const {
  const toml::node* node = place_->table().get(key);
  if (node != nullptr && node->source().begin.line > 0) return node->source().begin.line;
  return place_->table().source().begin.line;
}

void TomlTable::Fail(std::string_view key, const std::string& problem) const {
  throw FileError(file(), LineOf(key), place_->FullKey(key), problem);
}

double TomlTable::Number(std::string_view key, Range range) {
  return place_->ToNumber(place_->Take(key, Describe(range)), key, range);
}

double TomlTable::Number(std::string_view key, Range range, double absent) {
  return Has(key) ? Number(key, range) : absent;
}

std::int64_t TomlTable::Integer(std::string_view key, std::int64_t min, std::int64_t max) {
  const std::string allowed = fmt::format("allowed: from {} ... {}", min, max);
  const toml::node& node = place_->Take(key, allowed);
  const auto* integer = node.as_integer();
  if (integer == nullptr) place_->FailType(key, node, fmt::format("an integer; {}", allowed));
  if (integer->get() < min || integer->get() > max)
    Fail(key, fmt::format("is {}; {}", integer->get(), allowed));
  return integer->get();
}

std::int64_t TomlTable::Integer(std::string_view key, std::int64_t min, std::int64_t max,
                                std::int64_t absent) {
  return Has(key) ? Integer(key, min, max) : absent;
}

bool TomlTable::Boolean(std::string_view key) {
  const toml::node& node = place_->Take(key, "allowed: true or false");
  const auto* boolean = node.as_boolean();
  if (boolean == nullptr) place_->FailType(key, node, "true or false");
  return boolean->get();
}

bool TomlTable::Boolean(std::string_view key, bool absent) {
  return Has(key) ? Boolean(key) : absent;
}

std::string TomlTable::String(std::string_view key) {
  const toml::node& node = place_->Take(key, "allowed: a string");
  const auto* text = node.as_string();
  if (text == nullptr) place_->FailType(key, node, "a string");
  return text->get();
}

std::string TomlTable::String(std::string_view key, const std::string& absent) {
  return Has(key) ? String(key) : absent;
}

std::string TomlTable::Choice(std::string_view key, std::span<const std::string_view> allowed,
                              const std::string& absent) {
  const std::string list = fmt::format("allowed: {}", fmt::join(allowed, ", "));
  if (absent.empty() || Has(key)) place_->Take(key, list);
  std::string value = String(key, absent);
  if (std::find(allowed.begin(), allowed.end(), value) == allowed.end()) {
    Fail(key, fmt::format("is '{}'; {}", value, list));
  }
  return value;
}

std::vector<double> TomlTable::Numbers(std::string_view key, Range range) {
  const toml::node& node = place_->Take(key, "allowed: an array of numbers");
  const auto* array = node.as_array();
  if (array == nullptr) place_->FailType(key, node, "an array of numbers");
  std::vector<double> values;
  values.reserve(array->size());
  for (std::size_t i = 0; i < array->size(); ++i) {
    values.push_back(place_->ToNumber(*array->get(i), fmt::format("{}[{}]", key, i), range));
  }
  return values;
}

std::vector<double> TomlTable::Numbers(std::string_view key, Range range, std::size_t count) {
  std::vector<double> values = Numbers(key, range);
  if (values.size() != count)
    Fail(key, fmt::format("holds {} numbers; expected {}", values.size(), count));
  return values;
}

std::vector<std::string> TomlTable::Strings(std::string_view key) {
  const toml::node& node = place_->Take(key, "allowed: an array of strings");
  const auto* array = node.as_array();
  if (array == nullptr) place_->FailType(key, node, "an array of strings");
  std::vector<std::string> values;
  for (const toml::node& element : *array) {
    const auto* text = element.as_string();
    if (text == nullptr) place_->FailType(key, element, "a string");
    values.push_back(text->get());
  }
  return values;
}

std::vector<std::vector<std::string>> TomlTable::StringLists(std::string_view key) {
  const toml::node& node = place_->Take(key, "allowed: an array of arrays of strings");
  const auto* array = node.as_array();
  if (array == nullptr) place_->FailType(key, node, "an array of arrays of strings");
  std::vector<std::vector<std::string>> lists;
  for (const toml::node& element : *array) {
    const auto* list = element.as_array();
    if (list == nullptr) place_->FailType(key, element, "an array of strings");
    lists.emplace_back();
    for (const toml::node& entry : *list) {
      const auto* text = entry.as_string();
      if (text == nullptr) place_->FailType(key, entry, "a string");
      lists.back().push_back(text->get());
    }
  }
  return lists;
}

TomlTable TomlTable::Table(std::string_view key) {
  const toml::node& node =
      place_->Take(key, fmt::format("allowed: a table, [{}]", place_->FullKey(key)));
  const auto* table = node.as_table();
  if (table == nullptr) place_->FailType(key, node, "a table");
  return place_->Within(*table, place_->FullKey(key));
}

std::vector<TomlTable> TomlTable::Tables(std::string_view key) {
  return Tables(key, fmt::format("allowed: tables, each begun by [[{}]]", place_->FullKey(key)));
}

std::vector<TomlTable> TomlTable::Tables(std::string_view key, const std::string& what_to_write) {
  const toml::node& node = place_->Take(key, what_to_write);
  const auto* array = node.as_array();
  if (array == nullptr) place_->FailType(key, node, "an array of tables");
  std::vector<TomlTable> tables;
  for (std::size_t i = 0; i < array->size(); ++i) {
    const auto* table = array->get(i)->as_table();
    if (table == nullptr) place_->FailType(key, *array->get(i), "a table");
    place_->document().taken.insert(table);
    tables.push_back(place_->Within(*table, fmt::format("{}[{}]", place_->FullKey(key), i)));
  }
  return tables;
}

std::optional<TomlTable> TomlTable::OptionalTable(std::string_view key) {
  if (!Has(key)) return std::nullopt;
  return Table(key);
}

std::vector<TomlTable> TomlTable::OptionalTables(std::string_view key) {
  if (!Has(key)) return {};
  return Tables(key);
}

std::vector<std::string> TomlTable::Keys() const {
  std::vector<std::pair<std::uint32_t, std::string>> keys;
  for (const auto& [key, node] : place_->table())
    keys.emplace_back(node.source().begin.line, std::string(key.str()));
  std::stable_sort(keys.begin(), keys.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> names;
  names.reserve(keys.size());
  for (auto& entry : keys) names.push_back(std::move(entry.second));
  return names;
}

std::string TomlTable::CanonicalText(std::string_view without) const {
  std::string text;
  for (const auto& [key, node] : place_->table()) {
    if (key.str() != without) AppendCanonical(text, std::string(key.str()), node);
  }
  return text;
}

void TomlTable::RejectUnknownKeys() const {
  for (const auto& [key, node] : place_->table()) {
    if (place_->document().taken.count(&node) == 0) {
      throw FileError(file(), node.source().begin.line, place_->FullKey(key.str()),
                      fmt::format("is not a key that this file can hold; {}",
                                  KeyAdvice(key.str(), place_->table(),
                                            place_->document().known[&place_->table()])));
    }
    if (const auto* table = node.as_table()) {
      place_->Within(*table, place_->FullKey(key.str())).RejectUnknownKeys();
    } else if (const auto* array = node.as_array()) {
      for (std::size_t i = 0; i < array->size(); ++i) {
        if (const auto* element = array->get(i)->as_table()) {
          place_->Within(*element, fmt::format("{}[{}]", place_->FullKey(key.str()), i))
              .RejectUnknownKeys();
        }
      }
    }
  }
}

}  // namespace tumbler
