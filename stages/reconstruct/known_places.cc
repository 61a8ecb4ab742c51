#include "stages/reconstruct/known_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/base/quantiles.h"
#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/trajectory.h"
#include "stages/reconstruct/inertial/image_times.h"

namespace cairn::reconstruct {
namespace {

std::set<std::string> NamesOf(const Capture& capture) {
  std::set<std::string> names;
  for (const CaptureImage& image : capture.images) names.insert(image.name);
  return names;
}

// Words [first, last) joined with single spaces, as in a name.
std::string Join(const std::vector<std::string>& words, size_t first, size_t last) {
  return fmt::format("{}", fmt::join(words.begin() + static_cast<std::ptrdiff_t>(first),
                                     words.begin() + static_cast<std::ptrdiff_t>(last), " "));
}

// Calls `read` with the words of each line that is not empty or a comment; adds the line's place to
// its error.
Status ReadLines(const std::string& path,
                 const std::function<Status(const std::vector<std::string>& words)>& read) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  int line_number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++line_number;
    const std::vector<std::string> words = SplitWords(line);
    if (words.empty() || words[0][0] == '#') continue;
    if (const Status status = read(words); !status.ok())
      return MakeError(ErrorCode::kCorrupt, "{}:{}: {}", path, line_number, status.error().message);
  }
  return Ok();
}

// Splits words [0, last) into two names that the capture has.
Status SplitNames(const std::vector<std::string>& words, size_t last, const std::set<std::string>& names,
                  KnownDistance* known) {
  for (size_t middle = 1; middle < last; ++middle) {
    known->name1 = Join(words, 0, middle);
    known->name2 = Join(words, middle, last);
    if (names.count(known->name1) > 0 && names.count(known->name2) > 0) return Ok();
  }
  return MakeError(ErrorCode::kCorrupt, "'{}' are not the names of two images of the capture",
                   Join(words, 0, last));
}

constexpr double kMaxNormError = 0.01;  // of a quaternion
constexpr size_t kNumPoseNumbers = 7;
// Odometry by time says where an image was if it says so at most this long before and after it.
constexpr double kMaxTimeGapS = 0.2;

// Of odometry: separated by spaces, or by commas.
std::vector<std::string> SplitOdometry(const std::vector<std::string>& words) {
  const auto first = words.end() - static_cast<std::ptrdiff_t>(std::min(words.size(), kNumPoseNumbers));
  const auto has_comma = [](const std::string& word) { return word.find(',') != std::string::npos; };
  if (std::none_of(first, words.end(), has_comma)) return words;
  std::string line = Join(words, 0, words.size());
  std::replace(line.begin(), line.end(), ',', ' ');
  return SplitWords(line);
}

// "time,x,y,z,qx,qy,qz,qw": where a pose should be there is no number.
bool IsHeader(const std::vector<std::string>& words) {
  double number = 0;
  return words.size() > kNumPoseNumbers &&
         std::none_of(words.end() - kNumPoseNumbers, words.end(),
                      [&](const std::string& word) { return ParseNumber(word, &number); });
}

