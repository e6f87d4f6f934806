#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace tumbler {

/// Writes the text of a TOML file, line by line. Everything reads back exactly: doubles bit for
/// bit, texts byte for byte. All members but `Line` throw std::invalid_argument, naming the key,
/// when TOML cannot hold a value.
class TomlWriter {
 public:
  /// @param holder  the name for the file in messages, e.g. `a primitive`.
  explicit TomlWriter(std::string holder) : holder_(std::move(holder)) {}

  void Line(std::string_view line) { (text_ += line) += '\n'; }
  void Number(std::string_view key, double value);
  void Numbers(std::string_view key, std::span<const double> values);
  void Text(std::string_view key, std::string_view value);
  void Texts(std::string_view key, std::span<const std::string> values);
  /// A text of several lines, written so that people can read it in the file.
  void LongText(std::string_view key, std::string_view value);

  /// Returns the text written so far, and empties the writer.
  std::string Take() { return std::move(text_); }

 private:
  std::string holder_;
  std::string text_;
};

}  // namespace tumbler
