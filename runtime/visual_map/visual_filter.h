#pragma once

#include <memory>
#include <vector>

#include "core/options/options.h"
#include "runtime/visual_map/visual_estimate.h"

namespace cairn {

// p(x | z) over time: a Markov filter over the survey's places and headings [Sala06 §VI-C: names "a Markov
// chain and a model of the robot's motion"], for views that alone do not determine the place.
struct VisualFilterOptions {
  // Standard deviation of the odometry: part of the way, part of the turn, and an addition at every step, m
  // and degrees.  REQUIRES: >= 0
  double odometry_way_ratio = 0.1;
  double odometry_turn_ratio = 0.05;
  double odometry_sigma_m = 0.02;
  double odometry_sigma_deg = 1;
  // Probability that the robot was carried away since the last image.  REQUIRES: in [0, 1]
  double kidnapped_ratio = 0.01;
};
OptionTable DescribeOptions(VisualFilterOptions* options);

// Where the robot probably is, at first anywhere.  One per robot; not for concurrent calls.
class VisualFilter {
 public:
  explicit VisualFilter(std::shared_ptr<const VisualMap> map, const VisualFilterOptions& options = {},
                        const VisualEstimateOptions& estimate_options = {});

  // The robot drove: ahead and to the left (m, in its frame at the start), and turned left (rad).
  // Errors: InvalidArgument for a number that is not finite, or a way whose square is not.
  Status Move(const Eigen::Vector2d& way_m, double turn_left_rad);
  // It drove, and nobody counted: standard deviations of its way, per axis, and of its turn.  Errors:
  // InvalidArgument for a number that is negative or not finite.
  Status Wander(double sigma_m, double sigma_rad);
  // It sees landmarks.  The result is that of this image with the previous belief as its prior.  Its
  // at_place, mean and entropy are those of the new belief; where the image has a flag, position and
  // covariance are too.  Errors: as EstimateVisualPose.
  Result<VisualPose> See(const std::vector<SeenLandmark>& seen);

  // Probability per place of the map; sums to 1.
  std::vector<double> AtPlaces() const;
  // Of that, the part that looks in directions within a sector around this one.  REQUIRES: the map has the
  // place
  double AtHeading(int32_t place, double heading_deg, double half_sector_deg) const;
  const VisualMap& map() const { return *map_; }

 private:
  void Shift(const Eigen::Vector2d& way_m, double way_variance, double turn_left_rad, double turn_sigma_rad);

  std::shared_ptr<const VisualMap> map_;
  VisualFilterOptions options_;
  VisualEstimateOptions estimate_options_;
  std::vector<std::vector<double>> belief_;  // per place and heading bin
};

}  // namespace cairn
