#include "common/files/file_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "common/files/json.h"
#include "common/files/printable.h"

namespace tumbler {
namespace {

/// The number without its fraction. A number beyond all whole numbers becomes the last one.
std::int64_t Whole(double value) {
  constexpr double kBeyond = 9223372036854775808.0;  // 2^63
  if (value >= kBeyond) return std::numeric_limits<std::int64_t>::max();
  if (value < -kBeyond) return std::numeric_limits<std::int64_t>::min();
  return static_cast<std::int64_t>(value);
}

/// Reads the value of a key that is there, or has to be.
class ValueReader {
 public:
  ValueReader(TomlTable& table, const KeyText& text) : table_(table), text_(text) {}

  void operator()(double* value) const { *value = Number(); }
  void operator()(float* value) const { *value = static_cast<float>(Number()); }
  void operator()(std::optional<double>* value) const { *value = Number(); }
  void operator()(const SecondsValue& value) const {
    *value.nanoseconds = std::llround(1e9 * Number());
  }
  void operator()(const IntegerValue& value) const {
    value.set(value.at, text_.choices.empty() ? Integer() : Choice());
  }
  void operator()(bool* value) const { *value = table_.Boolean(text_.name); }
  void operator()(std::string* value) const {
    *value = table_.String(text_.name);
    CheckOneLine(*value);
  }
  void operator()(const LongTextValue& value) const { *value.text = table_.String(text_.name); }
  void operator()(const NameValue& value) const {
    const std::string name = table_.String(text_.name);
    if (name.empty() || name.size() > value.capacity) {
      table_.Fail(text_.name, fmt::format("is '{}', {} bytes; allowed: from 1 ... {}", name,
                                          name.size(), value.capacity));
    }
    CheckOneLine(name);
    value.set(value.at, name);
  }
  void operator()(std::span<double> value) const {
    const std::vector<double> numbers = table_.Numbers(text_.name, text_.allowed, value.size());
    std::copy(numbers.begin(), numbers.end(), value.begin());
  }
  void operator()(std::vector<double>* value) const {
    *value = table_.Numbers(text_.name, text_.allowed);
  }
  void operator()(std::vector<std::string>* value) const {
    *value = table_.Strings(text_.name);
    for (const std::string& text : *value) CheckOneLine(text);
  }

 private:
  /// Texts that are shown as they are, other than the long ones.
  void CheckOneLine(const std::string& text) const {
    if (const char* mistake = MistakeInName(text)) table_.Fail(text_.name, mistake);
  }
  [[nodiscard]] double Number() const { return table_.Number(text_.name, text_.allowed); }
  [[nodiscard]] std::int64_t Integer() const {
    return table_.Integer(text_.name, Whole(text_.allowed.min), Whole(text_.allowed.max));
  }
  [[nodiscard]] std::int64_t Choice() const {
    const std::string name = table_.Choice(text_.name, text_.choices, "");
    return std::find(text_.choices.begin(), text_.choices.end(), name) - text_.choices.begin();
  }

  TomlTable& table_;
  const KeyText& text_;
};

class ValueWriter {
 public:
  ValueWriter(TomlWriter& writer, const KeyText& text)
      : writer_(writer), name_(text.name), choices_(text.choices) {}

  void operator()(double* value) const { writer_.Number(name_, *value); }
  void operator()(const IntegerValue& value) const {
    const std::int64_t number = value.get(value.at);
    if (choices_.empty()) {
      writer_.Line(fmt::format("{} = {}", name_, number));
    } else {
      writer_.Text(name_, choices_[static_cast<std::size_t>(number)]);
    }
  }
  void operator()(std::string* value) const { writer_.Text(name_, *value); }
  /// A number that is not there is not written.
  void operator()(std::optional<double>* value) const {
    if (*value) writer_.Number(name_, **value);
  }
  void operator()(const LongTextValue& value) const { writer_.LongText(name_, *value.text); }
  void operator()(const NameValue& value) const { writer_.Text(name_, value.get(value.at)); }
  void operator()(std::span<double> value) const { writer_.Numbers(name_, value); }
  void operator()(std::vector<double>* value) const { writer_.Numbers(name_, *value); }
  void operator()(std::vector<std::string>* value) const { writer_.Texts(name_, *value); }
  template <class Other>
  void operator()(const Other& /*value*/) const {
    throw std::logic_error(fmt::format("{}: keys of this kind are only read", name_));
  }

