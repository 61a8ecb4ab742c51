#include "core/blocks/map_findings.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

template <typename... Args>
Error InvalidFindings(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, "map: {}", fmt::format(format, std::forward<Args>(args)...));
}

Status CheckRegionSelfTest(const RegionSelfTest& row, size_t num_regions) {
  if (row.region < kOutsideRegions || row.region >= static_cast<int64_t>(num_regions))
    return InvalidFindings("self-test of region {} of {}", row.region, num_regions);
  if (row.num_held_out < 1 || row.num_localized < 0 || row.num_localized > row.num_held_out ||
      row.num_gross_errors < 0 || row.num_gross_errors > row.num_localized) {
    return InvalidFindings("self-test of region {}: {} gross errors of {} localized of {} images", row.region,
                           row.num_gross_errors, row.num_localized, row.num_held_out);
  }
  if (row.errors.has_value() != (row.num_localized > 0))
    return InvalidFindings("self-test of region {}: {} localized, with errors: {}", row.region,
                           row.num_localized, row.errors.has_value());
  if (!row.errors) return Ok();
  for (const double error :
       {row.errors->median_m, row.errors->median_deg, row.errors->p90_m, row.errors->p90_deg}) {
    if (!(error >= 0 && std::isfinite(error)))
      return InvalidFindings("self-test of region {}: an error of {}", row.region, error);
  }
  return Ok();
}

Status CheckDropCount(const DropCount& row, size_t num_stations) {
  if (row.reason_id < 0 || row.num_dropped < 1)
    return InvalidFindings("{} dropped for reason {}", row.num_dropped, row.reason_id);
  if (!row.at_stations.empty() && row.at_stations.size() != num_stations) {
    return InvalidFindings("dropped as {}: counts of {} stations, of {}", row.name, row.at_stations.size(),
                           num_stations);
  }
  for (const int32_t count : row.at_stations) {
    if (count < 0 || count > row.num_dropped)
      return InvalidFindings("dropped as {}: {} at a station, {} in all", row.name, count, row.num_dropped);
  }
  return Ok();
}

bool IsProbability(double value) { return value >= 0 && value <= 1; }

bool IsNonNegative(double value) { return value >= 0 && std::isfinite(value); }

Status CheckCurve(const std::vector<PromiseBin>& bins) {
  for (size_t i = 0; i < bins.size(); ++i) {
    const PromiseBin& bin = bins[i];
    if (!IsProbability(bin.least) || !IsProbability(bin.mean_promised) || bin.num < 1 || bin.num_kept < 0 ||
        bin.num_kept > bin.num || (i > 0 && !(bin.least > bins[i - 1].least)))
      return InvalidFindings("{} of {} promises of {:.3f} kept", bin.num_kept, bin.num, bin.mean_promised);
  }
  return Ok();
}

Status CheckPromise(const MapPromise& promise, size_t num_regions, size_t num_images) {
  const PromiseTerms& terms = promise.terms;
  if (terms.min_matches < 1 || !(terms.max_error_m > 0) || !std::isfinite(terms.max_error_m) ||
      !(terms.max_error_deg > 0) || !std::isfinite(terms.max_error_deg) || !(terms.probability > 0) ||
      !(terms.probability < 1)) {
    return InvalidFindings("a promise of {} matches within {} m, {} deg with probability {}",
                           terms.min_matches, terms.max_error_m, terms.max_error_deg, terms.probability);
  }
  const PromiseModel& model = promise.model;
  if (!IsNonNegative(model.match_ratio) || !IsNonNegative(model.error_ratio) || !IsNonNegative(model.shape) ||
      !(model.shape > 0) || !IsNonNegative(promise.radius_m) || !IsNonNegative(promise.radius_deg) ||
      promise.landmarks_lower_bound < 0) {
    return InvalidFindings("the promise's model has impossible numbers");
  }
  for (const NodePromise& node : promise.nodes) {
    const auto exists = [&](int32_t image) { return image >= 0 && static_cast<size_t>(image) < num_images; };
    if (!exists(node.image) || !exists(node.other_image) || node.region < 0 ||
        static_cast<size_t>(node.region) >= num_regions || !IsProbability(node.probability) ||
        !IsProbability(node.most_probable) || !IsNonNegative(node.num_matches) ||
        !IsNonNegative(node.sigma_m)) {
      return InvalidFindings(
          "a promise of {} between images {} and {} of {}, in region {} of {}, with {} matches, sigma {}",
          node.probability, node.image, node.other_image, num_images, node.region, num_regions,
          node.num_matches, node.sigma_m);
    }
  }
  CAIRN_RETURN_IF_ERROR(CheckCurve(promise.left_out));
  return CheckCurve(promise.held_out);
}

