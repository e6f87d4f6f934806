#include "common/files/result_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <system_error>
#include <utility>

#include "common/files/held_results.h"

namespace tumbler {
namespace {

constexpr const char* kWouldReplace =
    "is not a regular file, and it would be replaced by one; leave the option out to write none";

std::string SystemMessage(int error) { return std::generic_category().message(error); }

[[noreturn]] void FailWrite(const std::string& path, const std::string& why) {
  throw FileError(path, 0, "", fmt::format("cannot be written: {}", why));
}

/// Whether a file is there that is no text: flight records, MCAP and LCM logs have zeros within
/// their first bytes.
bool IsOfBytes(const std::string& path) {
  std::array<char, 256> begin{};
  std::ifstream stream(path, std::ios::binary);
  stream.read(begin.data(), begin.size());
  return std::find(begin.begin(), begin.begin() + stream.gcount(), '\0') !=
         begin.begin() + stream.gcount();
}

[[noreturn]] void FailOfBytes(const std::string& path) {
  throw FileError(path, 0, "",
                  "is there, and no text, so that it is hardly a result of before; give another "
                  "name, or delete it");
}

/// The name without symbolic links, of a file that need not be there yet.
std::filesystem::path Canonical(const std::string& path) {
  std::error_code error;
  std::filesystem::path canonical = std::filesystem::weakly_canonical(path, error);
  if (error) FailWrite(path, error.message());
  return canonical;
}

/// Beside the file, and of this process alone, so that two programs can write to one folder.
std::string TemporaryName(const std::filesystem::path& path) {
  return fmt::format("{}.{}.tmp", path.string(), getpid());
}

}  // namespace

bool IsDevice(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  return std::filesystem::exists(status) && !std::filesystem::is_regular_file(status) &&
         !std::filesystem::is_directory(status);
}

namespace {

/// The folder itself, or the nearest one above it that is there.
std::filesystem::path NearestThere(std::filesystem::path folder) {
  std::error_code error;
  while (!std::filesystem::exists(folder, error) && folder != folder.root_path())
    folder = folder.parent_path();
  return folder;
}

constexpr mode_t kAllMayReadAndWrite = 0666;  // less what the user's mask takes away

/// Opens a file without a name in the folder, which is gone when it is closed or its program ends.
/// @returns its descriptor, or -1 with `errno` set; EOPNOTSUPP where the file system has none.
int OpenNameless(const std::filesystem::path& folder) {
  return open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, kAllMayReadAndWrite);
}

/// The name by which this program opens what it has open.
std::string NameOfOpen(int descriptor) { return fmt::format("/proc/self/fd/{}", descriptor); }

/// Waits until what was written to a file has reached its file system, as a network's or one with
/// quotas refuses it only then, or when the file is closed by whoever wrote it.
/// @returns an error number; 0: it has.
int AwaitWritten(int descriptor) {
  while (fsync(descriptor) != 0) {
    if (errno == EINVAL) return 0;  // of a file system that knows no such thing
    if (errno != EINTR) return errno;
  }
  return 0;
}

/// Makes a file to find out whether the folder can be written: permissions tell nothing about a
/// file system that is mounted read-only, or to the super-user. A program that is ended meanwhile
/// leaves nothing behind where files may have no name.
void ProbeFolder(const std::filesystem::path& folder, const std::string& path) {
  int probe = OpenNameless(folder);
  if (probe < 0 && (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)) {
    const std::filesystem::path named = folder / fmt::format(".tumbler.{}.tmp", getpid());
    probe = open(named.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, kAllMayReadAndWrite);
    if (probe >= 0) unlink(named.c_str());
  }
  const int why = errno;
  if (probe < 0) FailWrite(path, fmt::format("{}: {}", folder.string(), SystemMessage(why)));
  close(probe);
}

/// Checks that a file can be written in the folder, or in the nearest one above it that is there.
/// @param path  the name for the message.
void CheckFolderWritable(const std::filesystem::path& folder, const std::string& path) {
  std::error_code error;
  const std::filesystem::path existing = NearestThere(folder);
  if (!std::filesystem::is_directory(existing, error))
    FailWrite(path, fmt::format("{} is not a folder", existing.string()));
  ProbeFolder(existing, path);
}

}  // namespace

