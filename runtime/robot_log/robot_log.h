#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/blocks/map_head.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/geometry/pose.h"
#include "runtime/robot_log/log_budget.h"

namespace cairn {

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
  // The image's file, whose suffix the frame's name has.  With keep_images it is copied; else it need not be
  // there.
  std::string image_path;
};

// An open log: a folder to which frames are added, by one process at a time.
//   features.db    the features, and in tables cairn_log_... all that the lists are made from
//   images.txt, cameras.txt, frame.json     as of any capture; written anew with each frame
//   images/        with keep_images
// A frame is in it whole or not at all, whenever its process is killed.
//
// Chosen are frames that differ in place from all that were kept in the last 24 hours: by more than 0.5 m or
// 30 degrees, and more where the budget is low, so that what is left is spread over places and hours.  Same
// frames at the same times, same choice.  For one thread at a time.
class RobotLog {
 public:
  // Makes the folder, or goes on with a log of a map of this name and frame.  Errors: InvalidArgument (an
  // option, a folder with something else in it, the log of another map), Busy (another process writes to it),
  // Corrupt, Io.
  static Result<RobotLog> Open(const std::string& folder, const MapHead& map, const RobotLogOptions& options,
                               const MachineClocks& now);
  RobotLog(RobotLog&& other) noexcept;
  RobotLog& operator=(RobotLog&& other) noexcept;
  ~RobotLog();

  // Whether a frame with this fix may be kept: its place is new, and half of the last kept frame's bytes
  // would fit.  If not, its features need not be known.
  bool IsWanted(const Pose& cam_from_world, const MachineClocks& now);
  // Whether the frame was kept.  Errors: Io, DiskFull; Corrupt.
  Result<bool> Offer(const LoggedFrame& frame, const MachineClocks& now);

  int num_kept() const;  // by this object

 private:
  class Writer;
  explicit RobotLog(std::unique_ptr<Writer> writer);

  std::unique_ptr<Writer> writer_;
};

}  // namespace cairn
