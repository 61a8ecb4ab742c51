#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/geometry/pose.h"
#include "core/options/options.h"

namespace cairn {

class Map;            // runtime/map/map.h
struct Query;         // runtime/localize/measurement.h
struct Localization;  // runtime/localize/localization.h

// How often what happens.  The defaults are rounded from left-out images of the demo, of the kitchen and of
// the other floor of bench/held_out.
struct PlaceBeliefOptions {
  // Share of the images taken at a place of the map that have a fix there, and that have one at another
  // place. REQUIRES: > 0, their sum < 1
  double fix_ratio = 0.85;
  double wrong_fix_ratio = 0.005;
  // Share of the images of other buildings that have a fix; what one of them says is in its odds.  REQUIRES:
  // in (0, 1)
  double foreign_fix_ratio = 0.02;
  // Odds that one fix can speak for itself, however much of what it expects is found: a place may have a copy
  // that nobody surveyed.  REQUIRES: >= 1
  double max_fix_odds = 100;
  // Share of the images whose evidence means nothing, whatever it says: so no single image makes a place more
  // probable than the rest of this.  REQUIRES: in (0, 1)
  double misled_ratio = 0.01;
  // An image that shows the same as the one before errs alike: a fix less than one view from the last (a
  // tenth of the depth, or 15 degrees) counts by this distance, and no less than this.  REQUIRES: in (0, 1]
  double least_new_ratio = 0.05;
  // How much likelier an image without a fix is at the place whose survey image is most like it than at one
  // that shares nothing with it, less 1.  REQUIRES: >= 0
  double likeness_weight = 2;
  // At start, that the robot is where the map shows nothing; and from image to image: that it leaves what the
  // map shows, comes back, is carried to any other place.  REQUIRES: in (0, 1)
  double elsewhere_ratio = 0.5;
  double leave_ratio = 0.01;
  double return_ratio = 0.05;
  double kidnapped_ratio = 0.001;
  // Without odometry: between two images it goes no farther than over so many links between images that show
  // the same landmarks.  REQUIRES: >= 1
  int reach_links = 2;
  // With odometry: its error, as part of the way and of the turn, and each image's.  REQUIRES: >= 0, > 0
  double way_sigma_ratio = 0.1;
  double turn_sigma_ratio = 0.1;
  double way_sigma_m = 0.1;
  double turn_sigma_deg = 5;
};
OptionTable DescribeOptions(PlaceBeliefOptions* options);

// A place at which the robot may be: a survey image and those around it that show the same.
struct PlaceHypothesis {
  int32_t image = 0;  // of these the likeliest: index in the map
  ImageId image_id = 0;
  std::string name;
  double probability = 0;  // of them together
};

// Where a robot may be, image after image, as a probability of each survey image's place and of none of them:
// Bayes' filter with localization as its measurement.  A fix counts by the odds that it is right
// (Localization::probability); an image without one by how alike the survey's images are, and as a hint that
// the map does not show the place.  Nothing is published by one image alone: a robot that wakes up waits
// until one place has the probability that it needs.  Not for concurrent calls.
class PlaceBelief {
 public:
  // Errors: InvalidArgument (an option), NoData (a map without images), Corrupt, Io.
  static Result<PlaceBelief> Make(std::shared_ptr<const Map> map, const PlaceBeliefOptions& options = {});

  // The robot drove since the image before: metres ahead and to the left, in its frame there, and a turn to
  // the left, about the floor's normal.  Errors: InvalidArgument (not finite), Unsupported (a map whose unit
  // is not the metre).
  Status Move(const Eigen::Vector2d& way_m, double turn_left_rad);

  // The next image, and what Localizer::LocalizeQuery says of it without a prior: one from earlier images
  // would count them twice.  Without Move since the last: it went anywhere within reach.  Errors: Corrupt,
  // Io.
  Status See(const Query& query, const Localization& found);

  // The likeliest first; each image belongs to one.
  Result<std::vector<PlaceHypothesis>> Hypotheses(int max_num) const;
  double elsewhere() const { return elsewhere_; }                            // P(at no place of the map)
  const std::vector<double>& probabilities() const { return probability_; }  // of each image's place

  // The survey image nearest to this one, by links, of which the map knows no look-alike: what would tell the
  // robot where it is.  -1: none within reach, or a map without appearance graph.
  Result<int32_t> NextTellingImage(int32_t from) const;
  // Images that show enough of the same landmarks, ascending.
  const std::vector<int32_t>& Neighbours(int32_t image) const { return neighbours_[image]; }

 private:
  PlaceBelief(std::shared_ptr<const Map> map, const PlaceBeliefOptions& options)
      : map_(std::move(map)), options_(options) {}
  void Spread();   // over links
  Status Drive();  // by odometry, where it is a view's radius or more by now
  void LeaveAndReturn();
  // Where a fix puts the camera: images around it, ascending, and the share of each of the nearest.
  struct Place {
    std::vector<int32_t> images;
    std::vector<std::pair<int32_t, double>> shares;
  };
  // By a pose of the map's own frame.
  Result<Place> PlaceAround(const Pose& cam_from_world) const;
  // How likely the image is at each place and at none; `places`: within them belief follows the shares.
  void Weigh(const std::vector<double>& likelihood, double elsewhere_likelihood,
             const std::vector<Place>& places);

  std::shared_ptr<const Map> map_;
  PlaceBeliefOptions options_;
  std::vector<Pose> poses_;  // of each image, in the map's own frame
  std::vector<std::vector<int32_t>> neighbours_;
  double radius_m_ = 1;  // of a view
  std::vector<double> probability_;
  double elsewhere_ = 0;
  // Since belief last moved: in the frame of the robot there.
  Eigen::Vector2d way_m_ = Eigen::Vector2d::Zero();
  double turn_left_rad_ = 0;
  bool has_moved_ = false;  // since the last image
  bool has_seen_ = false;
  std::optional<Pose> last_fix_;
};

}  // namespace cairn
