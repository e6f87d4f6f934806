#include "common/files/json.h"

#include <algorithm>
#include <ostream>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace tumbler {

struct Json::Member {
  std::string name;
  Json value;

  friend bool operator==(const Member& a, const Member& b) = default;
};

namespace {

using Library = nlohmann::json;  // It parses, and writes numbers and texts.

/// The deepest nesting. No data of ours is deeper, and copying or destroying a value takes a stack
/// that is as deep.
constexpr std::size_t kDeepest = 100;

[[noreturn]] void FailKind(const char* expected) {
  throw std::invalid_argument(std::string("JSON: is not ") + expected);
}

/// Builds a value from the events of the library's parser. Each returns whether to go on.
class Builder final : public Library::json_sax_t {
 public:
  explicit Builder(Json& root) : root_(root) {}

  bool null() override { return Put(nullptr); }
  bool boolean(bool value) override { return Put(value); }
  bool number_integer(number_integer_t value) override { return Put(value); }
  bool number_unsigned(number_unsigned_t value) override { return Put(value); }
  bool number_float(number_float_t value, const string_t& /*text*/) override { return Put(value); }
  bool string(string_t& value) override { return Put(std::move(value)); }
  bool binary(binary_t& /*value*/) override { return false; }
  bool start_object(std::size_t /*size*/) override { return Open(Json::Object()); }
  bool start_array(std::size_t /*size*/) override { return Open(Json::Array()); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }
  bool key(string_t& name) override {
    key_ = std::move(name);
    return true;
  }
  bool parse_error(std::size_t /*position*/, const std::string& /*token*/,
                   const Library::exception& /*error*/) override {
    return false;
  }

 private:
  Json& Add(Json value) {
    if (open_.empty()) return root_ = std::move(value);
    Json& parent = *open_.back();
    if (parent.is_object()) return parent[key_] = std::move(value);
    parent.Append(std::move(value));
    return parent[parent.size() - 1];
  }
  bool Put(Json value) {
    Add(std::move(value));
    return true;
  }
  bool Open(Json value) {
    if (open_.size() == kDeepest) return false;
    open_.push_back(&Add(std::move(value)));
    return true;
  }
  bool Close() {
    open_.pop_back();
    return true;
  }

  Json& root_;
  std::vector<Json*> open_;  ///< The arrays and objects that are not closed yet, outermost first.
  std::string key_;
};

}  // namespace

Json::Json() noexcept = default;
Json::Json(std::nullptr_t) noexcept {}
Json::Json(const Scalar& scalar) {
  switch (scalar.kind) {
    case Scalar::kBoolean:
      value_ = scalar.boolean;
      break;
    case Scalar::kWhole:
      value_ = scalar.whole;
      break;
    case Scalar::kLarge:
      value_ = scalar.large;
      break;
    case Scalar::kReal:
      value_ = scalar.real;
      break;
  }
}
Json::Json(const char* text) : value_(std::string(text)) {}
Json::Json(std::string_view text) : value_(std::string(text)) {}
Json::Json(std::string text) : value_(std::move(text)) {}
Json::Json(const Json& other) = default;
Json::Json(Json&& other) noexcept = default;
Json& Json::operator=(const Json& other) = default;
Json& Json::operator=(Json&& other) noexcept = default;
Json::~Json() = default;

Json::Json(std::initializer_list<Json> entries) {
  const bool object = std::all_of(entries.begin(), entries.end(), [](const Json& entry) {
    return entry.is_array() && entry.size() == 2 && entry[0].is_text();
  });
  if (!object) {
    value_ = Elements(entries);
    return;
  }
  value_ = Members();
  for (const Json& entry : entries) (*this)[entry[0].text()] = entry[1];
}

Json Json::Array(std::initializer_list<Json> entries) {
  Json json;
  json.value_ = Elements(entries);
  return json;
}

Json Json::Object() {
  Json json;
  json.value_ = Members();
  return json;
}

bool Json::is_null() const noexcept { return std::holds_alternative<std::nullptr_t>(value_); }
bool Json::is_boolean() const noexcept { return std::holds_alternative<bool>(value_); }
bool Json::is_number() const noexcept {
  return std::holds_alternative<std::int64_t>(value_) ||
         std::holds_alternative<std::uint64_t>(value_) || std::holds_alternative<double>(value_);
}
bool Json::is_text() const noexcept { return std::holds_alternative<std::string>(value_); }
bool Json::is_array() const noexcept { return std::holds_alternative<Elements>(value_); }
bool Json::is_object() const noexcept { return std::holds_alternative<Members>(value_); }

bool Json::boolean() const {
  const bool* const value = std::get_if<bool>(&value_);
  if (value == nullptr) FailKind("true or false");
  return *value;
}

