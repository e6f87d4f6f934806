#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "common/core/fixed_string.h"
#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "common/files/toml_writer.h"

namespace tumbler {

/// The keys of a file, each described once. The reader, the writer and the table in docs/formats.md
/// come from the same list.
///
///   constexpr std::array kStopKeys = {
///       KeyOf<&Stop::stiffness_nm_per_rad>("stiffness_nm_per_rad", {0, 1e4}, "of the spring"),
///       KeyOf<&Stop::damping_nm_s_per_rad>("damping_nm_s_per_rad", {0, 50}, "of the damper")};
///
///   Stop stop;
///   ReadKeys(table, kStopKeys, stop);
///
/// A key that is not in the file leaves the member as it is. So the default is that of the struct,
/// or the value that the member had before. Keys are read in the order of the list.

/// The description of a key, whatever type its value has.
struct KeyText {
  std::string_view name;  ///< The key, with its unit at the end.
  Range allowed = Range::Any();
  std::span<const std::string_view> choices;  ///< Names of the values 0, 1, ... of an enumeration.
  const char* meaning = "";
  bool required = false;
  const char* default_text = nullptr;  ///< For people, where it is not the struct's own default.
  const char* allowed_text = nullptr;  ///< For people, where the range does not say everything.
  const char* schema = nullptr;        ///< JSON Schema of a value that a function reads.
};

/// A whole number of any type, or an enumeration, at any place.
struct IntegerValue {
  void* at;
  std::int64_t (*get)(const void*);
  void (*set)(void*, std::int64_t);
};
/// A FixedString of any capacity. In the file it must not be empty.
struct NameValue {
  void* at;
  std::size_t capacity;
  std::string_view (*get)(const void*);
  void (*set)(void*, std::string_view);
};
/// Seconds in the file, nanoseconds in the struct.
struct SecondsValue {
  std::int64_t* nanoseconds;
};
/// A text of several lines.
struct LongTextValue {
  std::string* text;
};
/// The place of a key's value in one struct. A span stands for an array of exactly its size.
using KeyValue = std::variant<double*, float*, IntegerValue, bool*, std::string*, NameValue,
                              SecondsValue, LongTextValue, std::optional<double>*,
                              std::span<double>, std::vector<double>*, std::vector<std::string>*>;

/// A key of a table whose values go into an `S`. `KeyOf` and its kin below make it.
template <class S>
struct FileKey {
  using Reader = void (*)(TomlTable& table, std::string_view key, S& settings);

  KeyText text;
  KeyValue (*value)(S&) = nullptr;
  Reader reader = nullptr;              ///< Reads a key that no list can describe; else `value`.
  Range (*range)(const S&) = nullptr;   ///< The range, where it depends on the keys before.
  void (*prepare)(S&) = nullptr;        ///< Sets the default, where it depends on the keys before.
  bool (*applies)(const S&) = nullptr;  ///< Whether the table has this key; null: always.

