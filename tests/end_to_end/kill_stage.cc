// A library to be preloaded: kills the process group (SIGKILL) of one stage of the line, at a moment of its
// own.  Its variables begin with LC_, which `cairn compile` passes on to the stages.
//   LC_KILL_STAGE=match-features     the command that is meant; others run on
//   LC_KILL_AFTER_US=N               N microseconds after the stage has begun
//   LC_KILL_AT_CALL=N                or before its N-th call that a crash could come between: creating,
//   syncing, renaming
//                                 or removing a file
//   LC_COUNT_CALLS=FILE              or not at all: appends how many such calls the stage makes

#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>

namespace {

std::atomic<long> num_calls = 0;
std::atomic<long> kill_at_call = -1;
bool is_counting = false;

bool IsMeant() {
  const char* stage = std::getenv("LC_KILL_STAGE");
  if (stage == nullptr) return false;
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string program, command;
  std::getline(file, program, '\0');
  std::getline(file, command, '\0');
  if (command == "stage") std::getline(file, command, '\0');
  return program.ends_with("/cairn") && command == stage;
}

void NoteCall() {
  if (++num_calls == kill_at_call) kill(0, SIGKILL);
}

__attribute__((constructor)) void Begin() {
  if (!IsMeant()) return;
  if (const char* call = std::getenv("LC_KILL_AT_CALL")) kill_at_call = std::atol(call);
  is_counting = std::getenv("LC_COUNT_CALLS") != nullptr;
  if (const char* after = std::getenv("LC_KILL_AFTER_US")) {
    std::thread([moment = std::chrono::microseconds(std::atol(after))] {
      std::this_thread::sleep_for(moment);
      kill(0, SIGKILL);
    }).detach();
  }
}

__attribute__((destructor)) void End() {
  if (is_counting) std::ofstream(std::getenv("LC_COUNT_CALLS"), std::ios::app) << num_calls << "\n";
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

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  if ((flags & O_CREAT) != 0) NoteCall();
  static auto* const next = NEXT(open);
  return next(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  if ((flags & O_CREAT) != 0) NoteCall();
  static auto* const next = NEXT(open64);
  return next(path, flags, mode);
}

FILE* fopen64(const char* path, const char* mode) {
  if (std::strchr(mode, 'w') != nullptr) NoteCall();
  static auto* const next = NEXT(fopen64);
  return next(path, mode);
}

int fsync(int fd) {
  NoteCall();
  static auto* const next = NEXT(fsync);
  return next(fd);
}

int syncfs(int fd) noexcept {
  NoteCall();
  static auto* const next = NEXT(syncfs);
  return next(fd);
}

int rename(const char* from, const char* to) noexcept {
  NoteCall();
  static auto* const next = NEXT(rename);
  return next(from, to);
}

int renameat2(int from_fd, const char* from, int to_fd, const char* to, unsigned flags) noexcept {
  NoteCall();
  static auto* const next = NEXT(renameat2);
  return next(from_fd, from, to_fd, to, flags);
}

int remove(const char* path) noexcept {
  NoteCall();
  static auto* const next = NEXT(remove);
  return next(path);
}

int mkdir(const char* path, mode_t mode) noexcept {
  NoteCall();
  static auto* const next = NEXT(mkdir);
  return next(path, mode);
}

}  // extern "C"
