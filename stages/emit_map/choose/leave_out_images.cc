#include "stages/emit_map/choose/leave_out_images.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/capture/sessions.h"
#include "core/colmap/colmap_database.h"
#include "core/colmap/landmark_images.h"
#include "core/features/descriptor_distance.h"
#include "core/promise/later_views.h"
#include "core/promise/view_distance.h"
#include "runtime/localize/localizer.h"

namespace cairn::emit_map {
namespace {

constexpr size_t kMinNumLeft = 4;  // at most one image in so many is left out
constexpr int kPlentyOfInliers = 50;
constexpr size_t kMinNumObservations = 2;

Result<Features> ReadFeatures(SQLite::Database& database, ImageId image_id, const DescriptorKind& kind) {
  Features features{.keypoints = {}, .descriptors = {}, .kind = kind};
  CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, image_id));
  CAIRN_ASSIGN_OR_RETURN(features.descriptors, ReadDatabaseDescriptors(database, image_id, kind));
  if (std::ssize(features.keypoints) != features.descriptors.rows()) {
    return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} keypoints and {} descriptors",
                     DatabasePath(database), image_id, features.keypoints.size(),
                     features.descriptors.rows());
  }
  return features;
}

// Classes whose descriptors are summed at a time, half a kilobyte each.
constexpr size_t kNumDescribedAtOnce = 16384;

// Descriptors of these classes (positions), from the observations that are left.
Status DescribeTogether(SQLite::Database& database, std::span<const size_t> affected, Classes* classes) {
  struct Seen {
    ImageId image_id = 0;
    KeypointIdx keypoint = 0;
    uint32_t described = 0;  // position in `affected`
  };
  std::vector<Seen> seen;
  for (uint32_t k = 0; k < affected.size(); ++k) {
    for (const Observation& observation : classes->classes[affected[k]].observations)
      seen.push_back({observation.image_id, observation.keypoint_idx, k});
  }
  std::stable_sort(seen.begin(), seen.end(),
                   [](const Seen& a, const Seen& b) { return a.image_id < b.image_id; });
  using Sum = Eigen::Matrix<uint32_t, 1, Eigen::Dynamic>;  // exact
  const DescriptorKind& kind = classes->descriptor_kind;
  std::vector<Sum> sums(affected.size(), Sum::Zero(kind.num_values));
  std::vector<int64_t> counts(affected.size(), 0);
  DescriptorMatrix descriptors;
  for (size_t i = 0; i < seen.size(); ++i) {
    const auto& [image_id, keypoint, described] = seen[i];
    if (i == 0 || image_id != seen[i - 1].image_id) {
      CAIRN_ASSIGN_OR_RETURN(descriptors, ReadDatabaseDescriptors(database, image_id, kind));
    }
    if (keypoint >= descriptors.rows()) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "emit_map: class {} is keypoint {} of image {}, which has {}; were the classes made from "
          "other matches?",
          classes->classes[affected[described]].class_id, keypoint, image_id, descriptors.rows());
    }
    sums[described] += descriptors.row(keypoint).cast<uint32_t>();
    ++counts[described];
  }
  for (size_t k = 0; k < affected.size(); ++k)
    classes->classes[affected[k]].descriptor =
        MeanDescriptor(sums[k].cast<double>(), counts[k], kind.space());
  return Ok();
}

// A part at a time: classes follow each other along the survey, so that few images are read for several.
Status DescribeAnew(SQLite::Database& database, std::span<const size_t> affected, Classes* classes) {
  while (!affected.empty()) {
    const std::span<const size_t> part = affected.first(std::min(affected.size(), kNumDescribedAtOnce));
    CAIRN_RETURN_IF_ERROR(DescribeTogether(database, part, classes));
    affected = affected.subspan(part.size());
  }
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
    for (FeatureIdx& feature : region.features) {
      // Those that the world lacks are refused with the map.
      if (feature >= 0 && feature < std::ssize(number_of)) feature = number_of[feature];
    }
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

bool LeftOutRounds::MayLeaveOut(const std::set<size_t>& images) const {
  return kMinNumLeft * images.size() <= num_survey_images_;
}

bool LeftOutRounds::Add(const std::vector<size_t>& tried, const std::set<size_t>& left_out) {
  size_t round = 0;
  for (; round < left_out_.size(); ++round) {
    std::set<size_t> both = left_out_[round];
    both.insert(left_out.begin(), left_out.end());
    if (!MayLeaveOut(both)) continue;
    left_out_[round] = std::move(both);
    break;
  }
  if (round == left_out_.size()) {
    if (round == kMaxNumRounds || !MayLeaveOut(left_out)) return false;
    left_out_.push_back(left_out);
    tried_.emplace_back();
  }
  tried_[round].insert(tried_[round].end(), tried.begin(), tried.end());
  return true;
}

std::vector<LeftOutImages> LeftOutRounds::Rounds() const {
  std::vector<LeftOutImages> rounds;
  for (size_t round = 0; round < tried_.size(); ++round)
    rounds.push_back({{left_out_[round].begin(), left_out_[round].end()}, tried_[round]});
  return rounds;
}

Result<std::vector<LeftOutImages>> ChooseLeftOut(const Classes& classes, size_t max_num_images,
                                                 const std::set<size_t>& never_tried) {
  const size_t num_images = classes.images.size();
  if (num_images < kMinNumSurveyImages) {
    return MakeError(ErrorCode::kNoData,
                     "emit_map: landmarks are chosen by leaving survey images out, but there are only {}; at "
                     "least {} are needed",
                     num_images, kMinNumSurveyImages);
  }
  const ViewDistance distance(classes, {});
  std::vector<size_t> may_be_tried;
  for (size_t image = 0; image < num_images; ++image) {
    if (!never_tried.contains(image)) may_be_tried.push_back(image);
  }
  const size_t step = (may_be_tried.size() + max_num_images - 1) / max_num_images;
  LeftOutRounds rounds(num_images);
  for (size_t i = step / 2; i < may_be_tried.size(); i += step) {
    const size_t tried = may_be_tried[i];
    std::set<size_t> view = {tried};
    distance.tree().ForNear(tried, 1,
                            [&](int32_t image, double) { view.insert(static_cast<size_t>(image)); });
    rounds.Add({tried}, view);
  }
  return rounds.Rounds();
}

Result<std::set<size_t>> LandmarkImages(const Classes& classes, const std::string& matches_path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<std::set<size_t>> {
    std::set<size_t> positions;
    const std::set<ImageId> image_ids = ReadLandmarkImages(database);
    for (size_t i = 0; i < classes.images.size(); ++i) {
      if (image_ids.contains(classes.images[i].image_id)) positions.insert(i);
    }
    return positions;
  });
}