  /// This key without a default: it has to be there.
  [[nodiscard]] constexpr FileKey Required() const {
    FileKey key = *this;
    key.text.required = true;
    return key;
  }
  /// This key with another default than the struct's.
  /// @param for_people  the default in words, where {} is the struct's.
  /// @param set         sets it, from the keys before.
  [[nodiscard]] constexpr FileKey Default(const char* for_people, void (*set)(S&) = nullptr) const {
    FileKey key = *this;
    key.text.default_text = for_people;
    key.prepare = set;
    return key;
  }
  /// This key with more than a constant range.
  /// @param for_people  the allowed values in words.
  /// @param of          the range that the keys before leave.
  [[nodiscard]] constexpr FileKey Allowed(const char* for_people,
                                          Range (*of)(const S&) = nullptr) const {
    FileKey key = *this;
    key.text.allowed_text = for_people;
    key.range = of;
    return key;
  }
  /// This key with a function that reads it, where it is there or required.
  [[nodiscard]] constexpr FileKey ReadBy(Reader read) const {
    FileKey key = *this;
    key.reader = read;
    return key;
  }
  /// This key with a JSON Schema of what its function reads.
  [[nodiscard]] constexpr FileKey Schema(const char* schema) const {
    FileKey key = *this;
    key.text.schema = schema;
    return key;
  }
  /// This key only where a condition on the keys before holds. Elsewhere it is an unknown key.
  [[nodiscard]] constexpr FileKey Where(bool (*holds)(const S&)) const {
    FileKey key = *this;
    key.applies = holds;
    return key;
  }
};

namespace file_keys_detail {

template <class M>
struct MemberOf;
template <class T, class C>
struct MemberOf<T C::*> {
  using Class = C;
  using Type = T;
};
template <auto kMember>
using ClassOf = typename MemberOf<decltype(kMember)>::Class;

inline KeyValue ValueOf(double& value) { return &value; }
inline KeyValue ValueOf(float& value) { return &value; }
inline KeyValue ValueOf(std::string& value) { return &value; }
inline KeyValue ValueOf(std::optional<double>& value) { return &value; }
inline KeyValue ValueOf(std::vector<double>& value) { return &value; }
inline KeyValue ValueOf(std::vector<std::string>& value) { return &value; }
template <std::size_t kCount>
KeyValue ValueOf(std::array<double, kCount>& value) {
  return std::span<double>(value);
}
template <std::size_t kCapacity>
KeyValue ValueOf(FixedString<kCapacity>& value) {
  using Name = FixedString<kCapacity>;
  return NameValue{&value, kCapacity,
                   [](const void* at) { return static_cast<const Name*>(at)->view(); },
                   [](void* at, std::string_view name) { *static_cast<Name*>(at) = Name(name); }};
}
template <class T>
KeyValue IntegerOf(T& value) {
  return IntegerValue{
      &value, [](const void* at) { return static_cast<std::int64_t>(*static_cast<const T*>(at)); },
      [](void* at, std::int64_t to) { *static_cast<T*>(at) = static_cast<T>(to); }};
}
template <class T>
requires(std::is_integral_v<T> || std::is_enum_v<T>) KeyValue ValueOf(T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    return &value;
  } else {
    return IntegerOf(value);
  }
}

void Read(TomlTable& table, const KeyText& text, const KeyValue& value);
void Write(TomlWriter& writer, const KeyText& text, const KeyValue& value);
/// @param value  the default; null: `text` has it.
KeyRow RowOf(const KeyText& text, const KeyValue* value, std::string_view table);

}  // namespace file_keys_detail

/// The key of a member that is a number, a text, a bool, an array of numbers, or a name
/// (FixedString).
/// @tparam S  the class of the member, or one derived from it.
template <auto kMember, class S = file_keys_detail::ClassOf<kMember>>
constexpr FileKey<S> KeyOf(std::string_view name, Range allowed, const char* meaning) {
  FileKey<S> key;
  key.text.name = name;
  key.text.allowed = allowed;
  key.text.meaning = meaning;
  key.value = [](S& settings) { return file_keys_detail::ValueOf(settings.*kMember); };
  return key;
}
template <auto kMember, class S = file_keys_detail::ClassOf<kMember>>
constexpr FileKey<S> KeyOf(std::string_view name, const char* meaning) {
  return KeyOf<kMember, S>(name, Range::Any(), meaning);
}
/// The key of a member that is an enumeration whose values 0, 1, ... have these names, or a bool.
template <auto kMember, class S = file_keys_detail::ClassOf<kMember>, std::size_t kCount>
constexpr FileKey<S> KeyOf(std::string_view name,
                           const std::array<std::string_view, kCount>& choices,
                           const char* meaning) {
  FileKey<S> key = KeyOf<kMember, S>(name, Range::Any(), meaning);
  key.text.choices = choices;
  key.value = [](S& settings) { return file_keys_detail::IntegerOf(settings.*kMember); };
  return key;
}
/// The key in seconds of a member in nanoseconds.
template <auto kMember, class S = file_keys_detail::ClassOf<kMember>>
constexpr FileKey<S> SecondsOf(std::string_view name, Range allowed, const char* meaning) {
  FileKey<S> key = KeyOf<kMember, S>(name, allowed, meaning);
  key.value = [](S& settings) -> KeyValue { return SecondsValue{&(settings.*kMember)}; };
  return key;
}
/// The key of a member that is a text of several lines.
template <auto kMember, class S = file_keys_detail::ClassOf<kMember>>
constexpr FileKey<S> LongTextOf(std::string_view name, const char* meaning) {
  FileKey<S> key = KeyOf<kMember, S>(name, meaning);
  key.value = [](S& settings) -> KeyValue { return LongTextValue{&(settings.*kMember)}; };
  return key;
}
/// A key without a member, which a function reads where it is there or required. `Default` and
/// `Allowed` describe it for people.
template <class S>
constexpr FileKey<S> KeyReadBy(std::string_view name, typename FileKey<S>::Reader reader,
                               const char* meaning) {
  FileKey<S> key;
  key.text.name = name;
  key.text.meaning = meaning;
  key.reader = reader;
  return key;
}

