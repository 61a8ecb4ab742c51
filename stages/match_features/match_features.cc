#include "stages/match_features/match_features.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "core/colmap_database.h"
#include "core/file.h"
#include "stages/match_features/pair_list.h"
#include "stages/match_features/predict_pairs.h"
#include "stages/match_features/retrieve_pairs.h"

namespace cairn {
namespace {

// How pairs are chosen: options.pairs, "auto" resolved.
std::string ChooseMethod(const MatchImages& images, const MatchFeaturesOptions& options) {
  if (options.pairs != "auto") return options.pairs;
  if (images.AllPosed()) return "frustum";
  const int num_images = static_cast<int>(images.images.size());
  return num_images <= options.max_num_exhaustive_images ? "exhaustive" : "retrieval";
}

Result<std::vector<PosedCamera>> PosedCameras(const MatchImages& images) {
  std::vector<PosedCamera> posed;
  for (const MatchImage& image : images.images) {
    if (!image.cam_from_world) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "pairs = frustum needs a pose for every image, {} has none; give --capture, or choose "
                       "pairs = retrieval or exhaustive",
                       image.name);
    }
    posed.push_back({images.cameras.at(image.camera_id), *image.cam_from_world});
  }
  return posed;
}

Result<IndexPairs> SelectSequencePairs(SQLite::Database& features, const MatchImages& images,
                                       const MatchFeaturesInputs& inputs, const MatchFeaturesOptions& options,
                                       uint64_t seed, int num_threads, Progress& progress) {
  std::vector<std::string> names;
  for (const MatchImage& image : images.images) names.push_back(image.name);
  const std::vector<int> order = NaturalOrder(names);
  IndexPairs pairs = SequencePairs(order, options.sequence_window);
  if (options.num_loop_candidates == 0) return pairs;
  CAIRN_ASSIGN_OR_RETURN(
      const ImageSimilarity similarity,
      MeasureSimilarity(features, images, inputs.vocabulary_path, seed, num_threads, progress));
  const IndexPairs loops =
      LoopPairs(similarity, order, options.sequence_window, options.num_loop_candidates, num_threads);
  pairs.insert(pairs.end(), loops.begin(), loops.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

// Pairs by every method but frustum.
Result<IndexPairs> SelectPairs(SQLite::Database& features, const MatchImages& images,
                               const MatchFeaturesInputs& inputs, const MatchFeaturesOptions& options,
                               const std::string& method, uint64_t seed, int num_threads,
                               Progress& progress) {
  if (method == "list") {
    CAIRN_ASSIGN_OR_RETURN(PairList list, ReadPairList(inputs.pair_list_path, images));
    return std::move(list.pairs);
  }
  const int num_images = static_cast<int>(images.images.size());
  if (method == "exhaustive") return ExhaustivePairs(num_images);
  if (method == "sequence")
    return SelectSequencePairs(features, images, inputs, options, seed, num_threads, progress);
  CAIRN_ASSIGN_OR_RETURN(
      const ImageSimilarity similarity,
      MeasureSimilarity(features, images, inputs.vocabulary_path, seed, num_threads, progress));
  return RetrievedPairs(similarity, num_images, options.num_retrieved, num_threads);
}

// Matches `pairs`, adds the verified ones to the database and tells them to `predictor` (may be null).
Status MatchInto(SQLite::Database& features, const MatchImages& images, const IndexPairs& pairs,
                 const MatchFeaturesOptions& options, int num_threads, Progress& progress,
                 MatchFeaturesSummary* summary, PairPredictor* predictor, SQLite::Database& database) {
  std::unordered_map<ImageId, int> idx_of_image;
  for (size_t i = 0; i < images.images.size(); ++i)
    idx_of_image[images.images[i].image_id] = static_cast<int>(i);
  const auto take = [&](const TwoViewGeometry& geometry, int num_putative) {
    ++summary->num_pairs_tried;
    summary->num_putative += num_putative;
    if (geometry.inliers.empty()) return;
    WriteDatabaseTwoViewGeometry(database, geometry);
    ++summary->num_pairs_verified;
    summary->num_inliers += static_cast<int64_t>(geometry.inliers.size());
    if (predictor != nullptr) {
      predictor->Add(idx_of_image.at(geometry.image_id1), idx_of_image.at(geometry.image_id2),
                     geometry.inliers);
    }
  };
  progress.Begin("match features", static_cast<int64_t>(pairs.size()), "pairs");
  CAIRN_RETURN_IF_ERROR(MatchPairs(features, images, pairs, options.matching, num_threads, progress, take));
  progress.End();
  return Ok();
}

// What the predictor knows of the images, in the world frame.
Result<std::vector<PairPredictor::View>> ReadViews(SQLite::Database& features, const MatchImages& images,
                                                   const Progress& progress) {
  std::vector<PairPredictor::View> views;
  for (const MatchImage& image : images.images) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reading features");
    const Camera& camera = images.cameras.at(image.camera_id);
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Eigen::Vector3d> bearings,
                           ReadImageBearings(features, image, camera));
    PairPredictor::View& view = views.emplace_back();
    view.center = image.cam_from_world->Center();
    view.focal_px = camera.MeanFocal();
    const Eigen::Quaterniond world_from_cam = image.cam_from_world->rotation.conjugate();
    for (const Eigen::Vector3d& bearing : bearings)
      view.rays.push_back((world_from_cam * bearing).cast<float>());
  }
  return views;
}

