#include "runtime/map.h"

#include <utility>

namespace cairn {

Result<std::shared_ptr<const Map>> Map::Open(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(MapRows rows, ReadMapRows(path));
  return std::shared_ptr<const Map>(new Map(std::move(rows)));
}

Result<std::shared_ptr<const Map>> Map::FromRows(MapRows rows) {
  CAIRN_RETURN_IF_ERROR(CheckMapRows(rows));
  return std::shared_ptr<const Map>(new Map(std::move(rows)));
}

Map::Map(MapRows rows) : rows_(std::move(rows)) {
  regions_of_station_.resize(rows_.stations.size());
  for (size_t region = 0; region < rows_.regions.size(); ++region) {
    for (const StationIdx station : rows_.regions[region].stations) {
      regions_of_station_[station].push_back(static_cast<RegionIdx>(region));
    }
  }
  images_of_landmark_.resize(rows_.landmarks.size());
  for (size_t image = 0; image < rows_.images.size(); ++image) {
    for (const LandmarkIdx landmark : rows_.images[image].landmarks) {
      images_of_landmark_[landmark].push_back(static_cast<int32_t>(image));
    }
  }
  int32_t image = 0;
  for (const ImageId image_id :
       rows_.vocabulary.document_ids) {  // both ascending; every document is an image
    while (rows_.images[image].image_id < image_id) ++image;
    image_of_document_.push_back(image);
  }
}

Result<Camera> Map::CameraForSize(int width, int height) const {
  const Camera* found = nullptr;
  int num_found = 0;
  std::string sizes;
  for (const Camera& camera : rows_.cameras) {
    sizes += fmt::format("{}{} x {}", sizes.empty() ? "" : ", ", camera.width, camera.height);
    if (camera.width != width || camera.height != height) continue;
    found = &camera;
    ++num_found;
  }
  if (num_found == 1) return *found;
  return MakeError(ErrorCode::kNotFound,
                   "{} cameras of map '{}' take images of {} x {} px (its cameras: {}); give the camera",
                   num_found, rows_.name, width, height, sizes);
}

}  // namespace cairn
