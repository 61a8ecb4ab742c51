#include <filesystem>

#include "core/colmap/colmap_model.h"
#include "pipeline/exchange/import/layouts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// The folder that holds the first image, among those where people keep images beside a model.
std::string FindImages(const fs::path& source, const fs::path& model, const std::string& first_name) {
  std::error_code error;
  for (const fs::path& folder : {source / "images", model / "images", model / ".." / "images",
                                 model / ".." / ".." / "images", source}) {
    if (fs::exists(folder / first_name, error)) return folder.lexically_normal().string();
  }
  return "";
}

}  // namespace

Result<ImportedSurvey> ReadColmapSurvey(const std::string& source, const ImportOptions& options) {
  std::string folder = source;
  for (const char* below : {"/sparse/0", "/sparse"}) {
    if (!IsColmapModel(folder) && IsColmapModel(source + below)) folder = source + below;
  }
  CAIRN_ASSIGN_OR_RETURN(ColmapModel model, ReadColmapModel(folder));
  if (model.images.empty()) return MakeError(ErrorCode::kNoData, "{}: the model has no image", folder);
  const std::string images = options.images_folder.empty()
                                 ? FindImages(source, folder, model.images.front().name)
                                 : options.images_folder;
  if (images.empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "{}: no folder `images` in or beside it has {}; name the images' folder with --images",
                     folder, model.images.front().name);
  }
  ImportedSurvey survey;
  survey.cameras = std::move(model.cameras);
  for (const ModelImage& image : model.images) {
    survey.images.push_back({image.name, images + "/" + image.name, image.camera_id, image.cam_from_world});
  }
  return survey;
}

}  // namespace cairn::pipeline
