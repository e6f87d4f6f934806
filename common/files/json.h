#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iosfwd>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace tumbler {

/// A JSON value (RFC 8259): null, a boolean, a number, a text, an array, or an object, whose
/// members stay in the order in which they came.
///
///     Json json = {{"name", "gait"}, {"joints", Json::Array()}};
///     json["joints"].Append({{"name", "leg1"}, {"position_rad", 0.5}});
///     json.Dump(2);
class Json {
 public:
  Json() noexcept;  ///< null
  // These are implicit, so that a member takes its kind from what is assigned to it.
  Json(std::nullptr_t) noexcept;
  template <std::same_as<bool> Boolean>
  Json(Boolean value) : Json(Scalar{.boolean = value}) {}
  template <std::integral Integer>
  requires(!std::same_as<Integer, bool>) Json(Integer value)
      : Json(std::in_range<std::int64_t>(value)
                 ? Scalar{.kind = Scalar::kWhole, .whole = static_cast<std::int64_t>(value)}
                 : Scalar{.kind = Scalar::kLarge, .large = static_cast<std::uint64_t>(value)}) {}
  template <std::floating_point Real>
  Json(Real value) : Json(Scalar{.kind = Scalar::kReal, .real = static_cast<double>(value)}) {}
  Json(const char* text);
  Json(std::string_view text);
  Json(std::string text);
  /// An object where every entry is a list of two that begins with a text: {{"a", 1}, {"b", 2}};
  /// otherwise an array.
  Json(std::initializer_list<Json> entries);
  /// An array of the values in a vector, an array or the like. Not of what consists of its own
  /// kind, as a path does.
  template <typename Range>
  requires(
      !std::convertible_to<Range, std::string_view> &&
      !std::same_as<std::remove_cvref_t<decltype(*std::declval<const Range&>().begin())>, Range> &&
      requires(const Range& range) {
        {Json(*range.begin())};
        range.end();
      }) Json(const Range& range)
      : Json(Array()) {
    for (const auto& value : range) Append(value);
  }
  static Json Array(std::initializer_list<Json> entries = {});
  static Json Object();

  Json(const Json& other);
  Json(Json&& other) noexcept;
  Json& operator=(const Json& other);
  Json& operator=(Json&& other) noexcept;
  ~Json();

  [[nodiscard]] bool is_null() const noexcept;
  [[nodiscard]] bool is_boolean() const noexcept;
  [[nodiscard]] bool is_number() const noexcept;
  [[nodiscard]] bool is_text() const noexcept;
  [[nodiscard]] bool is_array() const noexcept;
  [[nodiscard]] bool is_object() const noexcept;

  /// The value itself. @throws std::invalid_argument  when it is of another kind.
  [[nodiscard]] bool boolean() const;
  [[nodiscard]] double number() const;
  [[nodiscard]] const std::string& text() const;
  /// Empty unless it is a whole number that fits 64 bits with a sign.
  [[nodiscard]] std::optional<std::int64_t> integer() const noexcept;

  /// The number of values in an array, or of members in an object; otherwise 0.
  [[nodiscard]] std::size_t size() const noexcept;
  /// The values of an array; empty for any other kind.
  [[nodiscard]] std::span<const Json> elements() const noexcept;
  /// A value of an array. @throws std::out_of_range  when there is none at this index.
  Json& operator[](std::size_t index);
  const Json& operator[](std::size_t index) const;
  /// The member of this name. A missing one is added, and null becomes an object.
  /// @throws std::invalid_argument  when this is neither null nor an object.
  Json& operator[](std::string_view key);
  /// The member of this name. @throws std::out_of_range  when there is none.
  const Json& operator[](std::string_view key) const;
  /// The member of this name, or a null pointer.
  [[nodiscard]] const Json* Find(std::string_view key) const noexcept;

  /// Adds a value to an array; null becomes one.
  /// @throws std::invalid_argument  when this is neither null nor an array.
  void Append(Json value);
  /// Takes over the members of another object. Those of the same name are replaced.
  void Merge(const Json& other);

  /// The value as text: one value a line, indented by so many blanks for each level, or everything
  /// in one line when `indent` is negative. A number has the shortest text that reads back the
  /// same. Numbers that are not finite become null, and bytes that are not UTF-8 the replacement
  /// character.
  [[nodiscard]] std::string Dump(int indent) const;
  /// The value of a text; empty when the text is not JSON, or nested deeper than 100 levels.
  static std::optional<Json> Parse(std::string_view text);

  /// Compares numbers by value, and objects with the order of their members.
  friend bool operator==(const Json& a, const Json& b);
  /// Writes the value in one line.
  friend std::ostream& operator<<(std::ostream& stream, const Json& json);

 private:
  /// A value that the templates hand to a constructor that is compiled once.
  struct Scalar {
    enum Kind : std::uint8_t { kBoolean, kWhole, kLarge, kReal } kind = kBoolean;
    bool boolean = false;
    std::int64_t whole = 0;
    std::uint64_t large = 0;  ///< A number above the largest with a sign.
    double real = 0;
  };
  explicit Json(const Scalar& scalar);

  struct Member;
  struct Writer;
  using Elements = std::vector<Json>;
  using Members = std::vector<Member>;

  std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double, std::string, Elements,
               Members>
      value_;
};

}  // namespace tumbler