PendingPlace::PendingPlace(const std::string& path)
    : path_(std::filesystem::absolute(Canonical(path))), temporary_(TemporaryName(path_)) {
  std::error_code error;
  std::filesystem::path folder = path_.parent_path();
  for (; !std::filesystem::exists(folder, error) && folder != folder.root_path();
       folder = folder.parent_path()) {
    made_.push_back(folder);
  }
  MakeFolderOf(path);
}

std::error_code PendingPlace::Move() {
  std::error_code error;
  std::filesystem::rename(temporary_, path_, error);
  return error;
}

void PendingPlace::Commit() {
  if (const std::error_code error = Move()) FailWrite(path_.string(), error.message());
  Keep();
  temporary_.clear();  // which another file may have now
}

void PendingPlace::Discard() {
  std::error_code error;
  std::filesystem::remove(temporary_, error);
  // Only folders without a file go.
  for (const std::filesystem::path& folder : made_) std::filesystem::remove(folder, error);
}

PendingFile::PendingFile(const std::string& path, const std::string& text) : place_(path) {
  if (IsDevice(path)) throw FileError(path, 0, "", kWouldReplace);
  if (text.find('\0') == std::string::npos && IsOfBytes(path)) FailOfBytes(path);
  errno = 0;
  std::ofstream stream(place_.temporary(), std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) FailWrite(path, SystemMessage(errno));
}

PendingFiles::~PendingFiles() {
  // The first made the folders, which have to be empty to go.
  while (!files_.empty()) files_.pop_back();
}

void PendingFiles::Commit() {
  std::error_code error;
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> kept;  // where it was, is
  const auto put_back = [&](const PendingFile& last) {
    for (const PendingFile& file : files_) {
      if (&file == &last) break;
      std::filesystem::remove(file.place_.path(), error);
    }
    for (const auto& [path, keeps] : kept) {
      std::filesystem::rename(keeps, path, error);
      std::filesystem::remove(keeps, error);  // still there where both names were of one file
    }
  };
  for (PendingFile& file : files_) {
    std::error_code why;
    const std::filesystem::path& path = file.place_.path();
    if (std::filesystem::is_regular_file(path, error)) {
      const std::filesystem::path keeps = file.place_.temporary().string() + ".before";
      std::filesystem::remove(keeps, error);
      std::filesystem::create_hard_link(path, keeps, why);
      if (why) std::filesystem::rename(path, keeps, why);  // a file system without links
      if (!why) kept.emplace_back(path, keeps);
    }
    if (!why) why = file.place_.Move();
    if (!why) continue;
    put_back(file);
    FailWrite(path.string(), why.message());
  }
  for (PendingFile& file : files_) file.place_.Keep();
  for (const auto& [path, keeps] : kept) std::filesystem::remove(keeps, error);
}

PendingName::PendingName(const std::string& path) : to_open_(path) {
  if (IsDevice(path)) return;
  CheckWritable(path);
  place_.emplace(path);
  nameless_ = OpenNameless(place_->path().parent_path());
  to_open_ = nameless_ < 0 ? place_->temporary().string() : NameOfOpen(nameless_);
}

PendingName::~PendingName() {
  if (nameless_ >= 0) close(nameless_);
}

void PendingName::Commit() {
  if (!place_) return;
  const int written = nameless_ >= 0 ? nameless_ : open(to_open_.c_str(), O_WRONLY | O_CLOEXEC);
  int why = written < 0 ? errno : AwaitWritten(written);
  if (written >= 0 && written != nameless_ && close(written) != 0 && why == 0) why = errno;
  if (why != 0) FailWrite(place_->path().string(), SystemMessage(why));
  if (nameless_ >= 0) {
    const char* const temporary = place_->temporary().c_str();
    unlink(temporary);  // one of a program that was ended here, by the same number
    if (linkat(AT_FDCWD, to_open_.c_str(), AT_FDCWD, temporary, AT_SYMLINK_FOLLOW) != 0)
      FailWrite(place_->path().string(), SystemMessage(errno));
  }
  place_->Commit();
}

