#include "pipeline/commands/odometry.h"

#include <cmath>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

Result<Odometry> Odometry::Read(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  Odometry odometry;
  odometry.path_ = path;
  size_t number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::vector<std::string> words = SplitWords(line.substr(0, line.find('#')));
    if (words.empty()) continue;
    double values[3] = {0, 0, 0};
    bool is_valid = words.size() == 3;
    for (size_t i = 0; i < 3 && is_valid; ++i)
      is_valid = ParseNumber(words[i], &values[i]) && std::isfinite(values[i]);
    if (!is_valid) {
      return MakeError(
          ErrorCode::kCorrupt,
          "{}:{}: '{}' is not an image's odometry; expected metres ahead, metres to the left and "
          "degrees turned to the left",
          path, number, line);
    }
    odometry.steps_.push_back({{values[0], values[1]}, RadFromDeg(values[2])});
  }
  return odometry;
}

Status Odometry::MoveToNext(const std::string& image,
                            const std::function<Status(const Eigen::Vector2d&, double)>& move) {
  if (num_read_ == steps_.size()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: it has lines for {} images, and none for image {}, '{}'; each needs one", path_,
                     steps_.size(), steps_.size() + 1, image);
  }
  const Step& step = steps_[num_read_++];
  return num_read_ == 1 ? Ok() : move(step.way_m, step.turn_left_rad);
}

Status Odometry::CheckAllRead() const {
  if (num_read_ == steps_.size()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{}: it has lines for {} images, and there were {}", path_,
                   steps_.size(), num_read_);
}

}  // namespace cairn::pipeline
