#include "runtime/drive/place_belief.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <utility>

#include "core/base/no_throw.h"
#include "core/base/quantiles.h"
#include "core/blocks/map_rows.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

// A view's radius (ViewOptions of core/promise/view_distance.h).
constexpr double kSameViewRatio = 0.1;
constexpr double kSameViewDeg = 15;
// A fix lies among so many survey images, those nearest to it.
constexpr int kNumViewsOfFix = 4;
// Two images are linked that share this part of the landmarks of the one that has fewer.
constexpr double kMinSharedRatio = 0.1;
constexpr int kMinNumShared = 3;
// Of a landmark that more images see, so many tell which of them are linked.
constexpr size_t kMaxImagesOfLandmark = 100;

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

OptionTable DescribeOptions(PlaceBeliefOptions* o) {
  constexpr double kTiny = 1e-9, kAlmostOne = 1 - 1e-9;
  return {
      {.name = "fix_ratio",
       .value = &o->fix_ratio,
       .help = "share of the images of the map's places that have a fix there",
       .min = kTiny,
       .max = 0.99},
      {.name = "wrong_fix_ratio",
       .value = &o->wrong_fix_ratio,
       .help = "share of the images of the map's places that have a fix at another place",
       .min = kTiny,
       .max = 0.009},
      {.name = "foreign_fix_ratio",
       .value = &o->foreign_fix_ratio,
       .help = "share of the images of other places that have a fix",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "max_fix_odds",
       .value = &o->max_fix_odds,
       .help = "largest odds by which one fix counts as right",
       .min = 1},
      {.name = "misled_ratio",
       .value = &o->misled_ratio,
       .help = "share of the images whose evidence means nothing, whatever it says",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "least_new_ratio",
       .value = &o->least_new_ratio,
       .help = "least part by which a fix counts that is where the last one was",
       .min = kTiny,
       .max = 1},
      {.name = "likeness_weight",
       .value = &o->likeness_weight,
       .help = "how much likelier an image without a fix is where the survey looks most like it, less 1",
       .min = 0},
      {.name = "elsewhere_ratio",
       .value = &o->elsewhere_ratio,
       .help = "at start, the probability of being where the map shows nothing",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "leave_ratio",
       .value = &o->leave_ratio,
       .help = "probability of leaving what the map shows, per image",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "return_ratio",
       .value = &o->return_ratio,
       .help = "probability of coming back to it, per image",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "kidnapped_ratio",
       .value = &o->kidnapped_ratio,
       .help = "probability of being carried to any other place, per image",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "reach_links",
       .value = &o->reach_links,
       .help = "most links between images of the same landmarks from one image to the next, without odometry",
       .min = 1,
       .max = 100},
      {.name = "way_sigma_ratio",
       .value = &o->way_sigma_ratio,
       .help = "standard deviation of odometry's way, as part of it",
       .min = 0},
      {.name = "turn_sigma_ratio",
       .value = &o->turn_sigma_ratio,
       .help = "standard deviation of odometry's turn, as part of it",
       .min = 0},
      {.name = "way_sigma_m", .value = &o->way_sigma_m, .help = "and per image, m", .min = kTiny},
      {.name = "turn_sigma_deg", .value = &o->turn_sigma_deg, .help = "and per image, degrees", .min = kTiny},
  };
}

