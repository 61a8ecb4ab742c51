#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/pose.h"

namespace cairn {

class Map;  // runtime/map/map.h

// The places of a map, one for each survey image, and how a robot gets from one to another: what PlaceBelief
// moves its probabilities over.  Immutable.
class PlaceGraph {
 public:
  // Errors: NoData (a map without images), Corrupt, Io.
  static Result<PlaceGraph> Make(std::shared_ptr<const Map> map);

  int64_t num_places() const { return static_cast<int64_t>(neighbours_.size()); }
  // Of a view (ViewOptions of core/promise/view_distance.h): metres, or the map's units; degrees.
  double radius() const { return radius_; }
  double radius_deg() const;
  // Images that show enough of the same landmarks, ascending.
  const std::vector<int32_t>& Neighbours(int32_t image) const { return neighbours_[image]; }
  // Of these the near ones, no more than five views away, or the nearest four: they and the image are one
  // place.  What shows the same may stand at another corridor's end.  Ascending.
  const std::vector<int32_t>& SamePlace(int32_t image) const { return same_place_[image]; }
  // All images that are as near to a pose of the map's own frame, ascending.
  std::vector<int32_t> ImagesNear(const Pose& cam_from_world) const;
  // Images of places that the map knows to look like this one's, ascending.  Empty where it knows none.
  const std::vector<int32_t>& LookAlikes(int32_t image) const { return look_alikes_[image]; }
  // Distance of two poses of the map's own frame, in radii of a view.
  double ViewDistance(const Pose& a, const Pose& b) const;
  // The same of a robot's motion.
  double ViewDistance(const Eigen::Vector2d& way_m, double turn_rad) const;

  // Where a pose of the map's own frame is.
  struct Place {
    std::vector<int32_t> images;                      // around it, ascending
    std::vector<std::pair<int32_t, double>> nearest;  // a few of them, and each's share of it
  };
  Result<Place> PlaceAround(const Pose& cam_from_world) const;
  // Of each of several poses: an image is of the pose that it is nearest to, so that one of them may have
  // none.
  Result<std::vector<Place>> PlacesAround(const std::vector<Pose>& poses) const;

  // A robot goes anywhere along so many links (a fraction: with that probability one more); half of the times
  // it stays.
  void Spread(double num_links, std::vector<double>* probability) const;
  // A robot at any of the places drives this way, metres ahead and to the left, and turns left, all with the
  // error of these radii.  REQUIRES: radii > 0
  Status Drive(const Eigen::Vector2d& way_m, double turn_left_rad, double radius_m, double radius_deg,
               const std::vector<std::vector<double>*>& probabilities) const;

  // The image nearest to this one, by links, that the map knows no look-alike of; -1: none within reach, or
  // the map does not say.
  int32_t NextTellingImage(int32_t from) const;

 private:
  explicit PlaceGraph(std::shared_ptr<const Map> map) : map_(std::move(map)) {}
  Status ReadImages();
  Status ReadLookAlikes();
  std::vector<int32_t> NearAmong(const Pose& cam_from_world, const std::vector<int32_t>& images) const;
  Result<std::vector<std::pair<int32_t, double>>> Nearest(const Pose& cam_from_world, double radius,
                                                          double radius_deg) const;

  std::shared_ptr<const Map> map_;
  std::vector<Pose> poses_;  // of each image, in the map's own frame
  std::vector<std::vector<int32_t>> neighbours_, same_place_, look_alikes_;
  std::vector<char> is_telling_;  // has a place in the appearance graph, and no look-alike
  double radius_ = 1;
};

}  // namespace cairn
