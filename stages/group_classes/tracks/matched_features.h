#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/base/error.h"
#include "core/colmap/colmap_database.h"
#include "core/features/features.h"

namespace cairn::group_classes {

// What the stage needs of matches.db.  Where `path` is given, descriptors and geometries, which take most,
// are there and not here (MatchReader).
struct MatchedFeatures {
  std::map<CameraId, Camera> cameras;
  std::vector<DatabaseImage> images;        // ascending image_id
  std::vector<Features> features;           // per image
  std::vector<TwoViewGeometry> geometries;  // ascending pair
  std::set<ImageId> landmark_images;        // whose features are landmarks of an earlier map
  // Open as long as this lives: a file that takes its place meanwhile is another one.
  std::shared_ptr<SQLite::Database> database;
  std::string path;
};

// All but descriptors and geometries of a COLMAP database.  Errors: as OpenColmapDatabase, Corrupt.
Result<MatchedFeatures> ReadMatchedFeatures(const std::string& matches_path);

// Reads the descriptors and geometries of matched features, those of few images at once.
class MatchReader {
 public:
  // Keeps so many bytes of descriptors, and those that were read last.  `matched` outlives it.
  explicit MatchReader(const MatchedFeatures& matched, size_t max_num_bytes = size_t{256} << 20)
      : matched_(matched), max_num_bytes_(max_num_bytes) {}

  // Pairs with inliers, ascending.  Errors: Corrupt; of `visit`.
  Status ForEachPair(const std::function<Status(const TwoViewGeometry&)>& visit);
  // Of an image, by its index.
  Result<std::shared_ptr<const DescriptorMatrix>> DescriptorsOf(int image);

 private:
  const MatchedFeatures& matched_;
  size_t max_num_bytes_, num_bytes_ = 0;
  // Of which descriptors are kept, the last used first.
  std::list<int> images_;
  struct Kept {
    std::shared_ptr<const DescriptorMatrix> descriptors;
    std::list<int>::iterator place;
  };
  std::unordered_map<int, Kept> kept_;
};

}  // namespace cairn::group_classes
