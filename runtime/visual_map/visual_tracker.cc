#include "runtime/visual_map/visual_tracker.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/no_throw.h"
#include "core/base/pooled.h"
#include "core/blocks/map_blocks.h"
#include "core/geometry/pose.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

// A station with a heading counts for a belief in directions this near, where these have this part of the
// place's probability.
constexpr double kHalfSectorDeg = 45;
constexpr double kLeastHeadingShare = 0.05;

PooledVector<LandmarkIdx> LandmarksOf(const std::vector<SeenLandmark>& seen) {
  PooledVector<LandmarkIdx> landmarks;
  for (const SeenLandmark& match : seen) landmarks.push_back(match.landmark);
  SortUnique(&landmarks);
  return landmarks;
}

}  // namespace

OptionTable DescribeOptions(VisualTrackerOptions* o) {
  return {
      {"tracked_ratio", &o->tracked_ratio,
       "visual map: landmarks are looked for in the regions of places that together have this probability",
       1e-3, 1},
      {"max_num_tracked_regions", &o->max_num_tracked_regions,
       "visual map: where these are more regions, the robot is lost", 1},
      {"unknown_way_sigma_m", &o->unknown_way_sigma_m,
       "visual map: without odometry, standard deviation of the way between two images, per axis, metres", 0},
      {"unknown_turn_sigma_deg", &o->unknown_turn_sigma_deg,
       "visual map: without odometry, standard deviation of the turn between two images, degrees", 0}};
}

VisualTracker::VisualTracker(std::shared_ptr<const Map> map, std::shared_ptr<const VisualMap> visual,
                             const VisualTrackerOptions& options, VisualFilter filter)
    : map_(std::move(map)), visual_(std::move(visual)), options_(options), filter_(std::move(filter)) {}

Result<VisualTracker> VisualTracker::Make(std::shared_ptr<const Map> map, const VisualMapOptions& map_options,
                                          const VisualTrackerOptions& options,
                                          const VisualFilterOptions& filter_options,
                                          const VisualEstimateOptions& estimate_options) {
  return WithoutExceptions("visual map", [&]() -> Result<VisualTracker> {
    VisualTrackerOptions checked = options;
    VisualFilterOptions checked_filter = filter_options;
    VisualEstimateOptions checked_estimate = estimate_options;
    for (const OptionTable& table : {DescribeOptions(&checked), DescribeOptions(&checked.votes),
                                     DescribeOptions(&checked_filter), DescribeOptions(&checked_estimate)}) {
      CAIRN_RETURN_IF_ERROR(CheckOptions(table));
    }
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const VisualMap> visual, VisualMap::Open(map, map_options));
    if (map->num_regions() == 0 && !options.votes.localize_when_lost) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "map '{}' has no regions that landmarks could vote for; set localize_when_lost = true",
                       map->head().name);
    }
    VisualTracker tracker(std::move(map), visual, options,
                          VisualFilter(visual, filter_options, estimate_options));
    CAIRN_RETURN_IF_ERROR(tracker.ReadStations());
    return tracker;
  });
}

Status VisualTracker::ReadStations() {
  stations_.resize(visual_->places().size());
  for (int64_t ordinal = 0; ordinal < map_->directory().NumBlocks(BlockKind::kStations); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map_->Stations(ordinal));
    for (size_t i = 0; i < block->stations.size(); ++i) {
      const Eigen::Vector2d& position = block->stations[i].position;
      const auto nearest =
          std::min_element(visual_->places().begin(), visual_->places().end(),
                           [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
                             return (a - position).squaredNorm() < (b - position).squaredNorm();
                           });
      stations_[nearest - visual_->places().begin()].push_back(
          {block->stations[i].heading_deg, block->regions[i]});
    }
  }
  return Ok();
}

Status VisualTracker::Move(const Eigen::Vector2d& way_m, double turn_left_rad) {
  CAIRN_RETURN_IF_ERROR(filter_.Move(way_m, turn_left_rad));
  was_moved_ = true;
  return Ok();
}

