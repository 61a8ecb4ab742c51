// The part of Localizer that chooses which landmarks an image, or each image of a rig, is matched with.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/no_throw.h"
#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/blocks/map_rows.h"
#include "core/promise/view_distance.h"
#include "core/work/work_budget.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/match.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// What a landmark takes that is looked for near its projection: from the map, in rounds, and beside it.
int64_t PicosecondsOfGuided() {
  constexpr int kNumPoses = 5, kNumRounds = 8, kNumNear = 3;
  return WorkBudget::PicosecondsOf(Work::kLandmark) + kNumPoses * WorkBudget::PicosecondsOf(Work::kProject) +
         kNumRounds * kNumNear * WorkBudget::PicosecondsOf(Work::kNear);
}

}  // namespace

size_t Localizer::Attempt::num_landmarks() const {
  size_t num = 0;
  for (std::span<const LandmarkIdx> of_image : landmarks) num += of_image.size();
  return num;
}

Localizer::Attempt Localizer::WithAllImages(Scope scope, std::span<const LandmarkIdx> landmarks,
                                            const Sighting& sighting) {
  Attempt attempt{.scope = scope};
  attempt.landmarks.assign(sighting.images.size(), {landmarks.begin(), landmarks.end()});
  return attempt;
}

Result<Localization> Localizer::LocalizeRig(const std::vector<RigImage>& images,
                                            const std::optional<PosePrior>& prior,
                                            const std::optional<SensedUp>& up) {
  return WithoutExceptions("localize a rig", [&]() -> Result<Localization> {
    PooledVector<Query> queries;
    const Budget work = MakeBudget();
    for (const RigImage& image : images) {
      const WorkBudget::Share share(work.get(), 1.0 / static_cast<double>(images.size() - queries.size()));
      CAIRN_ASSIGN_OR_RETURN(Query query, QueryFromImage(image.grey, image.camera, work));
      CAIRN_RETURN_IF_ERROR(PutOnRig(image.cam_from_rig, &query));
      queries.push_back(std::move(query));
    }
    return LocalizeRigQueries(std::move(queries), prior, up);
  });
}

Result<Localization> Localizer::LocalizeRigFeatures(std::vector<RigFeatures> images,
                                                    const std::optional<PosePrior>& prior,
                                                    const std::optional<SensedUp>& up) {
  return WithoutExceptions("localize a rig", [&]() -> Result<Localization> {
    PooledVector<Query> queries;
    const Budget work = MakeBudget();
    for (RigFeatures& image : images) {
      CAIRN_ASSIGN_OR_RETURN(Query query, QueryFromFeatures(std::move(image.features), image.camera, work));
      CAIRN_RETURN_IF_ERROR(PutOnRig(image.cam_from_rig, &query));
      queries.push_back(std::move(query));
    }
    return LocalizeRigQueries(std::move(queries), prior, up);
  });
}

Status Localizer::PutOnRig(const Pose& cam_from_rig, Query* query) const {
  constexpr double kUnit = 1e-3;  // a quaternion's length
  if (!cam_from_rig.translation.allFinite() || !(std::abs(cam_from_rig.rotation.norm() - 1) <= kUnit))
    return MakeError(
        ErrorCode::kInvalidArgument,
        "localize: a camera's place on the rig is no pose: a rotation of length {} and ({}, {}, {})",
        cam_from_rig.rotation.norm(), cam_from_rig.translation.x(), cam_from_rig.translation.y(),
        cam_from_rig.translation.z());
  const Pose& camera_from_given = map_->head().camera_from_given;
  const Pose unit{cam_from_rig.rotation.normalized(), cam_from_rig.translation};
  query->cam_from_rig = camera_from_given * unit * camera_from_given.Inverse();
  return Ok();
}

Result<Localization> Localizer::LocalizeRigQueries(PooledVector<Query> queries,
                                                   const std::optional<PosePrior>& prior,
                                                   const std::optional<SensedUp>& up) const {
  if (queries.empty()) return MakeError(ErrorCode::kInvalidArgument, "localize: a rig without images");
  if (up) CAIRN_RETURN_IF_ERROR(SetUp(*up, &queries.front()));
  return LocalizeQuery(Sighting(std::span<const Query>(queries)), prior);
}

int64_t Localizer::MaxNumMatched(const Query& query) const {
  constexpr double kMatchPart = 0.4;
  const int64_t of_landmark =
      WorkBudget::PicosecondsOf(Work::kLandmark) +
      std::ssize(query.features.keypoints) * WorkBudget::PicosecondsOf(Work::kDescriptorPair);
  return NumAffordable(query.work.get(), of_landmark, kMatchPart);
}

PosePrior Localizer::PriorOfImage(const PosePrior& prior, const Query& query) const {
  const Pose& camera_from_given = map_->head().camera_from_given;
  PosePrior of_image = prior;
  of_image.cam_from_world =
      camera_from_given.Inverse() * query.cam_from_rig * camera_from_given * prior.cam_from_world;
  return of_image;
}

