#include "stages/group_classes/adjust/adjust_survey.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/parallel.h"
#include "stages/group_classes/adjust/left_out.h"
#include "stages/group_classes/adjust/straighten.h"
#include "stages/group_classes/adjust/survey_adjuster.h"
#include "stages/group_classes/tracks/sub_survey.h"

namespace cairn::group_classes {
namespace {

// Fewest residuals of a component that keypoints must determine before it is learnt, as a part of all.
constexpr double kMinDeterminedRatio = 0.02, kMinDetermined = 3;
constexpr double kOverRelaxation = 1.5;
constexpr double kMinSigmaM = 1e-6, kMinSigmaDeg = 1e-5;
// Chi-square of 6 degrees of freedom beyond which an offset is one: 1 in 10^5 by chance.
constexpr double kOffsetChiSquare = 33;
// A larger model of a camera is taken if left-out keypoints gain this many standard errors, and this part.
constexpr double kMinGainSigmas = 2, kMinGain = 1e-3, kMinGainOfShared = 0.5;
constexpr double kFarOffGain = 0.3;

class SurveyLearner : public SurveyAdjuster {
 public:
  using SurveyAdjuster::SurveyAdjuster;

  // Learns the noise, the cameras, whether there is an offset, and whether the poses need be moved at all.
  SurveyFindings Learn(const std::vector<Triangulation>& triangulations) {
    context_.progress.Begin("learn noise and cameras", 2 * int64_t{context_.options.num_rounds},
                            "rounds at most");
    Select(triangulations);
    AdjustAndMeasure(nullptr);
    LearnNoise();
    if (context_.options.refine_cameras && ChooseCameras()) {
      LearnNoise();
      // Again, by poses that a camera far off has not bent.
      const auto is_far_off = [](const CameraFinding& camera) { return camera.gain > kFarOffGain; };
      if (std::any_of(findings_.cameras.begin(), findings_.cameras.end(), is_far_off) && ChooseCameras())
        LearnNoise();
    }
    if (findings_.has_offset && evidence_.offset_chi_square < kOffsetChiSquare) {
      findings_.has_offset = false;
      problem_.is_offset_free = false;
      problem_.camera_from_given = Pose();
      LearnNoise();
    }
    for (size_t c = 0; c < findings_.cameras.size(); ++c) {
      findings_.cameras[c].camera = posed_.cameras[c];
      if (c < evidence_.camera_sigma.size()) findings_.cameras[c].sigma = evidence_.camera_sigma[c];
    }
    findings_.noise = problem_.noise;
    findings_.camera_from_given = problem_.camera_from_given;
    LeftOutErrors as_stated, adjusted;
    ForEachAdjustment(2, [&](int64_t i, const BundleOptions& options) {
      if (i == 0) {
        as_stated = LeaveOut(options, AsStated(problem_.camera_from_given));
      } else {
        adjusted = LeaveOut(options, problem_);
      }
    });
    const LeftOutGain gain = GainOf(problem_, as_stated, adjusted, -1);
    if (IsGain(gain)) findings_.pose_gain = gain.part;
    if (findings_.pose_gain == 0 && findings_.has_offset) {
      // Poses that are exact make the least offset significant; but it must explain something.
      const LeftOutErrors without = LeaveOut(bundle_options_, AsStated(Pose()));
      if (!IsGain(GainOf(problem_, without, as_stated, -1))) {
        findings_.has_offset = false;
        findings_.camera_from_given = Pose();
      }
    }
    context_.progress.End();
    return findings_;
  }

  KeypointNoise Measure(const std::vector<Triangulation>& triangulations) {
    Select(triangulations);
    return MeasureKeypointNoise(problem_, scales_);
  }

 private:
  // Adjusts, measures what keypoints' errors are, and places points anew.
  void AdjustAndMeasure(BundleEvidence* evidence) {
    Adjust(evidence);
    findings_.keypoints = MeasureKeypointNoise(problem_, scales_);
    FillAnew();
  }

  void FillAnew() {
    Fill(TriangulateTracks(context_.matched, selected_, posed_, context_.triangulate, context_.num_threads));
  }