Status CheckChanges(const std::vector<MapChange>& changes, const MapSizes& sizes) {
  const auto exists = [&](int32_t image) {
    return image >= -1 && image < static_cast<int64_t>(sizes.num_images);
  };
  for (size_t i = 0; i < changes.size(); ++i) {
    const MapChange& row = changes[i];
    if (row.session < 1 || static_cast<size_t>(row.session) >= sizes.num_sessions)
      return InvalidFindings("change {} is of session {} of {}", i, row.session, sizes.num_sessions);
    if (!exists(row.image_before) || !exists(row.image_after)) {
      return InvalidFindings("change {} is shown by images {} and {} of {}", i, row.image_before,
                             row.image_after, sizes.num_images);
    }
    if (!(row.position.array().abs() <= kMaxChangeExtentM).all() ||
        !(row.radius_m >= 0 && row.radius_m <= kMaxChangeExtentM) || row.num_vanished < 0 ||
        row.num_appeared < 0 || row.NumFeatures() < 1) {
      return InvalidFindings("change {}: {} gone and {} new within {} m", i, row.num_vanished,
                             row.num_appeared, row.radius_m);
    }
    if (i == 0) continue;
    const MapChange& last = changes[i - 1];
    if (row.session < last.session || (row.session == last.session && row.NumFeatures() > last.NumFeatures()))
      return InvalidFindings("change {} is out of order", i);
  }
  for (size_t i = 0; i < changes.size(); ++i) {
    const MapChange& row = changes[i];
    const int32_t to = row.moved_to;
    if (to < -1 || to >= static_cast<int32_t>(changes.size()) || (to < 0) != (row.num_moved == 0) ||
        row.num_moved < 0 || row.num_moved > row.num_vanished ||
        (to >= 0 && changes[to].session != row.session)) {
      return InvalidFindings("change {}: {} features of {} moved to change {} of {}", i, row.num_moved,
                             row.num_vanished, to, changes.size());
    }
  }
  return Ok();
}

}  // namespace

int MapPromise::NumKept() const {
  return static_cast<int>(std::count_if(nodes.begin(), nodes.end(), [&](const NodePromise& node) {
    return node.probability >= terms.probability;
  }));
}

bool MapFindings::HasMoves() const {
  return std::any_of(changes.begin(), changes.end(), [](const MapChange& row) { return row.moved_to >= 0; });
}

Status CheckMapFindings(const MapFindings& findings, const MapSizes& sizes) {
  const size_t num_regions = sizes.num_regions;
  for (size_t i = 0; i < findings.self_test_regions.size(); ++i) {
    const RegionSelfTest& row = findings.self_test_regions[i];
    if (i > 0 && row.region <= findings.self_test_regions[i - 1].region)
      return InvalidFindings("self-test of region {} is out of order", row.region);
    CAIRN_RETURN_IF_ERROR(CheckRegionSelfTest(row, num_regions));
  }
  for (size_t i = 0; i < findings.region_entropies.size(); ++i) {
    const RegionEntropy& row = findings.region_entropies[i];
    if (row.region < 0 || static_cast<size_t>(row.region) >= num_regions ||
        (i > 0 && row.region <= findings.region_entropies[i - 1].region) ||
        !(row.entropy >= 0 && std::isfinite(row.entropy)))
      return InvalidFindings("an entropy of {} nats of region {} of {}", row.entropy, row.region,
                             num_regions);
  }
  for (size_t i = 0; i < findings.drops.size(); ++i) {
    const DropCount& row = findings.drops[i];
    if (i > 0 && row.reason_id <= findings.drops[i - 1].reason_id)
      return InvalidFindings("what is dropped for reason {} is out of order", row.reason_id);
    CAIRN_RETURN_IF_ERROR(CheckDropCount(row, sizes.num_stations));
  }
  if (findings.promise) CAIRN_RETURN_IF_ERROR(CheckPromise(*findings.promise, num_regions, sizes.num_images));
  return CheckChanges(findings.changes, sizes);
}

}  // namespace cairn
