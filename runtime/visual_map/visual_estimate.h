#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/options/options.h"
#include "runtime/visual_map/visual_map.h"

namespace cairn {

// p(x | z) over the places and headings of a visual map [Sala06 §VI-C].
//   p(z | x) = product over the matched landmarks of (1 - o) N(z; model(x), S) + o U
// with U uniform over the image and the scales, and U alone where the landmark's model does not extend to x.
// S is the model's covariance from cross-validation plus the keypoint's own.  The camera may be turned
// between the headings of the survey, tilted a little, and held higher or lower: that moves all landmarks
// together, so for every place the best-fitting turn and height are found and integrated over (Laplace).
// Differs from the source, whose test poses have the survey's headings.  "Elsewhere", where every match is an
// outlier, is one more possibility, so that matches that agree by chance give no fix.
struct VisualEstimateOptions {
  // Standard deviation of a query's keypoint in addition to the model's own error, px.  REQUIRES: > 0
  double visual_sigma_px = 0.5;
  // The same for its scale, octaves.  REQUIRES: > 0
  double visual_sigma_octaves = 0.15;
  // Share of wrong matches, o; for landmarks whose model predicts badly, the mean of this and
  // 1.  REQUIRES: in (0, 1)
  double outlier_ratio = 0.3;
  // Standard deviation of the camera's pitch and roll in addition to that of the survey's cameras,
  // degrees.  REQUIRES: > 0
  double tilt_sigma_deg = 2;
  // Standard deviation of its height in addition to that of the survey's cameras, m.  REQUIRES: > 0
  double height_sigma_m = 0.05;
  // Headings farther than half way to the next of the survey count up to this much, degrees; where the survey
  // does not say how far a turn moves the image, only up to this.  REQUIRES: >= 0
  double heading_margin_deg = 5;
  // Number of places and headings that are refined between the places of the survey, and number of parts per
  // side.  REQUIRES: >= 1
  int num_refined_places = 12;
  int num_subdivisions = 5;
  // Errors that do not average out over landmarks, in addition to those that the survey itself shows
  // (VisualErrors), per axis, m and degrees.  REQUIRES: >= 0
  double shared_sigma_m = 0.002;
  double shared_sigma_deg = 0.05;
  // Prior probability that the camera is at none of these places.  REQUIRES: in (0, 1)
  double elsewhere_ratio = 0.5;
  // Flags: minimum number of matches that agree with the pose, and minimum share of those whose models extend
  // to it; smallest standard deviation of their positions in the image, as part of its diagonal; largest
  // distance from a place of the survey, in its spacings.  REQUIRES: >= 0
  int min_num_agreeing = 4;
  double min_agreeing_ratio = 0.3;
  double min_spread_ratio = 0.07;
  double max_distance_spacings = 0.75;
  // Minimum number of matches that agree where the survey localizes its own images badly (landmarks' shared
  // errors are above a quarter of its spacing): as many as an image needs for these errors to be learnt from
  // it.  REQUIRES: >= 0
  int min_num_agreeing_unsure = 8;
};
OptionTable DescribeOptions(VisualEstimateOptions* options);

// Why not to trust a pose.
enum class VisualFlag {
  kNone,
  kTooFewMatches,  // fewer than two landmarks
  kOneSpot,        // all in one place of the image
  kDisagree,       // the matches agree on no place, or too few do
  kOutside,        // the best pose lies outside of the survey
};
const char* VisualFlagName(VisualFlag flag);  // "none", "too_few_matches", ...

struct VisualPose {
  VisualFlag flag = VisualFlag::kNone;
  std::string message;  // of the flag: found and needed
  int num_matches = 0;
  int num_possible = 0;  // of them, those whose models extend to the pose
  int num_agreeing = 0;
  // Root mean square distance of these from their middle in the image, as part of its diagonal.
  double spread_ratio = 0;

  // The maximum of p(x | z), refined between the survey's places.
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // floor frame, metres
  double heading_deg = 0;                              // [0, 360)
  double higher_m = 0;                                 // than the survey's cameras on average
  // x m, y m, heading rad: of the maximum, widened by the posterior elsewhere (with a flag: by the
  // whole survey).
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  // As Localization's, on the floor: its outer product is part of the covariance.
  Eigen::Vector2d scale_sigma_m = Eigen::Vector2d::Zero();
  // Of the whole posterior.
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double entropy = 0;  // nats, over places and "elsewhere"
  double elsewhere = 1;
  std::vector<double> at_place;                 // per place of the map; with `elsewhere` they sum to 1
  std::vector<std::vector<double>> at_heading;  // per place and heading of the map: parts of at_place
  std::vector<std::vector<double>> turn_rad;    // per place and heading: the camera's best turn from it
};

// Landmarks in a small spot of the image, s across, hardly show how far a camera has turned around them: a
// turn by an angle a changes perspective by s^2 sin(a) / f px, and the models' errors are as large.  So the
// shared errors (VisualErrors) hold for images with landmarks everywhere, of this spread, and grow with its
// square where landmarks lie closer.
inline constexpr double kFullSpreadRatio = 0.2;
double SharedGrowth(double spread_ratio);

// `prior`: probability per place of the map (sums to 1), empty: uniform.  Same input, same result.  O(matches
// * places).  Errors: InvalidArgument (an invalid prior or one of another length, a landmark that does not
// exist, a number that is not finite, a bad option); as VisualMap::With.
Result<VisualPose> EstimateVisualPose(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                                      const VisualEstimateOptions& options = {},
                                      const std::vector<double>& prior = {});

// Adds the error of the map's scale at the pose's position to its covariance.
void AddScaleError(const VisualMap& map, VisualPose* pose);

// p(x | z) over the survey's places as the source has it [Sala06 §VI-C]:
//   p(x | z) ~ p(z | x) p(x)   with p(x) uniform over the places, and nothing beside them:
// no "elsewhere", no flags, so that every image has an estimate (LikeliestPlace of
// runtime/visual_map/lattice_posterior.h), also one without a match.  For comparisons with the source; a
// robot takes EstimateVisualPose, which says when not to believe it.
struct LatticePosterior {
  std::vector<double> at_place;  // per place of the map; sums to 1
  int num_matches = 0;           // landmarks
};
// `options`: of the likelihood; elsewhere_ratio and the limits of flags are not used.  O(matches * places).
// Errors: as EstimateVisualPose.
Result<LatticePosterior> PosteriorOnLattice(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                                            const VisualEstimateOptions& options = {});

// KlDivergence (runtime/visual_map/lattice_posterior.h) of two posteriors over the same places, with
// "elsewhere" as one place more, and with what flags do to them: not the source's, which knows neither.
double PosteriorDivergence(const VisualPose& p, const VisualPose& q, double uniform_weight);

}  // namespace cairn
