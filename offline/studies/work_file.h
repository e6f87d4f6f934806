#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "common/files/result_file.h"

namespace tumbler {

/// The lines in which a long work keeps what it has found, a JSON object each, so that a work that
/// was ended goes on where it was. The first line of the file says which work it is.
class WorkFile {
 public:
  /// What the work is: files of another kind, version or identity are refused.
  struct Work {
    std::string format;    ///< In the first line.
    int version = 1;       ///< Likewise.
    std::string identity;  ///< Likewise: a hash of everything that the result depends on.
    std::string program;   ///< Whose file it is, for messages.
    std::string differs;   ///< What makes the identity another, for messages.
  };

  /// The lines of a file behind its first. A last line without a line feed was being written when
  /// the program ended, and does not count.
  /// @throws FileError  when the file cannot be read, or is about another work.
  static std::string Read(const std::string& path, const Work& work);

  /// Opens a file for more lines, and makes it where it is missing. A broken last line is taken
  /// away. Until its end no other program may open it so: what two wrote would be mixed.
  /// @param lines  gets what Read would return. @throws FileError  as Read, and when another
  /// program
  ///               has it open.
  WorkFile(const std::string& path, const Work& work, std::string& lines);
  /// Adds lines, which are on disk when this returns. @throws FileError
  void Add(const std::string& lines);

 private:
  std::string path_;
  std::unique_ptr<WriterLock> lock_;
};

}  // namespace tumbler
