#include "runtime/scans/carmen_log.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "core/base/text.h"
#include "core/files/file.h"
#include "runtime/scans/wheel_log.h"

namespace cairn {
namespace {

// A range that occurs so often, and is the largest, is what the laser says where it met nothing.
constexpr int kNumOften = 20;

double LargestRange(const std::vector<RangeScan>& scans) {
  double largest = 0;
  int64_t num = 0;
  for (const RangeScan& scan : scans) {
    for (const double range : scan.ranges_m) {
      if (range > largest) num = 0;
      largest = std::max(largest, range);
      num += range == largest ? 1 : 0;
    }
  }
  return num >= kNumOften ? largest : std::numeric_limits<double>::infinity();
}

// Beyond what any robot measures, metres and radians.
constexpr double kFarthest = 1e5;

// A number of a message.
Result<double> NumberOf(const std::string& word, const std::string& what, const std::string& where) {
  double value = 0;
  if (ParseNumber(word, &value) && std::isfinite(value)) return value;
  return Corrupt(what, "{}: \"{}\" is not a finite number", where, word);
}

struct LoggedScan {
  RangeScan scan;
  PlanarPose wheels;  // of its line
};

Result<LoggedScan> ParseScan(const std::vector<std::string>& words, const std::string& what,
                             const std::string& where) {
  int num_beams = 0;
  if (words.size() < 2 || !ParseNumber(words[1], &num_beams) || num_beams < 1 || num_beams > kMaxBeams ||
      words.size() < static_cast<size_t>(num_beams) + 9) {
    return Corrupt(what,
                   "{}: FLASER with {} words; expected a number of beams, their ranges, two poses and times",
                   where, words.size());
  }
  std::vector<double> values;
  for (int i = 0; i < num_beams + 7; ++i) {
    CAIRN_ASSIGN_OR_RETURN(const double value, NumberOf(words[i + 2], what, where));
    values.push_back(value);
  }
  LoggedScan logged;
  RangeScan& scan = logged.scan;
  scan.first_angle_rad = -std::numbers::pi / 2;
  scan.step_rad = std::numbers::pi / (num_beams % 2 == 0 ? num_beams : std::max(1, num_beams - 1));
  scan.ranges_m.assign(values.begin(), values.begin() + num_beams);
  const double* after = values.data() + num_beams;
  scan.pose = {{after[0], after[1]}, after[2]};
  logged.wheels = {{after[3], after[4]}, after[5]};
  scan.time_s = after[6];
  return logged;
}

// Of three words.
Result<PlanarPose> PoseOf(std::span<const std::string> words, const std::string& what,
                          const std::string& where) {
  std::array<double, 3> values{};
  for (size_t i = 0; i < values.size(); ++i) {
    CAIRN_ASSIGN_OR_RETURN(values[i], NumberOf(words[i], what, where));
  }
  return PlanarPose{{values[0], values[1]}, values[2]};
}

// ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range accuracy remission_mode
//   n r_1 ... r_n m s_1 ... s_m laser_x laser_y laser_theta robot_x robot_y robot_theta tv rv forward side
//   turn ipc_timestamp host logger_timestamp
Result<RangeScan> ParseRobotLaser(const std::vector<std::string>& words, const std::string& what,
                                  const std::string& where) {
  constexpr size_t kHead = 8, kAfter = 14;
  int num_beams = 0, num_remissions = 0;
  const bool has_ranges = words.size() > kHead && ParseNumber(words[kHead], &num_beams) && num_beams >= 1 &&
                          num_beams <= kMaxBeams && words.size() > kHead + num_beams + 1;
  if (!has_ranges || !ParseNumber(words[kHead + num_beams + 1], &num_remissions) || num_remissions < 0 ||
      num_remissions > kMaxBeams || words.size() < kHead + num_beams + 2 + num_remissions + kAfter) {
    return Corrupt(what,
                   "{}: ROBOTLASER1 with {} words; expected seven values, a number of beams, their ranges, a "
                   "number of remissions, these, two poses, five values and times",
                   where, words.size());
  }
  RangeScan scan;
  CAIRN_ASSIGN_OR_RETURN(scan.first_angle_rad, NumberOf(words[2], what, where));
  CAIRN_ASSIGN_OR_RETURN(scan.step_rad, NumberOf(words[4], what, where));
  CAIRN_ASSIGN_OR_RETURN(scan.max_range_m, NumberOf(words[5], what, where));
  if (std::abs(scan.first_angle_rad) > kFarthest || std::abs(scan.step_rad) > kFarthest)
    return Corrupt(what, "{}: angles from {} rad on, {} rad apart", where, words[2], words[4]);
  for (int i = 0; i < num_beams; ++i) {
    CAIRN_ASSIGN_OR_RETURN(const double range_m, NumberOf(words[kHead + 1 + i], what, where));
    scan.ranges_m.push_back(range_m);
  }
  const auto after = std::span(words).subspan(kHead + num_beams + 2 + num_remissions);
  CAIRN_ASSIGN_OR_RETURN(scan.pose, PoseOf(after, what, where));
  CAIRN_ASSIGN_OR_RETURN(scan.time_s, NumberOf(after[11], what, where));
  return scan;
}

Status AddOdometry(const std::vector<std::string>& words, const std::string& what, const std::string& where,
                   WheelLog* wheels) {
  if (words.size() < 4)
    return Corrupt(what, "{}: ODOM with {} words; expected x, y, theta and more", where, words.size());
  CAIRN_ASSIGN_OR_RETURN(const PlanarPose pose, PoseOf(std::span(words).subspan(1), what, where));
  // x y theta tv rv [accel] ipc_timestamp host logger_timestamp
  double time_s = 0;
  const bool has_time = (words.size() == 9 || words.size() == 10) &&
                        ParseNumber(words[words.size() - 3], &time_s) && std::isfinite(time_s);
  wheels->AddOdometry(pose, has_time ? std::optional(time_s) : std::nullopt);
  return Ok();
}

}  // namespace

Result<std::vector<RangeScan>> ParseCarmenLog(const std::string& text, const std::string& what) {
  if (text.starts_with("\x1f\x8b")) return Corrupt(what, "is compressed; unpack it with gunzip");
  std::vector<RangeScan> scans;
  WheelLog wheels;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::string where = fmt::format("line {}", number);
    if (line.starts_with("ODOM ")) {
      CAIRN_RETURN_IF_ERROR(AddOdometry(SplitWords(line), what, where, &wheels));
    } else if (line.starts_with("PARAM robot_frontlaser_offset ")) {
      const std::vector<std::string> words = SplitWords(line);
      if (words.size() < 3) return Corrupt(what, "{}: robot_frontlaser_offset without a number", where);
      CAIRN_ASSIGN_OR_RETURN(const double offset_m, NumberOf(words[2], what, where));
      wheels.SetLaserOffset(offset_m);
    } else if (line.starts_with("FLASER ")) {
      CAIRN_ASSIGN_OR_RETURN(LoggedScan logged, ParseScan(SplitWords(line), what, where));
      wheels.AddScan(logged.scan.pose, logged.wheels, logged.scan.time_s);
      scans.push_back(std::move(logged.scan));
    } else if (line.starts_with("ROBOTLASER1 ")) {
      CAIRN_ASSIGN_OR_RETURN(RangeScan scan, ParseRobotLaser(SplitWords(line), what, where));
      wheels.AddScan(scan.pose, std::nullopt, scan.time_s);
      scans.push_back(std::move(scan));
    }
  }
  const double largest = LargestRange(scans);
  for (size_t i = 0; i < scans.size(); ++i) {
    scans[i].max_range_m = std::min(scans[i].max_range_m, largest);
    scans[i].odometry = wheels.LaserAt(i);
  }
  if (scans.empty()) return MakeError(ErrorCode::kNoData, "{}: no FLASER or ROBOTLASER1 line in it", what);
  return scans;
}

Result<std::vector<RangeScan>> ReadCarmenLog(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  return ParseCarmenLog(text, path);
}

}  // namespace cairn
