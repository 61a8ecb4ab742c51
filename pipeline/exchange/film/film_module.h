#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "pipeline/exchange/film/film_reader.h"

namespace cairn::pipeline {

// What film.so, the part of the program that links FFmpeg (ffmpeg_reader.cc), gives to the rest under the
// name kFilmModuleName (core/modules/module.h).
struct FilmModule {
  // Of its build.
  const char* version;
  // Opens a file that is not empty; `begins_like_mp4`: see core/capture/film_file.h.
  Result<std::unique_ptr<FilmReader>> (*open)(const std::string& path, bool begins_like_mp4);
};
inline constexpr char kFilmModuleName[] = "cairn_film_module";

const char* FilmModuleVersion();

// The program's, or another one (core/modules/module.h).
Result<const FilmModule*> LoadFilmModule();
Result<const FilmModule*> LoadFilmModule(const std::string& path);

}  // namespace cairn::pipeline