// world_from_cam of the last words.
Result<Pose> ParseOdometry(const std::vector<std::string>& words) {
  std::array<double, kNumPoseNumbers> numbers{};
  bool is_valid = words.size() > kNumPoseNumbers;
  for (size_t i = 0; is_valid && i < kNumPoseNumbers; ++i)
    is_valid =
        ParseNumber(words[words.size() - kNumPoseNumbers + i], &numbers[i]) && std::isfinite(numbers[i]);
  if (!is_valid) {
    return MakeError(ErrorCode::kCorrupt,
                     "expected IMAGE TX TY TZ QX QY QZ QW, or TIME in place of IMAGE: the camera's place, "
                     "metres, and its rotation, world from camera, as a quaternion");
  }
  const Eigen::Quaterniond rotation(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (!(std::abs(rotation.norm() - 1) <= kMaxNormError))
    return MakeError(ErrorCode::kCorrupt, "a quaternion of length {:.3g}, not 1", rotation.norm());
  return Pose{rotation.normalized(), {numbers[0], numbers[1], numbers[2]}};
}

// "cam0/" of "cam0/17.25": sessions that were joined have theirs in front of a time, too.
std::string FolderAndSlash(const std::string& name) { return name.substr(0, name.rfind('/') + 1); }

// Of a time in seconds or, from 1e14 on, nanoseconds; by TUM's trajectories and EuRoC's.  To the nanosecond
// where digits say it, as images' names do (an odometry of keyframes has no other pose near), else, 1.7e+09,
// to the microsecond, which is what such a number holds.
std::optional<int64_t> TimeOfNs(const std::string& name) {
  constexpr double kLeastNs = 1e14, kMostNs = 9e18;
  const std::string text = name.substr(FolderAndSlash(name).size());
  double time = 0;
  if (!ParseNumber(text, &time) || !std::isfinite(time)) return {};
  const bool is_in_ns = std::abs(time) >= kLeastNs;
  if (text.find('.') != std::string::npos || is_in_ns) {
    if (const auto exact_ns = TimeOfImageNs(text + ".")) return exact_ns;
  }
  const double time_us = is_in_ns ? time / 1e3 : 1e6 * time;
  if (!(std::abs(time_us) < kMostNs / 1e3)) return {};
  return 1000 * std::llround(time_us);
}

// Those of the images below a folder, in the order of their times.
void AddPosesAt(const std::set<std::string>& names, const std::string& folder, Trajectory* trajectory,
                std::vector<OdometryPose>* poses) {
  trajectory->Sort();
  std::vector<std::pair<int64_t, std::string>> images;
  for (const std::string& name : names) {
    if (!name.starts_with(folder)) continue;
    if (const auto time_ns = TimeOfImageNs(name)) images.emplace_back(*time_ns, name);
  }
  std::sort(images.begin(), images.end());
  for (const auto& [time_ns, name] : images) {
    if (const Result<Pose> pose = trajectory->At(time_ns, kMaxTimeGapS); pose.ok())
      poses->push_back({name, *pose});
  }
}

double WrapLongitude(double longitude_deg) { return std::remainder(longitude_deg, 360.0); }

}  // namespace

Result<std::vector<KnownDistance>> ReadKnownDistances(const std::string& path, const Capture& capture) {
  const std::set<std::string> names = NamesOf(capture);
  std::vector<KnownDistance> distances;
  CAIRN_RETURN_IF_ERROR(ReadLines(path, [&](const std::vector<std::string>& words) -> Status {
    KnownDistance known;
    if (words.size() < 3 || !ParseNumber(words.back(), &known.distance_m) ||
        !std::isfinite(known.distance_m) || known.distance_m <= 0) {
      return MakeError(ErrorCode::kCorrupt, "expected IMAGE1 IMAGE2 METRES, with more than 0 metres");
    }
    CAIRN_RETURN_IF_ERROR(SplitNames(words, words.size() - 1, names, &known));
    if (known.name1 == known.name2)
      return MakeError(ErrorCode::kCorrupt, "{} is given a distance to itself", known.name1);
    distances.push_back(known);
    return Ok();
  }));
  if (distances.empty()) return MakeError(ErrorCode::kNoData, "{}: no line IMAGE1 IMAGE2 METRES", path);
  return distances;
}

Result<std::vector<KnownDistance>> ReadRigBaselines(const std::string& path, const Capture& capture) {
  const std::set<std::string> names = NamesOf(capture);
  std::vector<KnownDistance> distances;
  CAIRN_RETURN_IF_ERROR(ReadLines(path, [&](const std::vector<std::string>& words) -> Status {
    double distance_m = 0;
    if (words.size() != 3 || !ParseNumber(words[2], &distance_m) || !std::isfinite(distance_m) ||
        distance_m <= 0 || words[0] == words[1]) {
      return MakeError(ErrorCode::kCorrupt,
                       "expected FOLDER1 FOLDER2 METRES, two folders and more than 0 metres");
    }
    const std::string first = words[0] + "/", second = words[1] + "/";
    for (const std::string& folder : {first, second}) {
      const auto image = names.lower_bound(folder);
      if (image == names.end() || !image->starts_with(folder))
        return MakeError(ErrorCode::kCorrupt, "the capture has no image below '{}'", folder);
    }
    const size_t num_before = distances.size();
    for (auto image = names.lower_bound(first); image != names.end() && image->starts_with(first); ++image) {
      const std::string other = second + image->substr(first.size());
      if (names.contains(other)) distances.push_back({*image, other, distance_m});
    }
    if (distances.size() > num_before) return Ok();
    return MakeError(
        ErrorCode::kCorrupt,
        "no image below '{}' has the name of one below '{}': images that were taken at once must have "
        "the same name in both",
        first, second);
  }));
  if (distances.empty()) return MakeError(ErrorCode::kNoData, "{}: no line FOLDER1 FOLDER2 METRES", path);
  return distances;
}

