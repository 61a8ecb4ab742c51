#include "core/colmap_database.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace cairn {
namespace {

// COLMAP's Database::kMaxNumImages.
constexpr int64_t kMaxNumImages = 2147483647;
constexpr int kMaxKeypoints = 10000000;

void BindBlob(SQLite::Statement& statement, int index, const void* bytes, size_t num_bytes) {
  if (num_bytes == 0) {
    statement.bind(index, "", 0);  // an empty blob, not NULL
  } else {
    statement.bind(index, bytes, static_cast<int>(num_bytes));
  }
}

void BindMatrix(SQLite::Statement& statement, int index, const Eigen::Matrix3d& matrix) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> row_major = matrix;
  BindBlob(statement, index, row_major.data(), sizeof(double) * 9);
}

Eigen::Matrix3d MatrixFromColumn(const SQLite::Column& column) {
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> matrix = Eigen::Matrix3d::Zero();
  if (column.getBytes() == sizeof(double) * 9)
    std::memcpy(matrix.data(), column.getBlob(), sizeof(double) * 9);
  return matrix;
}

Error BadRow(const SQLite::Database& database, const std::string& table, int64_t row,
             const std::string& problem) {
  return MakeError(ErrorCode::kCorrupt, "{}: table {}, row {}: {}", database.getFilename(), table, row,
                   problem);
}

// Checks that a blob has rows x columns values of `value_size` bytes.
std::string ShapeProblem(int64_t rows, int64_t columns, size_t value_size, size_t num_bytes) {
  if (rows < 0 || rows > kMaxKeypoints) return fmt::format("{} rows, expected 0 to {}", rows, kMaxKeypoints);
  if (num_bytes != static_cast<size_t>(rows * columns) * value_size) {
    return fmt::format("blob of {} bytes, expected {} x {} values of {} bytes", num_bytes, rows, columns,
                       value_size);
  }
  return "";
}

}  // namespace

const char* const kColmapSchema = R"sql(
CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE,
  camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL, prior_tx REAL, prior_ty REAL,
  prior_tz REAL, CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
  data BLOB, FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
  data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
PRAGMA user_version = 3800;
)sql";

int64_t PairIdFromImageIds(ImageId image_id1, ImageId image_id2) {
  return kMaxNumImages * std::min(image_id1, image_id2) + std::max(image_id1, image_id2);
}

std::pair<ImageId, ImageId> ImageIdsFromPairId(int64_t pair_id) {
  const int64_t image_id2 = pair_id % kMaxNumImages;
  return {static_cast<ImageId>((pair_id - image_id2) / kMaxNumImages), static_cast<ImageId>(image_id2)};
}

Result<std::map<CameraId, Camera>> ReadDatabaseCameras(SQLite::Database& database) {
  std::map<CameraId, Camera> cameras;
  SQLite::Statement query(
      database, "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras ORDER BY 1");
  while (query.executeStep()) {
    Camera camera;
    camera.camera_id = query.getColumn(0).getUInt();
    const auto model = CameraModelFromId(query.getColumn(1).getInt());
    if (!model.ok())
      return MakeError(ErrorCode::kUnsupported, "{}: {}", database.getFilename(), model.error().message);
    camera.model = *model;
    camera.width = query.getColumn(2).getInt();
    camera.height = query.getColumn(3).getInt();
    CAIRN_ASSIGN_OR_RETURN(camera.params,
                           BlobToVector<double>(query.getColumn(4), database.getFilename() + ": cameras"));
    camera.has_focal_prior = query.getColumn(5).getInt() != 0;
    if (const Status status = CheckCamera(camera); !status.ok()) {
      return BadRow(database, "cameras", camera.camera_id, status.error().message);
    }
    cameras.emplace(camera.camera_id, camera);
  }
  return cameras;
}