 private:
  TomlWriter& writer_;
  std::string_view name_;
  std::span<const std::string_view> choices_;
};

/// A number in the style of docs/formats.md: 0.001, 1e-5, 16 384, 1e6.
std::string Shown(double value) {
  const double exponent = std::log10(std::abs(value));
  if (exponent >= 5 && exponent == std::round(exponent))
    return fmt::format("{}1e{:.0f}", value < 0 ? "-" : "", exponent);
  if (std::abs(value) >= 1e4 && std::abs(value) < 1e12 && value == std::round(value)) {
    std::string text = fmt::format("{:.0f}", value);
    for (std::size_t end = text.size(); end > 3 && text[end - 4] != '-'; end -= 3)
      text.insert(end - 3, 1, ' ');
    return text;
  }
  std::string text = fmt::format("{:.6g}", value);
  if (const std::size_t zero = text.find("e-0"); zero != std::string::npos) text.erase(zero + 2, 1);
  return text;
}

std::string Shown(const Range& range) {
  constexpr double kLargest = std::numeric_limits<double>::max();
  const bool lower = range.min > -kLargest;
  const bool upper = range.max < kLargest;
  if (lower && upper) {
    if (range.min == range.max) return Shown(range.min);
    return range.min_excluded ? fmt::format("above {}, to {}", Shown(range.min), Shown(range.max))
                              : fmt::format("{} to {}", Shown(range.min), Shown(range.max));
  }
  if (lower && range.min_excluded) return "above " + Shown(range.min);
  if (lower) return Shown(range.min) + " or more";
  return upper ? "up to " + Shown(range.max) : "";
}

std::string Quoted(std::string_view text) { return fmt::format("`\"{}\"`", text); }

/// Makes the JSON Schema of a key's value.
class ValueSchema {
 public:
  explicit ValueSchema(const KeyText& text) : text_(text) {}

  Json operator()(double* /*value*/) const { return Number(); }
  Json operator()(float* /*value*/) const { return Number(); }
  Json operator()(std::optional<double>* /*value*/) const { return Number(); }
  Json operator()(const SecondsValue& /*value*/) const { return Number(); }
  Json operator()(const IntegerValue& /*value*/) const {
    if (text_.choices.empty()) return Bounded({{"type", "integer"}});
    return {{"enum", Json(text_.choices)}};
  }
  Json operator()(bool* /*value*/) const { return {{"type", "boolean"}}; }
  Json operator()(std::string* /*value*/) const { return {{"type", "string"}}; }
  Json operator()(const LongTextValue& /*value*/) const { return {{"type", "string"}}; }
  Json operator()(const NameValue& value) const {
    return {{"type", "string"}, {"minLength", 1}, {"maxLength", value.capacity}};
  }
  Json operator()(std::span<double> value) const {
    return {{"type", "array"},
            {"items", Number()},
            {"minItems", value.size()},
            {"maxItems", value.size()}};
  }
  Json operator()(std::vector<double>* /*value*/) const {
    return {{"type", "array"}, {"items", Number()}};
  }
  Json operator()(std::vector<std::string>* /*value*/) const {
    return {{"type", "array"}, {"items", {{"type", "string"}}}};
  }

 private:
  [[nodiscard]] Json Number() const { return Bounded({{"type", "number"}}); }
  [[nodiscard]] Json Bounded(Json schema) const {
    constexpr double kLargest = std::numeric_limits<double>::max();
    const Range& range = text_.allowed;
    if (range.min > -kLargest)
      schema[range.min_excluded ? "exclusiveMinimum" : "minimum"] = range.min;
    if (range.max < kLargest) schema["maximum"] = range.max;
    return schema;
  }