void WriteResult(const std::string& path, const std::string& text) {
  const bool standard = path == "-";
  if (!standard && !IsDevice(path)) {
    PendingFile(path, text).Commit();
    return;
  }
  std::FILE* const file = standard ? stdout : std::fopen(path.c_str(), "w");
  if (file == nullptr) FailWrite(path, SystemMessage(errno));
  errno = 0;
  bool whole = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  whole = std::fflush(file) == 0 && whole;
  const int why = errno;
  if (!standard) std::fclose(file);
  if (!whole) FailWrite(standard ? "standard output" : path, SystemMessage(why));
}

void MakeFolderOf(const std::string& path) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::absolute(Canonical(path)).parent_path();
  std::filesystem::create_directories(folder, error);
  if (error) FailWrite(path, fmt::format("{}: {}", folder.string(), error.message()));
}

void CheckWritable(const std::string& path) {
  if (path.ends_with('/'))
    throw FileError(path, 0, "", "is the name of a folder; give that of a file, without '/'");
  std::error_code error;
  const std::filesystem::path target = Canonical(path);
  if (std::filesystem::is_directory(target, error))
    throw FileError(path, 0, "", "is a directory, not a file");
  const bool exists = std::filesystem::exists(target, error);
  if (exists && !std::filesystem::is_regular_file(target, error)) {
    throw FileError(path, 0, "", kWouldReplace);
  }
  if (exists && access(target.c_str(), W_OK) != 0) FailWrite(path, SystemMessage(errno));
  CheckFolderWritable(std::filesystem::absolute(target).parent_path(), path);
}

void CheckTextFile(const std::string& path) {
  CheckWritable(path);
  if (IsOfBytes(path)) FailOfBytes(path);
}

void CheckFolderWritable(const std::string& path) {
  if (path == "-") {
    throw FileError(path, 0, "",
                    "a folder cannot be written to standard output; './-' is a folder");
  }
  CheckFolderWritable(std::filesystem::absolute(path), path);
}

WriterLock::WriterLock(const std::string& path) {
  if (IsDevice(path)) return;
  MakeFolderOf(path);
  file_ = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (file_ < 0) FailWrite(path, SystemMessage(errno));
  if (flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;  // or has no locks
  close(file_);
  throw FileError(path, 0, "", kWrittenByAnother);
}

WriterLock::~WriterLock() {
  if (file_ >= 0) close(file_);
}

void CheckResult(const std::string& path) {
  if (!path.empty() && path != "-" && !IsDevice(path)) CheckTextFile(path);
}

namespace {

/// Whether two names are of the same file, or would be when it is made.
bool SameFile(const std::string& a, const std::string& b) {
  std::error_code error;
  if (IsDevice(a)) return false;
  return PlaceOf(a) == PlaceOf(b) || std::filesystem::equivalent(a, b, error);
}

/// Whether a file would have to be a folder with another one in it.
bool Holds(const std::string& folder, const std::string& file) {
  const std::filesystem::path outer = PlaceOf(folder), inner = PlaceOf(file);
  const auto [end, rest] = std::ranges::mismatch(outer, inner);
  return end == outer.end() && rest != inner.end();
}

}  // namespace

void CheckDistinct(const std::vector<std::string>& inputs,
                   const std::vector<std::string>& outputs) {
  const auto is_file = [](const std::string& name) { return !name.empty() && name != "-"; };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (!is_file(outputs[i])) continue;
    for (const std::string& input : inputs) {
      if (is_file(input) && SameFile(outputs[i], input))
        throw FileError(outputs[i], 0, "", "is an input; results need a file of their own");
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (is_file(outputs[k]) && SameFile(outputs[i], outputs[k]))
        throw FileError(outputs[i], 0, "", "is named for two results; each needs its own file");
      if (!is_file(outputs[k])) continue;
      for (const auto& [outer, inner] : {std::pair(i, k), std::pair(k, i)}) {
        if (Holds(outputs[outer], outputs[inner])) {
          throw FileError(
              outputs[inner], 0, "",
              fmt::format("lies in '{}', which is a result, too, and no folder; give it "
                          "another folder",
                          outputs[outer]));
        }
      }
    }
  }
}

FileReader NotingReader(std::vector<std::string>& inputs) {
  return [&inputs](const std::string& path) {
    inputs.push_back(path);
    return ReadTextFile(path);
  };
}

}  // namespace tumbler
