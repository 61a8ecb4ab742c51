// The part of Localizer that tries the places which look like that of a fix.
#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "runtime/localize/accept.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/appearance_map.h"

namespace cairn {

// A pose of the rig, and the survey images near each of its cameras.
struct Localizer::PlaceToTry {
  Pose cam_from_world;
  PooledVector<PooledVector<Candidate>> near;
};

namespace {

// Where a place looks like that of a pose.
struct LookAlikePose {
  Pose rig_from_world;
  size_t of_pose = 0;
  int last_camera = 0;  // that found it so
  double weight = 0;    // landmarks that those cameras see which do
};

}  // namespace

Result<PooledVector<Localizer::PlaceToTry>> Localizer::WithLookAlikes(
    const Sighting& sighting, std::span<const Pose> poses, const std::optional<PosePrior>& prior) const {
  const Pose given_from_camera = map_->head().camera_from_given.Inverse();
  PooledVector<PlaceToTry> places;
  const auto add = [&](const Pose& pose) -> Status {
    PlaceToTry place{pose, {}};
    for (const Query& query : sighting.images) {
      CAIRN_ASSIGN_OR_RETURN(auto near,
                             RetrieveByPrior(*map_, PriorOfImage({given_from_camera * pose, 0, 0}, query),
                                             options_.retrieve, sighting.work));
      place.near.push_back(std::move(near));
    }
    places.push_back(std::move(place));
    return Ok();
  };
  for (const Pose& pose : poses) CAIRN_RETURN_IF_ERROR(add(pose));
  CAIRN_ASSIGN_OR_RETURN(const auto appearance, map_->Appearance());
  // What each camera of a rig makes of it differs by how far survey images are from each other; the landmarks
  // of a place are those from all around it.
  const auto are_one_place = [&](const Pose& a, const Pose& b) {
    if (sighting.num_images() == 1) return !AreFarApart(a, b, options_.accept);
    return CenterErrorM(a, b) <= options_.retrieve.prior_distance_m &&
           RotationErrorDeg(a, b) <= options_.retrieve.prior_angle_deg;
  };
  PooledVector<LookAlikePose> found;
  PooledVector<double> weights(poses.size(), 0);  // of all cameras, at each
  for (int k = 0; k < sighting.num_images(); ++k) {
    const Query& query = sighting.images[k];
    PooledVector<int32_t> possible;  // by the prior
    if (prior) {
      RetrieveOptions retrieve = options_.retrieve;
      retrieve.max_num_candidates = std::numeric_limits<int>::max();
      CAIRN_ASSIGN_OR_RETURN(const auto candidates,
                             RetrieveByPrior(*map_, PriorOfImage(*prior, query), retrieve, sighting.work));
      possible = ImagesOf(candidates);
      std::sort(possible.begin(), possible.end());
    }
    for (size_t i = 0; i < poses.size(); ++i) {
      if (places[i].near[k].empty()) continue;
      const int32_t image = places[i].near[k][0].image;
      CAIRN_ASSIGN_OR_RETURN(const auto nearest, map_->Image(image));
      const NodeIdx node = appearance->node_of_image[image];
      if (node < 0) continue;
      const auto weight = static_cast<double>(nearest->landmarks.size());
      weights[i] += weight;
      const Pose rig_from_nearest = poses[i] * nearest->cam_from_world.Inverse();
      for (const MapAppearanceNode::LookAlike& look_alike : appearance->look_alikes[node]) {
        const int32_t other = appearance->node_images[look_alike.node].front();
        if (prior && !std::binary_search(possible.begin(), possible.end(), other)) continue;
        CAIRN_ASSIGN_OR_RETURN(const auto other_image, map_->Image(other));
        const Pose there = rig_from_nearest * other_image->cam_from_world;
        // Of a place many images look alike.
        const auto known = std::find_if(found.begin(), found.end(), [&](const LookAlikePose& place) {
          return place.of_pose == i && are_one_place(place.rig_from_world, there);
        });
        if (known == found.end()) {
          found.push_back({there, i, k, weight});
        } else if (known->last_camera != k) {
          known->last_camera = k;
          known->weight += weight;
        }
      }
    }
  }
  for (const LookAlikePose& there : found) {
    // Where most of what a rig sees looks otherwise, what is left is not nearly as much.
    if (2 * there.weight < weights[there.of_pose]) continue;
    const bool is_known = std::any_of(places.begin(), places.end(), [&](const PlaceToTry& place) {
      return !AreFarApart(place.cam_from_world, there.rig_from_world, options_.accept);
    });
    if (!is_known) CAIRN_RETURN_IF_ERROR(add(there.rig_from_world));
  }
  return places;
}

Result<Localization> Localizer::ExcludeLookAlikes(const Sighting& sighting,
                                                  const std::optional<PosePrior>& prior,
                                                  Localization best) const {
  if (map_->directory().NumBlocks(BlockKind::kAmbiguity) == 0) return best;
  const std::span<const Pose> poses =
      best.has_fix() ? std::span<const Pose>(&best.cam_from_world, 1) : best.possible_poses;
  CAIRN_ASSIGN_OR_RETURN(const PooledVector<PlaceToTry> places, WithLookAlikes(sighting, poses, prior));
  if (places.size() == poses.size()) return best;
  // Each among the landmarks of its own place, so that numbers of matches compare: where those of look-alikes
  // are among them, no match is much better than the next best.
  std::vector<Localization> found;
  bool is_confirmed = true;
  for (size_t i = 0; i < places.size(); ++i) {
    // Or numbers of matches do not compare.
    Attempt attempt{.scope = Scope::kImages, .may_be_thinned = false};
    for (std::span<const Candidate> near : places[i].near) {
      CAIRN_ASSIGN_OR_RETURN(auto landmarks,
                             LandmarksOfImages(*map_, ImagesOf(near), kAnyNum, sighting.work));
      attempt.landmarks.push_back(std::move(landmarks));
    }
    Localization here;
    if (attempt.num_landmarks() > 0) {
      CAIRN_ASSIGN_OR_RETURN(here, Try(sighting, attempt));
    }
    const bool is_new = i >= poses.size();
    const bool is_here =
        here.has_fix() && !AreFarApart(here.cam_from_world, places[i].cam_from_world, options_.accept);
    is_confirmed = is_confirmed && (is_new || is_here);
    if (is_here || (is_new && here.has_places())) found.push_back(std::move(here));
  }
  if (!is_confirmed) found.insert(found.begin(), best);
  Localization decided = DecideAmong(found, options_.min_look_alike_odds, options_.accept);
  if (!best.has_fix() || !decided.has_fix() ||
      AreFarApart(decided.cam_from_world, best.cam_from_world, options_.accept))
    return decided;
  best.probability = decided.probability;
  return best;
}

}  // namespace cairn
