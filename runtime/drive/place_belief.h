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
class PlaceGraph;     // runtime/drive/place_graph.h
struct Query;         // runtime/localize/measurement.h
struct Localization;  // runtime/localize/localization.h

// How often what happens.  The defaults are rounded from left-out images of the demo, of the kitchen and of
// the other floor of bench/held_out.
struct PlaceBeliefOptions {
  // Share of the images taken at a place of the map that have a fix there, that have one at any other place,
  // and, where the map knows look-alikes of the place, that have one at these.  REQUIRES: > 0, their sum < 1
  double fix_ratio = 0.85;
  double wrong_fix_ratio = 0.005;
  double look_alike_fix_ratio = 0.02;
  // Share of the images of other buildings that have a fix; what one of them says is in its odds.  REQUIRES:
  // in (0, 1)
  double foreign_fix_ratio = 0.02;
  // Odds that one fix can speak for itself, however much of what it expects is found: a place may have a copy
  // that nobody surveyed.  REQUIRES: >= 1
  double max_fix_odds = 100;
  // Share of the views whose evidence means nothing, whatever it says: so no single view, in however many
  // images, makes a place more probable than the rest of this.  REQUIRES: in (0, 1)
  double misled_ratio = 0.01;
  // An image that shows the same as the one before errs alike: it counts by how far from the last a fix is,
  // or the robot drove, in radii of a view (a tenth of the depth, or 15 degrees), and no less than by this
  // for a second.  REQUIRES: in (0, 1]
  double least_new_ratio = 0.05;
  // How much likelier an image without a fix is at the place whose survey image is most like it than at one
  // that shares nothing with it, less 1.  REQUIRES: >= 0
  double likeness_weight = 2;
  // At start, that the robot is where the map shows nothing; and within a second: that it leaves what the map
  // shows, comes back, is carried to any other place.  REQUIRES: in (0, 1)
  double elsewhere_ratio = 0.5;
  double leave_ratio = 0.01;
  double return_ratio = 0.05;
  double kidnapped_ratio = 0.001;
  // Without odometry: in a second it goes no farther than over so many links between images that show the
  // same landmarks.  REQUIRES: >= 1
  int reach_links = 2;
  // With odometry: its error, as part of the way and of the turn, and each view's.  REQUIRES: >= 0, > 0
  double way_sigma_ratio = 0.1;
  double turn_sigma_ratio = 0.1;
  double way_sigma_m = 0.1;
  double turn_sigma_deg = 5;
  // Error of the map's own vertical, where gravity is told, degrees.  REQUIRES: > 0
  double map_up_sigma_deg = 2;
};
OptionTable DescribeOptions(PlaceBeliefOptions* options);

// A place at which the robot may be: a survey image and those near it that show the same.
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
// until one place has the probability that it needs.  Images may come at any rate: what they say counts by
// how much of it is new, and what may have happened meanwhile by the time.  Not for concurrent calls.
class PlaceBelief {
 public:
  // Errors: InvalidArgument (an option), NoData (a map without images), Corrupt, Io.
  static Result<PlaceBelief> Make(std::shared_ptr<const Map> map, const PlaceBeliefOptions& options = {});

  // What is known of the next image besides its pixels, told before See, in any order:

  // The robot drove since the image before: metres ahead and to the left, in its frame there, and a turn to
  // the left, about the floor's normal.  Several add up.  Errors: InvalidArgument (not finite), Unsupported
  // (a map whose unit is not the metre).
  Status Move(const Eigen::Vector2d& way_m, double turn_left_rad);
  // Seconds since the image before; several add up.  Without: one.  Errors: InvalidArgument (negative, not
  // finite).
  Status Elapse(double seconds);
  // Which way is up, in the camera's frame (x right, y down, z ahead; of any length), of an accelerometer at
  // rest, say, and its error.  A pose that says otherwise is refuted by it; none is confirmed, as robots
  // stand upright everywhere.  Errors: InvalidArgument (not finite, no direction, a sigma that is not
  // positive).
  Status SenseUp(const Eigen::Vector3d& up_in_camera, double sigma_deg);

  // The next image, and what Localizer::LocalizeQuery says of it without a prior: one from earlier images
  // would count them twice.  Without Move since the last: it went anywhere within reach.  Errors:
  // InvalidArgument (possible poses without their probabilities), Corrupt, Io.
  Status See(const Query& query, const Localization& found);

  // The likeliest first; each image belongs to one.
  Result<std::vector<PlaceHypothesis>> Hypotheses(int max_num) const;
  double elsewhere() const { return believed_.elsewhere; }  // P(at no place of the map)
  const std::vector<double>& probabilities() const { return believed_.at_image; }  // of each image's place
  // Of the place around a pose (cam_from_world, as fixes state it): survey images no more than five views
  // away, or the nearest ones.
  double ProbabilityAround(const Pose& cam_from_world) const;

  // The survey image nearest to this one, by links, of which the map knows no look-alike: what would tell the
  // robot where it is.  -1: none within reach, or a map without appearance graph.
  int32_t NextTellingImage(int32_t from) const;
  // Images that show enough of the same landmarks, ascending.
  const std::vector<int32_t>& Neighbours(int32_t image) const;

 private:
  // Their sum is 1.
  struct Distribution {
    std::vector<double> at_image;
    double elsewhere = 0;
  };
  // How likely an image is at each place and elsewhere, and the places of its fix.
  struct Evidence;
  struct Up {
    Eigen::Vector3d direction;  // of length 1, in the camera's frame
    double sigma_deg;
  };

  PlaceBelief(std::shared_ptr<const Map> map, std::shared_ptr<const PlaceGraph> graph,
              const PlaceBeliefOptions& options);
  // How it moved since the image before.
  Status Predict(double seconds);
  void LeaveAndReturn(double seconds, Distribution* distribution) const;
  // Of poses of the map's own frame.
  Result<Evidence> OfFix(const std::vector<Pose>& poses, const std::vector<double>& probabilities,
                         const std::optional<Up>& up) const;
  // How well a pose agrees with gravity: 1 where it does.
  double UprightRatio(const Pose& cam_from_world, const std::optional<Up>& up) const;
  Result<Evidence> OfLikeness(const Query& query) const;
  // By how much a fix, or an image without one, tells more than those before.
  double NewRatio(const std::vector<Pose>& poses, double seconds);
  double NewRatio(double seconds) const;
  void Weigh(const Evidence& evidence, double new_ratio);
  void Publish();

  std::shared_ptr<const Map> map_;
  std::shared_ptr<const PlaceGraph> graph_;
  PlaceBeliefOptions options_;
  // Before the view that the robot has now, moved as the robot since; with all that the view says; and what
  // is believed of it, since views may mislead.
  Distribution before_view_, with_view_, believed_;
  double view_ratio_ = 0;  // how much of a view was seen
  // Told of the next image.
  std::optional<double> elapsed_s_;
  std::optional<Up> up_;
  bool has_moved_ = false;
  double driven_views_ = 0;
  bool has_seen_ = false;
  // Since belief last moved: in the frame of the robot there.
  Eigen::Vector2d way_m_ = Eigen::Vector2d::Zero();
  double turn_left_rad_ = 0;
  // The places from which new ones are told, and how far from them they were.
  std::vector<Pose> last_poses_;
  double counted_views_ = 0;
};

}  // namespace cairn
