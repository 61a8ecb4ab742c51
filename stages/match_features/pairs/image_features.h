#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_database.h"
#include "core/features/approximate_search.h"
#include "core/features/descriptor_matcher.h"
#include "core/geometry/pose.h"

namespace cairn::match_features {

// An image to match, without its features: these stay in the database until a pair needs them.
struct MatchImage {
  ImageId image_id = 0;
  std::string name;
  CameraId camera_id = 0;
  std::optional<Pose> cam_from_world;
  int session = 0;  // of the capture's, in the order of time; those of none are with the first
  int num_features = 0;
};

struct MatchImages {
  std::map<CameraId, Camera> cameras;
  DescriptorKind descriptor_kind;
  std::vector<MatchImage> images;                   // those with features, ascending image_id
  std::map<std::string, ImageId> without_features;  // the others in the database, by name

  bool AllPosed() const;
};

// Cameras and images of a COLMAP database; poses by image name from `capture` (may be null).  Throws
// SQLite::Exception: call it inside WithDatabaseErrors.  Errors: Corrupt (an image without camera, counts of
// keypoints and descriptors that differ).
Result<MatchImages> ReadMatchImages(SQLite::Database& database, const Capture* capture);

// What of an image's features is needed beside what all matching reads.
struct NeededFeatures {
  bool descriptors = false;  // unpacked ones
  bool index = false;
};

// The features of one image, in the form that matching and verification use.
struct ImageFeatures {
  PooledVector<Keypoint> keypoints;
  std::vector<Eigen::Vector3d> bearings;  // of the keypoints, unit vectors, NaN where undefined
  DescriptorMatrix descriptors;           // for guided matching; without rows where there is none
  PackedDescriptors packed;
  std::optional<ApproximateIndex> index;  // where they are not compared with all of another image

  // Upper limit of the memory that the features of an image take, bytes.
  static int64_t NumBytes(int num_features, const DescriptorKind& kind, const NeededFeatures& needed);
};

// Errors: Corrupt.  Throws like ReadMatchImages.
Result<ImageFeatures> ReadImageFeatures(SQLite::Database& database, const MatchImage& image,
                                        const Camera& camera, const DescriptorKind& kind,
                                        const NeededFeatures& needed);

// Only the bearings of ImageFeatures.  Errors: Corrupt.  Throws like ReadMatchImages.
Result<std::vector<Eigen::Vector3d>> ReadImageBearings(SQLite::Database& database, const MatchImage& image,
                                                       const Camera& camera);

}  // namespace cairn::match_features
