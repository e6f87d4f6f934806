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
#include <utility>
#include <vector>

namespace tumbler {

/// A file that cannot be used. The message reads `FILE:LINE: KEY: what is wrong, what is allowed`.
class FileError : public std::runtime_error {
 public:
  FileError(const std::string& file, std::uint32_t line, const std::string& key,
            const std::string& problem);
};

/// The values that a number in a file may have. NaN and infinities are never allowed.
struct Range {
  double min = -std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::max();
  bool min_excluded = false;  ///< E.g. {0, 10, true} is 0 < x <= 10.

  static constexpr Range Any() { return {}; }
  static constexpr Range Positive() { return {0, std::numeric_limits<double>::max(), true}; }
  static constexpr Range NonNegative() { return {0, std::numeric_limits<double>::max(), false}; }
};

/// A TOML table that is read strictly: every value is checked for type and range when it is asked
/// for, and a key that nobody asked for is an error. All members throw FileError.
class TomlTable {
 public:
  /// Parses a file. When it is missing, unreadable or malformed, the error names file and line.
  static TomlTable ParseFile(const std::string& path);
  /// Parses a text. @param name  stands for the file in messages.
  static TomlTable Parse(std::string_view text, const std::string& name);

  [[nodiscard]] bool Has(std::string_view key) const;
  /// Notes that a list of keys which is read of the table has the key, whether or not it can be
  /// here: no message takes it for another one that was misspelt.
  void Expect(std::string_view key) const;
  /// Whether the value of the key is a table, for values that may be a table or something else.
  [[nodiscard]] bool IsTable(std::string_view key) const;

  /// Values that must be there.
  double Number(std::string_view key, Range range);
  std::int64_t Integer(std::string_view key, std::int64_t min, std::int64_t max);
  bool Boolean(std::string_view key);
  std::string String(std::string_view key);
  std::vector<double> Numbers(std::string_view key, Range range);  ///< An array of any length.
  std::vector<double> Numbers(std::string_view key, Range range, std::size_t count);
  std::vector<std::string> Strings(std::string_view key);
  std::vector<std::vector<std::string>> StringLists(std::string_view key);  ///< An array of arrays.
  TomlTable Table(std::string_view key);
  std::vector<TomlTable> Tables(std::string_view key);  ///< An array of tables.
  /// @param what_to_write  for the message where there are none.
  std::vector<TomlTable> Tables(std::string_view key, const std::string& what_to_write);

  /// Values that may be left out, with their defaults.
  double Number(std::string_view key, Range range, double absent);
  std::int64_t Integer(std::string_view key, std::int64_t min, std::int64_t max,
                       std::int64_t absent);
  bool Boolean(std::string_view key, bool absent);
  std::string String(std::string_view key, const std::string& absent);
  /// One of the names in `allowed`, which the error lists. An empty `absent` stands for no default.
  std::string Choice(std::string_view key, std::span<const std::string_view> allowed,
                     const std::string& absent);
  std::optional<TomlTable> OptionalTable(std::string_view key);
  std::vector<TomlTable> OptionalTables(std::string_view key);

  /// Throws when a key of this table, or of a table taken from it, was never asked for. The error
  /// names the key that was probably meant. To be called when everything has been read.
  void RejectUnknownKeys() const;

  /// Throws an error about a key of this table, or about the table itself when it has no such key.
  [[noreturn]] void Fail(std::string_view key, const std::string& problem) const;
  [[nodiscard]] std::uint32_t LineOf(std::string_view key) const;

  /// The keys of the table in the order of the file's lines, for tables whose keys are names, such
  /// as those of joints.
  [[nodiscard]] std::vector<std::string> Keys() const;

  /// Everything in this table as a text that does not depend on comments, white space, the order of
  /// keys or the notation of numbers: a line `PATH = VALUE` for each key and each entry of an
  /// array, keys in the order of their bytes. The VALUE of a whole number below 2^63 is in decimal,
  /// and that of any other number 0x and the 16 hexadecimal digits of its double (IEEE 754); a text
  /// has its length in bytes before it, as in 3:abc; an array is [N] and a table {N}, for N
  /// entries.
  /// @param without  a key of this table that is left out.
  [[nodiscard]] std::string CanonicalText(std::string_view without) const;

  [[nodiscard]] const std::string& file() const;
  [[nodiscard]] const std::string& path() const;  ///< E.g. `contact.ground`; empty at the top.

 private:
  class Place;
  explicit TomlTable(std::shared_ptr<const Place> place);

  std::shared_ptr<const Place> place_;  ///< The document, and the table in it. Copies share it.
};

/// Larger files than this are not read [bytes]. It is a thousand times the largest useful file, and
/// ends the reading of a device that never ends.
inline constexpr std::size_t kLargestFile = 16U << 20U;

/// Reads a whole file. @throws FileError  when it cannot be read, or is too large.
std::string ReadTextFile(const std::string& path);

/// Returns the text of a file for loaders of several files. It may take the text from elsewhere
/// than a disk, or note what is read. Throws FileError when it has no such file.
using FileReader = std::function<std::string(const std::string& path)>;

/// The shortest decimal text that reads back as exactly `value`, always recognisable as a TOML
/// float.
std::string ExactDecimal(double value);

/// A number for messages, with up to 6 significant digits.
std::string MessageNumber(double value);

/// Two numbers for a message, with as many digits as it takes to look different if they are.
std::pair<std::string, std::string> DistinctNumbers(double a, double b);

}  // namespace tumbler
