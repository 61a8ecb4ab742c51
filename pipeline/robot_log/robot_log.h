#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_head.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/files/database.h"
#include "core/files/file_lock.h"
#include "core/geometry/pose.h"
#include "pipeline/robot_log/log_budget.h"

namespace cairn::pipeline {

// What a robot keeps of the frames that it localizes, for a later compile: a capture of features
// (core/capture/ capture_features.h), with images only where they are asked for.
struct RobotLogOptions {
  // Largest growth in any 24 hours, 10^6 bytes.  REQUIRES: > 0
  double max_mb_per_day = 50;
  bool keep_images = false;
};

// A frame with a fix.
struct LoggedFrame {
  const Features* features = nullptr;
  const Camera* camera = nullptr;  // by which it was localized
  Pose cam_from_world;
  std::string image_path;  // the image's file
};

// An open log: a folder to which frames are added, by one process at a time.
//   features.db    the features, and in tables cairn_log_... all that the lists are made from
//   images.txt, cameras.txt, frame.json     as of any capture; written anew with each frame
//   images/        with keep_images
// A frame is in it whole or not at all, whenever its process is killed.
//
// Chosen are frames that differ in place from all that were kept in the last 24 hours: by more than 0.5 m or
// 30 degrees, and more where the budget is low, so that what is left is spread over places and hours.  Same
// frames at the same times, same choice.
class RobotLog {
 public:
  // Makes the folder, or goes on with a log of a map of this name and frame.  Errors: InvalidArgument (a
  // folder with something else in it, the log of another map), Busy (another process writes to it), Corrupt,
  // Io.
  static Result<RobotLog> Open(const std::string& folder, const MapHead& map, const RobotLogOptions& options,
                               const MachineClocks& now);

  // Whether the frame was kept.  Errors: Io, DiskFull; Corrupt.
  Result<bool> Offer(const LoggedFrame& frame, const MachineClocks& now);

  int num_kept() const { return num_kept_; }  // by this object

 private:
  struct Kept {
    Pose cam_from_world;
    double lived_s = 0;
  };

  RobotLog(std::string folder, const RobotLogOptions& options, FileLock lock)
      : folder_(std::move(folder)), options_(options), lock_(std::move(lock)) {}
  Status Load(const MapHead& map, const MachineClocks& now);
  bool IsElsewhere(const Pose& cam_from_world) const;
  Status Keep(const LoggedFrame& frame, const std::string& name, double num_bytes);
  CameraId CameraIdOf(const Camera& camera);
  void SaveBudget();
  Status WriteLists() const;
  double MaxBytesPerDay() const { return 1e6 * options_.max_mb_per_day; }

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
};

}  // namespace cairn::pipeline
