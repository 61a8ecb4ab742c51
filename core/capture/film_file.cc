#include "core/capture/film_file.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string_view>

#include "core/files/file.h"
#include "core/files/input_file.h"

namespace cairn {
namespace {

constexpr const char* kFilmSuffixes[] = {".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi",
                                         ".3gp", ".ts",  ".mts", ".mpg", ".mpeg"};
constexpr std::string_view kBoxes[] = {"ftyp", "moov", "mdat", "wide", "skip", "free"};

}  // namespace

bool BeginsLikeMp4(const std::string& path) {
  const std::string bytes = ReadHead(path, 8);
  return bytes.size() == 8 &&
         std::find(std::begin(kBoxes), std::end(kBoxes), bytes.substr(4)) != std::end(kBoxes);
}

bool IsFilm(const std::string& path) {
  if (!CheckInputFile(path).ok()) return false;
  std::string suffix = std::filesystem::path(path).extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (std::find(std::begin(kFilmSuffixes), std::end(kFilmSuffixes), suffix) != std::end(kFilmSuffixes))
    return true;
  const std::string bytes = ReadHead(path, 12);
  const bool is_avi = bytes.starts_with("RIFF") && bytes.ends_with("AVI ");
  return is_avi || bytes.starts_with("\x1a\x45\xdf\xa3") || BeginsLikeMp4(path);  // Matroska's mark
}

}  // namespace cairn
