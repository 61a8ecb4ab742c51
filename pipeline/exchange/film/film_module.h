#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "pipeline/exchange/film/film_reader.h"

namespace cairn::pipeline {

// What film.so, the part of the program that links FFmpeg (ffmpeg_reader.cc), gives to the rest under the
// name kFilmModuleName.  One build makes both: values of C++ pass between them.
struct FilmModule {
  // FilmModuleVersion() of its build.  Comes first, and is compared before anything else is touched.
  const char* version;
  // Opens a file that is not empty; `begins_like_mp4`: see core/capture/film_file.h.
  Result<std::unique_ptr<FilmReader>> (*open)(const std::string& path, bool begins_like_mp4);
};
inline constexpr char kFilmModuleName[] = "cairn_film_module";

// "0.1.0-91c37a5d3b0f6a24": the release, and a hash of the module's sources and of what compiled them.
const char* FilmModuleVersion();

// Loads a module and FFmpeg's libraries, for as long as the program runs; again: the same.  REQUIRES: `path`
// is absolute, and so looked for nowhere else.  Errors: NotFound (libraries that it needs), Unsupported (no
// module, or one of another build).
Result<const FilmModule*> LoadFilmModule(const std::string& path);

}  // namespace cairn::pipeline