std::set<size_t> ImagesOfThePast(const Classes& classes) {
  std::set<size_t> past;
  if (classes.sessions.size() < 2) return past;
  const std::vector<int32_t> later = LaterViews(classes, ViewDistance(classes, {}));
  for (size_t i = 0; i < later.size(); ++i) {
    if (later[i] >= 0) past.insert(i);
  }
  if (later.size() - past.size() < kMinNumToday) past.clear();
  return past;
}

Result<std::set<size_t>> NeverTried(const Classes& classes, const std::string& matches_path) {
  CAIRN_ASSIGN_OR_RETURN(std::set<size_t> never_tried, LandmarkImages(classes, matches_path));
  never_tried.merge(ImagesOfThePast(classes));
  return never_tried;
}

Result<LeftOutSurvey> LeaveOutImages(const Classes& classes, const std::string& matches_path,
                                     const LeftOutImages& which) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<LeftOutSurvey> {
    LeftOutSurvey survey;
    survey.classes = classes;
    std::map<CameraId, const Camera*> cameras;
    for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
    std::set<ImageId> left_out;
    for (const size_t i : which.left_out) left_out.insert(classes.images[i].image_id);
    for (const size_t i : which.tried) {
      const SurveyImage& image = classes.images[i];
      TrialImage row{.camera = *cameras.at(image.camera_id),
                     .cam_from_world = image.cam_from_world,
                     .features = {},
                     .session = SessionOfImage(classes.sessions, image.name)};
      CAIRN_ASSIGN_OR_RETURN(row.features, ReadFeatures(database, image.image_id, classes.descriptor_kind));
      survey.images.push_back(std::move(row));
    }
    std::erase_if(survey.classes.images,
                  [&](const SurveyImage& image) { return left_out.contains(image.image_id); });
    std::vector<FeatureClass>& list = survey.classes.classes;
    std::vector<ClassId> affected_ids;  // ascending, as classes are
    for (FeatureClass& feature_class : list) {
      const size_t num_erased = std::erase_if(
          feature_class.observations,
          [&](const Observation& observation) { return left_out.contains(observation.image_id); });
      if (num_erased > 0) affected_ids.push_back(feature_class.class_id);
    }
    std::erase_if(list,
                  [](const FeatureClass& row) { return row.observations.size() < kMinNumObservations; });
    std::vector<size_t> affected;
    for (size_t i = 0; i < list.size(); ++i) {
      if (std::binary_search(affected_ids.begin(), affected_ids.end(), list[i].class_id))
        affected.push_back(i);
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

void LeftOutTrial::Add(const LeftOutTrial& other) {
  images.insert(images.end(), other.images.begin(), other.images.end());
}

int LeftOutTrial::NumRight() const {
  return static_cast<int>(
      std::count_if(images.begin(), images.end(), [](const LeftOutResult& image) { return image.is_right; }));
}

double LeftOutTrial::MeanMargin() const {
  double sum = 0;
  for (const LeftOutResult& image : images) sum += std::min(image.num_inliers, kPlentyOfInliers);
  return sum / std::max(1, kPlentyOfInliers * NumTried());
}

double LeftOutTrial::MedianErrorM() const {
  std::vector<double> errors_m;
  for (const LeftOutResult& image : images) {
    if (image.is_right) errors_m.push_back(image.error_m);
  }
  return errors_m.empty() ? 0 : UpperMedian(std::move(errors_m));
}

double ErrorRatio(const LeftOutTrial& trial, const LeftOutTrial& reference, double least_error_m) {
  double sum_of_logs = 0;
  int num = 0;
  for (size_t i = 0; i < trial.images.size(); ++i) {
    const LeftOutResult &ours = trial.images[i], &theirs = reference.images[i];
    if (!ours.is_right || !theirs.is_right) continue;
    sum_of_logs += std::log(std::max(ours.error_m, least_error_m) / std::max(theirs.error_m, least_error_m));
    ++num;
  }
  return num == 0 ? 1 : std::exp(sum_of_logs / num);
}

Result<LeftOutTrial> TryLeftOutImages(MapRows rows, const std::vector<TrialImage>& images,
                                      const LeftOutLimits& limits, int num_threads) {
  // Fixes are in the frame of the stated poses; the true ones here are the map's own.
  rows.camera_from_given = Pose();
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::FromRows(std::move(rows)));
  LeftOutTrial trial;
  trial.images.resize(images.size());
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
    if (error_m <= limits.max_error_m && error_deg <= limits.max_error_deg)
      trial.images[i] = {true, error_m, found->num_inliers};
  });
  for (const Status& status : statuses) CAIRN_RETURN_IF_ERROR(status);
  return trial;
}

}  // namespace cairn::emit_map
