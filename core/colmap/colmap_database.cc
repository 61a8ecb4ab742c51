#include "core/colmap/colmap_database.h"

#include "core/base/pooled.h"
#include "core/base/printable.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <tuple>
#include <unordered_map>

namespace cairn {
namespace {

// COLMAP's Database::kMaxNumImages.
constexpr int64_t kMaxNumImages = 2147483647;
constexpr int64_t kMaxId = kMaxNumImages - 1;
constexpr int kMaxKeypoints = 10000000;
constexpr int kMaxTwoViewConfig = 8;  // WATERMARK = 7 and MULTIPLE = 8 come from COLMAP only

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
  return MakeError(ErrorCode::kCorrupt, "{}: table {}, row {}: {}", DatabasePath(database), table, row,
                   problem);
}

// Reads the columns of one row and keeps what is wrong with the first invalid one.
class RowReader {
 public:
  explicit RowReader(SQLite::Statement& statement) : statement_(statement) {}

  int64_t Integer(int index, int64_t min, int64_t max) {
    const SQLite::Column column = statement_.getColumn(index);
    const int64_t value = column.getInt64();
    if (column.isInteger() && value >= min && value <= max) return value;
    Fail(fmt::format("{} is {}, expected {} to {}", column.getName(),
                     column.isInteger() ? std::to_string(value) : "no integer", min, max));
    return min;
  }

  // A blob of rows x columns values of `value_size` bytes, the counts in the columns before it.
  std::string_view Matrix(int index, int64_t num_columns, size_t value_size) {
    const int64_t rows = Integer(index - 2, 0, kMaxKeypoints);
    const SQLite::Column blob = statement_.getColumn(index);
    const auto num_bytes = static_cast<size_t>(blob.getBytes());
    if (blob.isText()) Fail("a text in place of a blob");
    if (num_bytes != static_cast<size_t>(rows * num_columns) * value_size) {
      Fail(fmt::format("blob of {} bytes, expected {} x {} values of {} bytes", num_bytes, rows, num_columns,
                       value_size));
    }
    if (!ok()) return {};
    return {static_cast<const char*>(blob.getBlob()), num_bytes};
  }

  void Fail(const std::string& problem) {
    if (problem_.empty()) problem_ = problem;
  }
  bool ok() const { return problem_.empty(); }
  const std::string& problem() const { return problem_; }

 private:
  SQLite::Statement& statement_;
  std::string problem_;
};

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
  LimitedStatement query(
      database, "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras ORDER BY 1");
  while (query.executeStep()) {
    RowReader row(query);
    Camera camera;
    camera.camera_id = static_cast<CameraId>(row.Integer(0, 0, kMaxId));
    const auto model = CameraModelFromId(static_cast<int>(row.Integer(1, INT32_MIN, INT32_MAX)));
    camera.width = static_cast<int>(row.Integer(2, 1, INT32_MAX));
    camera.height = static_cast<int>(row.Integer(3, 1, INT32_MAX));
    camera.has_focal_prior = row.Integer(5, INT32_MIN, INT32_MAX) != 0;
    if (!row.ok()) return BadRow(database, "cameras", query.getColumn(0).getInt64(), row.problem());
    if (!model.ok()) {
      return MakeError(ErrorCode::kUnsupported, "{}: table cameras, row {}: {}", DatabasePath(database),
                       camera.camera_id, model.error().message);
    }
    camera.model = *model;
    CAIRN_ASSIGN_OR_RETURN(
        const std::vector<double> params,
        BlobToVector<double>(query.getColumn(4), fmt::format("{}: table cameras, row {}",
                                                             DatabasePath(database), camera.camera_id)));
    camera.params.assign(params.begin(), params.end());
    if (const Status status = CheckCamera(camera); !status.ok()) {
      return BadRow(database, "cameras", camera.camera_id, status.error().message);
    }
    cameras.emplace(camera.camera_id, camera);
  }
  return cameras;
}

Result<std::vector<DatabaseImage>> ReadDatabaseImages(SQLite::Database& database) {
  std::vector<DatabaseImage> images;
  std::map<std::string, ImageId> names;
  LimitedStatement query(database, "SELECT image_id, name, camera_id FROM images ORDER BY image_id");
  while (query.executeStep()) {
    RowReader row(query);
    DatabaseImage image;
    image.image_id = static_cast<ImageId>(row.Integer(0, 0, kMaxId));
    image.name = query.getColumn(1).getString();
    image.camera_id = static_cast<CameraId>(row.Integer(2, 0, kMaxId));
    if (image.name.empty()) row.Fail("the image has no name");
    if (HasControlCharacter(image.name))
      row.Fail(fmt::format("the image's name, '{}', has a control character", image.name));
    const auto [named, is_new] = names.emplace(image.name, image.image_id);
    if (!is_new) row.Fail(fmt::format("image {} has the same name, '{}'", named->second, image.name));
    if (!images.empty() && images.back().image_id >= image.image_id)
      row.Fail("another image has the same number");
    if (!row.ok()) return BadRow(database, "images", query.getColumn(0).getInt64(), row.problem());
    images.push_back(std::move(image));
  }
  return images;
}

