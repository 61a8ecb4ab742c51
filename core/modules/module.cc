#include "core/modules/module.h"

#include <dlfcn.h>
#include <sys/resource.h>

#include <atomic>
#include <mutex>
#include <new>
#include <string_view>

#include "core/modules/program_files.h"

namespace cairn {
namespace {

// By the words of the C library's loader, which are English here: the program sets no locale.
bool IsOfMissingLibrary(const std::string& text, const std::string& module) {
  return text.find("cannot open shared object file") != std::string::npos && !text.starts_with(module);
}

bool IsMemoryLimited() {
  rlimit data = {}, all = {};
  return (getrlimit(RLIMIT_DATA, &data) == 0 && data.rlim_cur != RLIM_INFINITY) ||
         (getrlimit(RLIMIT_AS, &all) == 0 && all.rlim_cur != RLIM_INFINITY);
}

// A segment that cannot be mapped may also be one that the file system does not let run.
bool IsOfMemory(const std::string& text) {
  return text == "out of memory" || text.find("annot allocate memory") != std::string::npos ||
         text.find("cannot map zero-fill pages") != std::string::npos ||
         (text.find("failed to map segment") != std::string::npos && IsMemoryLimited());
}

// What constructors of a module's libraries take (GDCM's tables, some 10 MiB).  Other threads may take it in
// the meantime.
constexpr size_t kConstructorsBytes = size_t{24} << 20;

std::mutex loading;
std::atomic<bool> loader_is_held = false;

}  // namespace

bool LoaderIsHeld() { return loader_is_held; }

Result<const void*> LoadModule(const std::string& path, const ModuleWanted& wanted) {
  const std::lock_guard<std::mutex> lock(loading);
  if (loader_is_held) throw std::bad_alloc();             // dlopen would wait for ever
  ::operator delete(::operator new(kConstructorsBytes));  // throws where there is not so much
  loader_is_held = true;  // stays so where a constructor throws, through dlopen
  // Never closed: what it made, and what its libraries registered, live on.
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  loader_is_held = false;
  if (library == nullptr) {
    const std::string text = dlerror();
    if (IsOfMemory(text)) throw std::bad_alloc();
    if (IsOfMissingLibrary(text, path)) {
      return MakeError(ErrorCode::kNotFound, "{}: needs {} ({}); install them (Debian: apt install {})", path,
                       wanted.needs, text, wanted.packages);
    }
    return MakeError(ErrorCode::kUnsupported, "{}: cannot be loaded ({}); install the program again", path,
                     text);
  }
  const void* const module = dlsym(library, wanted.symbol);
  if (module == nullptr) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: is no module of cairn ({} is not in it); install the program again", path,
                     wanted.symbol);
  }
  const char* const version = *static_cast<const char* const*>(module);
  if (std::string_view(version) != wanted.version) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: is of cairn {}, but the program is {}; install both of one build", path, version,
                     wanted.version);
  }
  return module;
}

Result<const void*> LoadModuleOfProgram(const std::string& name, const ModuleWanted& wanted) {
  CAIRN_ASSIGN_OR_RETURN(const std::string program, ProgramPath());
  CAIRN_ASSIGN_OR_RETURN(const std::string path, InstalledPath(program, "lib/cairn/" + name + ".so"));
  return LoadModule(path, wanted);
}

}  // namespace cairn
