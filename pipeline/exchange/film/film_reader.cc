#include "pipeline/exchange/film/film_reader.h"

#include <filesystem>

#include "core/capture/film_file.h"
#include "core/files/input_file.h"
#include "pipeline/exchange/film/film_module.h"

namespace cairn::pipeline {

namespace fs = std::filesystem;

Result<std::unique_ptr<FilmReader>> FilmReader::Open(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  std::error_code error;
  if (fs::file_size(path, error) == 0 && !error)
    return MakeError(ErrorCode::kEmptyFile, "{}: zero bytes; copy the film again", path);
  const Result<const FilmModule*> module = LoadFilmModule();
  if (!module.ok()) {
    return MakeError(module.error().code, "{}: films cannot be read here: {}", path, module.error().message);
  }
  return (*module)->open(path, BeginsLikeMp4(path));
}

}  // namespace cairn::pipeline
