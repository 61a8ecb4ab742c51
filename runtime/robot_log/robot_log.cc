#include "runtime/robot_log/robot_log.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "core/capture/capture_features.h"
#include "core/capture/capture_frame.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/files/file_lock.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kRecentS = 86400;
// How far apart frames are at least, with a full budget; with an empty one so many times as far.
constexpr double kRadiusM = 0.5, kRadiusDeg = 30, kMaxRadiusRatio = 8;
// What a frame takes on the disk besides its features: rows, half-filled pages, lines of lists.
constexpr double kBytesBesides = 16384;
// Of reading a small log.
constexpr int64_t kMaxLoadSteps = 10'000'000;
// Of the write-ahead log, in pages of 4 KiB, before it is taken into the database.
constexpr int kMaxLogPages = 128;

constexpr char kLogSchema[] = R"sql(
CREATE TABLE cairn_log_map (name TEXT NOT NULL, frame TEXT NOT NULL);
CREATE TABLE cairn_log_frames (image_id INTEGER PRIMARY KEY NOT NULL, lived_s REAL NOT NULL, qw REAL NOT NULL,
  qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, tx REAL NOT NULL, ty REAL NOT NULL, tz REAL NOT NULL);
CREATE TABLE cairn_log_budget (bytes REAL NOT NULL, lived_s REAL NOT NULL, latest_wall_s REAL NOT NULL,
  boot_s REAL NOT NULL, boot_id TEXT NOT NULL);
)sql";

// A line of images.txt and the empty one after it.
std::string ListLine(ImageId image_id, const Pose& pose, CameraId camera_id, const std::string& name) {
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.6f} {:.6f} {:.6f} {} {}\n\n", image_id,
                     pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z(),
                     pose.translation.x(), pose.translation.y(), pose.translation.z(), camera_id, name);
}

// A new database, put in place when it is whole.
Status WriteEmptyLog(const std::string& path, const MapHead& map, const LogBudget& budget) {
  return WriteDatabase(
      path, std::string(kColmapSchema) + kLogSchema, [&](SQLite::Database& database) -> Status {
        SQLite::Statement row(database, "INSERT INTO cairn_log_map VALUES (?, ?)");
        row.bind(1, map.name);
        row.bind(2, CaptureFrameJson(map.frame));
        row.exec();
        SQLite::Statement state(database, "INSERT INTO cairn_log_budget VALUES (?, 0, ?, ?, ?)");
        state.bind(1, budget.bytes);
        state.bind(2, budget.latest_wall_s);
        state.bind(3, budget.boot_s);
        state.bind(4, budget.boot_id);
        state.exec();
        return Ok();
      });
}

Status CheckIsOurs(const std::string& folder, const std::string& database) {
  std::error_code error;
  if (fs::exists(database, error)) return Ok();
  for (const char* name : {"images.txt", "images"}) {
    if (!fs::exists(folder + "/" + name, error)) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has {} and is no log of a robot: a log is not added to another capture; name a new "
                     "folder",
                     folder, name);
  }
  return Ok();
}

Result<FileLock> LockFolder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return MakeError(ErrorCode::kIo, "{}: the folder cannot be made: {}", folder, error.message());
  const std::string path = folder + "/lock";
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0)
    return MakeError(ErrorCode::kIo, "{}: cannot be opened: {}", path, std::strerror(errno));
  FileLock lock(descriptor);
  if (lock.Try(FileLock::Kind::kExclusive) != FileLock::Claim::kTaken) return lock;
  return MakeError(ErrorCode::kBusy, "{}: another process writes this log; give each its own folder", folder);
}

}  // namespace

class RobotLog::Writer {
 public:
  Writer(std::string folder, const RobotLogOptions& options, FileLock lock)
      : folder_(std::move(folder)), options_(options), lock_(std::move(lock)) {}
  Status Load(const MapHead& map, const MachineClocks& now);
  bool IsWanted(const Pose& cam_from_world, const MachineClocks& now);
  Result<bool> Offer(const LoggedFrame& frame, const MachineClocks& now);
  double MaxBytesPerDay() const { return 1e6 * options_.max_mb_per_day; }
  int num_kept() const { return num_kept_; }

 private:
  struct Kept {
    Pose cam_from_world;
    double lived_s = 0;
  };

  bool IsElsewhere(const Pose& cam_from_world) const;
  Status Keep(const LoggedFrame& frame, const std::string& name, double num_bytes);
  CameraId CameraIdOf(const Camera& camera);
  void SaveBudget();
  Status WriteLists() const;

  std::string folder_;
  RobotLogOptions options_;
  FileLock lock_;
  std::unique_ptr<SQLite::Database> database_;
  LogBudget budget_;
  std::vector<Kept> recent_;  // of the last 24 hours
  std::map<CameraId, Camera> cameras_;
  std::string images_text_;  // of images.txt
  ImageId last_id_ = 0;
  int num_kept_ = 0;
  double last_num_bytes_ = 0;  // of the frame that was kept last
};

