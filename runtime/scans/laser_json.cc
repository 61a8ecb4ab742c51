#include "runtime/scans/laser_json.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "runtime/scans/wheel_log.h"

namespace cairn {
namespace {

using nlohmann::json;

// No laser sees farther, metres.
constexpr double kFar = 1e5;
constexpr double kFarAway = 1e9;

// JSON has no numbers for what Python and JavaScript write thus.
std::string WithoutWords(std::string_view line) {
  std::string text(line);
  for (const auto& [word, number] : {std::pair<std::string_view, std::string_view>{"-Infinity", "-1e9"},
                                     {"Infinity", "1e9"},
                                     {"NaN", "null"}}) {
    for (size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + number.size()))
      text.replace(at, word.size(), number);
  }
  return text;
}

// A number at a path of keys.
std::optional<double> NumberAt(const json& message, std::initializer_list<const char*> path) {
  const json* at = &message;
  for (const char* key : path) {
    if (!at->is_object()) return std::nullopt;
    const auto found = at->find(key);
    if (found == at->end()) return std::nullopt;
    at = &*found;
  }
  if (!at->is_number() || !std::isfinite(at->get<double>())) return std::nullopt;
  return at->get<double>();
}

// Of ROS 2 or of ROS 1.
std::optional<double> TimeOf(const json& message) {
  for (const auto& [seconds, nanoseconds] : {std::pair("sec", "nanosec"), std::pair("secs", "nsecs")}) {
    const auto whole = NumberAt(message, {"header", "stamp", seconds}),
               part = NumberAt(message, {"header", "stamp", nanoseconds});
    if (whole && part) return *whole + 1e-9 * *part;
  }
  return NumberAt(message, {"header", "stamp"});
}

Result<RangeScan> ScanOf(const json& message, const std::string& what, const std::string& where) {
  std::array<double, 3> numbers{};
  constexpr std::array<const char*, 3> kNames = {"angle_min", "angle_increment", "range_max"};
  for (size_t i = 0; i < kNames.size(); ++i) {
    const auto number = NumberAt(message, {kNames[i]});
    if (!number || std::abs(*number) > kFar)
      return Corrupt(what, "{}: a LaserScan without a number as \"{}\"", where, kNames[i]);
    numbers[i] = *number;
  }
  const json& ranges = message["ranges"];
  if (!ranges.is_array() || std::ssize(ranges) > kMaxBeams)
    return Corrupt(what, "{}: \"ranges\" is no list of up to {} numbers", where, kMaxBeams);
  RangeScan scan;
  scan.first_angle_rad = numbers[0];
  scan.step_rad = numbers[1];
  scan.max_range_m = numbers[2];
  const double least = NumberAt(message, {"range_min"}).value_or(0);
  for (const json& range : ranges) {
    if (!range.is_number() && !range.is_null())
      return Corrupt(what, "{}: a range is {}, no number", where, range.dump());
    const double metres = range.is_null() ? std::numeric_limits<double>::quiet_NaN() : range.get<double>();
    scan.ranges_m.push_back(metres < least ? std::numeric_limits<double>::quiet_NaN() : metres);
  }
  return scan;
}

Result<PlanarPose> OdometryOf(const json& message, const std::string& what, const std::string& where) {
  std::array<double, 6> numbers{};
  const std::array<std::pair<const char*, const char*>, 6> names = {{{"position", "x"},
                                                                     {"position", "y"},
                                                                     {"orientation", "x"},
                                                                     {"orientation", "y"},
                                                                     {"orientation", "z"},
                                                                     {"orientation", "w"}}};
  for (size_t i = 0; i < names.size(); ++i) {
    const auto number = NumberAt(message, {"pose", "pose", names[i].first, names[i].second});
    if (!number) {
      return Corrupt(what, "{}: an Odometry without a number as \"pose.pose.{}.{}\"", where, names[i].first,
                     names[i].second);
    }
    numbers[i] = *number;
  }
  const auto [x, y, qx, qy, qz, qw] = numbers;
  const double norm = qx * qx + qy * qy + qz * qz + qw * qw;
  if (!(std::abs(x) <= kFarAway && std::abs(y) <= kFarAway && std::abs(norm - 1) <= 0.01))
    return Corrupt(what, "{}: an Odometry at ({}, {}) whose orientation has a squared length of {}", where, x,
                   y, norm);
  return PlanarPose{{x, y}, std::atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))};
}

}  // namespace

Result<std::vector<RangeScan>> ParseLaserJson(const std::string& text, const std::string& what) {
  std::vector<RangeScan> scans;
  WheelLog wheels;
  bool has_odometry = false;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    if (Trim(line).empty()) continue;
    const std::string where = fmt::format("line {}", number);
    const json whole = json::parse(WithoutWords(line), nullptr, /*allow_exceptions=*/false);
    if (!whole.is_object())
      return Corrupt(what, "{}: {:?} is no message as JSON", where, Trim(line).substr(0, 80));
    // rosbridge says what it is of.
    const bool is_wrapped = whole.contains("msg") && whole["msg"].is_object();
    const json& message = is_wrapped ? whole["msg"] : whole;
    const std::optional<double> time_s = TimeOf(message);
    if (message.contains("ranges")) {
      CAIRN_ASSIGN_OR_RETURN(RangeScan scan, ScanOf(message, what, where));
      scan.time_s = time_s.value_or(0);
      wheels.AddScan({}, std::nullopt, scan.time_s);
      scans.push_back(std::move(scan));
    } else if (message.contains("pose") && message.contains("twist")) {
      CAIRN_ASSIGN_OR_RETURN(const PlanarPose pose, OdometryOf(message, what, where));
      wheels.AddOdometry(pose, time_s);
      has_odometry = true;
    }
  }
  if (scans.empty()) return MakeError(ErrorCode::kNoData, "{}: no LaserScan in it", what);
  for (size_t i = 0; i < scans.size(); ++i) {
    if (has_odometry) scans[i].odometry = wheels.LaserAt(i);
  }
  return scans;
}

}  // namespace cairn