// Matches the pairs of largest overlap, then again and again those that the matches so far predict.
Status MatchFrustumInto(SQLite::Database& features, const MatchImages& images,
                        const MatchFeaturesOptions& options, int num_threads, Progress& progress,
                        MatchFeaturesSummary* summary, SQLite::Database& database) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<PosedCamera> posed, PosedCameras(images));
  CAIRN_ASSIGN_OR_RETURN(OverlapRanking ranking, RankOverlaps(posed, options.frustum, num_threads, progress));
  if (options.num_frustum_seeds == 0) {
    return MatchInto(features, images, FrustumPairs(ranking), options, num_threads, progress, summary,
                     nullptr, database);
  }
  IndexPairs next = FrustumSeeds(ranking, options.num_frustum_seeds, options.num_frustum_scouts);
  ranking = {};
  CAIRN_ASSIGN_OR_RETURN(std::vector<PairPredictor::View> views, ReadViews(features, images, progress));
  PairPredictor predictor(std::move(views));
  const PredictPairsOptions prediction = {
      .min_num_expected_matches = options.min_num_expected_matches,
      .max_ray_angle_deg = options.matching.verification.max_ray_angle_deg,
      .max_prior_error_px = options.matching.verification.max_prior_error_px,
      .min_baseline_m = options.matching.verification.min_baseline_m};
  IndexPairs tried;
  while (!next.empty()) {
    CAIRN_RETURN_IF_ERROR(
        MatchInto(features, images, next, options, num_threads, progress, summary, &predictor, database));
    tried.insert(tried.end(), next.begin(), next.end());
    std::sort(tried.begin(), tried.end());
    CAIRN_ASSIGN_OR_RETURN(next, predictor.Predict(tried, prediction, num_threads, progress));
  }
  return Ok();
}

Status CheckRanges(const MatchFeaturesOptions& options) {
  if (options.frustum.near_m >= options.frustum.far_m) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "frustum_near_m = {:g} must be less than frustum_far_m = {:g}", options.frustum.near_m,
                     options.frustum.far_m);
  }
  const VerifyPairOptions& verification = options.matching.verification;
  if (verification.max_prior_error_px < verification.max_epipolar_error_px) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "max_prior_error_px = {:g} must be at least max_epipolar_error_px = {:g}",
                     verification.max_prior_error_px, verification.max_epipolar_error_px);
  }
  if (options.matching.memory_budget_mib < 1) {
    return MakeError(ErrorCode::kInvalidArgument, "a memory budget of {} MiB; expected at least 1",
                     options.matching.memory_budget_mib);
  }
  return Ok();
}

}  // namespace

