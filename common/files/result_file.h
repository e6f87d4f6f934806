#pragma once

#include <filesystem>
#include <list>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "common/files/toml_reader.h"

namespace tumbler {

/// The place of a file that appears under its name only when it is whole, and only by Commit. So a
/// reader never sees a part of it, and a failure before leaves nothing behind: folders, which are
/// made where there are none, are removed again. All results are written so.
class PendingPlace {
 public:
  /// An existing file is replaced where it is, also behind a symbolic link.
  /// @throws FileError  when the folder cannot be made.
  explicit PendingPlace(const std::string& path);
  ~PendingPlace() { Discard(); }
  PendingPlace(const PendingPlace&) = delete;
  PendingPlace& operator=(const PendingPlace&) = delete;

  /// Where the file will be, and where it is to be written before.
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] const std::filesystem::path& temporary() const { return temporary_; }

  /// Puts the file in place. @throws FileError  when that fails.
  void Commit();
  /// The same with a reason in place of an exception, and folders may still be removed.
  [[nodiscard]] std::error_code Move();
  /// Lets folders stay.
  void Keep() { made_.clear(); }
  /// Removes what was not put in place.
  void Discard();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_;
  std::vector<std::filesystem::path>
      made_;  // those above the file that were not there, inmost first
};

/// A file that is there at once, as a PendingPlace.
class PendingFile {
 public:
  /// @throws FileError  when it cannot be written, is a device, whose place no file may take, or is
  /// a file of bytes, such as a flight record, in whose place a text would be put.
  PendingFile(const std::string& path, const std::string& text);
  /// Puts the file in place. @throws FileError  when that fails.
  void Commit() { place_.Commit(); }

 private:
  friend class PendingFiles;
  PendingPlace place_;
};

/// Files that belong together: all of them appear under their names, or none.
class PendingFiles {
 public:
  PendingFiles() = default;
  ~PendingFiles();
  PendingFiles(const PendingFiles&) = delete;
  PendingFiles& operator=(const PendingFiles&) = delete;

  /// @throws FileError  as PendingFile does.
  void Add(const std::string& path, const std::string& text) { files_.emplace_back(path, text); }
  /// Puts all files in place. @throws FileError  when that fails for one of them: files that were
  /// there are there again as they were, and no other is. (A program that is ended meanwhile leaves
  /// some of the files, each of them whole.)
  void Commit();

 private:
  std::list<PendingFile> files_;
};

/// The same for a file that is written bit by bit by whoever opens it, in this program. Where the
/// file system has files without a name (all usual ones do), a program that is ended before Commit
/// leaves nothing behind. A device is opened by its own name, and takes what is written as it
/// comes.
class PendingName {
 public:
  /// @throws FileError  when no such file can be written.
  explicit PendingName(const std::string& path);
  ~PendingName();
  PendingName(const PendingName&) = delete;
  PendingName& operator=(const PendingName&) = delete;

  /// The name to open.
  [[nodiscard]] const std::string& to_open() const { return to_open_; }
  /// Puts the file in place, once it is closed or flushed, and all of it has reached the file
  /// system. @throws FileError  when that fails.
  void Commit();

 private:
  std::optional<PendingPlace> place_;  // of a device: none
  std::string to_open_;
  int nameless_ = -1;  // holds a file that has no name yet
};

/// Holds a file for one writer that writes it bit by bit under its own name: another program that
/// would do so at the same time is refused, before it has cut the file off.
class WriterLock {
 public:
  /// Makes the file and its folders, where they are not there; what is in it stays. Devices are not
  /// held.
  /// @throws FileError  when another program writes the file, or it cannot be written.
  explicit WriterLock(const std::string& path);
  ~WriterLock();
  WriterLock(const WriterLock&) = delete;
  WriterLock& operator=(const WriterLock&) = delete;

 private:
  int file_ = -1;
};

/// Writes a result of a program: to standard output for `-`, to a device as it comes, else as a
/// PendingFile. @throws FileError  when it cannot be written whole.
void WriteResult(const std::string& path, const std::string& text);

/// Whether a name is that of a device, a pipe or a socket, which is there and takes text as it
/// comes: nothing may be put in its place.
bool IsDevice(const std::string& path);

/// Makes the folder of a file that is about to be written, and those above it, where they are not
/// there. @throws FileError  when that fails.
void MakeFolderOf(const std::string& path);

/// These check before the work whether its result can be written: a file, or files in a folder. No
/// folder is made yet. @throws FileError  when they cannot be written.
void CheckWritable(const std::string& path);
void CheckFolderWritable(const std::string& path);
/// The same of a text, as a PendingFile, which does not take the place of a file of bytes, such as
/// a flight record: who names one has mistaken its name.
void CheckTextFile(const std::string& path);
/// The same of a text that WriteResult will write. Empty: nothing.
void CheckResult(const std::string& path);

/// Checks that no result would replace one of the inputs, or another result, by whatever names they
/// go. To be called before anything is changed. An empty name and `-`, which is standard output,
/// are no files; devices can be named more than once.
/// @throws FileError  about the first that would.
void CheckDistinct(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// A reader for loaders that appends the name of each file to `inputs`, which has to outlive it.
FileReader NotingReader(std::vector<std::string>& inputs);

}  // namespace tumbler
