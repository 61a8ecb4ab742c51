#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"

namespace cairn::pipeline {

// How a robot drove from image to image, as its wheels say: a text file with a line for each image, three
// numbers: metres ahead and to the left, in the robot's frame at the image before, and degrees turned to the
// left.  What stands behind a # is a comment.  The first image's line counts nothing.
class Odometry {
 public:
  // Errors: Io, NotFound; Corrupt, naming the line, where one has not three finite numbers.
  static Result<Odometry> Read(const std::string& path);

  // The next line moves the robot: metres ahead and to the left, radians to the left.  Errors:
  // InvalidArgument where there is no line left for the image, and those of `move`.
  Status MoveToNext(const std::string& image,
                    const std::function<Status(const Eigen::Vector2d&, double)>& move);
  // Errors: InvalidArgument where there are more lines than there were images.
  Status CheckAllRead() const;

 private:
  struct Step {
    Eigen::Vector2d way_m = Eigen::Vector2d::Zero();
    double turn_left_rad = 0;
  };
  std::string path_;
  std::vector<Step> steps_;
  size_t num_read_ = 0;
};

}  // namespace cairn::pipeline