Result<std::map<std::string, Eigen::Vector3d>> ReadControlPoints(const std::string& path,
                                                                 const Capture& capture) {
  const std::set<std::string> names = NamesOf(capture);
  std::map<std::string, Eigen::Vector3d> points;
  CAIRN_RETURN_IF_ERROR(ReadLines(path, [&](const std::vector<std::string>& words) -> Status {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    bool is_valid = words.size() >= 4;
    for (size_t i = 0; is_valid && i < 3; ++i)
      is_valid = ParseNumber(words[words.size() - 3 + i], &point[static_cast<Eigen::Index>(i)]);
    if (!is_valid || !point.allFinite())
      return MakeError(ErrorCode::kCorrupt, "expected IMAGE X Y Z, in metres");
    const std::string name = Join(words, 0, words.size() - 3);
    if (names.count(name) == 0) return MakeError(ErrorCode::kCorrupt, "the capture has no image '{}'", name);
    if (!points.emplace(name, point).second)
      return MakeError(ErrorCode::kCorrupt, "image '{}' is listed twice", name);
    return Ok();
  }));
  if (points.empty()) return MakeError(ErrorCode::kNoData, "{}: no line IMAGE X Y Z", path);
  return points;
}

Result<std::vector<OdometryPose>> ReadOdometry(const std::string& path, const Capture& capture) {
  const std::set<std::string> names = NamesOf(capture);
  std::set<std::string> listed;
  std::vector<OdometryPose> poses;
  std::map<std::string, Trajectory> by_time;  // of each folder
  CAIRN_RETURN_IF_ERROR(ReadLines(path, [&](const std::vector<std::string>& given) -> Status {
    const std::vector<std::string> words = SplitOdometry(given);
    if (IsHeader(words)) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const Pose world_from_cam, ParseOdometry(words));
    const std::string name = Join(words, 0, words.size() - kNumPoseNumbers);
    if (!listed.insert(name).second) return MakeError(ErrorCode::kCorrupt, "'{}' is listed twice", name);
    if (names.contains(name)) {
      poses.push_back({name, world_from_cam});
    } else if (const std::optional<int64_t> time_ns = TimeOfNs(name)) {
      by_time[FolderAndSlash(name)].Add(*time_ns, world_from_cam);
    }
    return Ok();
  }));
  if (!poses.empty()) return poses;
  for (auto& [folder, trajectory] : by_time) AddPosesAt(names, folder, &trajectory, &poses);
  if (!poses.empty()) return poses;
  if (!by_time.empty()) {
    return MakeError(ErrorCode::kNoData,
                     "{}: its lines begin with times, and no image of the capture is named by a time "
                     "(seconds with a point, "
                     "1700000000.250000000.jpg, or nanoseconds) between two of them that are at most {} s "
                     "off; begin each line "
                     "with the name of an image, or name images by their times",
                     path, kMaxTimeGapS);
  }
  return MakeError(ErrorCode::kNoData, "{}: names none of the {} images of the capture", path,
                   capture.images.size());
}

std::map<std::string, ExifTags> ReadGpsTags(const Capture& capture) {
  std::map<std::string, ExifTags> tags;
  for (const CaptureImage& image : capture.images) {
    const ExifTags exif = ReadExif(capture.ImagePath(image));
    if (exif.gps) tags.emplace(image.name, exif);
  }
  return tags;
}

GeodeticPosition MedianPosition(const std::map<std::string, ExifTags>& tags) {
  const double first = tags.begin()->second.gps->longitude_deg;
  std::vector<double> latitudes, longitudes, altitudes;
  for (const auto& [name, exif] : tags) {
    latitudes.push_back(exif.gps->latitude_deg);
    longitudes.push_back(WrapLongitude(exif.gps->longitude_deg - first));
    if (exif.has_altitude) altitudes.push_back(exif.gps->altitude_m);
  }
  return {std::round(1e7 * UpperMedian(latitudes)) / 1e7,
          std::round(1e7 * WrapLongitude(first + UpperMedian(longitudes))) / 1e7,
          altitudes.empty() ? 0 : std::round(100 * UpperMedian(altitudes)) / 100};
}

}  // namespace cairn::reconstruct
