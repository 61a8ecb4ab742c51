// A library to be preloaded: lets one call of one kind fail, as full disks, broken ones and spent limits do.
//   FAULT_KIND=open|read|write|sync|rename|link|unlink|close
//   FAULT_ERROR=N             what the call says: an errno; "killed": the process is killed just before it
//   FAULT_AT=N                the N-th call of the kind fails (from 1)
//   FAULT_FOLDER=DIR          only calls on files in this folder count; without it, all of the program's
//   FAULT_LOG=FILE            gets a line "KIND PATH" for the call that failed; not made where none failed
// A close that fails has closed the file, as on Linux.

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

constexpr int kKilled = -1;

struct Fault {
  std::string kind, folder, log;
  int error = 0;
  long at = -1;
};

const Fault& TheFault() {
  static const Fault* const fault = [] {
    const auto text = [](const char* name) {
      const char* value = std::getenv(name);
      return std::string(value == nullptr ? "" : value);
    };
    return new Fault{text("FAULT_KIND"), text("FAULT_FOLDER"), text("FAULT_LOG"),
                     text("FAULT_ERROR") == "killed" ? kKilled : std::atoi(text("FAULT_ERROR").c_str()),
                     std::atol(text("FAULT_AT").c_str())};
  }();
  return *fault;
}

std::atomic<long> num_calls = 0;

void Log(const std::string& path) {
  const std::string line = TheFault().kind + " " + path + "\n";
  const long fd = syscall(SYS_openat, AT_FDCWD, TheFault().log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
  if (fd < 0) return;
  syscall(SYS_write, fd, line.data(), line.size());
  syscall(SYS_close, fd);
}

// Whether this call is to fail; then errno says why.
bool Fails(const char* kind, const std::string& path) {
  const Fault& fault = TheFault();
  if (fault.kind != kind || path.compare(0, fault.folder.size(), fault.folder) != 0) return false;
  if (++num_calls != fault.at) return false;
  Log(path);
  if (fault.error == kKilled) syscall(SYS_kill, syscall(SYS_getpid), SIGKILL);
  errno = fault.error;
  return true;
}

bool Fails(const char* kind, int fd) {
  if (TheFault().kind != kind) return false;
  char link[64], path[PATH_MAX + 1] = {};
  std::snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
  const ssize_t size = syscall(SYS_readlinkat, AT_FDCWD, link, path, PATH_MAX);
  return size > 0 && path[0] == '/' && Fails(kind, std::string(path, size));
}

template <typename Function>
Function* Next(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

mode_t ModeOf(int flags, va_list arguments) {
  return (flags & O_CREAT) != 0 ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
}

}  // namespace

// What the C library calls them.
#define NEXT(name) Next(static_cast<decltype(::name)*>(nullptr), #name)
#define MODE_ARGUMENT                           \
  va_list arguments;                            \
  va_start(arguments, flags);                   \
  const mode_t mode = ModeOf(flags, arguments); \
  va_end(arguments)

extern "C" {

int open(const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(open);
  return Fails("open", path) ? -1 : next(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(open64);
  return Fails("open", path) ? -1 : next(path, flags, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(openat);
  return Fails("open", path) ? -1 : next(folder, path, flags, mode);
}

int openat64(int folder, const char* path, int flags, ...) {
  MODE_ARGUMENT;
  static auto* const next = NEXT(openat64);
  return Fails("open", path) ? -1 : next(folder, path, flags, mode);
}

FILE* fopen(const char* path, const char* mode) {
  static auto* const next = NEXT(fopen);
  return Fails("open", path) ? nullptr : next(path, mode);
}

FILE* fopen64(const char* path, const char* mode) {
  static auto* const next = NEXT(fopen64);
  return Fails("open", path) ? nullptr : next(path, mode);
}

ssize_t read(int fd, void* bytes, size_t size) {
  static auto* const next = NEXT(read);
  return Fails("read", fd) ? -1 : next(fd, bytes, size);
}

ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  static auto* const next = NEXT(pread);
  return Fails("read", fd) ? -1 : next(fd, bytes, size, offset);
}

ssize_t pread64(int fd, void* bytes, size_t size, off64_t offset) {
  static auto* const next = NEXT(pread64);
  return Fails("read", fd) ? -1 : next(fd, bytes, size, offset);
}

ssize_t write(int fd, const void* bytes, size_t size) {
  static auto* const next = NEXT(write);
  return Fails("write", fd) ? -1 : next(fd, bytes, size);
}

ssize_t pwrite(int fd, const void* bytes, size_t size, off_t offset) {
  static auto* const next = NEXT(pwrite);
  return Fails("write", fd) ? -1 : next(fd, bytes, size, offset);
}

ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t offset) {
  static auto* const next = NEXT(pwrite64);
  return Fails("write", fd) ? -1 : next(fd, bytes, size, offset);
}

int fsync(int fd) {
  static auto* const next = NEXT(fsync);
  return Fails("sync", fd) ? -1 : next(fd);
}

int fdatasync(int fd) {
  static auto* const next = NEXT(fdatasync);
  return Fails("sync", fd) ? -1 : next(fd);
}

int rename(const char* from, const char* to) noexcept {
  static auto* const next = NEXT(rename);
  return Fails("rename", to) ? -1 : next(from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
  static auto* const next = NEXT(renameat2);
  return Fails("rename", to) ? -1 : next(from_folder, from, to_folder, to, flags);
}

int link(const char* from, const char* to) noexcept {
  static auto* const next = NEXT(link);
  return Fails("link", to) ? -1 : next(from, to);
}

int unlink(const char* path) noexcept {
  static auto* const next = NEXT(unlink);
  return Fails("unlink", path) ? -1 : next(path);
}

int close(int fd) {
  static auto* const next = NEXT(close);
  const bool fails = Fails("close", fd);
  const int error = errno;
  const int closed = next(fd);
  if (!fails) return closed;
  errno = error;
  return -1;
}

}  // extern "C"
