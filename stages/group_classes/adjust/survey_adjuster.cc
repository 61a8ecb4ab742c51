#include "stages/group_classes/adjust/survey_adjuster.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/camera/panorama.h"
#include "stages/group_classes/tracks/choose_tracks.h"

namespace cairn::group_classes {
namespace {

// Noise and cameras' models need no adjustment to the last digit.
constexpr double kLearningTolerance = 1e-3;
constexpr int kMinNumCameraImages = 5;

}  // namespace

SurveyAdjuster::SurveyAdjuster(const AdjustContext& context, const std::vector<Track>& tracks,
                               PosedImages* posed)
    : context_(context),
      tracks_(tracks),
      posed_(*posed),
      bundle_options_{.max_num_iterations = context.options.max_num_iterations,
                      .function_tolerance = kLearningTolerance,
                      .solved = context.solved,
                      .cancel = &context.progress,
                      .num_threads = context.num_threads} {
  findings_.cameras.resize(posed_.cameras.size());
  findings_.has_offset = context.options.refine_camera_offset;
  MakeImages();
}

void SurveyAdjuster::MakeImages() {
  for (int i = 0; i < posed_.num_images(); ++i) {
    BundleProblem::Image image;
    image.camera_idx = posed_.camera_idx[i];
    image.stated = image.cam_from_world = image.drifted = posed_.stated[i];
    image.way_m = posed_.way_m[i];
    problem_.images.push_back(image);
  }
  problem_.is_offset_free = findings_.has_offset;
  problem_.offset_sigma_m = context_.options.offset_sigma_m;
  problem_.offset_sigma_deg = context_.options.offset_sigma_deg;
  problem_.cameras.resize(posed_.cameras.size());
  variants_.assign(posed_.cameras.size(), 0);
  for (const Camera& camera : posed_.cameras)
    candidates_.push_back(CameraVariants(camera, context_.options.camera_prior));
  // Views of a panorama have the camera that they were rendered with.
  std::vector<int> num_images(posed_.cameras.size(), 0);
  for (int i = 0; i < posed_.num_images(); ++i) {
    int& count = num_images[posed_.camera_idx[i]];
    ++count;
    if (ParsePanoramaViewName(NameOf(i))) count = -posed_.num_images();
  }
  for (size_t c = 0; c < candidates_.size(); ++c) {
    if (num_images[c] < kMinNumCameraImages) candidates_[c].resize(1);
  }
}

void SurveyAdjuster::Select(const std::vector<Triangulation>& triangulations) {
  selected_.clear();
  std::vector<Triangulation> chosen;
  for (const size_t t : ChooseTracks(tracks_, triangulations, std::vector<char>(posed_.num_images(), 1),
                                     context_.options.num_keypoints_adjusted)) {
    selected_.push_back(tracks_[t]);
    chosen.push_back(triangulations[t]);
  }
  Fill(chosen);
}

void SurveyAdjuster::Fill(const std::vector<Triangulation>& triangulations) {
  problem_.observations.clear();
  problem_.points.clear();
  scales_.clear();
  size_t num_seen = 0;  // at most
  for (const Triangulation& triangulation : triangulations) num_seen += Spread(triangulation.inliers).size();
  problem_.observations.reserve(num_seen);
  scales_.reserve(num_seen);
  std::vector<TrackElement> seen;  // per observation
  seen.reserve(num_seen);
  for (size_t t = 0; t < selected_.size(); ++t) {
    if (triangulations[t].outcome != TriangulateOutcome::kOk) continue;
    for (const int i : Spread(triangulations[t].inliers)) {
      const TrackElement& element = selected_[t][i];
      const Keypoint& keypoint =
          context_.matched.features[posed_.feature_idx[element.image_idx]].keypoints[element.keypoint_idx];
      BundleProblem::Observation& observation = problem_.observations.emplace_back();
      observation.image_idx = element.image_idx;
      observation.point_idx = static_cast<int>(problem_.points.size());
      observation.pixel = {keypoint.x, keypoint.y};
      seen.push_back(element);
      scales_.push_back(keypoint.scale);
    }
    problem_.points.push_back(triangulations[t].position);
  }
  constexpr int64_t kAtOnce = 256;
  ParallelForRuns(std::ssize(seen), kAtOnce, context_.num_threads, [&](int64_t begin, int64_t end) {
    for (int64_t k = begin; k < end; ++k)
      problem_.observations[k].ray = RayOfTrack(context_.matched, posed_, seen[k]);
  });
  SetCameras(variants_, false, &problem_);
  SetKeypointNoise();
}

void SurveyAdjuster::SetKeypointNoise() {
  std::vector<double> count(problem_.images.size(), 0);
  for (size_t i = 0; i < problem_.observations.size(); ++i) {
    problem_.observations[i].sigma_px = findings_.keypoints.SigmaPx(scales_[i]);
    ++count[problem_.observations[i].image_idx];
  }
  for (size_t i = 0; i < problem_.images.size(); ++i) {
    // A fixed image has more keypoints than those that it shares with what is adjusted.
    const double num = problem_.images[i].is_fixed
                           ? std::max<double>(count[i], context_.options.num_keypoints_adjusted)
                           : count[i];
    problem_.images[i].dispersion = findings_.keypoints.Dispersion(num);
  }
}

void SurveyAdjuster::SetCameras(const std::vector<int>& variants, bool afresh, BundleProblem* problem) const {
  for (size_t c = 0; c < variants.size(); ++c) {
    const CameraVariant& variant = candidates_[c][variants[c]];
    CameraBlock& block = problem->cameras[c];
    block = {variant.free, {}, variant.sigma, std::vector<double>(variant.free.size(), 0.0)};
    const double gradient = FocalGradient(static_cast<int>(c)) / (NumFocals(variant.camera.model));
    for (size_t k = 0; k < variant.free.size(); ++k) {
      const int p = variant.free[k];
      block.prior.push_back(afresh ? 0 : variant.camera.params[p] - posed_.cameras[c].params[p]);
      if (p < NumFocals(variant.camera.model))
        block.prior[k] -= gradient * variant.sigma[k] * variant.sigma[k];
    }
    block.difference_sigma = variant.difference_sigma;
    if (block.difference_sigma > 0) block.difference_prior = block.prior[0] - block.prior[1];
  }
  for (BundleProblem::Observation& observation : problem->observations) {
    const int c = problem->images[observation.image_idx].camera_idx;
    const Camera& camera = afresh ? candidates_[c][variants[c]].camera : posed_.cameras[c];
    if (afresh) {
      if (const auto ray = MakePixelRay(camera, observation.pixel)) observation.ray = *ray;
    }
    observation.camera = {};
    if (!problem->cameras[c].free.empty())
      observation.camera = SensitivityOf(camera, observation.pixel, problem->cameras[c].free);
  }
}

// An adjustment that finds poses and focal length together makes that too long: a longer one moves pixels
// as far by smaller, more likely turns.  What is likely of the focal length alone, poses integrated out,
// has the term - n ln f, n = turns up or sideways that keypoints determine; this is its gradient, to be
// shared by the focal lengths, 1 / px.
double SurveyAdjuster::FocalGradient(int camera) const {
  const double num_turns = 2.0 / 3 * (evidence_.own_deg.num_determined + evidence_.walk_deg.num_determined);
  const auto of_camera = std::count(posed_.camera_idx.begin(), posed_.camera_idx.end(), camera);
  return num_turns * static_cast<double>(of_camera) / std::max(1, posed_.num_images()) /
         posed_.cameras[camera].MeanFocal();
}

void SurveyAdjuster::Adjust(BundleEvidence* evidence) {
  AdjustBundle(bundle_options_, &problem_, evidence);
  for (int i = 0; i < posed_.num_images(); ++i) posed_.poses[i] = problem_.images[i].cam_from_world;
  for (size_t c = 0; c < problem_.cameras.size(); ++c) {
    const CameraBlock& block = problem_.cameras[c];
    for (size_t k = 0; k < block.free.size(); ++k) posed_.cameras[c].params[block.free[k]] += block.delta[k];
  }
}

}  // namespace cairn::group_classes
