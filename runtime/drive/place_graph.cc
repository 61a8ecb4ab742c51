#include "runtime/drive/place_graph.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <utility>

#include "core/base/quantiles.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/promise/view_distance.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

// A pose lies among so many survey images, those nearest to it.
constexpr int kNumViewsOfPose = 4;
// Where the probability of a pose may have spread to: so many links around these.
constexpr int kNumLinksAround = 2;
// Images of one place are no more radii of a view apart.
constexpr double kPlaceViews = 5;
// Two images are linked that share this part of the landmarks of the one that has fewer.
constexpr double kMinSharedRatio = 0.1;
constexpr int kMinNumShared = 3;
// Of a landmark that more images see, so many tell which of them are linked.
constexpr size_t kMaxImagesOfLandmark = 100;
// A probability that is not worth moving: this part of what each place has where nothing is known.
constexpr double kNegligibleRatio = 0.1;

std::vector<std::vector<int32_t>> LinkImages(const std::vector<std::vector<LandmarkIdx>>& seen,
                                             int64_t num_landmarks) {
  std::vector<std::vector<int32_t>> images_of(num_landmarks);
  for (size_t i = 0; i < seen.size(); ++i) {
    for (const LandmarkIdx landmark : seen[i]) images_of[landmark].push_back(static_cast<int32_t>(i));
  }
  std::vector<std::vector<int32_t>> neighbours(seen.size());
  std::vector<int> num_shared(seen.size());
  for (size_t i = 0; i < seen.size(); ++i) {
    std::vector<int32_t> sharing;
    for (const LandmarkIdx landmark : seen[i]) {
      const std::vector<int32_t>& images = images_of[landmark];
      const size_t stride = images.size() / kMaxImagesOfLandmark + 1;
      for (size_t k = 0; k < images.size(); k += stride) {
        if (num_shared[images[k]]++ == 0) sharing.push_back(images[k]);
      }
    }
    std::sort(sharing.begin(), sharing.end());
    for (const int32_t j : sharing) {
      const double needed = kMinSharedRatio * static_cast<double>(std::min(seen[i].size(), seen[j].size()));
      if (std::exchange(num_shared[j], 0) >= std::max(static_cast<double>(kMinNumShared), needed) &&
          j != static_cast<int32_t>(i))
        neighbours[i].push_back(j);
    }
  }
  return neighbours;
}

// By the square of a distance in radii: 1 there, and never so little that a chain of errors could not be
// undone.
double Closeness(double squared_distance) { return 1 / ((1 + squared_distance) * (1 + squared_distance)); }

}  // namespace

double PlaceGraph::radius_deg() const { return ViewOptions().same_view_deg; }

Result<PlaceGraph> PlaceGraph::Make(std::shared_ptr<const Map> map) {
  if (map->num_images() == 0)
    return MakeError(ErrorCode::kNoData, "map '{}' has no images: nothing says which places it shows",
                     map->head().name);
  PlaceGraph graph(std::move(map));
  CAIRN_RETURN_IF_ERROR(graph.ReadImages());
  CAIRN_RETURN_IF_ERROR(graph.ReadLookAlikes());
  return graph;
}

Status PlaceGraph::ReadImages() {
  std::vector<std::vector<LandmarkIdx>> seen;
  std::vector<double> depths;
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map_->AllLandmarks());
  for (int64_t i = 0; i < map_->num_images(); ++i) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map_->Image(i));
    poses_.push_back(image->cam_from_world);
    seen.push_back(image->landmarks);
    for (const LandmarkIdx landmark : image->landmarks)
      depths.push_back((landmarks->Find(landmark).position - image->cam_from_world.Center()).norm());
  }
  if (!depths.empty()) radius_ = ViewOptions().same_view_ratio * UpperMedian(std::move(depths));
  neighbours_ = LinkImages(seen, map_->num_landmarks());
  for (size_t i = 0; i < poses_.size(); ++i) same_place_.push_back(NearAmong(poses_[i], neighbours_[i]));
  return Ok();
}

