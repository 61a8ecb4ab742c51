#include "core/capture/capture_features.h"

#include <filesystem>
#include <set>
#include <utility>

#include "core/capture/sessions.h"
#include "core/colmap/colmap_database.h"
#include "core/colmap/cut_database.h"
#include "core/features/descriptor_kind_table.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// A keypoint at the border may lie a little outside, where an image was made smaller before.
constexpr float kBorderPx = 1;

bool HasPath(const std::string& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

Result<SQLite::Database> OpenFeatures(const std::string& path, bool is_cut) {
  return is_cut ? OpenCutDatabase(path) : OpenColmapDatabase(path);
}

// Of a database whose end is missing those whose rows are there.
Result<std::vector<DatabaseImage>> ReadImages(const std::string& path, bool is_cut,
                                              SQLite::Database& database) {
  if (!is_cut) return ReadDatabaseImages(database);
  std::vector<DatabaseImage> images = ReadCutDatabaseImages(database);
  if (!images.empty()) return images;
  return MakeError(ErrorCode::kCorrupt, "{}: no row of table images is there", path);
}

Result<std::map<std::string, FeaturesRow>> ReadRows(const std::string& path, const std::string& prefix) {
  const DatabasePart part = PartOfDatabase(path);
  auto read = WithDatabaseErrors(path, [&]() -> Result<std::map<std::string, FeaturesRow>> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenFeatures(path, part.is_cut()));
    CAIRN_ASSIGN_OR_RETURN(const auto cameras, ReadDatabaseCameras(database));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images,
                           ReadImages(path, part.is_cut(), database));
    const bool replaces_files = HasDescriptorKind(database);
    std::map<std::string, FeaturesRow> rows;
    for (const DatabaseImage& image : images) {
      const auto camera = cameras.find(image.camera_id);
      if (camera == cameras.end()) {
        return MakeError(ErrorCode::kCorrupt, "{}: image '{}' has camera {}, which is not in it", path,
                         image.name, image.camera_id);
      }
      rows.emplace(prefix + image.name, FeaturesRow{path, image.image_id, camera->second, replaces_files});
    }
    if (!HasTable(database, "cairn_landmark_images")) return rows;
    std::set<int64_t> of_landmarks;
    LimitedStatement query(database, "SELECT image_id FROM cairn_landmark_images");
    while (query.executeStep()) of_landmarks.insert(query.getColumn(0).getInt64());
    for (auto& [name, row] : rows) row.are_landmarks = of_landmarks.contains(row.image_id);
    return rows;
  });
  if (read.ok() || !part.is_cut()) return read;
  return MakeError(ErrorCode::kCorrupt, "{}, and its images and cameras are not; copy it again",
                   CutText(path, part));
}

Result<Features> ReadFeaturesOf(const FeaturesRow& row, const Camera& camera, bool is_cut) {
  return WithDatabaseErrors(row.path, [&]() -> Result<Features> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenFeatures(row.path, is_cut));
    if (camera.width != row.camera.width || camera.height != row.camera.height) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: features of an image of {} x {} px, but its camera {} has {} x {} px", row.path,
                       row.camera.width, row.camera.height, camera.camera_id, camera.width, camera.height);
    }
    Features features;
    CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, row.image_id));
    CAIRN_ASSIGN_OR_RETURN(features.kind, ReadDescriptorKind(database, row.path));
    CAIRN_ASSIGN_OR_RETURN(features.descriptors,
                           ReadDatabaseDescriptors(database, row.image_id, features.kind));
    if (static_cast<Eigen::Index>(features.keypoints.size()) != features.descriptors.rows()) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {}: {} keypoints and {} descriptors", row.path,
                       row.image_id, features.keypoints.size(), features.descriptors.rows());
    }
    for (size_t i = 0; i < features.keypoints.size(); ++i) {
      const Keypoint& keypoint = features.keypoints[i];
      const bool is_inside = keypoint.x >= -kBorderPx && keypoint.y >= -kBorderPx &&
                             keypoint.x <= static_cast<float>(camera.width) + kBorderPx &&
                             keypoint.y <= static_cast<float>(camera.height) + kBorderPx;
      if (!is_inside) {
        return MakeError(ErrorCode::kCorrupt,
                         "{}: image {}: keypoint {} at ({:g}, {:g}) is not in {} x {} px", row.path,
                         row.image_id, i, keypoint.x, keypoint.y, camera.width, camera.height);
      }
      if (!(keypoint.scale > 0 || (keypoint.scale == 0 && !features.kind.is_sift()))) {
        return MakeError(ErrorCode::kCorrupt, "{}: image {}: keypoint {} has the scale {:g}", row.path,
                         row.image_id, i, keypoint.scale);
      }
    }
    return features;
  });
}

}  // namespace

std::string SessionFeaturesPath(const std::string& root, const std::string& session) {
  return fmt::format("{}/{}/{}.db", root, kFeaturesFolder, session);
}

std::string CaptureFeatures::PathOf(const std::string& session) const {
  const std::string path =
      session.empty() ? root_ + "/" + kFeaturesFile : SessionFeaturesPath(root_, session);
  return HasPath(path) ? path : "";
}

std::string CaptureFeatures::SessionOf(const std::string& name) const {
  const std::string session = name.substr(0, name.find('/'));
  return session.size() < name.size() && IsSessionName(session) && !PathOf(session).empty() ? session : "";
}

std::string CaptureFeatures::PathFor(const std::string& name) const { return PathOf(SessionOf(name)); }

Result<const std::map<std::string, FeaturesRow>*> CaptureFeatures::List(const std::string& session) {
  auto found = read_.find(session);
  if (found == read_.end()) {
    std::map<std::string, FeaturesRow> rows;
    if (const std::string path = PathOf(session); !path.empty()) {
      CAIRN_ASSIGN_OR_RETURN(rows, ReadRows(path, session.empty() ? "" : session + "/"));
    }
    found = read_.emplace(session, std::move(rows)).first;
  }
  return &found->second;
}

Result<const FeaturesRow*> CaptureFeatures::Find(const std::string& name) {
  CAIRN_ASSIGN_OR_RETURN(const auto* rows, List(SessionOf(name)));
  const auto row = rows->find(name);
  return row == rows->end() ? nullptr : &row->second;
}

bool CaptureFeatures::ReplacesFiles(const std::string& name) {
  const std::string session = SessionOf(name);
  const auto [known, is_new] = replace_files_.try_emplace(session, false);
  if (is_new) {
    const auto rows = List(session);
    known->second = rows.ok() && !(*rows)->empty() && (*rows)->begin()->second.replaces_file;
  }
  return known->second;
}

Result<Features> ReadCaptureFeatures(const FeaturesRow& row, const Camera& camera) {
  const DatabasePart part = PartOfDatabase(row.path);
  const Result<Features> features = ReadFeaturesOf(row, camera, part.is_cut());
  if (!part.is_cut()) return features;
  // A row that ends on a page of which a part is missing ends in zeros.
  const bool is_whole =
      features.ok() && (features->descriptors.rows() == 0 || features->descriptors.bottomRows(1).any());
  if (is_whole) return features;
  return MakeError(ErrorCode::kCorrupt, "{}, and the features of image {} are not; copy it again",
                   CutText(row.path, part), row.image_id);
}

}  // namespace cairn