/// These keys, all of them required.
template <class S, std::size_t kCount>
constexpr std::array<FileKey<S>, kCount> AllRequired(std::array<FileKey<S>, kCount> keys) {
  for (FileKey<S>& key : keys) key.text.required = true;
  return keys;
}

/// Reads the keys in their order.
/// @throws FileError  about the first key that is wrong, or is missing although it is required.
template <class S, std::size_t kCount>
void ReadKeys(TomlTable& table, const std::array<FileKey<S>, kCount>& keys,
              std::type_identity_t<S>& settings) {
  for (const FileKey<S>& key : keys) table.Expect(key.text.name);
  for (const FileKey<S>& key : keys) {
    if (key.applies != nullptr && !key.applies(settings)) continue;
    if (key.prepare != nullptr) key.prepare(settings);
    if (key.reader != nullptr) {
      if (key.text.required || table.Has(key.text.name)) key.reader(table, key.text.name, settings);
      continue;
    }
    KeyText text = key.text;
    if (key.range != nullptr) text.allowed = key.range(settings);
    file_keys_detail::Read(table, text, key.value(settings));
  }
}

/// Writes the keys in their order. @throws std::invalid_argument  about a value that TOML cannot
/// hold.
// A key's value may be set as well as read, so it is asked for of a copy.
// NOLINTBEGIN(performance-unnecessary-value-param)
template <class S, std::size_t kCount>
void WriteKeys(TomlWriter& writer, const std::array<FileKey<S>, kCount>& keys,
               std::type_identity_t<S> settings) {
  for (const FileKey<S>& key : keys) file_keys_detail::Write(writer, key.text, key.value(settings));
}

/// The rows of these keys for docs/formats.md.
/// @param table     their table, in Markdown, which stands before each key.
/// @param defaults  holds the defaults.
template <class S, std::size_t kCount>
std::vector<KeyRow> RowsOf(const std::array<FileKey<S>, kCount>& keys, std::string_view table = "",
                           std::type_identity_t<S> defaults = {}) {
  std::vector<KeyRow> rows;
  for (const FileKey<S>& key : keys) {
    std::optional<KeyValue> value;
    if (key.value != nullptr) value = key.value(defaults);
    KeyRow row = file_keys_detail::RowOf(key.text, value ? &*value : nullptr, table);
    // What is required with a default in words is so only beside some other keys.
    row.required = key.text.required && key.applies == nullptr && key.text.default_text == nullptr;
    rows.push_back(row);
  }
  return rows;
}
// NOLINTEND(performance-unnecessary-value-param)

/// The kind of a file: its keys `format` and `version`, which are read first.
struct FileHeader {
  const char* format;
  int version;
  /// The problem of another format, where {0} is the file's value and {1} the one above. Null: the
  /// same words as of a choice.
  const char* other_format = "is '{0}'; allowed: {1}";
  /// The problem of a newer version, likewise. Null: no other version is read.
  const char* newer_version = nullptr;
};
/// @throws FileError  when the file is of another kind.
void ReadHeader(TomlTable& file, const FileHeader& header);
KeyRow RowOf(const FileHeader& header);

}  // namespace tumbler