Result<TrackedVisualPose> VisualTracker::See(const Query& query) {
  return WithoutExceptions("track on the floor", [&]() -> Result<TrackedVisualPose> {
    VisualFilter filter = filter_;
    if (!was_moved_) {
      CAIRN_RETURN_IF_ERROR(
          filter.Wander(options_.unknown_way_sigma_m, RadFromDeg(options_.unknown_turn_sigma_deg)));
    }
    CAIRN_ASSIGN_OR_RETURN(std::optional<TrackedVisualPose> found, SeeTracked(query, &filter));
    if (!found) {
      CAIRN_ASSIGN_OR_RETURN(found, SeeLost(query, &filter));
    }
    filter_ = std::move(filter);
    was_moved_ = false;
    was_found_ = was_found_ || found->pose.flag == VisualFlag::kNone;
    return *std::move(found);
  });
}

std::vector<RegionIdx> VisualTracker::RegionsOf(const VisualFilter& filter) const {
  const std::vector<double> at_places = filter.AtPlaces();
  std::vector<int32_t> order(at_places.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int32_t a, int32_t b) { return at_places[a] > at_places[b]; });
  std::vector<RegionIdx> regions;
  double sum = 0;
  for (const int32_t place : order) {
    for (const Station& station : stations_[place]) {
      if (station.heading_deg && filter.AtHeading(place, *station.heading_deg, kHalfSectorDeg) <
                                     kLeastHeadingShare * at_places[place])
        continue;
      regions.insert(regions.end(), station.regions.begin(), station.regions.end());
    }
    std::sort(regions.begin(), regions.end());
    regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
    if (static_cast<int>(regions.size()) > options_.max_num_tracked_regions) return {};
    sum += at_places[place];
    if (sum >= options_.tracked_ratio) break;
  }
  return regions;
}

Result<std::optional<TrackedVisualPose>> VisualTracker::SeeTracked(const Query& query,
                                                                   VisualFilter* filter) const {
  // [Sala06 §III] inside a region its features are tracked
  const std::vector<RegionIdx> regions = was_found_ ? RegionsOf(*filter) : std::vector<RegionIdx>();
  if (regions.empty()) return std::optional<TrackedVisualPose>();
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, LandmarksOfRegions(*map_, regions));
  CAIRN_ASSIGN_OR_RETURN(const auto seen, visual_->MatchAmong(query, landmarks));
  VisualFilter tried = *filter;
  CAIRN_ASSIGN_OR_RETURN(VisualPose pose, tried.See(seen));
  if (pose.flag != VisualFlag::kNone) return std::optional<TrackedVisualPose>();
  *filter = std::move(tried);
  return std::optional(TrackedVisualPose{std::move(pose), Scope::kTrack, regions});
}

Result<TrackedVisualPose> VisualTracker::SeeLost(const Query& query, VisualFilter* filter) const {
  // [Sala06 §III] where they are not all visible, those that are vote for their regions
  CAIRN_ASSIGN_OR_RETURN(std::vector<SeenLandmark> seen, visual_->Match(query));
  CAIRN_ASSIGN_OR_RETURN(Vote vote, VoteForRegions(*map_, LandmarksOf(seen), options_.votes));
  const VisualFilter before = *filter;
  TrackedVisualPose found{.scope = Scope::kVotes, .regions = vote.regions};
  if (!vote.regions.empty() || !options_.votes.localize_when_lost) {
    CAIRN_ASSIGN_OR_RETURN(const auto voted, LandmarksOfRegions(*map_, vote.regions));
    std::vector<SeenLandmark> of_regions;
    for (const SeenLandmark& match : seen) {
      if (std::binary_search(voted.begin(), voted.end(), match.landmark)) of_regions.push_back(match);
    }
    CAIRN_ASSIGN_OR_RETURN(found.pose, filter->See(of_regions));
    if (vote.regions.empty()) found.pose.message = std::move(vote.message);
    if (found.pose.flag == VisualFlag::kNone || !options_.votes.localize_when_lost) return found;
  }
  *filter = before;
  CAIRN_ASSIGN_OR_RETURN(found.pose, filter->See(seen));
  found.scope = Scope::kAll;
  found.regions.clear();
  return found;
}

}  // namespace cairn
