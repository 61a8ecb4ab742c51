// A library to be preloaded: records the calls that change files of a folder, or sync them, in the order in
// which this process and its children make them.
//   LC_RECORD_FOLDER=DIR   with all links resolved
//   LC_RECORD_LOG=FILE     elsewhere; gets a RecordedCall for each of them  (LC_: compile passes these on to
//   stages)
// Each call is done and recorded while no other is.

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>
#include <string>
#include <vector>

#include "tests/recorded/recorded_call.h"

namespace {

using cairn::RecordedCall;

template <typename Function>
Function* Next(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}
#define NEXT(name) Next(static_cast<decltype(::name)*>(nullptr), #name)

const std::string& Folder() {
  static const std::string* const folder = [] {
    const char* value = std::getenv("LC_RECORD_FOLDER");
    return new std::string(value == nullptr ? "/none" : value);
  }();
  return *folder;
}

bool IsInFolder(const std::string& path) {
  return path.compare(0, Folder().size(), Folder()) == 0 &&
         (path.size() == Folder().size() || path[Folder().size()] == '/');
}

std::mutex mutex;

// The log, for as long as no other thread or process records.
class Log {
 public:
  Log() : lock_(mutex) {
    static int log = -1;
    static pid_t opened_by = -1;
    if (opened_by != getpid()) {  // a child has a lock of its own
      const char* path = std::getenv("LC_RECORD_LOG");
      log = static_cast<int>(
          syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
      opened_by = getpid();
    }
    log_ = log;
    flock(log_, LOCK_EX);
  }
  ~Log() {
    const int error = errno;
    flock(log_, LOCK_UN);
    errno = error;
  }

  void Write(RecordedCall call, const std::string& path, const char* other, size_t other_bytes) const {
    const int error = errno;
    timespec now = {};
    clock_gettime(CLOCK_REALTIME, &now);
    call.date_ns = now.tv_sec * int64_t{1000000000} + now.tv_nsec;
    call.path_bytes = static_cast<uint32_t>(path.size());
    call.other_bytes = other_bytes;
    const iovec parts[] = {{&call, sizeof(call)},
                           {const_cast<char*>(path.data()), path.size()},
                           {const_cast<char*>(other), other_bytes}};
    if (syscall(SYS_writev, log_, parts, 3) != static_cast<long>(sizeof(call) + path.size() + other_bytes))
      abort();
    errno = error;
  }
  void Write(RecordedCall call, const std::string& path, const std::string& other = "") const {
    Write(call, path, other.data(), other.size());
  }

 private:
  std::lock_guard<std::mutex> lock_;
  int log_;
};

std::string PathOf(int fd) {
  char link[64], path[PATH_MAX + 1] = {};
  std::snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
  const ssize_t size = syscall(SYS_readlinkat, AT_FDCWD, link, path, PATH_MAX);
  return size > 0 ? std::string(path, static_cast<size_t>(size)) : std::string();
}

// With the links of its folder resolved, not that of the file itself; "" where there is no such folder.
std::string Absolute(int folder, const char* path) {
  std::string full = path;
  if (full.empty() || full[0] != '/') full = PathOf(folder) + "/" + full;
  if (folder == AT_FDCWD && path[0] != '/') {
    char current[PATH_MAX] = {};
    if (syscall(SYS_getcwd, current, sizeof(current)) < 0) return "";
    full = std::string(current) + "/" + path;
  }
  while (full.size() > 1 && full.back() == '/') full.pop_back();
  const size_t slash = full.rfind('/');
  char resolved[PATH_MAX] = {};
  if (realpath(slash == 0 ? "/" : full.substr(0, slash).c_str(), resolved) == nullptr) return "";
  return std::string(resolved) + full.substr(slash);
}

uint64_t InodeOf(int fd) {
  struct stat status = {};
  return fstat(fd, &status) == 0 ? status.st_ino : 0;
}

// Whether it is a file of the folder, or the folder or one in it.
bool IsRecorded(int fd) { return IsInFolder(PathOf(fd)); }

bool IsFile(int fd) {
  struct stat status = {};
  return fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
}

// `open`: does it.
template <typename Open>
int RecordOpen(int folder, const char* path, int flags, const Open& open) {
  if ((flags & (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)) == 0) return open();
  const std::string full = Absolute(folder, path);
  if (!IsInFolder(full)) return open();
  const Log log;
  struct stat status = {};
  const bool was_there = stat(full.c_str(), &status) == 0;
  const int fd = open();
  if (fd >= 0 && IsFile(fd)) {
    const int64_t how = !was_there ? 1 : (flags & O_TRUNC) != 0 ? 2 : 0;
    log.Write({.kind = RecordedCall::kOpen, .inode = InodeOf(fd), .offset = how}, full);
  }
  return fd;
}

void RecordBytes(const Log& log, int fd, int64_t offset, const void* bytes, ssize_t size) {
  log.Write({.kind = RecordedCall::kWrite, .inode = InodeOf(fd), .offset = offset}, "",
            static_cast<const char*>(bytes), static_cast<size_t>(size));
}

// Where the next write goes.
int64_t OffsetOf(int fd) {
  if ((fcntl(fd, F_GETFL) & O_APPEND) != 0) {
    struct stat status = {};
    fstat(fd, &status);
    return status.st_size;
  }
  return lseek(fd, 0, SEEK_CUR);
}

// `write`: does it.
template <typename Write>
ssize_t RecordWrite(int fd, const void* bytes, int64_t offset, const Write& write) {
  if (!IsRecorded(fd) || !IsFile(fd)) return write();
  const Log log;
  if (offset < 0) offset = OffsetOf(fd);
  const ssize_t size = write();
  if (size > 0) RecordBytes(log, fd, offset, bytes, size);
  return size;
}

template <typename Write>
ssize_t RecordVector(int fd, const iovec* parts, int num_parts, int64_t offset, const Write& write) {
  std::string bytes;
  for (int i = 0; i < num_parts; ++i)
    bytes.append(static_cast<const char*>(parts[i].iov_base), parts[i].iov_len);
  return RecordWrite(fd, bytes.data(), offset, write);
}

// What another file's bytes were written to is read.
template <typename Copy>
ssize_t RecordCopy(int fd, int64_t offset, const Copy& copy) {
  if (!IsRecorded(fd) || !IsFile(fd)) return copy();
  const Log log;
  if (offset < 0) offset = OffsetOf(fd);
  const ssize_t size = copy();
  if (size <= 0) return size;
  std::vector<char> bytes(static_cast<size_t>(size));
  const std::string name = "/proc/self/fd/" + std::to_string(fd);
  const int again = static_cast<int>(syscall(SYS_openat, AT_FDCWD, name.c_str(), O_RDONLY | O_CLOEXEC));
  if (syscall(SYS_pread64, again, bytes.data(), bytes.size(), offset) != size) abort();
  syscall(SYS_close, again);
  RecordBytes(log, fd, offset, bytes.data(), size);
  return size;
}

// `call`: does it; 0 where it was done.
template <typename Call>
int RecordNames(RecordedCall::Kind kind, const std::string& path, const std::string& other,
                const Call& call) {
  if (!IsInFolder(path) && !IsInFolder(other)) return call();
  const Log log;
  const int done = call();
  if (done == 0) log.Write({.kind = kind}, path, other);
  return done;
}

template <typename Call>
int RecordOfFile(RecordedCall::Kind kind, int fd, int64_t offset, const Call& call) {
  if (!IsRecorded(fd)) return call();
  const Log log;
  const int done = call();
  if (done == 0)
    log.Write({.kind = kind, .inode = InodeOf(fd), .offset = offset}, IsFile(fd) ? "" : PathOf(fd));
  return done;
}

int64_t DateOf(const timespec* times) {
  timespec date = {};
  clock_gettime(CLOCK_REALTIME, &date);
  if (times != nullptr && times[1].tv_nsec == UTIME_OMIT) return -1;
  if (times != nullptr && times[1].tv_nsec != UTIME_NOW) date = times[1];
  return date.tv_sec * int64_t{1000000000} + date.tv_nsec;
}

int FlagsOf(const char* mode) {
  return mode[0] == 'r' && std::strchr(mode, '+') == nullptr ? 0
         : mode[0] == 'w'                                    ? O_WRONLY | O_TRUNC
                                                             : O_WRONLY;
}

}  // namespace

#define MODE_ARGUMENT                                   \
  mode_t mode = 0;                                      \
  if ((flags & O_CREAT) != 0) {                         \
    va_list arguments;                                  \
    va_start(arguments, flags);                         \
    mode = static_cast<mode_t>(va_arg(arguments, int)); \
    va_end(arguments);                                  \
  }

extern "C" {

int open(const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(open);
  return RecordOpen(AT_FDCWD, path, flags, [&] { return next(path, flags, mode); });
}

int open64(const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(open64);
  return RecordOpen(AT_FDCWD, path, flags, [&] { return next(path, flags, mode); });
}

int openat(int folder, const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(openat);
  return RecordOpen(folder, path, flags, [&] { return next(folder, path, flags, mode); });
}

int openat64(int folder, const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(openat64);
  return RecordOpen(folder, path, flags, [&] { return next(folder, path, flags, mode); });
}

int creat(const char* path, mode_t mode) { return open(path, O_CREAT | O_WRONLY | O_TRUNC, mode); }

FILE* fopen(const char* path, const char* mode) {
  static auto* const next = NEXT(fopen);
  FILE* file = nullptr;
  RecordOpen(AT_FDCWD, path, FlagsOf(mode), [&] {
    file = next(path, mode);
    return file == nullptr ? -1 : fileno(file);
  });
  return file;
}

FILE* fopen64(const char* path, const char* mode) { return fopen(path, mode); }

ssize_t write(int fd, const void* bytes, size_t size) {
  static auto* const next = NEXT(write);
  return RecordWrite(fd, bytes, -1, [&] { return next(fd, bytes, size); });
}

ssize_t pwrite(int fd, const void* bytes, size_t size, off_t offset) {
  static auto* const next = NEXT(pwrite);
  return RecordWrite(fd, bytes, offset, [&] { return next(fd, bytes, size, offset); });
}

ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t offset) {
  static auto* const next = NEXT(pwrite64);
  return RecordWrite(fd, bytes, offset, [&] { return next(fd, bytes, size, offset); });
}

ssize_t writev(int fd, const iovec* parts, int num_parts) {
  static auto* const next = NEXT(writev);
  return RecordVector(fd, parts, num_parts, -1, [&] { return next(fd, parts, num_parts); });
}

ssize_t pwritev(int fd, const iovec* parts, int num_parts, off_t offset) {
  static auto* const next = NEXT(pwritev);
  return RecordVector(fd, parts, num_parts, offset, [&] { return next(fd, parts, num_parts, offset); });
}

ssize_t sendfile(int out, int in, off_t* offset, size_t size) noexcept {
  static auto* const next = NEXT(sendfile);
  return RecordCopy(out, -1, [&] { return next(out, in, offset, size); });
}

ssize_t sendfile64(int out, int in, off64_t* offset, size_t size) noexcept {
  static auto* const next = NEXT(sendfile64);
  return RecordCopy(out, -1, [&] { return next(out, in, offset, size); });
}

ssize_t copy_file_range(int in, off64_t* in_offset, int out, off64_t* out_offset, size_t size,
                        unsigned flags) {
  static auto* const next = NEXT(copy_file_range);
  return RecordCopy(out, out_offset == nullptr ? -1 : *out_offset,
                    [&] { return next(in, in_offset, out, out_offset, size, flags); });
}

int ftruncate(int fd, off_t size) noexcept {
  static auto* const next = NEXT(ftruncate);
  return RecordOfFile(RecordedCall::kTruncate, fd, size, [&] { return next(fd, size); });
}

int ftruncate64(int fd, off64_t size) noexcept {
  static auto* const next = NEXT(ftruncate64);
  return RecordOfFile(RecordedCall::kTruncate, fd, size, [&] { return next(fd, size); });
}

int posix_fallocate(int, off_t, off_t) { return EOPNOTSUPP; }
int posix_fallocate64(int, off64_t, off64_t) { return EOPNOTSUPP; }

int fsync(int fd) {
  static auto* const next = NEXT(fsync);
  return RecordOfFile(RecordedCall::kSync, fd, 0, [&] { return next(fd); });
}

int fdatasync(int fd) {
  static auto* const next = NEXT(fdatasync);
  return RecordOfFile(RecordedCall::kSync, fd, 0, [&] { return next(fd); });
}

int syncfs(int fd) noexcept {
  static auto* const next = NEXT(syncfs);
  return RecordOfFile(RecordedCall::kSyncAll, fd, 0, [&] { return next(fd); });
}

int utimensat(int folder, const char* path, const timespec* times, int flags) noexcept {
  static auto* const next = NEXT(utimensat);
  const int fd = static_cast<int>(syscall(SYS_openat, folder, path, O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  const int done = fd < 0 ? next(folder, path, times, flags)
                          : RecordOfFile(RecordedCall::kSetDate, fd, DateOf(times),
                                         [&] { return next(folder, path, times, flags); });
  if (fd >= 0) syscall(SYS_close, fd);
  return done;
}

int futimens(int fd, const timespec* times) noexcept {
  static auto* const next = NEXT(futimens);
  return RecordOfFile(RecordedCall::kSetDate, fd, DateOf(times), [&] { return next(fd, times); });
}

int rename(const char* from, const char* to) noexcept {
  static auto* const next = NEXT(rename);
  return RecordNames(RecordedCall::kRename, Absolute(AT_FDCWD, from), Absolute(AT_FDCWD, to),
                     [&] { return next(from, to); });
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
  static auto* const next = NEXT(renameat2);
  return RecordNames((flags & RENAME_EXCHANGE) != 0 ? RecordedCall::kExchange : RecordedCall::kRename,
                     Absolute(from_folder, from), Absolute(to_folder, to),
                     [&] { return next(from_folder, from, to_folder, to, flags); });
}

int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
  return renameat2(from_folder, from, to_folder, to, 0);
}

int link(const char* from, const char* to) noexcept {
  static auto* const next = NEXT(link);
  return RecordNames(RecordedCall::kLink, Absolute(AT_FDCWD, from), Absolute(AT_FDCWD, to),
                     [&] { return next(from, to); });
}

int unlinkat(int folder, const char* path, int flags) noexcept {
  static auto* const next = NEXT(unlinkat);
  return RecordNames(RecordedCall::kUnlink, Absolute(folder, path), "",
                     [&] { return next(folder, path, flags); });
}

int unlink(const char* path) noexcept { return unlinkat(AT_FDCWD, path, 0); }

int rmdir(const char* path) noexcept { return unlinkat(AT_FDCWD, path, AT_REMOVEDIR); }

int remove(const char* path) noexcept {
  const int done = unlinkat(AT_FDCWD, path, 0);
  return done != 0 && errno == EISDIR ? unlinkat(AT_FDCWD, path, AT_REMOVEDIR) : done;
}

int mkdirat(int folder, const char* path, mode_t mode) noexcept {
  static auto* const next = NEXT(mkdirat);
  return RecordNames(RecordedCall::kMakeFolder, Absolute(folder, path), "",
                     [&] { return next(folder, path, mode); });
}

int mkdir(const char* path, mode_t mode) noexcept { return mkdirat(AT_FDCWD, path, mode); }

}  // extern "C"
