#include "core/files/temporary.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include <fmt/format.h>

#include "core/files/output_path.h"
#include "core/files/write_error.h"

namespace cairn {
namespace {

constexpr std::string_view kTemporaryMark = ".tmp-";
// Tries of names that are already taken before giving up: more than can happen by chance.
constexpr int kMaxNumTries = 100;

}  // namespace

std::string TemporaryPath(const std::string& target) {
  return fmt::format("{}{}{}", target, kTemporaryMark, getpid());
}

std::string RandomTemporaryPath(const std::string& target) {
  uint64_t number = 0;  // if the system gives none: a caller that finds the name taken tries again or fails
  (void)!getrandom(&number, sizeof(number), 0);
  return fmt::format("{}-{:016x}", TemporaryPath(target), number);
}

bool IsTemporaryName(const std::string& name, const std::string& target) {
  const size_t mark = target.empty() ? name.rfind(kTemporaryMark) : target.size();
  if (mark == std::string::npos || name.compare(0, target.size(), target) != 0 ||
      name.compare(mark, kTemporaryMark.size(), kTemporaryMark) != 0) {
    return false;
  }
  const size_t digits = mark + kTemporaryMark.size();
  const size_t end = std::min(name.find_first_not_of("0123456789", digits), name.size());
  return end > digits && (end == name.size() || name[end] == '-' ||
                          name.compare(end, kTemporaryMark.size(), kTemporaryMark) == 0);
}

std::vector<std::string> TemporariesOf(const std::string& target) {
  const std::filesystem::path path(target);
  const std::string name = path.filename().string();
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(opendir(FolderOf(target).c_str()), &closedir);
  std::vector<std::string> temporaries;
  if (folder == nullptr) return temporaries;
  while (const dirent* const entry = readdir(folder.get())) {
    if (IsTemporaryName(entry->d_name, name)) temporaries.push_back(path.parent_path() / entry->d_name);
  }
  std::sort(temporaries.begin(), temporaries.end());
  return temporaries;
}

Result<TemporaryFile> CreateTemporary(const std::string& target, mode_t mode) {
  for (int i = 0; i < kMaxNumTries; ++i) {
    TemporaryFile file{.path = RandomTemporaryPath(target)};
    file.descriptor = open(file.path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
    if (file.descriptor >= 0) return file;
    if (errno != EEXIST) break;
  }
  return WriteError(target, "cannot be written: no file can be created beside it", errno);
}

Status ScratchFile::Append(const void* bytes, size_t num_bytes) {
  if (!file_) {
    CAIRN_ASSIGN_OR_RETURN(const TemporaryFile made, CreateTemporary(beside_, 0600));
    file_.emplace(made.descriptor);
    unlink(made.path.c_str());
  }
  if (!WriteAllAt(file_->get(), bytes, num_bytes, num_bytes_))
    return WriteError(beside_, "the file beside it, of what memory has no room for, cannot be written",
                      errno);
  num_bytes_ += num_bytes;
  return Ok();
}

Status ScratchFile::Read(uint64_t offset, void* bytes, size_t num_bytes) const {
  if (!ReadAllAt(file_ ? file_->get() : -1, bytes, num_bytes, offset))
    return WriteError(beside_, "the file beside it, of what memory has no room for, cannot be read", errno);
  return Ok();
}

}  // namespace cairn