Result<PooledVector<Localizer::Attempt>> Localizer::MakeAttempts(const Sighting& sighting,
                                                                 const std::optional<PosePrior>& prior,
                                                                 std::vector<ImageId>* candidate_ids) const {
  Attempt near{.scope = Scope::kPrior}, of_regions{.scope = Scope::kRegions},
      of_images{.scope = Scope::kImages};
  for (const Query& query : sighting.images) {
    if (prior) {
      CAIRN_ASSIGN_OR_RETURN(const auto images, RetrieveByPrior(*map_, PriorOfImage(*prior, query),
                                                                options_.retrieve, sighting.work));
      CAIRN_ASSIGN_OR_RETURN(auto landmarks,
                             LandmarksOfImages(*map_, ImagesOf(images), kAnyNum, sighting.work));
      near.landmarks.push_back(std::move(landmarks));
    }
    CAIRN_ASSIGN_OR_RETURN(const auto candidates, RetrieveByWords(*map_, query, options_.retrieve));
    for (const Candidate& candidate : candidates) {
      CAIRN_ASSIGN_OR_RETURN(const auto image, map_->Image(candidate.image));
      if (std::find(candidate_ids->begin(), candidate_ids->end(), image->image_id) == candidate_ids->end())
        candidate_ids->push_back(image->image_id);
    }
    CAIRN_ASSIGN_OR_RETURN(const auto regions, RegionsOfCandidates(*map_, candidates, options_.retrieve));
    CAIRN_ASSIGN_OR_RETURN(auto landmarks_of_regions, LandmarksOfRegions(*map_, regions, sighting.work));
    of_regions.landmarks.push_back(std::move(landmarks_of_regions));
    CAIRN_ASSIGN_OR_RETURN(auto landmarks_of_images, LandmarksOfImages(*map_, ImagesOf(candidates),
                                                                       MaxNumMatched(query), sighting.work));
    of_images.landmarks.push_back(std::move(landmarks_of_images));
  }
  PooledVector<Attempt> attempts;
  const auto add = [&](Attempt attempt) {
    if (attempt.num_landmarks() == 0) return;
    for (const Attempt& other : attempts) {
      if (other.landmarks == attempt.landmarks) return;
    }
    attempts.push_back(std::move(attempt));
  };
  if (prior) add(std::move(near));
  const bool images_first = options_.first_landmarks == "images" ||
                            (options_.first_landmarks == "auto" && map_->head().landmark_choice != "regions");
  if (images_first) add(of_images);
  add(std::move(of_regions));
  add(std::move(of_images));
  if (options_.fall_back_to_all && map_->num_landmarks() <= options_.fall_back_max_num_landmarks) {
    PooledVector<LandmarkIdx> all(map_->num_landmarks());
    std::iota(all.begin(), all.end(), 0);
    add(WithAllImages(Scope::kAll, all, sighting));
  }
  return attempts;
}

int64_t Localizer::MaxNumGuided(const Sighting& sighting, size_t num_poses) {
  constexpr double kGuidedPart = 0.5;
  return NumAffordable(sighting.work, PicosecondsOfGuided(),
                       kGuidedPart / static_cast<double>(num_poses * sighting.images.size()));
}

Result<PooledVector<LandmarkIdx>> Localizer::LandmarksToLookFor(const Sighting& sighting,
                                                                std::span<const Correspondence> inliers,
                                                                const Pose& rig_from_world,
                                                                int64_t max_num) const {
  if (sighting.num_images() == 1)
    return CovisibleLandmarks(*map_, LandmarksOf(inliers), options_.match, max_num, sighting.work);
  CAIRN_ASSIGN_OR_RETURN(const auto matched, map_->Gather(LandmarksOf(inliers), false));
  PooledVector<double> distances;
  for (const MapLandmark& landmark : matched->landmarks)
    distances.push_back((rig_from_world * landmark.position).norm());
  const ViewOptions one_view;
  const double radius_m = one_view.same_view_ratio * UpperMedian(std::move(distances));
  PooledVector<LandmarkIdx> landmarks;
  for (int i = 0; i < sighting.num_images(); ++i) {
    PooledVector<Correspondence> of_image;
    std::copy_if(inliers.begin(), inliers.end(), std::back_inserter(of_image),
                 [&](const Correspondence& inlier) { return inlier.image == i; });
    PooledVector<LandmarkIdx> seen;
    if (!of_image.empty()) {
      CAIRN_ASSIGN_OR_RETURN(
          seen, CovisibleLandmarks(*map_, LandmarksOf(of_image), options_.match, max_num, sighting.work));
    } else {  // what the survey saw from near the place that the others give it
      CAIRN_ASSIGN_OR_RETURN(
          const PooledVector<NearView> near,
          NearestViews(*map_, sighting.images[i].cam_from_rig * rig_from_world, radius_m,
                       one_view.same_view_deg, options_.match.guided_num_images, sighting.work));
      PooledVector<int32_t> images;
      for (const NearView& view : near) images.push_back(view.image);
      CAIRN_ASSIGN_OR_RETURN(seen, LandmarksOfImages(*map_, images, max_num, sighting.work));
    }
    landmarks.insert(landmarks.end(), seen.begin(), seen.end());
  }
  SortUnique(&landmarks);
  return landmarks;
}

}  // namespace cairn
