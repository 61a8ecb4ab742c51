// A library to be preloaded: lets one request for memory fail, of those that are made from main on.
//   FAULT_AT=N        the N-th request fails (from 1); 0: none does
//   FAULT_FROM=1      all after it fail, too
//   FAULT_TRAP=1      the process stops there, for a debugger
//   FAULT_LOG=FILE    gets the number of requests where none failed, and "failed" where one did

#include <dlfcn.h>
#include <fcntl.h>
#include <malloc.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t num, size_t size);
void* __libc_realloc(void* memory, size_t size);
void* __libc_memalign(size_t alignment, size_t size);
}

namespace {

std::atomic<long> num_requests = 0;
std::atomic<bool> counts = false;
long at = 0;
bool from = false;
const char* log_path = nullptr;

void Log(const char* text) {
  const long fd = syscall(SYS_openat, AT_FDCWD, log_path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (fd < 0) return;
  syscall(SYS_write, fd, text, std::strlen(text));
  syscall(SYS_close, fd);
}

bool Fails() {
  if (!counts) return false;
  const long request = ++num_requests;
  if (request == at) {
    Log("failed");
    if (std::getenv("FAULT_TRAP") != nullptr) __builtin_trap();
  }
  if (request != at && !(from && at > 0 && request > at)) return false;
  errno = ENOMEM;
  return true;
}

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;

int CountingMain(int argc, char** argv, char** environment) {
  const char* const given = std::getenv("FAULT_AT");
  at = given == nullptr ? 0 : std::atol(given);
  from = std::getenv("FAULT_FROM") != nullptr;
  log_path = std::getenv("FAULT_LOG");
  counts = log_path != nullptr;
  const int code = real_main(argc, argv, environment);
  counts = false;
  if (log_path != nullptr && (at == 0 || num_requests < at)) {
    char text[32];
    std::snprintf(text, sizeof(text), "%ld", num_requests.load());
    Log(text);
  }
  return code;
}

}  // namespace

extern "C" {

void* malloc(size_t size) { return Fails() ? nullptr : __libc_malloc(size); }
void* calloc(size_t num, size_t size) { return Fails() ? nullptr : __libc_calloc(num, size); }
void* realloc(void* memory, size_t size) { return Fails() ? nullptr : __libc_realloc(memory, size); }
void* memalign(size_t alignment, size_t size) { return Fails() ? nullptr : __libc_memalign(alignment, size); }
void* aligned_alloc(size_t alignment, size_t size) { return memalign(alignment, size); }
int posix_memalign(void** memory, size_t alignment, size_t size) {
  void* const taken = memalign(alignment, size);
  if (taken == nullptr) return ENOMEM;
  *memory = taken;
  return 0;
}

int __libc_start_main(Main main, int argc, char** argv, void (*init)(), void (*fini)(), void (*rtld_fini)(),
                      void* stack_end) {
  real_main = main;
  using Start = int (*)(Main, int, char**, void (*)(), void (*)(), void (*)(), void*);
  const auto start = reinterpret_cast<Start>(dlsym(RTLD_NEXT, "__libc_start_main"));
  return start(&CountingMain, argc, argv, init, fini, rtld_fini, stack_end);
}
}