Status PlaceGraph::ReadLookAlikes() {
  look_alikes_.resize(neighbours_.size());
  is_telling_.assign(neighbours_.size(), 0);
  if (map_->directory().NumBlocks(BlockKind::kAmbiguity) == 0) return Ok();
  CAIRN_ASSIGN_OR_RETURN(const auto appearance, map_->Appearance());
  for (size_t i = 0; i < neighbours_.size(); ++i) {
    const NodeIdx node = appearance->node_of_image[i];
    if (node < 0) continue;
    is_telling_[i] = appearance->look_alikes[node].empty() ? 1 : 0;
    for (const MapAppearanceNode::LookAlike& other : appearance->look_alikes[node]) {
      const std::vector<int32_t>& images = appearance->node_images[other.node];
      look_alikes_[i].insert(look_alikes_[i].end(), images.begin(), images.end());
    }
    std::sort(look_alikes_[i].begin(), look_alikes_[i].end());
  }
  return Ok();
}

std::vector<int32_t> PlaceGraph::NearAmong(const Pose& cam_from_world,
                                           const std::vector<int32_t>& images) const {
  std::vector<std::pair<double, int32_t>> by_distance;
  for (const int32_t image : images)
    by_distance.emplace_back(ViewDistance(poses_[image], cam_from_world), image);
  const size_t num_nearest = std::min<size_t>(kNumViewsOfPose, by_distance.size());
  std::partial_sort(by_distance.begin(), by_distance.begin() + static_cast<std::ptrdiff_t>(num_nearest),
                    by_distance.end());
  std::vector<int32_t> near;
  for (size_t i = 0; i < by_distance.size(); ++i) {
    if (i < num_nearest || by_distance[i].first <= kPlaceViews) near.push_back(by_distance[i].second);
  }
  std::sort(near.begin(), near.end());
  return near;
}

std::vector<int32_t> PlaceGraph::ImagesNear(const Pose& cam_from_world) const {
  std::vector<int32_t> all(poses_.size());
  std::iota(all.begin(), all.end(), 0);
  return NearAmong(cam_from_world, all);
}

double PlaceGraph::ViewDistance(const Pose& a, const Pose& b) const {
  return std::hypot(CenterErrorM(a, b) / radius_, RotationErrorDeg(a, b) / radius_deg());
}

double PlaceGraph::ViewDistance(const Eigen::Vector2d& way_m, double turn_rad) const {
  return std::hypot(way_m.norm() / radius_, DegFromRad(turn_rad) / radius_deg());
}

Result<std::vector<std::pair<int32_t, double>>> PlaceGraph::Nearest(const Pose& cam_from_world, double radius,
                                                                    double radius_deg) const {
  CAIRN_ASSIGN_OR_RETURN(const auto near,
                         NearestViews(*map_, cam_from_world, radius, radius_deg, kNumViewsOfPose));
  double sum = 0;
  for (const NearView& view : near) sum += Closeness(view.squared_distance);
  std::vector<std::pair<int32_t, double>> shares;
  for (const NearView& view : near) shares.emplace_back(view.image, Closeness(view.squared_distance) / sum);
  return shares;
}

Result<PlaceGraph::Place> PlaceGraph::PlaceAround(const Pose& cam_from_world) const {
  Place place;
  CAIRN_ASSIGN_OR_RETURN(place.nearest, Nearest(cam_from_world, radius_, radius_deg()));
  for (const auto& [image, share] : place.nearest) place.images.push_back(image);
  // As far as Spread may have taken what is here: the farther places with many images lose no more of it than
  // those with few.
  for (int link = 0; link < kNumLinksAround; ++link) {
    const size_t num_inner = place.images.size();
    for (size_t i = 0; i < num_inner; ++i) {
      const std::vector<int32_t>& linked = neighbours_[place.images[i]];
      place.images.insert(place.images.end(), linked.begin(), linked.end());
    }
    std::sort(place.images.begin(), place.images.end());
    place.images.erase(std::unique(place.images.begin(), place.images.end()), place.images.end());
  }
  return place;
}