Result<PlaceBelief> PlaceBelief::Make(std::shared_ptr<const Map> map, const PlaceBeliefOptions& options) {
  return WithoutExceptions("place belief", [&]() -> Result<PlaceBelief> {
    PlaceBeliefOptions checked = options;
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
    if (map->num_images() == 0)
      return MakeError(ErrorCode::kNoData, "map '{}' has no images: nothing says which places it shows",
                       map->head().name);
    PlaceBelief belief(std::move(map), options);
    std::vector<std::vector<LandmarkIdx>> seen;
    std::vector<double> depths;
    CAIRN_ASSIGN_OR_RETURN(const auto landmarks, belief.map_->AllLandmarks());
    for (int64_t i = 0; i < belief.map_->num_images(); ++i) {
      CAIRN_ASSIGN_OR_RETURN(const auto image, belief.map_->Image(i));
      belief.poses_.push_back(image->cam_from_world);
      seen.push_back(image->landmarks);
      for (const LandmarkIdx landmark : image->landmarks)
        depths.push_back((landmarks->Find(landmark).position - image->cam_from_world.Center()).norm());
    }
    if (!depths.empty()) belief.radius_m_ = kSameViewRatio * UpperMedian(std::move(depths));
    belief.neighbours_ = LinkImages(seen, belief.map_->num_landmarks());
    belief.elsewhere_ = options.elsewhere_ratio;
    belief.probability_.assign(belief.poses_.size(),
                               (1 - options.elsewhere_ratio) / static_cast<double>(belief.poses_.size()));
    return belief;
  });
}

void PlaceBelief::Spread() {
  for (int link = 0; link < options_.reach_links; ++link) {
    std::vector<double> next(probability_.size());
    for (size_t i = 0; i < probability_.size(); ++i) {
      const std::vector<int32_t>& neighbours = neighbours_[i];
      const double stays = neighbours.empty() ? 1 : 0.5;
      next[i] += stays * probability_[i];
      for (const int32_t j : neighbours)
        next[j] += (1 - stays) * probability_[i] / static_cast<double>(neighbours.size());
    }
    probability_ = std::move(next);
  }
}

Status PlaceBelief::Move(const Eigen::Vector2d& way_m, double turn_left_rad) {
  return WithoutExceptions("place belief", [&]() -> Status {
    if (!way_m.allFinite() || !std::isfinite(turn_left_rad))
      return MakeError(ErrorCode::kInvalidArgument, "odometry: a way or a turn that is no number");
    const MapHead& head = map_->head();
    if (!IsMetric(head.frame)) {
      return MakeError(ErrorCode::kUnsupported,
                       "odometry is in metres, and the unit of map '{}' is not known; leave the odometry out",
                       head.name);
    }
    way_m_ += Eigen::Rotation2Dd(turn_left_rad_) * way_m;
    turn_left_rad_ += turn_left_rad;
    has_moved_ = true;
    return Ok();
  });
}

Status PlaceBelief::Drive() {
  // Shorter ways would be lost between the survey's images: they add up first.
  if (way_m_.norm() < radius_m_ && std::abs(turn_left_rad_) < RadFromDeg(kSameViewDeg)) return Ok();
  const Pose& floor_from_world = map_->head().floor_from_world;
  const double radius_m =
      std::hypot(radius_m_, options_.way_sigma_m, options_.way_sigma_ratio * way_m_.norm());
  const double radius_deg = std::hypot(kSameViewDeg, options_.turn_sigma_deg,
                                       options_.turn_sigma_ratio * DegFromRad(std::abs(turn_left_rad_)));
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(turn_left_rad_, Eigen::Vector3d::UnitZ()));
  constexpr double kNegligible = 1e-7;
  std::vector<double> next(probability_.size());
  for (size_t i = 0; i < probability_.size(); ++i) {
    if (probability_[i] < kNegligible) {
      next[i] += probability_[i];
      continue;
    }
    // The robot's heading is the camera's over the floor.
    const Pose floor_from_cam = floor_from_world * poses_[i].Inverse();
    const Eigen::Vector3d ahead3 = floor_from_cam.rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector2d ahead = ahead3.head<2>().normalized(), left(-ahead.y(), ahead.x());
    Eigen::Vector3d center = floor_from_cam.translation;
    center.head<2>() += way_m_.x() * ahead + way_m_.y() * left;
    const Pose moved{turn * floor_from_cam.rotation, center};
    CAIRN_ASSIGN_OR_RETURN(const auto near,
                           NearestViews(*map_, (floor_from_world.Inverse() * moved).Inverse(), radius_m,
                                        radius_deg, kNumViewsOfFix));
    double sum = 0;
    for (const NearView& view : near) sum += Closeness(view.squared_distance);
    for (const NearView& view : near)
      next[view.image] += probability_[i] * Closeness(view.squared_distance) / sum;
  }
  probability_ = std::move(next);
  way_m_.setZero();
  turn_left_rad_ = 0;
  return Ok();
}

