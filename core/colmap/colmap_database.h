#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/files/database.h"

namespace cairn {

// COLMAP's database.  features.db and matches.db are such files, with the schema of version 3.8
// (src/base/database.cc there) and tables of our own beside COLMAP's (prefix cairn_), which COLMAP ignores.
// Databases of COLMAP 3.0 to 4.0 are read; docs/colmap.md says which parts.

struct DatabaseImage {
  ImageId image_id = 0;
  std::string name;
  CameraId camera_id = 0;
};

// COLMAP's TwoViewGeometry::ConfigurationType.
enum class TwoViewConfig : int {
  kUndefined = 0,
  kDegenerate = 1,
  kCalibrated = 2,    // essential matrix
  kUncalibrated = 3,  // fundamental matrix
  kPlanar = 4,
  kPanoramic = 5,
  kPlanarOrPanoramic = 6,
  kWatermark = 7,
  kMultiple = 8,  // several moving objects: only in COLMAP's databases, never in ours
};

// The verified matches of two images, image_id1 < image_id2.
struct TwoViewGeometry {
  ImageId image_id1 = 0;
  ImageId image_id2 = 0;
  TwoViewConfig config = TwoViewConfig::kUndefined;
  std::vector<Match> inliers;                   // ascending
  Eigen::Matrix3d F = Eigen::Matrix3d::Zero();  // x2' F x1 = 0, pixels
  Eigen::Matrix3d E = Eigen::Matrix3d::Zero();  // normalised coordinates
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
};

// COLMAP's pair_id of two images (order does not matter) and back, smaller id first.
int64_t PairIdFromImageIds(ImageId image_id1, ImageId image_id2);
std::pair<ImageId, ImageId> ImageIdsFromPairId(int64_t pair_id);

// CREATE TABLE statements of COLMAP 3.8's schema (user_version 3800 set).
extern const char* const kColmapSchema;

// Opens a database of COLMAP, or of another program with its schema, without changing it: waits up to 5 s for
// a program that writes to it, reads what lies in a write-ahead log, checks that the tables are there.  All
// reads see one state of it, whatever others write meanwhile.  Errors: NotFound; Corrupt (not SQLite, not
// COLMAP's, truncated); Unsupported (a version of the schema that is not known; names table and column); Busy
// (another program writes to it, or died while it did).
Result<SQLite::Database> OpenColmapDatabase(const std::string& path);

// Copies an open database into a new file, in rollback-journal mode, with the columns of
// two_view_geometries that versions before 3.8 lack.  Throws SQLite::Exception.
void CopyColmapDatabase(SQLite::Database& source, const std::string& copy_path);

// Readers.  Each checks lengths, counts and references; errors are Corrupt and name the file, table and row.
// They throw SQLite::Exception: call them inside WithDatabaseErrors.
Result<std::map<CameraId, Camera>> ReadDatabaseCameras(SQLite::Database& database);
Result<std::vector<DatabaseImage>> ReadDatabaseImages(SQLite::Database& database);  // ascending image_id
// A keypoint of an affine shape a11 a12 a21 a22, as COLMAP's FeatureKeypoint has its scale and orientation.
Keypoint KeypointOfShape(float x, float y, const float* shape);
Result<PooledVector<Keypoint>> ReadDatabaseKeypoints(SQLite::Database& database, ImageId image_id);
Result<int> ReadNumDescriptors(SQLite::Database& database, ImageId image_id);
// Of this kind, which the database says (ReadDescriptorKind).
Result<DescriptorMatrix> ReadDatabaseDescriptors(SQLite::Database& database, ImageId image_id,
                                                 const DescriptorKind& kind = {});
// All pairs with at least `min_num_inliers` inliers, ascending pair_id.
Result<std::vector<TwoViewGeometry>> ReadDatabaseTwoViewGeometries(SQLite::Database& database,
                                                                   int min_num_inliers);
// The same one by one: a large survey's do not fit into memory.  Ends at an error of `visit`.
Status ForEachTwoViewGeometry(SQLite::Database& database, int min_num_inliers,
                              const std::function<Status(TwoViewGeometry)>& visit);

// Writers.
void WriteDatabaseCamera(SQLite::Database& database, const Camera& camera);
void WriteDatabaseImage(SQLite::Database& database, const DatabaseImage& image);
void WriteDatabaseFeatures(SQLite::Database& database, ImageId image_id, const Features& features);
void WriteDatabaseTwoViewGeometry(SQLite::Database& database, const TwoViewGeometry& geometry);

}  // namespace cairn