Result<std::vector<PlaceGraph::Place>> PlaceGraph::PlacesAround(const std::vector<Pose>& poses) const {
  std::vector<Place> places;
  for (const Pose& pose : poses) {
    CAIRN_ASSIGN_OR_RETURN(Place place, PlaceAround(pose));
    places.push_back(std::move(place));
  }
  const auto is_of_another = [&](int32_t image, size_t k) {
    for (size_t other = 0; other < poses.size(); ++other) {
      if (std::pair(ViewDistance(poses_[image], poses[other]), other) <
          std::pair(ViewDistance(poses_[image], poses[k]), k))
        return true;
    }
    return false;
  };
  for (size_t k = 0; k < poses.size(); ++k) {
    std::erase_if(places[k].images, [&](int32_t image) { return is_of_another(image, k); });
    std::erase_if(places[k].nearest, [&](const auto& near) { return is_of_another(near.first, k); });
    if (places[k].nearest.empty()) places[k].images.clear();
    double sum = 0;
    for (const auto& [image, share] : places[k].nearest) sum += share;
    for (auto& [image, share] : places[k].nearest) share /= sum;
  }
  return places;
}

void PlaceGraph::Spread(double num_links, std::vector<double>* probability) const {
  for (double left = num_links; left > 0; left -= 1) {
    const double goes = 0.5 * std::min(1.0, left);
    std::vector<double> next(probability->size());
    for (size_t i = 0; i < probability->size(); ++i) {
      const std::vector<int32_t>& neighbours = neighbours_[i];
      const double stays = neighbours.empty() ? 1 : 1 - goes;
      next[i] += stays * (*probability)[i];
      for (const int32_t j : neighbours)
        next[j] += (1 - stays) * (*probability)[i] / static_cast<double>(neighbours.size());
    }
    *probability = std::move(next);
  }
}

Status PlaceGraph::Drive(const Eigen::Vector2d& way_m, double turn_left_rad, double radius_m,
                         double radius_deg, const std::vector<std::vector<double>*>& probabilities) const {
  const Pose& floor_from_world = map_->head().floor_from_world;
  const Pose world_from_floor = floor_from_world.Inverse();
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(turn_left_rad, Eigen::Vector3d::UnitZ()));
  const double negligible = kNegligibleRatio / static_cast<double>(poses_.size());
  std::vector<std::vector<double>> next(probabilities.size(), std::vector<double>(poses_.size()));
  for (size_t i = 0; i < poses_.size(); ++i) {
    std::vector<std::pair<int32_t, double>> shares = {{static_cast<int32_t>(i), 1.0}};
    if (std::any_of(probabilities.begin(), probabilities.end(),
                    [&](const auto* probability) { return (*probability)[i] >= negligible; })) {
      // The robot's heading is the camera's over the floor.
      const Pose floor_from_cam = floor_from_world * poses_[i].Inverse();
      const Eigen::Vector3d ahead3 = floor_from_cam.rotation * Eigen::Vector3d::UnitZ();
      const Eigen::Vector2d ahead = ahead3.head<2>().normalized(), left(-ahead.y(), ahead.x());
      Eigen::Vector3d center = floor_from_cam.translation;
      center.head<2>() += way_m.x() * ahead + way_m.y() * left;
      const Pose moved{turn * floor_from_cam.rotation, center};
      CAIRN_ASSIGN_OR_RETURN(shares, Nearest((world_from_floor * moved).Inverse(), radius_m, radius_deg));
    }
    for (size_t k = 0; k < probabilities.size(); ++k) {
      for (const auto& [image, share] : shares) next[k][image] += share * (*probabilities[k])[i];
    }
  }
  for (size_t k = 0; k < probabilities.size(); ++k) *probabilities[k] = std::move(next[k]);
  return Ok();
}

int32_t PlaceGraph::NextTellingImage(int32_t from) const {
  std::vector<char> is_known(neighbours_.size());
  std::deque<int32_t> next = {from};
  is_known[from] = 1;
  while (!next.empty()) {
    const int32_t image = next.front();
    next.pop_front();
    if (is_telling_[image] != 0) return image;
    for (const int32_t neighbour : neighbours_[image]) {
      if (std::exchange(is_known[neighbour], 1) == 0) next.push_back(neighbour);
    }
  }
  return -1;
}

}  // namespace cairn