Keypoint KeypointOfShape(float x, float y, const float* shape) {
  return {x, y, 0.5f * (std::hypot(shape[0], shape[2]) + std::hypot(shape[1], shape[3])),
          std::atan2(shape[2], shape[0])};
}

Result<PooledVector<Keypoint>> ReadDatabaseKeypoints(SQLite::Database& database, ImageId image_id) {
  LimitedStatement query(database, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?");
  query.bind(1, image_id);
  PooledVector<Keypoint> keypoints;
  if (!query.executeStep()) return keypoints;
  RowReader row(query);
  // 2: x, y; 4: + scale, orientation; 6: x, y and an affine shape a11 a12 a21 a22 (COLMAP's FeatureKeypoint).
  const int64_t columns = row.Integer(1, INT32_MIN, INT32_MAX);
  if (row.ok() && columns != 2 && columns != 4 && columns != 6)
    row.Fail(fmt::format("{} columns, expected 2, 4 or 6", columns));
  const std::string_view blob = row.Matrix(2, row.ok() ? columns : 0, sizeof(float));
  if (!row.ok()) return BadRow(database, "keypoints", image_id, row.problem());
  keypoints.resize(blob.size() / (columns * sizeof(float)));
  for (size_t i = 0; i < keypoints.size(); ++i) {
    float v[6] = {0, 0, 1, 0, 0, 0};
    std::memcpy(v, blob.data() + i * columns * sizeof(float), columns * sizeof(float));
    Keypoint& keypoint = keypoints[i];
    keypoint = {v[0], v[1], v[2], v[3]};
    if (columns == 6) keypoint = KeypointOfShape(v[0], v[1], v + 2);
    if (!std::isfinite(keypoint.x) || !std::isfinite(keypoint.y) || !std::isfinite(keypoint.scale) ||
        !std::isfinite(keypoint.orientation)) {
      return BadRow(database, "keypoints", image_id, fmt::format("keypoint {} is not finite", i));
    }
  }
  return keypoints;
}

Result<int> ReadNumDescriptors(SQLite::Database& database, ImageId image_id) {
  LimitedStatement query(database, "SELECT rows FROM descriptors WHERE image_id = ?");
  query.bind(1, image_id);
  if (!query.executeStep()) return 0;
  RowReader row(query);
  const int64_t rows = row.Integer(0, 0, kMaxKeypoints);
  if (!row.ok()) return BadRow(database, "descriptors", image_id, row.problem());
  return static_cast<int>(rows);
}

Result<DescriptorMatrix> ReadDatabaseDescriptors(SQLite::Database& database, ImageId image_id,
                                                 const DescriptorKind& kind) {
  // COLMAP 4.0 says what extracted them: 0 is SIFT.
  const bool has_type = HasColumn(database, "descriptors", "type");
  LimitedStatement query(database,
                         fmt::format("SELECT rows, cols, data, {} FROM descriptors WHERE image_id = ?",
                                     has_type ? "type" : "0"));
  query.bind(1, image_id);
  DescriptorMatrix descriptors(0, kind.num_values);
  if (!query.executeStep()) return descriptors;
  RowReader row(query);
  const int64_t type = row.Integer(3, INT32_MIN, INT32_MAX);
  const int64_t columns = row.Integer(1, INT32_MIN, INT32_MAX);
  const int64_t rows = row.Integer(0, 0, kMaxKeypoints);
  if (row.ok() && rows > 0 && kind.is_sift() &&
      (type != 0 || columns == kSiftDescriptorDim * int64_t{sizeof(float)})) {
    return MakeError(
        ErrorCode::kUnsupported,
        "{}: table descriptors, row {}: {} bytes a descriptor{}: not SIFT's 128 bytes; say what they "
        "are: `cairn features DATABASE CAPTURE --descriptors float` (or binary)",
        DatabasePath(database), image_id, columns,
        type != 0 ? fmt::format(", of extractor type {}", type) : "");
  }
  if (row.ok() && rows > 0 && columns != kind.num_values)
    row.Fail(fmt::format("{} columns, expected {}", columns, kind.num_values));
  const std::string_view blob = row.Matrix(2, kind.num_values, 1);
  if (!row.ok()) return BadRow(database, "descriptors", image_id, row.problem());
  descriptors.resize(rows, kind.num_values);
  if (rows > 0) std::memcpy(descriptors.data(), blob.data(), blob.size());
  return descriptors;
}

namespace {

// Number of keypoints of every image, by image_id.
Result<std::unordered_map<ImageId, int64_t>> CountKeypoints(SQLite::Database& database) {
  std::unordered_map<ImageId, int64_t> num_keypoints;
  LimitedStatement query(
      database, "SELECT image_id, coalesce(rows, 0) FROM images LEFT JOIN keypoints USING (image_id)");
  while (query.executeStep()) {
    RowReader row(query);
    const auto image_id = static_cast<ImageId>(row.Integer(0, 0, kMaxId));
    const bool is_first = num_keypoints.emplace(image_id, row.Integer(1, 0, kMaxKeypoints)).second;
    if (!is_first) row.Fail("the image has two rows");  // one of which is read as its keypoints
    if (!row.ok()) return BadRow(database, "keypoints", query.getColumn(0).getInt64(), row.problem());
  }
  return num_keypoints;
}

// What is wrong with the images and indices of a pair; empty when nothing is.
std::string PairProblem(const TwoViewGeometry& geometry,
                        const std::unordered_map<ImageId, int64_t>& num_keypoints) {
  const auto image1 = num_keypoints.find(geometry.image_id1);
  const auto image2 = num_keypoints.find(geometry.image_id2);
  if (geometry.image_id1 >= geometry.image_id2 || image1 == num_keypoints.end() ||
      image2 == num_keypoints.end()) {
    return fmt::format(
        "a pair of the images {} and {}: expected two ids of the table images, the smaller first",
        geometry.image_id1, geometry.image_id2);
  }
  for (const Match& match : geometry.inliers) {
    if (match.idx1 < image1->second && match.idx2 < image2->second) continue;
    return fmt::format("matches keypoints {} and {} of images with {} and {} keypoints", match.idx1,
                       match.idx2, image1->second, image2->second);
  }
  return "";
}

}  // namespace

Status ForEachTwoViewGeometry(SQLite::Database& database, int min_num_inliers,
                              const std::function<Status(TwoViewGeometry)>& visit) {
  CAIRN_ASSIGN_OR_RETURN(const auto num_keypoints, CountKeypoints(database));
  const char* const table = "two_view_geometries";
  const auto matrix_column = [&](const char* name) {
    return HasColumn(database, table, name) ? name : "NULL";
  };
  LimitedStatement query(
      database, fmt::format("SELECT pair_id, rows, cols, data, config, {}, {}, {} FROM {} ORDER BY 1",
                            matrix_column("F"), matrix_column("E"), matrix_column("H"), table));
  while (query.executeStep()) {
    RowReader row(query);
    TwoViewGeometry geometry;
    const int64_t pair_id = row.Integer(0, 0, kMaxNumImages * kMaxNumImages);
    std::tie(geometry.image_id1, geometry.image_id2) = ImageIdsFromPairId(pair_id);
    const int64_t rows = row.Integer(1, 0, kMaxKeypoints);
    if (rows > 0) row.Integer(2, 2, 2);
    const std::string_view blob = row.Matrix(3, 2, sizeof(uint32_t));
    geometry.config = static_cast<TwoViewConfig>(row.Integer(4, 0, kMaxTwoViewConfig));
    if (row.ok()) {
      geometry.inliers.resize(rows);
      if (rows > 0) std::memcpy(geometry.inliers.data(), blob.data(), blob.size());
      if (const std::string problem = PairProblem(geometry, num_keypoints); !problem.empty())
        row.Fail(problem);
    }
    if (!row.ok()) return BadRow(database, table, query.getColumn(0).getInt64(), row.problem());
    if (rows < min_num_inliers) continue;
    std::sort(geometry.inliers.begin(), geometry.inliers.end());
    geometry.inliers.erase(std::unique(geometry.inliers.begin(), geometry.inliers.end()),
                           geometry.inliers.end());
    geometry.F = MatrixFromColumn(query.getColumn(5));
    geometry.E = MatrixFromColumn(query.getColumn(6));
    geometry.H = MatrixFromColumn(query.getColumn(7));
    CAIRN_RETURN_IF_ERROR(visit(std::move(geometry)));
  }
  return Ok();
}

Result<std::vector<TwoViewGeometry>> ReadDatabaseTwoViewGeometries(SQLite::Database& database,
                                                                   int min_num_inliers) {
  std::vector<TwoViewGeometry> geometries;
  CAIRN_RETURN_IF_ERROR(
      ForEachTwoViewGeometry(database, min_num_inliers, [&](TwoViewGeometry geometry) -> Status {
        geometries.push_back(std::move(geometry));
        return Ok();
      }));
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
  SQLite::Statement descriptors(database, "INSERT INTO descriptors VALUES (?, ?, ?, ?)");
  descriptors.bind(1, image_id);
  descriptors.bind(2, rows);
  descriptors.bind(3, static_cast<int64_t>(features.descriptors.cols()));
  BindBlob(descriptors, 4, features.descriptors.data(), features.descriptors.size());
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