RobotLog::RobotLog(std::unique_ptr<Writer> writer) : writer_(std::move(writer)) {}
RobotLog::RobotLog(RobotLog&& other) noexcept = default;
RobotLog& RobotLog::operator=(RobotLog&& other) noexcept = default;
RobotLog::~RobotLog() = default;

int RobotLog::num_kept() const { return writer_->num_kept(); }

bool RobotLog::IsWanted(const Pose& cam_from_world, const MachineClocks& now) {
  return writer_->IsWanted(cam_from_world, now);
}

Result<bool> RobotLog::Offer(const LoggedFrame& frame, const MachineClocks& now) {
  return writer_->Offer(frame, now);
}

Result<RobotLog> RobotLog::Open(const std::string& folder, const MapHead& map, const RobotLogOptions& options,
                                const MachineClocks& now) {
  if (!(options.max_mb_per_day > 0) || !std::isfinite(options.max_mb_per_day)) {
    return MakeError(ErrorCode::kInvalidArgument, "max_mb_per_day is {:g}; must be greater than 0",
                     options.max_mb_per_day);
  }
  if (!map.descriptor_kind.is_sift()) {
    return MakeError(ErrorCode::kUnsupported,
                     "map '{}' has descriptors of the kind '{}', and a log keeps SIFT's", map.name,
                     ToString(map.descriptor_kind));
  }
  const std::string path = folder + "/" + kFeaturesFile;
  CAIRN_RETURN_IF_ERROR(CheckIsOurs(folder, path));
  CAIRN_ASSIGN_OR_RETURN(FileLock lock, LockFolder(folder));
  auto writer = std::make_unique<Writer>(folder, options, std::move(lock));
  std::error_code error;
  if (!fs::exists(path, error)) {
    CAIRN_RETURN_IF_ERROR(WriteEmptyLog(path, map, LogBudget::Begin(writer->MaxBytesPerDay(), now)));
  }
  CAIRN_RETURN_IF_ERROR(CheckSqliteFile(path));
  CAIRN_RETURN_IF_ERROR(WithDatabaseErrors(path, [&] { return writer->Load(map, now); }));
  return RobotLog(std::move(writer));
}

Status RobotLog::Writer::Load(const MapHead& map, const MachineClocks& now) {
  const std::string path = folder_ + "/" + kFeaturesFile;
  database_ = std::make_unique<SQLite::Database>(path, SQLite::OPEN_READWRITE);
  SQLite::Database& database = *database_;
  Harden(database, UINT64_MAX);  // frames of any size are added
  ReadSchema(database);
  std::error_code error;
  const StepLimit steps(database, kMaxLoadSteps + 16 * static_cast<int64_t>(fs::file_size(path, error)));
  if (!HasTable(database, "cairn_log_frames")) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: no log of a robot, which are not added to other captures; name a new folder", path);
  }
  database.exec("PRAGMA journal_mode = WAL");
  database.exec(fmt::format("PRAGMA wal_autocheckpoint = {}", kMaxLogPages));
  LimitedStatement of_map(database, "SELECT name, frame FROM cairn_log_map");
  if (!of_map.executeStep() || of_map.getColumn(0).getString() != map.name ||
      of_map.getColumn(1).getString() != CaptureFrameJson(map.frame)) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: the log of another map, or of one in another frame, than '{}': its poses would not be "
        "of one frame; name another folder",
        folder_, map.name);
  }
  LimitedStatement state(database,
                         "SELECT bytes, lived_s, latest_wall_s, boot_s, boot_id FROM cairn_log_budget");
  if (!state.executeStep())
    return MakeError(ErrorCode::kCorrupt, "{}: table cairn_log_budget is empty", path);
  budget_ = {state.getColumn(0).getDouble(), state.getColumn(1).getDouble(), state.getColumn(2).getDouble(),
             state.getColumn(3).getDouble(), state.getColumn(4).getString()};
  budget_.Advance(MaxBytesPerDay(), now);
  CAIRN_ASSIGN_OR_RETURN(cameras_, ReadDatabaseCameras(database));
  LimitedStatement frames(database,
                          "SELECT image_id, name, camera_id, lived_s, qw, qx, qy, qz, tx, ty, tz FROM "
                          "cairn_log_frames JOIN images USING (image_id) ORDER BY image_id");
  images_text_.clear();
  while (frames.executeStep()) {
    const auto number = [&](int column) { return frames.getColumn(column).getDouble(); };
    const Pose pose{Eigen::Quaterniond(number(4), number(5), number(6), number(7)),
                    {number(8), number(9), number(10)}};
    last_id_ = frames.getColumn(0).getUInt();
    images_text_ += ListLine(last_id_, pose, frames.getColumn(2).getUInt(), frames.getColumn(1).getString());
    if (number(3) > budget_.lived_s - kRecentS) recent_.push_back({pose, number(3)});
  }
  // A process that was killed may have left lists without its last frame.
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder_ + "/" + kCaptureFrameFile, CaptureFrameJson(map.frame)));
  return images_text_.empty() ? Ok() : WriteLists();
}

