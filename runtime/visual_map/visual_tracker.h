#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/options/options.h"
#include "runtime/localize/localization.h"
#include "runtime/track/region_votes.h"
#include "runtime/visual_map/visual_filter.h"

namespace cairn {

// How a stream of images is followed by the visual map, beyond the filter's own options.
struct VisualTrackerOptions {
  // The robot's regions are those of the likeliest places that together have this
  // probability.  REQUIRES: in (0, 1]
  double tracked_ratio = 0.95;
  // Where these are more regions, the robot is lost: its belief says too little.  REQUIRES: >= 1
  int max_num_tracked_regions = 6;
  // How far the robot moves between two images without odometry: standard deviations of its way, per axis, m,
  // and of its turn, degrees.  REQUIRES: >= 0
  double unknown_way_sigma_m = 0.3;
  double unknown_turn_sigma_deg = 20;
  // When it is lost.
  VoteOptions votes;
};
// Without those of the vote, which have a table of their own.
OptionTable DescribeOptions(VisualTrackerOptions* options);

// A place, and what it was found by.
struct TrackedVisualPose {
  VisualPose pose;
  // kTrack: the landmarks of the robot's regions; kVotes: of the regions that landmarks in view vote for;
  // kAll: any.
  Scope scope = Scope::kAll;
  std::vector<RegionIdx> regions;  // of kTrack and kVotes
};

// Finds where a camera is on the floor, image after image, with the models of the robot's regions alone
// [Sala06 §III, §VI-C]: as RegionTracker does with landmarks in space.  A Markov filter (visual_filter.h)
// says where the robot probably is, and only the landmarks of the regions there are looked for.  Where these
// place the image nowhere, all landmarks in view vote for regions (region_votes.h), and those of the
// candidates count; where these do not either, all of them (localize_when_lost).  Models are loaded as they
// are needed.  One per robot; the map is shared.
class VisualTracker {
 public:
  // Errors: as VisualMap::Open; InvalidArgument (a bad option; a map without regions and not
  // localize_when_lost).
  static Result<VisualTracker> Make(std::shared_ptr<const Map> map, const VisualMapOptions& map_options = {},
                                    const VisualTrackerOptions& options = {},
                                    const VisualFilterOptions& filter_options = {},
                                    const VisualEstimateOptions& estimate_options = {});

  // The robot drove since the last image: VisualFilter::Move.  Several calls before an image add up.
  Status Move(const Eigen::Vector2d& way_m, double turn_left_rad);
  // The next image.  Without a Move before it the robot may have gone anywhere within unknown_way_sigma_m.
  // Errors: Unsupported for an image of another size than the survey's; as EstimateVisualPose; then nothing
  // was seen.  The same images, the same results.
  Result<TrackedVisualPose> See(const Query& query);

  const VisualFilter& filter() const { return filter_; }

 private:
  VisualTracker(std::shared_ptr<const Map> map, std::shared_ptr<const VisualMap> visual,
                const VisualTrackerOptions& options, VisualFilter filter);
  Status ReadStations();
  // Regions of the places where it probably is, ascending; none when lost.
  std::vector<RegionIdx> RegionsOf(const VisualFilter& filter) const;
  Result<std::optional<TrackedVisualPose>> SeeTracked(const Query& query, VisualFilter* filter) const;
  Result<TrackedVisualPose> SeeLost(const Query& query, VisualFilter* filter) const;

  struct Station {
    std::optional<double> heading_deg;
    std::vector<RegionIdx> regions;
  };

  std::shared_ptr<const Map> map_;
  std::shared_ptr<const VisualMap> visual_;
  VisualTrackerOptions options_;
  VisualFilter filter_;
  std::vector<std::vector<Station>> stations_;  // per place of the visual map
  bool was_moved_ = true;                       // since the last image; the first one needs no motion
  bool was_found_ = false;                      // by some image
};

}  // namespace cairn