double Json::number() const {
  if (const auto* real = std::get_if<double>(&value_)) return *real;
  if (const auto* whole = std::get_if<std::int64_t>(&value_)) return static_cast<double>(*whole);
  if (const auto* large = std::get_if<std::uint64_t>(&value_)) return static_cast<double>(*large);
  FailKind("a number");
}

const std::string& Json::text() const {
  const std::string* const value = std::get_if<std::string>(&value_);
  if (value == nullptr) FailKind("a text");
  return *value;
}

std::optional<std::int64_t> Json::integer() const noexcept {
  const std::int64_t* const value = std::get_if<std::int64_t>(&value_);
  return value == nullptr ? std::nullopt : std::optional(*value);
}

std::size_t Json::size() const noexcept {
  if (const auto* elements = std::get_if<Elements>(&value_)) return elements->size();
  if (const auto* members = std::get_if<Members>(&value_)) return members->size();
  return 0;
}

std::span<const Json> Json::elements() const noexcept {
  const Elements* const elements = std::get_if<Elements>(&value_);
  return elements == nullptr ? std::span<const Json>() : std::span<const Json>(*elements);
}

const Json& Json::operator[](std::size_t index) const {
  if (index >= elements().size())
    throw std::out_of_range("JSON: has no value " + std::to_string(index));
  return elements()[index];
}

Json& Json::operator[](std::size_t index) { return const_cast<Json&>(std::as_const(*this)[index]); }

const Json* Json::Find(std::string_view key) const noexcept {
  const Members* const members = std::get_if<Members>(&value_);
  if (members == nullptr) return nullptr;
  const auto found = std::find_if(members->begin(), members->end(),
                                  [key](const Member& member) { return member.name == key; });
  return found == members->end() ? nullptr : &found->value;
}

const Json& Json::operator[](std::string_view key) const {
  const Json* const found = Find(key);
  if (found == nullptr) throw std::out_of_range("JSON: has no member " + std::string(key));
  return *found;
}

Json& Json::operator[](std::string_view key) {
  if (is_null()) value_ = Members();
  if (const Json* const found = Find(key)) return const_cast<Json&>(*found);
  Members* const members = std::get_if<Members>(&value_);
  if (members == nullptr) FailKind("an object");
  return members->emplace_back(Member{std::string(key), nullptr}).value;
}

void Json::Append(Json value) {
  if (is_null()) value_ = Elements();
  Elements* const elements = std::get_if<Elements>(&value_);
  if (elements == nullptr) FailKind("an array");
  elements->push_back(std::move(value));
}

void Json::Merge(const Json& other) {
  const Members* const members = std::get_if<Members>(&other.value_);
  if (members == nullptr) FailKind("an object");
  for (const Member& member : *members) (*this)[member.name] = member.value;
}

struct Json::Writer {
  int indent;
  std::string text = {};
  std::size_t depth = 0;

  void Write(const Json& json) { std::visit(*this, json.value_); }
  void operator()(const Elements& elements) {
    Enclose('[', ']', elements, [this](const Json& element) { Write(element); });
  }
  void operator()(const Members& members) {
    Enclose('{', '}', members, [this](const Member& member) {
      (*this)(member.name);
      text += indent < 0 ? ":" : ": ";
      Write(member.value);
    });
  }
  template <typename Scalar>
  void operator()(const Scalar& value) {
    text += Library(value).dump(-1, ' ', false, Library::error_handler_t::replace);
  }

 private:
  template <typename Entries, typename WriteEntry>
  void Enclose(char open, char close, const Entries& entries, const WriteEntry& write) {
    text += open;
    ++depth;
    for (const auto& entry : entries) {
      if (&entry != &entries.front()) text += ',';
      BreakLine();
      write(entry);
    }
    --depth;
    if (!entries.empty()) BreakLine();
    text += close;
  }
  void BreakLine() {
    if (indent >= 0) (text += '\n').append(depth * static_cast<std::size_t>(indent), ' ');
  }
};

std::string Json::Dump(int indent) const {
  Writer writer{.indent = indent};
  writer.Write(*this);
  return std::move(writer.text);
}

std::optional<Json> Json::Parse(std::string_view text) {
  Json json;
  Builder builder(json);
  if (!Library::sax_parse(text, &builder)) return std::nullopt;
  return json;
}

bool operator==(const Json& a, const Json& b) {
  if (a.is_number() && b.is_number() && a.value_.index() != b.value_.index())
    return a.number() == b.number();
  return a.value_ == b.value_;
}

std::ostream& operator<<(std::ostream& stream, const Json& json) { return stream << json.Dump(-1); }

}  // namespace tumbler
