#include "runtime/scans/range_scan.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace cairn {

Status CheckRangeScan(const RangeScan& scan) {
  const size_t num_beams = scan.ranges_m.size();
  if (num_beams == 0 || num_beams > static_cast<size_t>(kMaxBeams))
    return MakeError(ErrorCode::kInvalidArgument, "a scan of {} beams; expected 1 to {}", num_beams,
                     kMaxBeams);
  if (!scan.angles_rad.empty() && scan.angles_rad.size() != num_beams)
    return MakeError(ErrorCode::kInvalidArgument, "a scan of {} ranges and {} angles; expected one for each",
                     num_beams, scan.angles_rad.size());
  double least = scan.AngleOf(0), most = least;
  for (size_t i = 0; i < num_beams; ++i) {
    const double angle = scan.AngleOf(i);
    if (!std::isfinite(angle))
      return MakeError(ErrorCode::kInvalidArgument, "the angle of beam {} of a scan is {}", i, angle);
    least = std::min(least, angle);
    most = std::max(most, angle);
  }
  if (num_beams > 1 && least == most)
    return MakeError(ErrorCode::kInvalidArgument,
                     "all {} beams of a scan look at {} rad; what is the step from beam to beam?", num_beams,
                     least);
  // A beam may be there twice where a turn ends.
  constexpr double kTurn = 1.01 * 2 * std::numbers::pi;
  if (most - least > kTurn)
    return MakeError(
        ErrorCode::kInvalidArgument,
        "the beams of a scan look from {} to {} rad, which is more than a turn: are the angles degrees?",
        least, most);
  if (!(scan.max_range_m > 0))
    return MakeError(
        ErrorCode::kInvalidArgument,
        "the largest range of a scan is {} m; expected more than 0, infinity where it is not known",
        scan.max_range_m);
  return Ok();
}

}  // namespace cairn