OptionTable DescribeOptions(MatchFeaturesOptions* o) {
  return {
      {.name = "pairs",
       .value = &o->pairs,
       .help = "which images to match; auto: frustum where all images have poses, else exhaustive for few "
               "images, else retrieval",
       .choices = {"auto", "exhaustive", "frustum", "retrieval", "sequence"}},
      {.name = "max_num_exhaustive_images",
       .value = &o->max_num_exhaustive_images,
       .help = "pairs = auto: most images without poses that are matched exhaustively",
       .min = 0},
      {.name = "num_retrieved",
       .value = &o->num_retrieved,
       .help = "pairs = retrieval: number of images most like it that each image is matched with",
       .min = 1},
      {.name = "sequence_window",
       .value = &o->sequence_window,
       .help = "pairs = sequence: number of successors that each image is matched with",
       .min = 1},
      {.name = "num_loop_candidates",
       .value = &o->num_loop_candidates,
       .help =
           "pairs = sequence: number of images most like it, but no neighbours, that each is matched with",
       .min = 0},
      {.name = "frustum_near_m",
       .value = &o->frustum.near_m,
       .help = "pairs = frustum: nearest scene, metres",
       .min = 1e-3},
      {.name = "frustum_far_m",
       .value = &o->frustum.far_m,
       .help = "pairs = frustum: farthest scene, metres",
       .min = 1e-3},
      {.name = "min_overlap_ratio",
       .value = &o->frustum.min_overlap_ratio,
       .help = "pairs = frustum: least part of either frustum that the other camera sees",
       .min = 0,
       .max = 1},
      {.name = "num_frustum_seeds",
       .value = &o->num_frustum_seeds,
       .help = "pairs = frustum: images of largest overlap that each image is matched with at first, before "
               "the pairs that these matches predict; 0: match every pair whose frusta overlap",
       .min = 0},
      {.name = "num_frustum_scouts",
       .value = &o->num_frustum_scouts,
       .help = "pairs = frustum: images spread over those of smaller overlap that each is matched with at "
               "first",
       .min = 0},
      {.name = "min_num_expected_matches",
       .value = &o->min_num_expected_matches,
       .help = "pairs = frustum: fewest matches that a pair must promise, by the matches of both images with "
               "others, to be matched after the seeds",
       .min = 1},
      {.name = "max_view_angle_deg",
       .value = &o->frustum.max_view_angle_deg,
       .help = "pairs = frustum: largest angle between two views of a point, degrees",
       .min = 1,
       .max = 180},
      {.name = "max_scale_ratio",
       .value = &o->frustum.max_scale_ratio,
       .help = "pairs = frustum: largest ratio of the two distances to a point",
       .min = 1},
      {.name = "max_ratio",
       .value = &o->matching.matcher.max_ratio,
       .help = "largest ratio of the angles to the best and second best descriptor",
       .min = 0,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->matching.matcher.max_angle_rad,
       .help = "largest angle between matched descriptors, radians",
       .min = 0,
       .max = 3.2},
      {.name = "max_epipolar_error_px",
       .value = &o->matching.verification.max_epipolar_error_px,
       .help = "largest distance of an inlier to its epipolar line, pixels",
       .min = 1e-3},
      {.name = "max_homography_error_px",
       .value = &o->matching.verification.max_homography_error_px,
       .help = "largest distance of an inlier from where a homography puts it, pixels (COLMAP: 4)",
       .min = 1e-3},
      {.name = "max_prior_error_px",
       .value = &o->matching.verification.max_prior_error_px,
       .help =
           "with known poses: largest distance of a match to the epipolar line of the stated poses, pixels",
       .min = 1e-3},
      {.name = "max_ray_angle_deg",
       .value = &o->matching.verification.max_ray_angle_deg,
       .help = "with known poses: rays that differ by more are no match, degrees",
       .min = 1,
       .max = 180},
      {.name = "min_num_inliers",
       .value = &o->matching.verification.min_num_inliers,
       .help = "fewest inliers of a verified pair",
       .min = 8},
      {.name = "min_homography_ratio",
       .value = &o->matching.verification.min_homography_ratio,
       .help = "part of the inliers on one homography that makes a pair planar or panoramic (COLMAP: 0.8)",
       .min = 0,
       .max = 1},
      {.name = "min_essential_ratio",
       .value = &o->matching.verification.min_essential_ratio,
       .help = "without poses: least inliers of the essential over those of the fundamental matrix for the "
               "intrinsics to be believed (COLMAP: 0.95)",
       .min = 0,
       .max = 1},
      {.name = "min_baseline_m",
       .value = &o->matching.verification.min_baseline_m,
       .help = "with known poses: a shorter baseline is none, metres",
       .min = 1e-12},
      {.name = "min_watermark_ratio",
       .value = &o->matching.verification.min_watermark_ratio,
       .help =
           "part of the inliers on the image borders, shifted alike, that makes a watermark (COLMAP: 0.7)",
       .min = 0.5,
       .max = 1},
      {.name = "watermark_border_ratio",
       .value = &o->matching.verification.watermark_border_ratio,
       .help = "width of the border that holds watermarks, over the diagonal (COLMAP: 0.1)",
       .min = 0,
       .max = 0.5},
      {.name = "guided_matching",
       .value = &o->matching.verification.guided_matching,
       .help = "which pairs are matched again along the epipolar lines of the geometry found: those whose "
               "poses are known, all, or none",
       .choices = {"posed", "all", "none"}},
      {.name = "guided_max_ratio",
       .value = &o->matching.verification.guided.max_ratio,
       .help = "guided matching: largest ratio of the angles to the best and second best candidate",
       .min = 0,
       .max = 1},
      {.name = "guided_max_angle_rad",
       .value = &o->matching.verification.guided.max_angle_rad,
       .help = "guided matching: largest angle between matched descriptors, radians",
       .min = 0,
       .max = 3.2},
      {.name = "guided_max_scale_ratio",
       .value = &o->matching.verification.guided.max_scale_ratio,
       .help = "guided matching: largest factor of a match's change of scale over that of the inliers",
       .min = 1},
      {.name = "guided_max_turn_deg",
       .value = &o->matching.verification.guided.max_turn_deg,
       .help = "guided matching: largest angle of a match's change of orientation off that of the inliers, "
               "degrees",
       .min = 1e-3,
       .max = 180},
  };
}