void PlaceBelief::LeaveAndReturn() {
  const double in_map = std::accumulate(probability_.begin(), probability_.end(), 0.0);
  const double arriving = (options_.kidnapped_ratio * in_map + options_.return_ratio * elsewhere_) /
                          static_cast<double>(probability_.size());
  for (double& p : probability_) p = (1 - options_.leave_ratio - options_.kidnapped_ratio) * p + arriving;
  elsewhere_ = (1 - options_.return_ratio) * elsewhere_ + options_.leave_ratio * in_map;
}

Status PlaceBelief::See(const Query& query, const Localization& found) {
  return WithoutExceptions("place belief", [&]() -> Status {
    if (has_seen_) {
      if (has_moved_) {
        CAIRN_RETURN_IF_ERROR(Drive());
      } else {
        Spread();
      }
      LeaveAndReturn();
    } else {  // how it drove before is no way from one place to another
      way_m_.setZero();
      turn_left_rad_ = 0;
    }
    has_seen_ = true;
    has_moved_ = false;
    if (found.reason == NoFix::kTooFewFeatures) return Ok();  // it shows nothing, wherever it is
    const auto num = static_cast<double>(probability_.size());
    const std::vector<Pose> poses =
        found.has_fix() ? std::vector<Pose>{found.cam_from_world} : found.possible_poses;
    if (!poses.empty()) {
      const Pose& camera_from_given = map_->head().camera_from_given;
      const Pose fix = camera_from_given * poses.front();
      double new_ratio = 1;
      if (last_fix_) {
        new_ratio = std::clamp(std::hypot(CenterErrorM(fix, *last_fix_) / radius_m_,
                                          RotationErrorDeg(fix, *last_fix_) / kSameViewDeg),
                               options_.least_new_ratio, 1.0);
      }
      last_fix_ = fix;
      const double odds = found.probability / std::max(1e-12, 1 - found.probability);
      const double weight =
          options_.fix_ratio * std::min(options_.max_fix_odds, odds) / static_cast<double>(poses.size());
      std::vector<Place> places;
      double num_of_places = 0;
      for (const Pose& pose : poses) {
        CAIRN_ASSIGN_OR_RETURN(Place place, PlaceAround(camera_from_given * pose));
        num_of_places += static_cast<double>(place.images.size());
        places.push_back(std::move(place));
      }
      // A fix that is wrong is at this place as often as at any other.
      const double by_chance = num_of_places / static_cast<double>(places.size()) / num;
      std::vector<double> likelihood(probability_.size(), options_.wrong_fix_ratio * by_chance);
      for (const Place& place : places) {
        for (const int32_t image : place.images)
          likelihood[image] = options_.wrong_fix_ratio * by_chance + weight;
      }
      for (double& value : likelihood) value = std::pow(value, new_ratio);
      // The odds are against being elsewhere.
      Weigh(likelihood, std::pow(options_.fix_ratio * by_chance, new_ratio), places);
      return Ok();
    }
    RetrieveOptions all;
    all.max_num_candidates = static_cast<int>(probability_.size());
    all.min_score_ratio = 0;
    CAIRN_ASSIGN_OR_RETURN(const auto candidates, RetrieveByWords(*map_, query, all));
    std::vector<double> likelihood(probability_.size(), 1.0);
    for (const Candidate& candidate : candidates) {
      // [Mariottini11 §IV] as ProbabilitiesOfScores
      likelihood[candidate.image] +=
          options_.likeness_weight * std::pow(candidate.score / candidates.front().score, 4);
    }
    const double mean = std::accumulate(likelihood.begin(), likelihood.end(), 0.0) / num;
    const double no_fix = 1 - options_.fix_ratio - options_.wrong_fix_ratio;
    for (double& value : likelihood) value *= no_fix / mean;
    Weigh(likelihood, 1 - options_.foreign_fix_ratio, {});
    return Ok();
  });
}

