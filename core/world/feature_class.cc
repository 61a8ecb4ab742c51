#include "core/world/feature_class.h"

#include <array>
#include <set>

#include "core/features/descriptor_kind_table.h"
#include "core/files/database.h"
#include "core/world/dropped_items.h"
#include "schemas/classes_sql.h"

namespace cairn {
namespace {

using PoseArray = std::array<double, 7>;

PoseArray ArrayFromPose(const Pose& pose) {
  return {pose.rotation.w(),    pose.rotation.x(),    pose.rotation.y(),   pose.rotation.z(),
          pose.translation.x(), pose.translation.y(), pose.translation.z()};
}

Pose PoseFromArray(const PoseArray& a) {
  return {Eigen::Quaterniond(a[0], a[1], a[2], a[3]), Eigen::Vector3d(a[4], a[5], a[6])};
}

// What an observation looks like in its blob: the struct itself has no padding.
static_assert(sizeof(Observation) == 24 && std::is_trivially_copyable_v<Observation>);
static_assert(sizeof(SessionSightings) == 12 && std::is_trivially_copyable_v<SessionSightings>);

template <size_t N>
void BindArray(SQLite::Statement& statement, int index, const std::array<double, N>& values) {
  statement.bind(index, values.data(), static_cast<int>(sizeof(double) * N));
}

template <size_t N>
Result<std::array<double, N>> ArrayFromColumn(const SQLite::Column& column, const std::string& what) {
  std::array<double, N> values;
  if (column.getBytes() != static_cast<int>(sizeof(values))) {
    return MakeError(ErrorCode::kCorrupt, "{}: blob of {} bytes, expected {}", what, column.getBytes(),
                     sizeof(values));
  }
  std::memcpy(values.data(), column.getBlob(), sizeof(values));
  return values;
}

Result<FeatureClass> ClassFromRow(SQLite::Statement& row, const std::string& path,
                                  const std::set<ImageId>& image_ids, size_t num_sessions, int num_values) {
  FeatureClass feature_class;
  feature_class.class_id = row.getColumn(0).getUInt();
  const std::string what = fmt::format("{}: class {}", path, feature_class.class_id);
  CAIRN_ASSIGN_OR_RETURN(const auto position, ArrayFromColumn<3>(row.getColumn(1), what));
  CAIRN_ASSIGN_OR_RETURN(const auto c, ArrayFromColumn<6>(row.getColumn(2), what));
  feature_class.position = Eigen::Vector3d(position[0], position[1], position[2]);
  feature_class.covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  feature_class.reprojection_error_px = row.getColumn(3).getDouble();
  const SQLite::Column descriptor = row.getColumn(4);
  if (descriptor.getBytes() != num_values) {
    return MakeError(ErrorCode::kCorrupt, "{}: descriptor of {} bytes, expected {}", what,
                     descriptor.getBytes(), num_values);
  }
  feature_class.descriptor.resize(num_values);
  std::memcpy(feature_class.descriptor.data(), descriptor.getBlob(), num_values);
  CAIRN_ASSIGN_OR_RETURN(feature_class.observations, BlobToVector<Observation>(row.getColumn(5), what));
  for (const Observation& observation : feature_class.observations) {
    if (image_ids.count(observation.image_id) == 0) {
      return MakeError(ErrorCode::kCorrupt, "{}: observed in image {}, which the file does not list", what,
                       observation.image_id);
    }
  }
  feature_class.age.presence = static_cast<float>(row.getColumn(6).getDouble());
  CAIRN_ASSIGN_OR_RETURN(feature_class.age.sessions, BlobToVector<SessionSightings>(row.getColumn(7), what));
  if (!feature_class.age.sessions.empty() && feature_class.age.sessions.size() != num_sessions) {
    return MakeError(ErrorCode::kCorrupt, "{}: sightings of {} sessions, expected {}", what,
                     feature_class.age.sessions.size(), num_sessions);
  }
  return feature_class;
}

Result<std::vector<FeatureClass>> SelectClasses(SQLite::Database& database, const std::string& table,
                                                const std::string& path, const std::set<ImageId>& image_ids,
                                                size_t num_sessions, int num_values) {
  std::vector<FeatureClass> classes;
  LimitedStatement row(database,
                       "SELECT class_id, position, covariance, reprojection_error_px, descriptor, "
                       "observations, presence, sightings FROM " +
                           table + " ORDER BY 1");
  while (row.executeStep()) {
    CAIRN_ASSIGN_OR_RETURN(FeatureClass feature_class,
                           ClassFromRow(row, path, image_ids, num_sessions, num_values));
    classes.push_back(std::move(feature_class));
  }
  return classes;
}

void InsertClasses(SQLite::Database& database, const std::string& table,
                   const std::vector<FeatureClass>& classes) {
  SQLite::Statement row(database, "INSERT INTO " + table + " VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  for (const FeatureClass& feature_class : classes) {
    const Eigen::Vector3d& p = feature_class.position;
    const Eigen::Matrix3d& c = feature_class.covariance;
    row.bind(1, feature_class.class_id);
    BindArray(row, 2, std::array<double, 3>{p.x(), p.y(), p.z()});
    BindArray(row, 3, std::array<double, 6>{c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)});
    row.bind(4, feature_class.reprojection_error_px);
    row.bind(5, feature_class.descriptor.data(), static_cast<int>(feature_class.descriptor.size()));
    row.bind(6, feature_class.observations.data(),
             static_cast<int>(feature_class.observations.size() * sizeof(Observation)));
    row.bind(7, static_cast<double>(feature_class.age.presence));
    // No sessions: an empty blob, not NULL.
    const std::vector<SessionSightings>& sightings = feature_class.age.sessions;
    row.bind(8, sightings.empty() ? static_cast<const void*>("") : sightings.data(),
             static_cast<int>(sightings.size() * sizeof(SessionSightings)));
    row.exec();
    row.reset();
  }
}

void InsertChanges(SQLite::Database& database, const std::vector<PlaceChange>& changes) {
  SQLite::Statement row(database, "INSERT INTO changes VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const PlaceChange& change : changes) {
    row.bind(1, change.session);
    BindArray(row, 2, std::array<double, 3>{change.position.x(), change.position.y(), change.position.z()});
    row.bind(3, change.radius_m);
    row.bind(4, change.num_vanished);
    row.bind(5, change.num_appeared);
    row.bind(6, change.image_before);
    row.bind(7, change.image_after);
    row.bind(8, change.moved_to);
    row.bind(9, change.num_moved);
    row.exec();
    row.reset();
  }
}

Result<std::vector<PlaceChange>> SelectChanges(SQLite::Database& database, const std::string& path,
                                               const std::set<ImageId>& image_ids, size_t num_sessions) {
  std::vector<PlaceChange> changes;
  LimitedStatement row(database,
                       "SELECT session_idx, position, radius_m, num_vanished, num_appeared, image_before, "
                       "image_after, moved_to, num_moved FROM changes ORDER BY rowid");
  while (row.executeStep()) {
    PlaceChange change;
    change.session = row.getColumn(0).getInt();
    const std::string what = fmt::format("{}: change {}", path, changes.size());
    CAIRN_ASSIGN_OR_RETURN(const auto position, ArrayFromColumn<3>(row.getColumn(1), what));
    change.position = {position[0], position[1], position[2]};
    change.radius_m = row.getColumn(2).getDouble();
    change.num_vanished = row.getColumn(3).getInt();
    change.num_appeared = row.getColumn(4).getInt();
    change.image_before = row.getColumn(5).getUInt();
    change.image_after = row.getColumn(6).getUInt();
    change.moved_to = row.getColumn(7).getInt();
    change.num_moved = row.getColumn(8).getInt();
    const bool images_exist = (change.image_before == 0 || image_ids.count(change.image_before) != 0) &&
                              (change.image_after == 0 || image_ids.count(change.image_after) != 0);
    if (change.session < 0 || static_cast<size_t>(change.session) >= num_sessions || !images_exist) {
      return MakeError(ErrorCode::kCorrupt, "{}: of session {} of {}, shown by images {} and {}", what,
                       change.session, num_sessions, change.image_before, change.image_after);
    }
    changes.push_back(change);
  }
  for (size_t i = 0; i < changes.size(); ++i) {
    const int32_t to = changes[i].moved_to;
    if (to < -1 || to >= static_cast<int32_t>(changes.size()) ||
        (to >= 0 && changes[to].session != changes[i].session)) {
      return MakeError(ErrorCode::kCorrupt, "{}: change {} moved to change {} of {}", path, i, to,
                       changes.size());
    }
  }
  return changes;
}

void InsertCameras(SQLite::Database& database, const std::string& table, const std::vector<Camera>& cameras) {
  SQLite::Statement row(database, "INSERT INTO " + table + " VALUES (?, ?, ?, ?, ?, ?)");
  for (const Camera& camera : cameras) {
    row.bind(1, camera.camera_id);
    row.bind(2, static_cast<int>(camera.model));
    row.bind(3, camera.width);
    row.bind(4, camera.height);
    row.bind(5, camera.params.data(), static_cast<int>(camera.params.size() * sizeof(double)));
    row.bind(6, camera.has_focal_prior ? 1 : 0);
    row.exec();
    row.reset();
  }
}

Result<std::vector<Camera>> SelectCameras(SQLite::Database& database, const std::string& table,
                                          const std::string& path) {
  std::vector<Camera> cameras;
  LimitedStatement row(database, "SELECT camera_id, model, width, height, params, has_focal_prior FROM " +
                                     table + " ORDER BY 1");
  while (row.executeStep()) {
    Camera camera;
    camera.camera_id = row.getColumn(0).getUInt();
    CAIRN_ASSIGN_OR_RETURN(camera.model, CameraModelFromId(row.getColumn(1).getInt()));
    camera.width = row.getColumn(2).getInt();
    camera.height = row.getColumn(3).getInt();
    CAIRN_ASSIGN_OR_RETURN(const std::vector<double> params,
                           BlobToVector<double>(row.getColumn(4), path + ": " + table));
    camera.params.assign(params.begin(), params.end());
    camera.has_focal_prior = row.getColumn(5).getInt() != 0;
    CAIRN_RETURN_IF_ERROR(CheckCamera(camera));
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace

Status WriteClasses(const Classes& classes, const std::string& path,
                    const std::vector<DroppedItem>& dropped_items) {
  return WriteDatabase(path, kClassesSql, [&](SQLite::Database& database) -> Status {
    WriteDescriptorKind(database, classes.descriptor_kind);
    InsertCameras(database, "cameras", classes.cameras);
    InsertCameras(database, "stated_cameras", classes.stated_cameras);
    SQLite::Statement image_row(database, "INSERT INTO images VALUES (?, ?, ?, ?, ?)");
    for (const SurveyImage& image : classes.images) {
      image_row.bind(1, image.image_id);
      image_row.bind(2, image.name);
      image_row.bind(3, image.camera_id);
      BindArray(image_row, 4, ArrayFromPose(image.cam_from_world));
      BindArray(image_row, 5, ArrayFromPose(image.given_cam_from_world));
      image_row.exec();
      image_row.reset();
    }
    InsertClasses(database, "classes", classes.classes);
    InsertClasses(database, "vanished", classes.vanished);
    SQLite::Statement session_row(database, "INSERT INTO sessions VALUES (?, ?)");
    for (size_t i = 0; i < classes.sessions.size(); ++i) {
      session_row.bind(1, static_cast<int64_t>(i));
      session_row.bind(2, classes.sessions[i]);
      session_row.exec();
      session_row.reset();
    }
    InsertChanges(database, classes.changes);
    SQLite::Statement alignment_row(database, "INSERT INTO alignment VALUES (?, ?, ?, ?)");
    BindArray(alignment_row, 1, ArrayFromPose(classes.camera_from_given));
    alignment_row.bind(2, classes.stated_pose_sigma_m);
    alignment_row.bind(3, classes.stated_pose_sigma_deg);
    alignment_row.bind(4, classes.keypoint_correlation);
    alignment_row.exec();
    SQLite::Statement dropped_row(database, "INSERT INTO dropped VALUES (?, ?)");
    for (const auto& [reason, num_classes] : classes.dropped) {
      dropped_row.bind(1, reason);
      dropped_row.bind(2, num_classes);
      dropped_row.exec();
      dropped_row.reset();
    }
    WriteDroppedItems(database, kDroppedItemsTable, dropped_items);
    return Ok();
  });
}

Status WriteClasses(const Classes& classes, const std::string& path) {
  return WriteClasses(classes, path, {});
}

Result<Classes> ReadClasses(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<Classes> {
    if (!HasTable(database, "classes") || !HasTable(database, "stated_cameras") ||
        !HasTable(database, "vanished") || !HasColumn(database, "changes", "moved_to")) {
      return MakeError(
          ErrorCode::kUnsupported,
          "{}: has no tables 'classes', 'stated_cameras' and 'vanished'; expected the output of this "
          "program's group-classes",
          path);
    }
    Classes classes;
    CAIRN_ASSIGN_OR_RETURN(classes.descriptor_kind, ReadDescriptorKind(database, path));
    const int num_values = classes.descriptor_kind.num_values;
    CAIRN_ASSIGN_OR_RETURN(classes.cameras, SelectCameras(database, "cameras", path));
    CAIRN_ASSIGN_OR_RETURN(classes.stated_cameras, SelectCameras(database, "stated_cameras", path));
    std::set<CameraId> camera_ids;
    for (const Camera& camera : classes.cameras) camera_ids.insert(camera.camera_id);
    std::set<ImageId> image_ids;
    LimitedStatement image_row(database,
                               "SELECT image_id, name, camera_id, refined, given FROM images ORDER BY 1");
    while (image_row.executeStep()) {
      SurveyImage image;
      image.image_id = image_row.getColumn(0).getUInt();
      image.name = image_row.getColumn(1).getString();
      image.camera_id = image_row.getColumn(2).getUInt();
      CAIRN_ASSIGN_OR_RETURN(const PoseArray refined,
                             ArrayFromColumn<7>(image_row.getColumn(3), path + ": " + image.name));
      CAIRN_ASSIGN_OR_RETURN(const PoseArray given,
                             ArrayFromColumn<7>(image_row.getColumn(4), path + ": " + image.name));
      image.cam_from_world = PoseFromArray(refined);
      image.given_cam_from_world = PoseFromArray(given);
      if (!image_ids.insert(image.image_id).second)
        return MakeError(ErrorCode::kCorrupt, "{}: two images have the number {}", path, image.image_id);
      if (!camera_ids.contains(image.camera_id)) {
        return MakeError(ErrorCode::kCorrupt, "{}: image '{}' has camera {}, which is not in it", path,
                         image.name, image.camera_id);
      }
      classes.images.push_back(image);
    }
    LimitedStatement session_row(database, "SELECT name FROM sessions ORDER BY session_idx");
    while (session_row.executeStep()) classes.sessions.push_back(session_row.getColumn(0).getString());
    CAIRN_ASSIGN_OR_RETURN(classes.classes, SelectClasses(database, "classes", path, image_ids,
                                                          classes.sessions.size(), num_values));
    CAIRN_ASSIGN_OR_RETURN(classes.vanished, SelectClasses(database, "vanished", path, image_ids,
                                                           classes.sessions.size(), num_values));
    CAIRN_ASSIGN_OR_RETURN(classes.changes,
                           SelectChanges(database, path, image_ids, classes.sessions.size()));
    LimitedStatement alignment_row(
        database,
        "SELECT camera_from_given, stated_pose_sigma_m, stated_pose_sigma_deg, keypoint_correlation "
        "FROM alignment");
    if (alignment_row.executeStep()) {
      CAIRN_ASSIGN_OR_RETURN(const PoseArray pose,
                             ArrayFromColumn<7>(alignment_row.getColumn(0), path + ": alignment"));
      classes.camera_from_given = PoseFromArray(pose);
      classes.stated_pose_sigma_m = alignment_row.getColumn(1).getDouble();
      classes.stated_pose_sigma_deg = alignment_row.getColumn(2).getDouble();
      classes.keypoint_correlation = alignment_row.getColumn(3).getDouble();
    }
    LimitedStatement dropped_row(database, "SELECT reason, num_classes FROM dropped ORDER BY 1");
    while (dropped_row.executeStep())
      classes.dropped[dropped_row.getColumn(0).getString()] = dropped_row.getColumn(1).getInt64();
    return classes;
  });
}

}  // namespace cairn
