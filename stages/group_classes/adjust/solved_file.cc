#include "stages/group_classes/adjust/solved_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/base/blob.h"
#include "core/files/file.h"
#include "core/line/program_identity.h"

namespace cairn::group_classes {
namespace {

constexpr std::string_view kMagic("cairn solved 1\n\0", 16);

// A problem's hash, the solution with its size.
std::string RecordOf(const ContentHash& problem, std::string_view solution) {
  BlobWriter blob;
  WriteHash(problem, &blob);
  blob.UInt64(solution.size());
  blob.Bytes(solution);
  return blob.Take();
}

}  // namespace

std::string SolvedPath(const std::string& output_path) { return output_path + ".solved"; }

SolvedFile::SolvedFile(std::string path) : path_(std::move(path)) {
  if (!ProgramIdentity().empty()) Open();
}

void SolvedFile::Open() {
  const int descriptor = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (descriptor < 0) return GiveUp("cannot be opened", errno);
  file_ = std::make_unique<FileLock>(descriptor);
  if (file_->Try(FileLock::Kind::kExclusive) == FileLock::Claim::kTaken)
    return GiveUp("belongs to another run that is going on", 0);
  const Result<std::string> bytes = ReadFile(path_);
  if (!bytes.ok()) return GiveUp("cannot be read", 0);
  BlobWriter blob;
  blob.Bytes(kMagic);
  blob.ZeroTerminated(ProgramIdentity());
  const std::string head = blob.Take();
  Read(*bytes, head);
  if (ftruncate(descriptor, static_cast<off_t>(num_good_bytes_)) != 0 || lseek(descriptor, 0, SEEK_END) < 0)
    return GiveUp("cannot be written", errno);
  if (num_good_bytes_ == 0) Write(head);
}

void SolvedFile::Read(const std::string& bytes, const std::string& head) {
  if (bytes.empty()) return;
  if (!bytes.starts_with(head)) {
    spdlog::info("{}: of another program, or no file of solved adjustments; all are solved anew", path_);
    return;
  }
  num_good_bytes_ = head.size();
  while (num_good_bytes_ < bytes.size()) {
    BlobReader reader(std::string_view(bytes).substr(num_good_bytes_));
    const ContentHash problem = ReadHash(&reader);
    const uint64_t size = reader.UInt64();
    const std::string_view solution = size <= reader.num_left() ? reader.Bytes(size) : std::string_view();
    const ContentHash check = ReadHash(&reader);
    const std::string record = RecordOf(problem, solution);
    if (!reader.ok() || solution.size() != size || check != HashContents(record)) {
      spdlog::info("{}: damaged or cut off after {} solved adjustments; what follows is solved anew", path_,
                   found_.size());
      break;
    }
    found_.emplace(problem, solution);
    num_good_bytes_ += record.size() + sizeof(check);
  }
  if (!found_.empty())
    spdlog::info("{}: goes on where an earlier run stood, after {} adjustments", path_, found_.size());
}

std::optional<std::string> SolvedFile::Find(const ContentHash& problem) const {
  const auto found = found_.find(problem);
  if (found == found_.end()) return std::nullopt;
  return found->second;
}

void SolvedFile::Add(const ContentHash& problem, const std::string& solution) {
  std::string record = RecordOf(problem, solution);
  BlobWriter blob;
  WriteHash(HashContents(record), &blob);
  record += blob.Take();
  const std::lock_guard lock(mutex_);
  if (file_ != nullptr) Write(record);
}

void SolvedFile::Write(const std::string& bytes) {
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t written = write(file_->descriptor(), bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const int error_number = errno;
      unlink(path_.c_str());  // its room is needed elsewhere
      return GiveUp("cannot be written", error_number);
    }
    done += static_cast<size_t>(written);
  }
  if (fdatasync(file_->descriptor()) != 0 && errno != EINVAL) GiveUp("cannot be synced", errno);
}

void SolvedFile::Remove() {
  if (file_ == nullptr) return;
  unlink(path_.c_str());
  file_.reset();
}

void SolvedFile::GiveUp(const std::string& what, int error_number) {
  spdlog::warn("{}: {}{}{}; a run that is stopped will begin anew", path_, what,
               error_number != 0 ? ": " : "", error_number != 0 ? std::strerror(error_number) : "");
  file_.reset();
}

}  // namespace cairn::group_classes
