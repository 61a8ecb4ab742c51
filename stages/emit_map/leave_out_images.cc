#include "stages/emit_map/leave_out_images.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <unordered_map>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/colmap/colmap_database.h"
#include "runtime/localize/localizer.h"

namespace cairn::emit_map {
namespace {

constexpr size_t kMinNumSurveyImages = 12;  // of which a run of four is left out
constexpr size_t kRunLength = 4;
constexpr size_t kMinStep = 4;
constexpr int kPlentyOfInliers = 50;
constexpr size_t kMinNumObservations = 2;

Result<Features> ReadFeatures(SQLite::Database& database, ImageId image_id) {
  Features features;
  CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, image_id));
  CAIRN_ASSIGN_OR_RETURN(features.descriptors, ReadDatabaseDescriptors(database, image_id));
  return features;
}

// Descriptors of these classes (positions), from the observations that are left.
Status DescribeAnew(SQLite::Database& database, const std::set<size_t>& affected, Classes* classes) {
  std::map<ImageId, std::vector<std::pair<size_t, KeypointIdx>>> by_image;
  for (const size_t i : affected) {
    for (const Observation& observation : classes->classes[i].observations)
      by_image[observation.image_id].emplace_back(i, observation.keypoint_idx);
  }
  std::unordered_map<size_t, DescriptorSum> sums;
  for (const size_t i : affected) sums[i] = DescriptorSum::Zero();
  for (const auto& [image_id, seen] : by_image) {
    CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix descriptors, ReadDatabaseDescriptors(database, image_id));
    for (const auto& [i, keypoint] : seen) {
      if (keypoint >= descriptors.rows()) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "emit_map: class {} is keypoint {} of image {}, which has {}; were the classes made from "
            "other matches?",
            classes->classes[i].class_id, keypoint, image_id, descriptors.rows());
      }
      sums[i] += descriptors.row(keypoint).cast<double>();
    }
  }
  for (const size_t i : affected) classes->classes[i].descriptor = MeanDescriptor(sums[i]);
  return Ok();
}

// Leaves out the features of removed classes; the rest are renumbered in their order.
void LeaveOutFeatures(const std::set<ClassId>& class_ids, World* world, Decomposition* decomposition) {
  constexpr FeatureIdx kGone = -1;
  std::vector<FeatureIdx> number_of(world->class_ids.size(), kGone);
  std::vector<ClassId> left_ids;
  std::vector<std::vector<StationIdx>> left_areas;
  for (size_t feature = 0; feature < number_of.size(); ++feature) {
    if (!class_ids.contains(world->class_ids[feature])) continue;
    number_of[feature] = static_cast<FeatureIdx>(left_ids.size());
    left_ids.push_back(world->class_ids[feature]);
    left_areas.push_back(std::move(world->areas[feature]));
  }
  world->class_ids = std::move(left_ids);
  world->areas = std::move(left_areas);
  for (Region& region : decomposition->regions) {
    for (FeatureIdx& feature : region.features) feature = number_of[feature];
    std::erase(region.features, kGone);
  }
}

// Neighbours of a kept node that lost all its images could no longer be found, so they are kept.
void LeaveOutNodes(const std::set<ImageId>& images, Appearance* appearance) {
  const std::vector<NodeIdx> kept = appearance->Kept();
  for (AppearanceNode& node : appearance->nodes)
    std::erase_if(node.images, [&](ImageId image) { return !images.contains(image); });
  for (const NodeIdx node : kept) {
    if (!appearance->nodes[node].images.empty()) continue;
    for (const AppearanceGraph::Neighbour& neighbour : appearance->graph.Neighbours(node)) {
      NodeRole& role = appearance->nodes[neighbour.node].role;
      if (role == NodeRole::kDropped) role = NodeRole::kRestored;
    }
  }
}

}  // namespace

