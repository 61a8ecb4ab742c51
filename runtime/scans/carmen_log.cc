#include "runtime/scans/carmen_log.h"

#include <algorithm>
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

}  // namespace

Result<std::vector<RangeScan>> ParseCarmenLog(const std::string& text, const std::string& what) {
  if (text.starts_with("\x1f\x8b")) return Corrupt(what, "is compressed; unpack it with gunzip");
  std::vector<RangeScan> scans;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    if (!line.starts_with("FLASER ")) continue;
    const std::vector<std::string> words = SplitWords(line);
    int num_beams = 0;
    if (words.size() < 2 || !ParseNumber(words[1], &num_beams) || num_beams < 1 || num_beams > kMaxBeams ||
        words.size() < static_cast<size_t>(num_beams) + 9) {
      return Corrupt(
          what,
          "line {}: FLASER with {} words; expected a number of beams, their ranges, two poses and times",
          number, words.size());
    }
    RangeScan scan;
    scan.first_angle_rad = -std::numbers::pi / 2;
    scan.step_rad = std::numbers::pi / (num_beams % 2 == 0 ? num_beams : std::max(1, num_beams - 1));
    std::vector<double> values(num_beams + 7);
    for (size_t i = 0; i < values.size(); ++i) {
      if (!ParseNumber(words[i + 2], &values[i]) || !std::isfinite(values[i])) {
        return Corrupt(what, "line {}: \"{}\" is not a finite number", number, words[i + 2]);
      }
    }
    scan.ranges_m.assign(values.begin(), values.begin() + num_beams);
    scan.pose = {{values[num_beams], values[num_beams + 1]}, values[num_beams + 2]};
    scan.time_s = values[num_beams + 6];
    scans.push_back(std::move(scan));
  }
  const double largest = LargestRange(scans);
  for (RangeScan& scan : scans) scan.max_range_m = largest;
  if (scans.empty()) return MakeError(ErrorCode::kNoData, "{}: no FLASER line in it", what);
  return scans;
}

Result<std::vector<RangeScan>> ReadCarmenLog(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  return ParseCarmenLog(text, path);
}

}  // namespace cairn