  const KeyText& text_;
};

/// Writes a default for docs/formats.md.
class ValueShower {
 public:
  explicit ValueShower(const KeyText& text) : text_(text) {}

  std::string operator()(double* value) const { return Shown(*value); }
  std::string operator()(float* value) const { return Shown(static_cast<double>(*value)); }
  std::string operator()(std::optional<double>* value) const {
    return *value ? Shown(**value) : "none";
  }
  std::string operator()(const SecondsValue& value) const {
    return Shown(1e-9 * static_cast<double>(*value.nanoseconds));
  }
  std::string operator()(const IntegerValue& value) const {
    const std::int64_t number = value.get(value.at);
    return text_.choices.empty() ? Shown(static_cast<double>(number))
                                 : Quoted(text_.choices[static_cast<std::size_t>(number)]);
  }
  std::string operator()(bool* value) const { return *value ? "true" : "false"; }
  std::string operator()(std::string* value) const {
    return value->empty() ? "none" : Quoted(*value);
  }
  template <class Other>
  std::string operator()(const Other& /*value*/) const {
    return "none";
  }

 private:
  const KeyText& text_;
};

}  // namespace

namespace file_keys_detail {

void Read(TomlTable& table, const KeyText& text, const KeyValue& value) {
  if (text.required || table.Has(text.name)) std::visit(ValueReader(table, text), value);
}

void Write(TomlWriter& writer, const KeyText& text, const KeyValue& value) {
  std::visit(ValueWriter(writer, text), value);
}

KeyRow RowOf(const KeyText& text, const KeyValue* value, std::string_view table) {
  KeyRow row;
  row.table = table;
  row.key = fmt::format("`{}`", text.name);
  const std::string shown = value != nullptr ? std::visit(ValueShower(text), *value) : "";
  if (text.default_text != nullptr) {
    row.absent = fmt::format(fmt::runtime(text.default_text), shown);
  } else {
    row.absent = text.required ? "required" : shown;
  }
  if (text.allowed_text != nullptr) {
    row.allowed = text.allowed_text;
  } else if (!text.choices.empty()) {
    for (const std::string_view choice : text.choices)
      row.allowed += (row.allowed.empty() ? "" : ", ") + Quoted(choice);
  } else if (value != nullptr && std::holds_alternative<NameValue>(*value)) {
    row.allowed = fmt::format("1 to {} bytes", std::get<NameValue>(*value).capacity);
  } else {
    row.allowed = Shown(text.allowed);
  }
  row.meaning = text.meaning;
  row.name = text.name;
  if (text.schema != nullptr) {
    row.schema = text.schema;
  } else {
    row.schema = value != nullptr ? std::visit(ValueSchema(text), *value).Dump(-1) : "{}";
  }
  return row;
}

}  // namespace file_keys_detail

void ReadHeader(TomlTable& file, const FileHeader& header) {
  if (header.other_format == nullptr) {
    const std::array<std::string_view, 1> formats = {header.format};
    file.Choice("format", formats, "");
  } else if (const std::string format = file.String("format"); format != header.format) {
    file.Fail("format", fmt::format(fmt::runtime(header.other_format), format, header.format));
  }
  if (header.newer_version == nullptr) {
    file.Integer("version", header.version, header.version);
    return;
  }
  const std::int64_t version = file.Integer("version", 1, std::numeric_limits<std::int64_t>::max());
  if (version > header.version)
    file.Fail("version", fmt::format(fmt::runtime(header.newer_version), version, header.version));
}

KeyRow RowOf(const FileHeader& header) {
  return {"", "`format`, `version`", "required",
          fmt::format("{}, {}", Quoted(header.format), header.version), ""};
}

std::vector<KeyRow> Joined(std::initializer_list<std::vector<KeyRow>> lists) {
  std::vector<KeyRow> rows;
  for (const std::vector<KeyRow>& list : lists) rows.insert(rows.end(), list.begin(), list.end());
  return rows;
}

}  // namespace tumbler
