#pragma once

#include <string>
#include <string_view>

#include "firmware_interface/devices/drives_toml.h"

namespace tumbler {

/// The text of a drives file, done or half done, that changes as its drives become known. Comments
/// and everything that is not changed stay as they are.
class DrivesDraft {
 public:
  /// @param name  of the file, for messages.
  /// @throws FileError  when it cannot be read as a drives file.
  DrivesDraft(std::string text, std::string name);

  [[nodiscard]] const DrivesConfig& config() const { return config_; }
  [[nodiscard]] const std::string& text() const { return text_; }

  /// Changes keys of the drive of this index, whose order stays. `Check` has to follow.
  void SetText(std::size_t drive, std::string_view key, std::string_view value);
  void SetNumber(std::size_t drive, std::string_view key, double value);
  void SetInteger(std::size_t drive, std::string_view key, int value);
  /// Says at the head of the text how far it is right, in a comment in place of an earlier one.
  void SetNote(std::string_view note);
  /// Writes the key that keeps the file from being used, in place of an earlier one.
  /// @param what  is left to do; empty: nothing, and the key goes.
  void SetUnfinished(std::string_view what);
  /// The text for a file at another place: paths of data sheets (`eds`) lead from there to the
  /// same.
  [[nodiscard]] std::string TextFor(const std::string& path) const;
  /// Reads the whole again. @throws FileError  when it cannot be read as a drives file.
  void Check();

 private:
  [[nodiscard]] DrivesConfig Parsed() const;
  void Set(std::size_t drive, std::string_view key, const std::string& value);

  std::string name_;
  std::string text_;
  DrivesConfig config_;
};

}  // namespace tumbler
