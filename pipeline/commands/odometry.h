#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/line/command.h"
#include "runtime/localize/localization.h"

namespace cairn::pipeline {

// What a robot's other sensors say of images: a text file with a line of three numbers for each.  What stands
// behind a # is a comment.
class SensorFile {
 public:
  // `line_is`: "an image's odometry; expected metres ahead, ...".  Errors: Io, NotFound; Corrupt, naming the
  // line, where one has not three finite numbers.
  static Result<SensorFile> Read(const std::string& path, const std::string& line_is);

  // Those of the next image.  Errors: InvalidArgument where there is no line left for it.
  Result<std::array<double, 3>> Next(const std::string& image);
  bool is_first() const { return num_read_ <= 1; }  // the line last read is the first image's
  // Errors: InvalidArgument where there are more lines than there were images.
  Status CheckAllRead() const;

 private:
  std::string path_;
  std::vector<std::array<double, 3>> lines_;
  size_t num_read_ = 0;
};

// How a robot drove from image to image, as its wheels say: metres ahead and to the left, in the robot's
// frame at the image before, and degrees turned to the left.  The first image's line counts nothing.
class Odometry {
 public:
  // Errors: as SensorFile.
  static Result<Odometry> Read(const std::string& path);

  // The next line moves the robot: metres ahead and to the left, radians to the left.  Errors: as SensorFile,
  // and those of `move`.
  Status MoveToNext(const std::string& image,
                    const std::function<Status(const Eigen::Vector2d&, double)>& move);
  Status CheckAllRead() const { return file_.CheckAllRead(); }

 private:
  SensorFile file_;
};

// --gravity and --gravity-sigma-deg.
struct GravityArguments {
  std::string path;      // empty: not given
  double sigma_deg = 0;  // 0: not given

  void Add(ArgumentParser& parser, const std::string& help);
  // Refuses an error of gravity without gravity, and these options.  Errors: InvalidArgument.
  Status Check(const OptionArguments& given, const std::vector<std::string>& options) const;
};

// Which way was up at each image: a direction in the camera's frame (x right, y down, z ahead; of any
// length).
class Gravity {
 public:
  // With an error that is usual, 2 degrees, where none was given.  Errors: as SensorFile.
  static Result<Gravity> Read(const GravityArguments& arguments);
  // Errors: as SensorFile, and as CheckSensedUp, naming the image.
  Result<SensedUp> Next(const std::string& image);
  Status CheckAllRead() const { return file_.CheckAllRead(); }

 private:
  SensorFile file_;
  double sigma_deg_ = 0;
};

}  // namespace cairn::pipeline