Result<PlaceBelief::Place> PlaceBelief::PlaceAround(const Pose& cam_from_world) const {
  CAIRN_ASSIGN_OR_RETURN(const auto near,
                         NearestViews(*map_, cam_from_world, radius_m_, kSameViewDeg, kNumViewsOfFix));
  Place place;
  double sum = 0;
  for (const NearView& view : near) sum += Closeness(view.squared_distance);
  for (const NearView& view : near)
    place.shares.emplace_back(view.image, Closeness(view.squared_distance) / sum);
  for (const NearView& view : near) place.images.push_back(view.image);
  place.images.insert(place.images.end(), neighbours_[near[0].image].begin(),
                      neighbours_[near[0].image].end());
  std::sort(place.images.begin(), place.images.end());
  place.images.erase(std::unique(place.images.begin(), place.images.end()), place.images.end());
  return place;
}

void PlaceBelief::Weigh(const std::vector<double>& likelihood, double elsewhere_likelihood,
                        const std::vector<Place>& places) {
  double sum = elsewhere_ * elsewhere_likelihood;
  for (size_t i = 0; i < probability_.size(); ++i) sum += probability_[i] * likelihood[i];
  std::vector<double> weighed(probability_.size());
  for (size_t i = 0; i < probability_.size(); ++i) weighed[i] = probability_[i] * likelihood[i] / sum;
  // How probable a place is does not depend on how densely it was surveyed: where in it a fix is comes after.
  for (const Place& place : places) {
    double of_place = 0;
    for (const int32_t image : place.images) of_place += std::exchange(weighed[image], 0);
    for (const auto& [image, share] : place.shares) weighed[image] += share * of_place;
  }
  for (size_t i = 0; i < probability_.size(); ++i)
    probability_[i] = options_.misled_ratio * probability_[i] + (1 - options_.misled_ratio) * weighed[i];
  elsewhere_ = options_.misled_ratio * elsewhere_ +
               (1 - options_.misled_ratio) * elsewhere_ * elsewhere_likelihood / sum;
}

Result<std::vector<PlaceHypothesis>> PlaceBelief::Hypotheses(int max_num) const {
  std::vector<double> left = probability_;
  std::vector<PlaceHypothesis> hypotheses;
  while (static_cast<int>(hypotheses.size()) < max_num) {
    // Of a place the image whose surroundings are likeliest, so that neighbours of alike probability are one.
    const auto best = std::max_element(left.begin(), left.end());
    if (*best <= 0) break;
    const auto image = static_cast<int32_t>(best - left.begin());
    PlaceHypothesis hypothesis{.image = image, .probability = std::exchange(left[image], 0)};
    for (const int32_t neighbour : neighbours_[image])
      hypothesis.probability += std::exchange(left[neighbour], 0);
    CAIRN_ASSIGN_OR_RETURN(const auto row, map_->Image(image));
    hypothesis.image_id = row->image_id;
    hypothesis.name = row->name;
    hypotheses.push_back(std::move(hypothesis));
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const auto& a, const auto& b) { return a.probability > b.probability; });
  return hypotheses;
}

Result<int32_t> PlaceBelief::NextTellingImage(int32_t from) const {
  if (map_->directory().NumBlocks(BlockKind::kAmbiguity) == 0) return -1;
  CAIRN_ASSIGN_OR_RETURN(const auto appearance, map_->Appearance());
  std::vector<char> is_known(neighbours_.size());
  std::deque<int32_t> next = {from};
  is_known[from] = 1;
  while (!next.empty()) {
    const int32_t image = next.front();
    next.pop_front();
    const NodeIdx node = appearance->node_of_image[image];
    if (node >= 0 && appearance->look_alikes[node].empty()) return image;
    for (const int32_t neighbour : neighbours_[image]) {
      if (std::exchange(is_known[neighbour], 1) == 0) next.push_back(neighbour);
    }
  }
  return -1;
}

}  // namespace cairn
