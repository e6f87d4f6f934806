#pragma once

#include <string>

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

/// The number of a TOML text. The same parameters and errors.
double NumberAt(const std::string& text, const std::string& name, const std::string& path);

}  // namespace tumbler