Result<LeftOutSurvey> LeaveOutImages(const Classes& classes, const std::string& matches_path,
                                     int max_num_images) {
  if (classes.images.size() < kMinNumSurveyImages) {
    return MakeError(ErrorCode::kNoData,
                     "emit_map: max_bytes chooses landmarks by leaving survey images out, but there are only "
                     "{}; at least {} are needed",
                     classes.images.size(), kMinNumSurveyImages);
  }
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<LeftOutSurvey> {
    LeftOutSurvey survey;
    survey.classes = classes;
    std::map<CameraId, const Camera*> cameras;
    for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
    const size_t most = static_cast<size_t>(max_num_images);
    const size_t step = std::max(kMinStep, (classes.images.size() + most - 1) / most);
    std::set<ImageId> left_out;
    for (size_t i = 0; i < classes.images.size(); ++i) {
      if (i / kRunLength % step != step / 2) continue;
      const SurveyImage& image = classes.images[i];
      left_out.insert(image.image_id);
      TrialImage row{.camera = *cameras.at(image.camera_id), .cam_from_world = image.cam_from_world};
      CAIRN_ASSIGN_OR_RETURN(row.features, ReadFeatures(database, image.image_id));
      survey.images.push_back(std::move(row));
    }
    std::erase_if(survey.classes.images,
                  [&](const SurveyImage& image) { return left_out.contains(image.image_id); });
    std::vector<FeatureClass>& list = survey.classes.classes;
    std::set<ClassId> affected_ids;
    for (FeatureClass& feature_class : list) {
      const size_t num_erased = std::erase_if(
          feature_class.observations,
          [&](const Observation& observation) { return left_out.contains(observation.image_id); });
      if (num_erased > 0) affected_ids.insert(feature_class.class_id);
    }
    std::erase_if(list,
                  [](const FeatureClass& row) { return row.observations.size() < kMinNumObservations; });
    std::set<size_t> affected;
    for (size_t i = 0; i < list.size(); ++i) {
      if (affected_ids.contains(list[i].class_id)) affected.insert(i);
    }
    CAIRN_RETURN_IF_ERROR(DescribeAnew(database, affected, &survey.classes));
    return survey;
  });
}

SurveyParts PartsOf(const Classes& classes, SurveyParts parts) {
  std::set<ImageId> images;
  for (const SurveyImage& image : classes.images) images.insert(image.image_id);
  for (std::vector<ImageId>& of_station : parts.world.station_images)
    std::erase_if(of_station, [&](ImageId image) { return !images.contains(image); });
  std::set<ClassId> class_ids;
  for (const FeatureClass& feature_class : classes.classes) class_ids.insert(feature_class.class_id);
  LeaveOutFeatures(class_ids, &parts.world, &parts.decomposition);
  if (parts.appearance) LeaveOutNodes(images, &*parts.appearance);
  return parts;
}

Result<LeftOutTrial> TryLeftOutImages(MapRows rows, const std::vector<TrialImage>& images,
                                      const LeftOutLimits& limits, int num_threads) {
  // Fixes are in the frame of the stated poses; the true ones here are the map's own.
  rows.camera_from_given = Pose();
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::FromRows(std::move(rows)));
  std::vector<double> error_of(images.size(), -1);  // negative: not localized within the limits
  std::vector<int> num_inliers(images.size(), 0);
  std::vector<Status> statuses(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, [&](int64_t i) {
    const Result<Localization> found = Localizer(map).LocalizeFeatures(images[i].features, images[i].camera);
    if (!found.ok()) {
      statuses[i] = found.error();
      return;
    }
    if (!found->has_fix()) return;
    const double error_m = CenterErrorM(found->cam_from_world, images[i].cam_from_world);
    const double error_deg = RotationErrorDeg(found->cam_from_world, images[i].cam_from_world);
    if (error_m <= limits.max_error_m && error_deg <= limits.max_error_deg) {
      error_of[i] = error_m;
      num_inliers[i] = std::min(found->num_inliers, kPlentyOfInliers);
    }
  });
  for (const Status& status : statuses) CAIRN_RETURN_IF_ERROR(status);
  LeftOutTrial trial{.num_tried = static_cast<int>(images.size())};
  trial.mean_margin = std::accumulate(num_inliers.begin(), num_inliers.end(), 0.0) /
                      std::max<double>(1, kPlentyOfInliers * static_cast<double>(images.size()));
  std::erase_if(error_of, [](double error) { return error < 0; });
  trial.num_right = static_cast<int>(error_of.size());
  if (!error_of.empty()) trial.median_error_m = UpperMedian(std::move(error_of));
  return trial;
}

}  // namespace cairn::emit_map
