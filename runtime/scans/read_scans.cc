#include "runtime/scans/read_scans.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/base/text.h"
#include "core/files/file.h"
#include "runtime/scans/beam.h"
#include "runtime/scans/carmen_log.h"
#include "runtime/scans/laser_json.h"

namespace cairn {
namespace {

// No laser sees farther, metres.
constexpr double kMaxRangeM = 1e5;

Result<ScanView> ParseSegments(const std::string& text, const std::string& what, double sigma_m) {
  ScanView view;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::string_view trimmed = Trim(line);
    if (trimmed.empty() || trimmed[0] == '#') continue;
    const std::vector<double> values = ParseNumbers(trimmed).value_or(std::vector<double>());
    const bool is_near =
        std::all_of(values.begin(), values.end(), [](double v) { return std::abs(v) <= kMaxRangeM; });
    if ((values.size() != 4 && values.size() != 6) || !is_near) {
      return Corrupt(what,
                     "line {}: {:?} is not x0,y0,x1,y1 or x0,y0,x1,y1,sigma_angle_deg,sigma_offset_m (finite "
                     "numbers up to {:g})",
                     number, trimmed.substr(0, 80), kMaxRangeM);
    }
    if (values.size() == 6 && (values[4] <= 0 || values[5] <= 0))
      return Corrupt(what, "line {}: standard deviations {} and {}; both must be more than 0", number,
                     values[4], values[5]);
    ScanSegment segment;
    segment.start = {values[0], values[1]};
    segment.end = {values[2], values[3]};
    const double turn = segment.start.x() * segment.end.y() - segment.start.y() * segment.end.x();
    if (turn == 0)
      return Corrupt(what, "line {}: a segment on a line through the robot, which cannot see it", number);
    if (turn < 0) std::swap(segment.start, segment.end);
    segment.sigma_offset_m = values.size() == 6 ? values[5] : sigma_m;
    segment.sigma_angle_rad =
        values.size() == 6 ? values[4] * std::numbers::pi / 180 : 2 * sigma_m / segment.Length();
    view.segments.push_back(segment);
  }
  return view;
}

bool IsJson(const std::string& text) { return Trim(text).starts_with('{'); }

bool IsOfRanges(const std::string& text) {
  const auto has_line = [&](const std::string& begin) {
    return text.starts_with(begin) || text.find("\n" + begin) != std::string::npos;
  };
  return IsJson(text) || has_line("FLASER ") || has_line("ROBOTLASER1 ") || text.starts_with("\x1f\x8b");
}

Result<std::vector<RangeScan>> ParseRanges(const std::string& text, const std::string& what) {
  return IsJson(text) ? ParseLaserJson(text, what) : ParseCarmenLog(text, what);
}

}  // namespace

ScanView ViewOf(const RangeScan& scan, const ScanSegmentsOptions& options) {
  return {FindScanSegments(scan, options), BeamsOf(scan, options.max_range_m), scan.odometry};
}

Result<std::vector<ScanView>> ParseScans(const std::string& text, const std::string& what,
                                         const ScanSegmentsOptions& options) {
  std::vector<ScanView> views;
  if (!IsOfRanges(text)) {
    CAIRN_ASSIGN_OR_RETURN(ScanView view, ParseSegments(text, what, options.sigma_range_m));
    if (view.segments.empty()) {
      return MakeError(ErrorCode::kNoData,
                       "{}: neither scans (FLASER or ROBOTLASER1 lines, LaserScan messages as JSON) nor "
                       "segments in it",
                       what);
    }
    view.beams = BeamsTo(view.segments);
    views.push_back(std::move(view));
    return views;
  }
  CAIRN_ASSIGN_OR_RETURN(const std::vector<RangeScan> scans, ParseRanges(text, what));
  for (const RangeScan& scan : scans) views.push_back(ViewOf(scan, options));
  return views;
}

Result<std::vector<RangeScan>> ReadRangeScans(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  if (!IsOfRanges(text)) {
    return MakeError(ErrorCode::kNoData,
                     "{}: no scans in it (FLASER or ROBOTLASER1 lines, LaserScan messages as JSON)", path);
  }
  return ParseRanges(text, path);
}

Result<std::vector<ScanView>> ReadScans(const std::string& path, const ScanSegmentsOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  return ParseScans(text, path, options);
}

}  // namespace cairn