Result<MatchFeaturesSummary> MatchFeatures(const MatchFeaturesInputs& inputs,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, uint64_t seed, int num_threads,
                                           Progress& progress) {
  CAIRN_RETURN_IF_ERROR(CheckRanges(options));
  const std::string& path = inputs.features_path;
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database features, OpenColmapDatabase(path));
  const auto images = WithDatabaseErrors(path, [&] { return ReadMatchImages(features, inputs.capture); });
  if (!images.ok()) return images.error();
  MatchFeaturesSummary summary;
  summary.num_images = static_cast<int>(images->images.size());
  summary.num_without_features = static_cast<int>(images->without_features.size());
  if (summary.num_images < 2) {
    return MakeError(ErrorCode::kNoData, "{}: {} image(s) with features, at least 2 are needed to match",
                     path, summary.num_images);
  }
  cv::setNumThreads(1);  // pairs are the unit of parallel work
  summary.pairs = inputs.pair_list_path.empty() ? ChooseMethod(*images, options) : "list";
  IndexPairs pairs;
  if (summary.pairs != "frustum") {
    auto selected = WithDatabaseErrors(path, [&] {
      return SelectPairs(features, *images, inputs, options, summary.pairs, seed, num_threads, progress);
    });
    if (!selected.ok()) return selected.error();
    pairs = std::move(selected).value();
  }

  CAIRN_RETURN_IF_ERROR(ReplaceFileAtomically(matches_path, [&](const std::string& temporary) -> Status {
    return WithDatabaseErrors(temporary, [&]() -> Status {
      CopyColmapDatabase(features, temporary);
      SQLite::Database database(temporary, SQLite::OPEN_READWRITE);
      database.exec(
          "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN; DELETE FROM two_view_geometries");
      CAIRN_RETURN_IF_ERROR(
          summary.pairs == "frustum"
              ? MatchFrustumInto(features, *images, options, num_threads, progress, &summary, database)
              : MatchInto(features, *images, pairs, options, num_threads, progress, &summary, nullptr,
                          database));
      if (summary.num_pairs_verified == 0) {
        return MakeError(
            ErrorCode::kNoData,
            "{}: none of {} pairs ({}) has {} verified matches; do the images overlap, and do the poses fit?",
            path, summary.num_pairs_tried, summary.pairs, options.matching.verification.min_num_inliers);
      }
      database.exec("COMMIT");
      return Ok();
    });
  }));
  return summary;
}

}  // namespace cairn
