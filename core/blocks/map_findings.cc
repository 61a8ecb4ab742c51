#include "core/blocks/map_findings.h"

#include <cmath>

namespace cairn {
namespace {

template <typename... Args>
Error Invalid(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, "map: {}", fmt::format(format, std::forward<Args>(args)...));
}

Status CheckRegionSelfTest(const RegionSelfTest& row, size_t num_regions) {
  if (row.region < kOutsideRegions || row.region >= static_cast<int64_t>(num_regions))
    return Invalid("self-test of region {} of {}", row.region, num_regions);
  if (row.num_held_out < 1 || row.num_localized < 0 || row.num_localized > row.num_held_out ||
      row.num_gross_errors < 0 || row.num_gross_errors > row.num_localized) {
    return Invalid("self-test of region {}: {} gross errors of {} localized of {} images", row.region,
                   row.num_gross_errors, row.num_localized, row.num_held_out);
  }
  if (row.errors.has_value() != (row.num_localized > 0))
    return Invalid("self-test of region {}: {} localized, with errors: {}", row.region, row.num_localized,
                   row.errors.has_value());
  if (!row.errors) return Ok();
  for (const double error :
       {row.errors->median_m, row.errors->median_deg, row.errors->p90_m, row.errors->p90_deg}) {
    if (!(error >= 0 && std::isfinite(error)))
      return Invalid("self-test of region {}: an error of {}", row.region, error);
  }
  return Ok();
}

Status CheckDropCount(const DropCount& row, size_t num_stations) {
  if (row.reason_id < 0 || row.num_dropped < 1)
    return Invalid("{} dropped for reason {}", row.num_dropped, row.reason_id);
  if (!row.at_stations.empty() && row.at_stations.size() != num_stations) {
    return Invalid("dropped as {}: counts of {} stations, of {}", row.name, row.at_stations.size(),
                   num_stations);
  }
  for (const int32_t count : row.at_stations) {
    if (count < 0 || count > row.num_dropped)
      return Invalid("dropped as {}: {} at a station, {} in all", row.name, count, row.num_dropped);
  }
  return Ok();
}

}  // namespace

Status CheckMapFindings(const MapFindings& findings, size_t num_regions, size_t num_stations) {
  for (size_t i = 0; i < findings.self_test_regions.size(); ++i) {
    const RegionSelfTest& row = findings.self_test_regions[i];
    if (i > 0 && row.region <= findings.self_test_regions[i - 1].region)
      return Invalid("self-test of region {} is out of order", row.region);
    CAIRN_RETURN_IF_ERROR(CheckRegionSelfTest(row, num_regions));
  }
  for (size_t i = 0; i < findings.region_entropies.size(); ++i) {
    const RegionEntropy& row = findings.region_entropies[i];
    if (row.region < 0 || static_cast<size_t>(row.region) >= num_regions ||
        (i > 0 && row.region <= findings.region_entropies[i - 1].region) ||
        !(row.entropy >= 0 && std::isfinite(row.entropy)))
      return Invalid("an entropy of {} nats of region {} of {}", row.entropy, row.region, num_regions);
  }
  for (size_t i = 0; i < findings.drops.size(); ++i) {
    const DropCount& row = findings.drops[i];
    if (i > 0 && row.reason_id <= findings.drops[i - 1].reason_id)
      return Invalid("what is dropped for reason {} is out of order", row.reason_id);
    CAIRN_RETURN_IF_ERROR(CheckDropCount(row, num_stations));
  }
  return Ok();
}

}  // namespace cairn