  void LearnNoise() {
    for (int round = 0; round < context_.options.num_rounds && !context_.progress.Cancelled(); ++round) {
      AdjustAndMeasure(&evidence_);
      context_.progress.Advance();
      double change = 0;
      const auto learn = [&](const NoiseEvidence& evidence, double least, double* sigma) {
        const double few = std::max(kMinDetermined, kMinDeterminedRatio * evidence.num_residuals);
        if (!(evidence.num_determined >= few)) return;
        const double ratio =
            std::clamp(std::sqrt(evidence.sum_of_squares / evidence.num_determined), 0.05, 20.0);
        // MacKay's step is too short by far where a component vanishes.
        const double learnt = std::max(least, *sigma * std::pow(ratio, kOverRelaxation));
        change = std::max(change, std::abs(std::log(learnt / *sigma)));
        *sigma = learnt;
      };
      learn(evidence_.own_m, kMinSigmaM, &problem_.noise.own_m);
      learn(evidence_.own_deg, kMinSigmaDeg, &problem_.noise.own_deg);
      learn(evidence_.walk_m, kMinSigmaM, &problem_.noise.walk_m);
      learn(evidence_.walk_deg, kMinSigmaDeg, &problem_.noise.walk_deg);
      if (change < 0.1) break;
    }
  }

  // Several adjustments, adjust(i, options): one beside the other where there are no more threads than these,
  // else one after the other on all threads.
  template <typename Adjust>
  void ForEachAdjustment(int64_t num_adjustments, const Adjust& adjust) const {
    const bool is_side_by_side = NumThreads(context_.num_threads) <= num_adjustments;
    BundleOptions options = bundle_options_;
    if (is_side_by_side) options.num_threads = 1;
    ParallelFor(num_adjustments, is_side_by_side ? context_.num_threads : 1,
                [&](int64_t i) { adjust(i, options); });
  }

  // The problem with the poses that are stated, and this offset.
  BundleProblem AsStated(const Pose& camera_from_given) const {
    BundleProblem problem = problem_;
    problem.noise = {kMinSigmaM, kMinSigmaDeg, kMinSigmaM, kMinSigmaDeg};
    problem.is_offset_free = false;
    problem.camera_from_given = camera_from_given;
    for (BundleProblem::Image& image : problem.images) {
      image.cam_from_world = camera_from_given * image.stated;
      image.drifted = image.stated;
    }
    return problem;
  }

  // Returns whether a camera is another one now.
  bool ChooseCameras() {
    size_t num_variants = 1;
    for (const auto& of_camera : candidates_) num_variants = std::max(num_variants, of_camera.size());
    if (num_variants == 1) return false;
    std::vector<LeftOutErrors> tried(num_variants);
    ForEachAdjustment(static_cast<int64_t>(num_variants), [&](int64_t v, const BundleOptions& options) {
      std::vector<int> variants;
      for (const auto& of_camera : candidates_)
        variants.push_back(static_cast<int>(std::min<size_t>(v, of_camera.size() - 1)));
      BundleProblem problem = problem_;
      SetCameras(variants, true, &problem);
      tried[v] = LeaveOut(options, std::move(problem));
    });
    bool changed = false;
    for (size_t c = 0; c < candidates_.size(); ++c) {
      int best = 0;
      for (size_t v = 1; v < candidates_[c].size(); ++v) {
        if (IsGain(GainOf(problem_, tried[best], tried[v], static_cast<int>(c)))) best = static_cast<int>(v);
      }
      findings_.cameras[c].variant = candidates_[c][best].name;
      findings_.cameras[c].free = candidates_[c][best].free;
      findings_.cameras[c].gain = GainOf(problem_, tried[0], tried[best], static_cast<int>(c)).part;
      if (best == variants_[c]) continue;
      changed = true;
      variants_[c] = best;
      posed_.cameras[c] = candidates_[c][best].camera;
    }
    if (changed) {
      FillAnew();
      AdjustAndMeasure(nullptr);
    }
    return changed;
  }

