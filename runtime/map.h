#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/map_rows.h"

namespace cairn {

// An open map: immutable, shareable between threads, one Localizer per thread.  The first header to read;
// then runtime/localizer.h.
class Map {
 public:
  // Opens a map file read-only; nothing of it is left open.  Errors: as ReadMapRows (core/map_rows.h).
  static Result<std::shared_ptr<const Map>> Open(const std::string& path);
  // A map that was never a file.  Errors: InvalidArgument (CheckMapRows).
  static Result<std::shared_ptr<const Map>> FromRows(MapRows rows);

  const MapRows& rows() const { return rows_; }

  // The camera of the survey with this image size.
  // Errors: NotFound when no camera or more than one has it; lists the sizes there are.
  Result<Camera> CameraForSize(int width, int height) const;

  // Regions that contain a station, ascending.
  const std::vector<RegionIdx>& RegionsOfStation(StationIdx station) const {
    return regions_of_station_[station];
  }
  // Indices into rows().images of the images that see a landmark, ascending.
  const std::vector<int32_t>& ImagesOfLandmark(LandmarkIdx landmark) const {
    return images_of_landmark_[landmark];
  }
  // Index into rows().images of a document of the vocabulary.
  int32_t ImageOfDocument(int32_t document) const { return image_of_document_[document]; }

 private:
  explicit Map(MapRows rows);

  MapRows rows_;
  std::vector<std::vector<RegionIdx>> regions_of_station_;
  std::vector<std::vector<int32_t>> images_of_landmark_;
  std::vector<int32_t> image_of_document_;
};

}  // namespace cairn
