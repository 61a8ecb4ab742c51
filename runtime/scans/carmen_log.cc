#include "runtime/scans/carmen_log.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn {
namespace {

constexpr int kMaxBeams = 100000;

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

// Where the wheels say that a log's scans were taken.
class WheelLog {
 public:
  Status AddOdometry(const std::vector<std::string>& words, const std::string& what,
                     const std::string& where) {
    if (words.size() < 4)
      return Corrupt(what, "{}: ODOM with {} words; expected x, y, theta and more", where, words.size());
    std::array<double, 3> values{};
    for (size_t i = 0; i < values.size(); ++i) {
      CAIRN_ASSIGN_OR_RETURN(values[i], NumberOf(words[i + 1], what, where));
    }
    // The third from the end, of logs with and without an acceleration.
    double time_s = last_told_s_;
    if (words.size() >= 7) (void)ParseNumber(words[words.size() - 3], &time_s);
    const PlanarPose told = {{values[0], values[1]}, values[2]};
    PlanarPose wheels = told;
    if (!messages_.empty()) {
      // What has no time tells a corrected pose, from which the next messages go on: nothing moved.
      const bool moved = time_s != 0 || last_told_s_ == 0;
      const PlanarPose& last = messages_.back().wheels;
      wheels = moved ? Moved(last, last_told_, told) : last;
    }
    last_told_ = told;
    last_told_s_ = time_s;
    messages_.push_back({wheels, time_s});
    return Ok();
  }
  Status SetLaserOffset(const std::vector<std::string>& words, const std::string& what,
                        const std::string& where) {
    if (words.size() < 3) return Corrupt(what, "{}: robot_frontlaser_offset without a number", where);
    CAIRN_ASSIGN_OR_RETURN(laser_offset_m_, NumberOf(words[2], what, where));
    return Ok();
  }
  void AddScan(const LoggedScan& logged) {
    scans_.push_back({logged.wheels, logged.scan.time_s, messages_.size()});
    const PlanarPose& pose = logged.scan.pose;
    told_by_scans_ = told_by_scans_ || pose.position != logged.wheels.position ||
                     pose.heading_rad != logged.wheels.heading_rad;
  }

  // The laser's pose.
  std::optional<PlanarPose> LaserAt(size_t scan) const {
    std::optional<PlanarPose> wheels;
    if (told_by_scans_) {
      wheels = scans_[scan].wheels;
    } else if (!messages_.empty()) {
      wheels = Between(scans_[scan]);
    }
    if (wheels) wheels->position = wheels->FloorFromRobot({laser_offset_m_, 0});
    return wheels;
  }

 private:
  struct Message {
    PlanarPose wheels;
    double time_s = 0;
  };
  struct Scan {
    PlanarPose wheels;
    double time_s = 0;
    size_t num_before = 0;  // messages
  };

  // By the messages before and after it in the log.
  PlanarPose Between(const Scan& scan) const {
    if (scan.num_before == 0) return messages_.front().wheels;
    const Message& before = messages_[scan.num_before - 1];
    if (scan.num_before == messages_.size()) return before.wheels;
    const Message& after = messages_[scan.num_before];
    const double between_s = after.time_s - before.time_s;
    // Clocks of several computers may disagree.
    const double share = between_s > 0 ? std::clamp((scan.time_s - before.time_s) / between_s, 0.0, 1.0) : 0;
    return {before.wheels.position + share * (after.wheels.position - before.wheels.position),
            WrapAngle(before.wheels.heading_rad +
                      share * WrapAngle(after.wheels.heading_rad - before.wheels.heading_rad))};
  }

  // A pose moved as from one to another.
  static PlanarPose Moved(const PlanarPose& pose, const PlanarPose& from, const PlanarPose& to) {
    return {pose.FloorFromRobot(from.RobotFromFloor(to.position)),
            WrapAngle(pose.heading_rad + to.heading_rad - from.heading_rad)};
  }

  std::vector<Message> messages_;
  PlanarPose last_told_;
  double last_told_s_ = 0;
  std::vector<Scan> scans_;
  bool told_by_scans_ = false;
  double laser_offset_m_ = 0;
};

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
      CAIRN_RETURN_IF_ERROR(wheels.AddOdometry(SplitWords(line), what, where));
    } else if (line.starts_with("PARAM robot_frontlaser_offset ")) {
      CAIRN_RETURN_IF_ERROR(wheels.SetLaserOffset(SplitWords(line), what, where));
    } else if (line.starts_with("FLASER ")) {
      CAIRN_ASSIGN_OR_RETURN(const LoggedScan logged, ParseScan(SplitWords(line), what, where));
      wheels.AddScan(logged);
      scans.push_back(logged.scan);
    }
  }
  const double largest = LargestRange(scans);
  for (size_t i = 0; i < scans.size(); ++i) {
    scans[i].max_range_m = largest;
    scans[i].odometry = wheels.LaserAt(i);
  }
  if (scans.empty()) return MakeError(ErrorCode::kNoData, "{}: no FLASER line in it", what);
  return scans;
}

Result<std::vector<RangeScan>> ReadCarmenLog(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  return ParseCarmenLog(text, path);
}

}  // namespace cairn