Result<std::vector<DatabaseImage>> ReadDatabaseImages(SQLite::Database& database) {
  std::vector<DatabaseImage> images;
  SQLite::Statement query(database, "SELECT image_id, name, camera_id FROM images ORDER BY image_id");
  while (query.executeStep()) {
    images.push_back(
        {query.getColumn(0).getUInt(), query.getColumn(1).getString(), query.getColumn(2).getUInt()});
  }
  return images;
}

Result<std::vector<Keypoint>> ReadDatabaseKeypoints(SQLite::Database& database, ImageId image_id) {
  SQLite::Statement query(database, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?");
  query.bind(1, image_id);
  std::vector<Keypoint> keypoints;
  if (!query.executeStep()) return keypoints;
  const int64_t rows = query.getColumn(0).getInt64();
  const int64_t columns = query.getColumn(1).getInt64();
  const SQLite::Column blob = query.getColumn(2);
  std::string problem = ShapeProblem(rows, columns, sizeof(float), blob.getBytes());
  // 2: x, y; 4: + scale, orientation; 6: x, y and an affine shape a11 a12 a21 a22 (COLMAP's FeatureKeypoint).
  if (problem.empty() && columns != 2 && columns != 4 && columns != 6)
    problem = fmt::format("{} columns, expected 2, 4 or 6", columns);
  if (!problem.empty()) return BadRow(database, "keypoints", image_id, problem);
  const auto* values = static_cast<const float*>(blob.getBlob());
  keypoints.resize(rows);
  for (int64_t i = 0; i < rows; ++i) {
    const float* v = values + i * columns;
    Keypoint& keypoint = keypoints[i];
    keypoint = {v[0], v[1], 1, 0};
    if (columns == 4) {
      keypoint.scale = v[2];
      keypoint.orientation = v[3];
    } else if (columns == 6) {
      keypoint.scale = 0.5f * (std::hypot(v[2], v[4]) + std::hypot(v[3], v[5]));
      keypoint.orientation = std::atan2(v[4], v[2]);
    }
    if (!std::isfinite(keypoint.x) || !std::isfinite(keypoint.y) || !std::isfinite(keypoint.scale)) {
      return BadRow(database, "keypoints", image_id, fmt::format("keypoint {} is not finite", i));
    }
  }
  return keypoints;
}

Result<DescriptorMatrix> ReadDatabaseDescriptors(SQLite::Database& database, ImageId image_id) {
  SQLite::Statement query(database, "SELECT rows, cols, data FROM descriptors WHERE image_id = ?");
  query.bind(1, image_id);
  DescriptorMatrix descriptors(0, kDescriptorDim);
  if (!query.executeStep()) return descriptors;
  const int64_t rows = query.getColumn(0).getInt64();
  const int64_t columns = query.getColumn(1).getInt64();
  const SQLite::Column blob = query.getColumn(2);
  std::string problem = ShapeProblem(rows, columns, 1, blob.getBytes());
  if (problem.empty() && rows > 0 && columns != kDescriptorDim)
    problem = fmt::format("{} columns, expected {}", columns, kDescriptorDim);
  if (!problem.empty()) return BadRow(database, "descriptors", image_id, problem);
  descriptors.resize(rows, kDescriptorDim);
  if (rows > 0) std::memcpy(descriptors.data(), blob.getBlob(), blob.getBytes());
  return descriptors;
}

Result<std::vector<TwoViewGeometry>> ReadDatabaseTwoViewGeometries(SQLite::Database& database,
                                                                   int min_num_inliers) {
  std::vector<TwoViewGeometry> geometries;
  SQLite::Statement query(database,
                          "SELECT pair_id, rows, cols, data, config, F, E, H FROM two_view_geometries "
                          "WHERE rows >= ? ORDER BY pair_id");
  query.bind(1, min_num_inliers);
  while (query.executeStep()) {
    TwoViewGeometry geometry;
    const int64_t pair_id = query.getColumn(0).getInt64();
    std::tie(geometry.image_id1, geometry.image_id2) = ImageIdsFromPairId(pair_id);
    const int64_t rows = query.getColumn(1).getInt64();
    const int64_t columns = query.getColumn(2).getInt64();
    const SQLite::Column blob = query.getColumn(3);
    std::string problem = ShapeProblem(rows, columns, sizeof(uint32_t), blob.getBytes());
    if (problem.empty() && rows > 0 && columns != 2) problem = fmt::format("{} columns, expected 2", columns);
    if (!problem.empty()) return BadRow(database, "two_view_geometries", pair_id, problem);
    geometry.inliers.resize(rows);
    if (rows > 0) std::memcpy(geometry.inliers.data(), blob.getBlob(), blob.getBytes());
    geometry.config = static_cast<TwoViewConfig>(query.getColumn(4).getInt());
    geometry.F = MatrixFromColumn(query.getColumn(5));
    geometry.E = MatrixFromColumn(query.getColumn(6));
    geometry.H = MatrixFromColumn(query.getColumn(7));
    geometries.push_back(std::move(geometry));
  }
  return geometries;
}

void WriteDatabaseCamera(SQLite::Database& database, const Camera& camera) {
  SQLite::Statement insert(database, "INSERT INTO cameras VALUES (?, ?, ?, ?, ?, ?)");
  insert.bind(1, camera.camera_id);
  insert.bind(2, static_cast<int>(camera.model));
  insert.bind(3, camera.width);
  insert.bind(4, camera.height);
  BindBlob(insert, 5, camera.params.data(), camera.params.size() * sizeof(double));
  insert.bind(6, camera.has_focal_prior ? 1 : 0);
  insert.exec();
}

void WriteDatabaseImage(SQLite::Database& database, const DatabaseImage& image) {
  SQLite::Statement insert(database, "INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?)");
  insert.bind(1, image.image_id);
  insert.bind(2, image.name);
  insert.bind(3, image.camera_id);
  insert.exec();
}

void WriteDatabaseFeatures(SQLite::Database& database, ImageId image_id, const Features& features) {
  static_assert(sizeof(Keypoint) == 4 * sizeof(float));
  const auto rows = static_cast<int64_t>(features.keypoints.size());
  SQLite::Statement keypoints(database, "INSERT INTO keypoints VALUES (?, ?, 4, ?)");
  keypoints.bind(1, image_id);
  keypoints.bind(2, rows);
  BindBlob(keypoints, 3, features.keypoints.data(), rows * sizeof(Keypoint));
  keypoints.exec();
  SQLite::Statement descriptors(database, "INSERT INTO descriptors VALUES (?, ?, 128, ?)");
  descriptors.bind(1, image_id);
  descriptors.bind(2, rows);
  BindBlob(descriptors, 3, features.descriptors.data(), rows * kDescriptorDim);
  descriptors.exec();
}

void WriteDatabaseTwoViewGeometry(SQLite::Database& database, const TwoViewGeometry& geometry) {
  static_assert(sizeof(Match) == 2 * sizeof(uint32_t));
  SQLite::Statement insert(
      database,
      "INSERT INTO two_view_geometries (pair_id, rows, cols, data, config, F, E, H, qvec, "
      "tvec) VALUES (?, ?, 2, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(1, PairIdFromImageIds(geometry.image_id1, geometry.image_id2));
  insert.bind(2, static_cast<int64_t>(geometry.inliers.size()));
  BindBlob(insert, 3, geometry.inliers.data(), geometry.inliers.size() * sizeof(Match));
  insert.bind(4, static_cast<int>(geometry.config));
  BindMatrix(insert, 5, geometry.F);
  BindMatrix(insert, 6, geometry.E);
  BindMatrix(insert, 7, geometry.H);
  // COLMAP 3.8's matcher leaves the relative pose zero, too: its mapper estimates it from the matches.
  const double qvec[4] = {0, 0, 0, 0};
  const double tvec[3] = {0, 0, 0};
  BindBlob(insert, 8, qvec, sizeof(qvec));
  BindBlob(insert, 9, tvec, sizeof(tvec));
  insert.exec();
}

}  // namespace cairn