  // Whether it is more than chance, and worth it beside the part that an image's keypoints share.
  bool IsGain(const LeftOutGain& gain) const {
    return gain.part > kMinGainOfShared * findings_.keypoints.correlation + kMinGain &&
           gain.part > kMinGainSigmas * gain.standard_error;
  }
};

}  // namespace

OptionTable DescribeOptions(AdjustSurveyOptions* o) {
  OptionTable table = {{.name = "refine_cameras",
                        .value = &o->refine_cameras,
                        .help = "find out which parameters of the cameras differ from what is stated"}};
  for (Option& option : DescribeOptions(&o->camera_prior)) table.push_back(std::move(option));
  const OptionTable others = {
      {.name = "refine_camera_offset",
       .value = &o->refine_camera_offset,
       .help = "find one rigid offset between all stated poses and their cameras"},
      {.name = "offset_sigma_m",
       .value = &o->offset_sigma_m,
       .help = "standard deviation of that offset, metres",
       .min = 1e-6},
      {.name = "offset_sigma_deg",
       .value = &o->offset_sigma_deg,
       .help = "standard deviation of that offset, degrees",
       .min = 1e-6},
      {.name = "num_keypoints_adjusted",
       .value = &o->num_keypoints_adjusted,
       .help = "keypoints of an image that decide on poses and cameras",
       .min = 10},
      {.name = "num_images_learnt",
       .value = &o->num_images_learnt,
       .help = "images from which the noise of poses and the cameras are learnt",
       .min = 10,
       .max = 1000},
      {.name = "num_rounds",
       .value = &o->num_rounds,
       .help = "most rounds in which the noise of the stated poses is learnt",
       .min = 1,
       .max = 100},
      {.name = "max_num_iterations",
       .value = &o->max_num_iterations,
       .help = "most iterations of a round's solver",
       .min = 1},
      {.name = "num_images_at_once",
       .value = &o->num_images_at_once,
       .help = "poses of a survey of more images are straightened in parts before all are adjusted together",
       .min = 10},
      {.name = "num_images_together",
       .value = &o->num_images_together,
       .help = "most images whose poses are adjusted together: a larger survey is adjusted block by block",
       .min = 10},
  };
  table.insert(table.end(), others.begin(), others.end());
  AddCondition({"refine_cameras", {"true"}},
               {"focal_sigma_ratio", "principal_point_sigma_ratio", "distortion_sigma", "calibrated_ratio"},
               &table);
  AddCondition({"refine_camera_offset", {"true"}}, {"offset_sigma_m", "offset_sigma_deg"}, &table);
  return table;
}

KeypointNoise MeasureSurvey(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                            const TriangulateOptions& triangulate, const AdjustSurveyOptions& options,
                            int num_threads, const PosedImages& posed) {
  SubSurvey sub = Restrict(posed, tracks, ImagesToLearnFrom(posed, options.num_images_learnt));
  const std::vector<Triangulation> triangulations =
      TriangulateTracks(matched, sub.tracks, sub.posed, triangulate, num_threads);
  NoProgress progress;
  const AdjustContext context = {matched, triangulate, options, num_threads, progress, nullptr};
  return SurveyLearner(context, sub.tracks, &sub.posed).Measure(triangulations);
}

SurveyFindings AdjustSurvey(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                            const TriangulateOptions& first, const TriangulateOptions& triangulate,
                            const AdjustSurveyOptions& options, int num_threads, Progress& progress,
                            SolvedFile* solved, PosedImages* posed) {
  SubSurvey sub = Restrict(*posed, tracks, ImagesToLearnFrom(*posed, options.num_images_learnt));
  const std::vector<Triangulation> triangulations =
      TriangulateTracks(matched, sub.tracks, sub.posed, first, num_threads);
  const AdjustContext context = {matched, triangulate, options, num_threads, progress, solved};
  const SurveyFindings findings = SurveyLearner(context, sub.tracks, &sub.posed).Learn(triangulations);
  if (!progress.Cancelled()) StraightenSurvey(context, tracks, first, findings, posed);
  return findings;
}

}  // namespace cairn::group_classes