bool RobotLog::Writer::IsElsewhere(const Pose& cam_from_world) const {
  const double fill = std::max(budget_.Fill(MaxBytesPerDay()), 1 / kMaxRadiusRatio);
  return std::none_of(recent_.begin(), recent_.end(), [&](const Kept& kept) {
    return kept.lived_s > budget_.lived_s - kRecentS &&
           std::hypot(CenterErrorM(cam_from_world, kept.cam_from_world) / kRadiusM,
                      RotationErrorDeg(cam_from_world, kept.cam_from_world) / kRadiusDeg) < 1 / fill;
  });
}

bool RobotLog::Writer::IsWanted(const Pose& cam_from_world, const MachineClocks& now) {
  budget_.Advance(MaxBytesPerDay(), now);
  return budget_.bytes >= kBytesBesides + 0.5 * last_num_bytes_ && IsElsewhere(cam_from_world);
}

Result<bool> RobotLog::Writer::Offer(const LoggedFrame& frame, const MachineClocks& now) {
  budget_.Advance(MaxBytesPerDay(), now);
  if (frame.features->keypoints.empty() || !IsElsewhere(frame.cam_from_world)) return false;
  std::error_code error;
  double num_bytes = kBytesBesides + static_cast<double>(frame.features->keypoints.size() *
                                                         (sizeof(Keypoint) + kSiftDescriptorDim));
  if (options_.keep_images) {
    const uintmax_t of_image = fs::file_size(frame.image_path, error);
    if (error) return MakeError(ErrorCode::kIo, "{}: {}", frame.image_path, error.message());
    num_bytes += static_cast<double>(of_image);
  }
  if (num_bytes > budget_.bytes) return false;
  const std::string name =
      fmt::format("{:08}{}", last_id_ + 1, fs::path(frame.image_path).extension().string());
  CAIRN_RETURN_IF_ERROR(
      WithDatabaseErrors(folder_ + "/" + kFeaturesFile, [&] { return Keep(frame, name, num_bytes); }));
  CAIRN_RETURN_IF_ERROR(WriteLists());
  ++num_kept_;
  last_num_bytes_ = num_bytes;
  return true;
}

// The image first, then all that refers to it at once, then the lists, which the next process writes where
// this one does not come to it.
Status RobotLog::Writer::Keep(const LoggedFrame& frame, const std::string& name, double num_bytes) {
  if (options_.keep_images) {
    std::error_code error;
    fs::create_directories(folder_ + "/images", error);
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(frame.image_path));
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder_ + "/images/" + name, bytes));
  }
  SQLite::Database& database = *database_;
  std::map<CameraId, Camera> cameras_before = cameras_;
  const LogBudget budget_before = budget_;
  const ImageId image_id = last_id_ + 1;
  const Pose& pose = frame.cam_from_world;
  const CameraId camera_id = CameraIdOf(*frame.camera);
  try {
    SQLite::Transaction transaction(database);
    if (!cameras_before.contains(camera_id)) WriteDatabaseCamera(database, cameras_.at(camera_id));
    WriteDatabaseImage(database, {image_id, name, camera_id});
    WriteDatabaseFeatures(database, image_id, *frame.features);
    SQLite::Statement row(database, "INSERT INTO cairn_log_frames VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
    row.bind(1, image_id);
    int column = 2;
    for (const double value :
         {budget_.lived_s, pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z(),
          pose.translation.x(), pose.translation.y(), pose.translation.z()})
      row.bind(column++, value);
    row.exec();
    budget_.bytes -= num_bytes;
    SaveBudget();
    transaction.commit();
  } catch (...) {
    cameras_.swap(cameras_before);
    budget_ = budget_before;
    throw;
  }
  last_id_ = image_id;
  recent_.push_back({pose, budget_.lived_s});
  images_text_ += ListLine(image_id, pose, camera_id, name);
  return Ok();
}

CameraId RobotLog::Writer::CameraIdOf(const Camera& camera) {
  for (const auto& [camera_id, known] : cameras_) {
    if (known.model == camera.model && known.width == camera.width && known.height == camera.height &&
        known.params == camera.params)
      return camera_id;
  }
  Camera added = camera;
  added.camera_id = cameras_.empty() ? 1 : cameras_.rbegin()->first + 1;
  cameras_.emplace(added.camera_id, added);
  return added.camera_id;
}

void RobotLog::Writer::SaveBudget() {
  SQLite::Statement row(*database_,
                        "UPDATE cairn_log_budget SET bytes = ?, lived_s = ?, latest_wall_s = ?, boot_s = ?, "
                        "boot_id = ?");
  row.bind(1, budget_.bytes);
  row.bind(2, budget_.lived_s);
  row.bind(3, budget_.latest_wall_s);
  row.bind(4, budget_.boot_s);
  row.bind(5, budget_.boot_id);
  row.exec();
}

Status RobotLog::Writer::WriteLists() const {
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder_ + "/cameras.txt", cameras_));
  return WriteFileAtomically(folder_ + "/images.txt", images_text_);
}

}  // namespace cairn
