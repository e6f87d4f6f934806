#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tumbler {

/// A TOML text in which one number has another value; everything else, comments too, stays as it
/// is, and on its line.
/// @param name  stands for the file in messages.
/// @param path  of the number, with dots: `contact.mu`; an entry of an array by its number from 0:
///              `obstacle.0.normal.1`.
/// @param value  finite. Written as a whole number where one was and it is whole.
/// @throws FileError  when the text is not TOML, or has no number there.
std::string WithNumber(const std::string& text, const std::string& name, const std::string& path,
                       double value);

/// A TOML text with these of its top-level keys and tables only. Comments go, and so does the
/// order.
/// @throws FileError  when the text is not TOML.
std::string WithOnly(const std::string& text, const std::string& name,
                     std::span<const std::string_view> keys);

/// The number of a TOML text. The same parameters and errors.
double NumberAt(const std::string& text, const std::string& name, const std::string& path);

}  // namespace tumbler
