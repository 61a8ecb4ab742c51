#include "pipeline/exchange/film/film_module.h"

#include <dlfcn.h>

#include <string_view>

namespace cairn::pipeline {
namespace {

// By the words of the C library's loader, which are English here: the program sets no locale.
bool IsOfMissingLibrary(const std::string& text, const std::string& module) {
  return text.find("cannot open shared object file") != std::string::npos && !text.starts_with(module);
}

}  // namespace

const char* FilmModuleVersion() { return CAIRN_FILM_VERSION; }

Result<const FilmModule*> LoadFilmModule(const std::string& path) {
  // Never closed: readers, and what FFmpeg's libraries registered, live on.
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    const std::string text = dlerror();
    if (IsOfMissingLibrary(text, path)) {
      return MakeError(ErrorCode::kNotFound,
                       "{}: needs FFmpeg's libraries ({}); install them (Debian: apt install {})", path, text,
                       CAIRN_FFMPEG_PACKAGES);
    }
    return MakeError(ErrorCode::kUnsupported,
                     "{}: cannot be loaded ({}); install the program again, or allow it more memory where "
                     "that is limited (ulimit -v, -d)",
                     path, text);
  }
  const auto* const module = static_cast<const FilmModule*>(dlsym(library, kFilmModuleName));
  if (module == nullptr) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: is no module of cairn ({} is not in it); install the program again", path,
                     kFilmModuleName);
  }
  if (std::string_view(module->version) != FilmModuleVersion()) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: is of cairn {}, but the program is {}; install both of one build", path,
                     module->version, FilmModuleVersion());
  }
  return module;
}

}  // namespace cairn::pipeline
