#include "pipeline/exchange/film/film_module.h"

#include "core/modules/module.h"

namespace cairn::pipeline {

namespace {

ModuleWanted Wanted() {
  return {.symbol = kFilmModuleName,
          .version = FilmModuleVersion(),
          .needs = "FFmpeg's libraries",
          .packages = CAIRN_FFMPEG_PACKAGES};
}

}  // namespace

const char* FilmModuleVersion() { return CAIRN_MODULE_VERSION; }

Result<const FilmModule*> LoadFilmModule() {
  CAIRN_ASSIGN_OR_RETURN(const void* const module, LoadModuleOfProgram("film", Wanted()));
  return static_cast<const FilmModule*>(module);
}

Result<const FilmModule*> LoadFilmModule(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const void* const module, LoadModule(path, Wanted()));
  return static_cast<const FilmModule*>(module);
}

}  // namespace cairn::pipeline
