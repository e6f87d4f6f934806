#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

/// A file that cannot be used. The message reads `FILE:LINE: KEY: what is wrong, what is allowed`.
class FileError : public std::runtime_error {
 public:
  FileError(const std::string& file, std::uint32_t line, const std::string& key,
            const std::string& problem);
};

/// Values that a number in a file may take. NaN and infinities never are.
struct Range {
  double min = -std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::max();
  bool min_excluded = false;  ///< e.g. {0, 10, true} is 0 < x <= 10.

  static constexpr Range Any() { return {}; }
  static constexpr Range Positive() { return {0, std::numeric_limits<double>::max(), true}; }
  static constexpr Range NonNegative() { return {0, std::numeric_limits<double>::max(), false}; }
};

/// A TOML table that is read strictly: every value is checked for type and range as it is taken,
/// and a key that nobody took is an error. All members throw FileError.
class TomlTable {
 public:
  /// Parses a file; the error of a missing, unreadable or malformed one names the file and the
  /// line.
  static TomlTable ParseFile(const std::string& path);
  /// Parses text; `name` stands for the file in messages.
  static TomlTable Parse(std::string_view text, const std::string& name);

  [[nodiscard]] bool Has(std::string_view key) const;
  /// Whether the key holds a table, for values that may be one or a number.
  [[nodiscard]] bool IsTable(std::string_view key) const;

  /// Required values.
  double Number(std::string_view key, Range range);
  std::int64_t Integer(std::string_view key, std::int64_t min, std::int64_t max);
  bool Boolean(std::string_view key);
  std::string String(std::string_view key);
  std::vector<double> Numbers(std::string_view key, Range range);  ///< An array of any length.
  std::vector<double> Numbers(std::string_view key, Range range, std::size_t count);
  std::vector<std::string> Strings(std::string_view key);
  std::vector<std::vector<std::string>> StringLists(std::string_view key);  ///< An array of such.
  TomlTable Table(std::string_view key);
  std::vector<TomlTable> Tables(std::string_view key);  ///< An array of tables.

  /// Values with a default.
  double Number(std::string_view key, Range range, double absent);
  std::int64_t Integer(std::string_view key, std::int64_t min, std::int64_t max,
                       std::int64_t absent);
  bool Boolean(std::string_view key, bool absent);
  std::string String(std::string_view key, const std::string& absent);
  /// One of `allowed`; the error lists them.
  std::string Choice(std::string_view key, std::span<const std::string_view> allowed,
                     const std::string& absent);
  std::optional<TomlTable> OptionalTable(std::string_view key);
  std::vector<TomlTable> OptionalTables(std::string_view key);

  /// Throws if a key of this table, or of a table taken from it, was never asked for, and names the
  /// one that was probably meant. Call when all is read.
  void RejectUnknownKeys() const;

  /// Throws about `key` of this table (or about the table itself when the key is not in it).
  [[noreturn]] void Fail(std::string_view key, const std::string& problem) const;
  [[nodiscard]] std::uint32_t LineOf(std::string_view key) const;

  /// The keys of the table in the file's order of lines, for tables whose keys are names (joints).
  [[nodiscard]] std::vector<std::string> Keys() const;

  [[nodiscard]] const std::string& file() const;
  [[nodiscard]] const std::string& path() const;  ///< e.g. `contact.ground`; empty at the top.

 private:
  class Place;
  explicit TomlTable(std::shared_ptr<const Place> place);

  std::shared_ptr<const Place> place_;  ///< Which table of which document. Copies share it.
};

/// Larger files than this are not read [bytes]: a thousand times the largest that is of use, and
/// the end of what never ends, such as a device.
inline constexpr std::size_t kLargestFile = 16U << 20U;

/// The whole of a file. @throws FileError when there is none to read, or it is too large.
std::string ReadTextFile(const std::string& path);

/// Where loaders of several files get their texts from, by path: elsewhere than on a disk, or from
/// there with somebody looking on. Throws FileError when it has none.
using FileReader = std::function<std::string(const std::string& path)>;

/// The shortest decimal text that reads back as exactly `value`, always recognisable as a TOML
/// float.
std::string ExactDecimal(double value);

/// A number as it belongs in a message: up to 6 significant digits.
std::string MessageNumber(double value);

}  // namespace tumbler
