#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/files/toml_reader.h"

namespace tumbler {

/// The parts of a FileError's message `FILE:LINE: KEY: what is wrong`.
struct FileErrorParts {
  std::string file;
  std::optional<std::uint32_t> line;
  std::optional<std::string> key;
};

/// Takes the message of a FileError apart. Of several places at which the file's name might end, it
/// is the one behind `path`, else the one up to which the text names something that exists, or else
/// the first.
/// @param path  of the file that was to be read, which may have named the one that is at fault.
FileErrorParts PartsOf(std::string_view message, std::string_view path);

/// An error in reading a file that Python named.
struct ReadingError {
  std::string message;
  std::string path;
};

/// What `read` returns. @throws ReadingError  in place of a FileError.
template <typename Read>
auto Reading(const std::string& path, const Read& read) {
  try {
    return read(path);
  } catch (const FileError& error) {
    throw ReadingError{error.what(), path};
  }
}

}  // namespace tumbler
