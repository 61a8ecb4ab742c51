#include "pipeline/commands/odometry.h"

#include <cmath>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

Result<SensorFile> SensorFile::Read(const std::string& path, const std::string& line_is) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  SensorFile file;
  file.path_ = path;
  size_t number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::vector<std::string> words = SplitWords(line.substr(0, line.find('#')));
    if (words.empty()) continue;
    std::array<double, 3> values = {0, 0, 0};
    bool is_valid = words.size() == values.size();
    for (size_t i = 0; i < values.size() && is_valid; ++i)
      is_valid = ParseNumber(words[i], &values[i]) && std::isfinite(values[i]);
    if (!is_valid)
      return MakeError(ErrorCode::kCorrupt, "{}:{}: '{}' is not {}", path, number, line, line_is);
    file.lines_.push_back(values);
  }
  return file;
}

Result<std::array<double, 3>> SensorFile::Next(const std::string& image) {
  if (num_read_ == lines_.size()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: it has lines for {} images, and none for image {}, '{}'; each needs one", path_,
                     lines_.size(), lines_.size() + 1, image);
  }
  return lines_[num_read_++];
}

Status SensorFile::CheckAllRead() const {
  if (num_read_ == lines_.size()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{}: it has lines for {} images, and there were {}", path_,
                   lines_.size(), num_read_);
}

Result<Odometry> Odometry::Read(const std::string& path) {
  Odometry odometry;
  CAIRN_ASSIGN_OR_RETURN(
      odometry.file_,
      SensorFile::Read(path,
                       "an image's odometry; expected metres ahead, metres to the left and degrees turned "
                       "to the left"));
  return odometry;
}

Status Odometry::MoveToNext(const std::string& image,
                            const std::function<Status(const Eigen::Vector2d&, double)>& move) {
  CAIRN_ASSIGN_OR_RETURN(const auto step, file_.Next(image));
  return file_.is_first() ? Ok() : move({step[0], step[1]}, RadFromDeg(step[2]));
}

void GravityArguments::Add(ArgumentParser& parser, const std::string& help) {
  parser.Add("--gravity", path, help).Type("FILE");
  parser.Add("--gravity-sigma-deg", sigma_deg, "Standard deviation of gravity's direction, degrees [2]")
      .Range(1e-3, 90.0)
      .Type("DEG");
}

Status GravityArguments::Check(const OptionArguments& given, const std::vector<std::string>& options) const {
  if (!path.empty()) return Ok();
  CAIRN_RETURN_IF_ERROR(given.RefuseGiven(options, "is for gravity; give --gravity, or leave it out"));
  if (sigma_deg == 0) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "--gravity-sigma-deg is the error of --gravity; give that, or leave this out");
}

Result<Gravity> Gravity::Read(const GravityArguments& arguments) {
  constexpr double kUsualSigmaDeg = 2;
  Gravity gravity;
  gravity.sigma_deg_ = arguments.sigma_deg > 0 ? arguments.sigma_deg : kUsualSigmaDeg;
  CAIRN_ASSIGN_OR_RETURN(
      gravity.file_,
      SensorFile::Read(arguments.path,
                       "an image's gravity; expected the direction up in the camera's frame: to the right, "
                       "down and ahead"));
  return gravity;
}

Result<SensedUp> Gravity::Next(const std::string& image) {
  CAIRN_ASSIGN_OR_RETURN(const auto numbers, file_.Next(image));
  const SensedUp up{{numbers[0], numbers[1], numbers[2]}, sigma_deg_};
  if (const Status status = CheckSensedUp(up); !status.ok())
    return MakeError(status.error().code, "{}: {}", image, status.error().message);
  return up;
}

}  // namespace cairn::pipeline
