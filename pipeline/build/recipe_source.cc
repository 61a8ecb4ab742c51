#include "pipeline/build/recipe_source.h"

#include <filesystem>

#include "core/capture/capture_features.h"
#include "core/capture/film_file.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/images/image_file.h"
#include "core/map/map_head_tables.h"
#include "pipeline/build/footage.h"
#include "pipeline/build/make_words.h"
#include "pipeline/build/recipe.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kWhatIsCompiled =
    "compile takes a recipe (docs/recipe.md), a film, a ROS bag or the folder of a capture";
constexpr const char* kWhatIsASurvey =
    "what is new is a film, a ROS bag or the folder of a capture (docs/captures.md)";

// Links to folders are not followed below it.
bool HoldsImages(const std::string& folder) {
  std::error_code error;
  fs::recursive_directory_iterator it(folder, fs::directory_options::skip_permission_denied, error), end;
  for (; !error && it != end; it.increment(error)) {
    std::error_code type_error;
    if (it->is_regular_file(type_error) && HasImageSuffix(it->path().string())) return true;
  }
  return false;
}

// `what_is_taken`: instead of what was given.
Status CheckIsCapture(const std::string& folder, const char* what_is_taken) {
  std::error_code error;
  if (fs::exists(folder + "/config.mk", error) && fs::is_directory(folder + "/options", error)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the build folder of a map, not a capture; {}", folder,
                     what_is_taken);
  }
  // images/ may be a link to a folder.
  if (HoldsImages(folder) || HoldsImages(folder + "/images")) return Ok();
  if (fs::exists(folder + "/" + kFeaturesFile, error)) return Ok();
  std::string hint = "are the images in another folder?";
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".toml")
      hint = fmt::format("did you mean the recipe {}?", entry.path().string());
  }
  return MakeError(ErrorCode::kInvalidArgument, "{}: a folder without an image; {}; {}", folder,
                   what_is_taken, hint);
}

// A file that is clearly not a text gets a message which says what it is.
Status CheckIsText(const std::string& path, const char* what_is_taken) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    return MakeError(ErrorCode::kNotFound, "{}: no such file or folder; {}", path, what_is_taken);
  }
  if (!fs::is_regular_file(path, error)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: neither a file nor a folder; {}", path, what_is_taken);
  }
  if (IsSqliteFile(path)) {
    const Status is_map = WithDatabaseErrors(path, [&]() -> Status {
      SQLite::Database database = OpenImmutable(path);
      const Status status = CheckMapVersion(database, path, kMapVersionMajor);
      const bool is_foreign = !status.ok() && status.error().code == ErrorCode::kForeignFile;
      return is_foreign ? status : Ok();
    });
    if (!is_map.ok() && is_map.error().code == ErrorCode::kNoMemory) return is_map;
    if (is_map.ok()) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: a compiled map; `cairn inspect` shows it, and {}",
                       path, what_is_taken);
    }
    return MakeError(ErrorCode::kInvalidArgument, "{}: a database of COLMAP or of a stage, not a recipe; {}",
                     path, what_is_taken);
  }
  if (HasImageSuffix(path)) {
    const std::string folder = fs::absolute(path).lexically_normal().parent_path().string();
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: an image, not a recipe; to compile its folder: cairn compile {}", path, folder);
  }
  return Ok();
}

// The recipe that compiles a folder, a film or a bag with defaults.  The path has no character that TOML
// needs escaped.
std::string DefaultRecipe(const std::string& name, const std::string& folder) {
  return fmt::format(
      "# Every key that is not here has its default; docs/recipe.md lists them.\n"
      "name = \"{}\"\n\n[[capture]]\npath = \"{}\"\n",
      name, folder);
}

}  // namespace

Result<RecipeSource> FindRecipe(const std::string& given, const std::string& map) {
  std::error_code error;
  const bool is_folder = fs::is_directory(given, error);
  const bool is_bag = KindOfCapture(given) == CaptureKind::kBag;
  if (!is_folder && !is_bag && !IsFilm(given)) {
    CAIRN_RETURN_IF_ERROR(CheckIsText(given, kWhatIsCompiled));
    return RecipeSource{.recipe = given, .map = map};
  }
  fs::path folder = fs::absolute(given).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();  // a trailing '/'
  if (is_folder && !is_bag) CAIRN_RETURN_IF_ERROR(CheckIsCapture(given, kWhatIsCompiled));
  const std::string name = NameOfFolder(folder.string());
  RecipeSource source{.map = map.empty() ? name + ".cairn" : map};
  if (fs::path(source.map).extension() != ".cairn")
    return MakeError(ErrorCode::kInvalidArgument, "-o {}: a map's name ends in .cairn", source.map);
  const fs::path recipe = fs::path(source.map).replace_extension(".toml");
  source.recipe = recipe.string();
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the capture", folder.string()));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the map", source.map));
  // A relative path: recipe and capture can be moved together.
  const fs::path beside = fs::absolute(recipe).lexically_normal().parent_path();
  const std::string text = DefaultRecipe(name, folder.lexically_relative(beside).string());
  CAIRN_ASSIGN_OR_RETURN(
      source.was_written,
      WriteNewRecipe(source.recipe, text, fmt::format("compiles {} with defaults", given), source.map));
  return source;
}

Status CheckIsSurvey(const std::string& given) {
  std::error_code error;
  if (KindOfCapture(given) == CaptureKind::kBag || IsFilm(given)) return Ok();
  if (fs::is_directory(given, error)) return CheckIsCapture(given, kWhatIsASurvey);
  CAIRN_RETURN_IF_ERROR(CheckIsText(given, kWhatIsASurvey));
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{}: neither the folder of a capture nor a film or a ROS bag; a recipe says itself what it "
      "is made of: add a [[capture]] to it and compile it",
      given);
}

Result<bool> WriteNewRecipe(const std::string& recipe, const std::string& text, const std::string& what,
                            const std::string& map) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(recipe, error))) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(recipe, text));
    return true;
  }
  const auto there = ReadFile(recipe);
  if (there.ok() && *there == text) return false;
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: exists and is not the recipe that {}; compile it (cairn compile {} -o {}), or give "
                   "another -o",
                   recipe, what, recipe, map);
}

}  // namespace cairn::pipeline
