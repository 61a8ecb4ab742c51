#include "stages/group_classes/adjust/adjust_survey.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Eigenvalues>

#include "core/base/parallel.h"
#include "core/camera/panorama.h"
#include "stages/group_classes/adjust/blocks.h"
#include "stages/group_classes/adjust/choose_tracks.h"
#include "stages/group_classes/adjust/left_out.h"
#include "stages/group_classes/adjust/parts.h"
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
// Noise and cameras' models need no adjustment to the last digit.
constexpr double kLearningTolerance = 1e-3;
constexpr int kMinNumCameraImages = 5;
// Steps of a large survey that are made before they are kept in a file: some minutes.
constexpr int kNumStepsAtOnce = 4;
// What was straightened in parts is nearly right: damped as at a bad start, the bends that are left would
// take several steps more.
constexpr double kTrustInStraightened = 1e7;

// Rounds in which a survey's blocks are adjusted, each with other borders.
constexpr int kNumRoundsOfBlocks = 3;

// The rotation from which some differ least, in the mean.
class MeanRotation {
 public:
  void Add(const Eigen::Quaterniond& rotation) { sum_ += rotation.coeffs() * rotation.coeffs().transpose(); }
  Eigen::Quaterniond Mean() const {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum_);
    return Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3))).normalized();
  }

 private:
  Eigen::Matrix4d sum_ = Eigen::Matrix4d::Zero();
};

// Of each camera the mean of what was found.
class MeanCameras {
 public:
  explicit MeanCameras(std::vector<Camera> before) : mean_(std::move(before)), num_(mean_.size(), 0) {}
  void Add(int idx, const Camera& camera) {
    const double part = 1.0 / ++num_[idx];
    for (size_t p = 0; p < camera.params.size(); ++p)
      mean_[idx].params[p] += part * (camera.params[p] - mean_[idx].params[p]);
  }
  const std::vector<Camera>& Mean() const { return mean_; }

 private:
  std::vector<Camera> mean_;
  std::vector<int> num_;
};

class SurveyAdjuster {
 public:
  SurveyAdjuster(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                 const TriangulateOptions& triangulate, const AdjustSurveyOptions& options, int num_threads,
                 Progress& progress, SolvedFile* solved, PosedImages* posed)
      : matched_(matched),
        tracks_(tracks),
        triangulate_(triangulate),
        options_(options),
        bundle_options_{.max_num_iterations = options.max_num_iterations,
                        .function_tolerance = kLearningTolerance,
                        .solved = solved,
                        .cancel = &progress,
                        .num_threads = num_threads},
        num_threads_(num_threads),
        progress_(progress),
        posed_(*posed) {
    findings_.cameras.resize(posed_.cameras.size());
    findings_.has_offset = options.refine_camera_offset;
    MakeImages();
  }

  // Learns the noise, the cameras, whether there is an offset, and whether the poses need be moved at all.
  SurveyFindings Learn(const std::vector<Triangulation>& triangulations) {
    progress_.Begin("learn noise and cameras", 2 * int64_t{options_.num_rounds}, "rounds at most");
    Select(triangulations);
    Adjust(nullptr);
    LearnNoise();
    if (options_.refine_cameras && ChooseCameras()) {
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
    progress_.End();
    return findings_;
  }

  KeypointNoise Measure(const std::vector<Triangulation>& triangulations) {
    Select(triangulations);
    return MeasureKeypointNoise(problem_, scales_);
  }

  // Adjusts everything by what was learnt.
  void Apply(const SurveyFindings& findings, const TriangulateOptions& first) {
    is_learning_ = false;
    findings_ = findings;
    problem_.noise = findings.noise;
    problem_.is_offset_free = findings.has_offset;
    problem_.camera_from_given = findings.camera_from_given;
    for (size_t c = 0; c < findings.cameras.size(); ++c) posed_.cameras[c] = findings.cameras[c].camera;
    for (size_t c = 0; c < variants_.size(); ++c) {
      for (size_t v = 0; v < candidates_[c].size(); ++v) {
        if (candidates_[c][v].name == findings.cameras[c].variant) variants_[c] = static_cast<int>(v);
      }
    }
    const Pose offset = findings.camera_from_given;
    for (int i = 0; i < posed_.num_images(); ++i) {
      // Without an offset bit for bit: a product would be normalised anew.
      posed_.poses[i] = findings.has_offset ? offset * posed_.stated[i] : posed_.stated[i];
      problem_.images[i].cam_from_world = posed_.poses[i];
    }
    posed_.camera_from_given = offset;
    if (findings.pose_gain == 0) return;
    const std::vector<int> rounds = NumPartsOfRounds(posed_.num_images(), options_.num_images_at_once);
    for (const int num_parts : rounds) AdjustParts(num_parts, first);
    if (!rounds.empty()) {
      bundle_options_.initial_trust_region_radius = kTrustInStraightened;
      bundle_options_.points_follow = true;
      bundle_options_.num_steps_at_once = kNumStepsAtOnce;
    }
    if (posed_.num_images() > options_.num_images_together) {
      AdjustBlocks(first);
      if (!progress_.Cancelled()) KeepFrame();
      return;
    }
    if (progress_.Cancelled()) return;
    progress_.Begin("adjust all poses", 2 * int64_t{options_.max_num_iterations}, "steps at most");
    bundle_options_.steps = &progress_;
    Select(TriangulateTracks(matched_, tracks_, posed_, first, num_threads_));
    Adjust(nullptr);
    if (!progress_.Cancelled()) {  // again, with all that agrees now, and to the end
      bundle_options_.function_tolerance = BundleOptions().function_tolerance;
      Select(TriangulateTracks(matched_, tracks_, posed_, triangulate_, num_threads_));
      Adjust(nullptr);
    }
    progress_.End();
    KeepFrame();
  }

  // Adjusts poses alone by what was learnt of the whole, from those that are known, where they were freed
  // from drift.
  PosesOfPart AdjustPart(const SurveyAdjuster& whole, const std::vector<Pose>& drifted,
                         const TriangulateOptions& first) {
    TakeOver(whole, drifted);
    Select(TriangulateTracks(matched_, tracks_, posed_, first, num_threads_));
    Adjust(nullptr);
    return {posed_.poses, DriftedPoses()};
  }

  // The same of a block, whose tracks these are, and, where they are to be, of the cameras in it.
  PosesOfPart AdjustAsBlock(const SurveyAdjuster& whole, const std::vector<Pose>& drifted,
                            const SurveyBlock& block, bool with_cameras) {
    TakeOver(whole, drifted);
    bundle_options_ = whole.bundle_options_;
    for (size_t i = 0; i < problem_.images.size(); ++i) problem_.images[i].is_fixed = block.is_fixed[i] != 0;
    if (with_cameras) {
      candidates_ = whole.candidates_;
      variants_ = whole.variants_;
    }
    selected_ = block.tracks;
    Fill(block.triangulations);
    Adjust(nullptr);
    return {posed_.poses, DriftedPoses()};
  }

 private:
  void TakeOver(const SurveyAdjuster& whole, const std::vector<Pose>& drifted) {
    is_learning_ = false;
    findings_ = whole.findings_;
    problem_.noise = findings_.noise;
    problem_.is_offset_free = false;
    problem_.camera_from_given = posed_.camera_from_given;
    for (int i = 0; i < posed_.num_images(); ++i) {
      problem_.images[i].cam_from_world = posed_.poses[i];
      problem_.images[i].drifted = drifted[i];
    }
  }

  std::vector<Pose> DriftedPoses() const {
    std::vector<Pose> drifted;
    for (const BundleProblem::Image& image : problem_.images) drifted.push_back(image.drifted);
    return drifted;
  }

  // One round of parts (parts.h).
  void AdjustParts(int num_parts, const TriangulateOptions& first) {
    const std::vector<int> begins = BeginsOfParts(posed_.num_images(), num_parts);
    std::vector<std::vector<Track>> tracks = SplitTracks(tracks_, begins);
    const std::vector<Pose> drifted = DriftedPoses();
    std::vector<PosesOfPart> parts(num_parts);
    progress_.Begin("straighten poses", num_parts, "parts");
    ParallelFor(num_parts, num_threads_, [&](int64_t p) {
      if (progress_.Cancelled()) return;
      std::vector<int> images(begins[p + 1] - begins[p]);
      std::iota(images.begin(), images.end(), begins[p]);
      SubSurvey sub = {SelectImages(posed_, images), std::move(tracks[p])};
      parts[p] =
          SurveyAdjuster(matched_, sub.tracks, triangulate_, options_, 1, progress_, bundle_options_.solved,
                         &sub.posed)
              .AdjustPart(*this, {drifted.begin() + begins[p], drifted.begin() + begins[p + 1]}, first);
      progress_.Advance();
    });
    progress_.End();
    if (progress_.Cancelled()) return;
    PosesOfPart whole = JoinParts(parts, drifted);
    for (int i = 0; i < posed_.num_images(); ++i) {
      problem_.images[i].cam_from_world = whole.poses[i];
      problem_.images[i].drifted = whole.drifted[i];
    }
    posed_.poses = std::move(whole.poses);
  }

  // All rounds of blocks (blocks.h).  Cameras and the offset are what the blocks find in the mean; in the
  // last round they stay.
  void AdjustBlocks(const TriangulateOptions& first) {
    for (int round = 0; round < kNumRoundsOfBlocks && !progress_.Cancelled(); ++round) {
      const bool is_last = round == kNumRoundsOfBlocks - 1;
      if (is_last) bundle_options_.function_tolerance = BundleOptions().function_tolerance;
      const std::vector<std::vector<int32_t>> blocks =
          BlocksOfRound(posed_, round, options_.num_images_together);
      const std::vector<std::vector<int64_t>> tracks_of =
          TracksOfBlocks(tracks_, blocks, posed_.num_images());
      MeanCameras cameras(posed_.cameras);
      progress_.Begin("adjust poses", std::ssize(blocks), "blocks");
      for (size_t b = 0; b < blocks.size() && !progress_.Cancelled(); ++b) {
        if (round == 0) {
          const int last = blocks[b].back();
          const Pose before = problem_.images[last].drifted;
          AdjustBlock(blocks[b], tracks_of[b], last + 1, first, true, nullptr);
          // Again, with all that agrees now.
          AdjustBlock(blocks[b], tracks_of[b], last + 1, triangulate_, true, &cameras);
          MoveAlong(last + 1, before.Inverse() * problem_.images[last].drifted);
        } else {
          AdjustBlock(blocks[b], tracks_of[b], posed_.num_images(), triangulate_, !is_last, &cameras);
        }
        progress_.Advance();
      }
      progress_.End();
      if (is_last || progress_.Cancelled()) continue;
      posed_.cameras = cameras.Mean();
      if (findings_.has_offset) posed_.camera_from_given = problem_.camera_from_given = MeanOffset();
    }
  }

  // `num_known`: images that are there by now.  `cameras`: gets those of the block; may be null.
  void AdjustBlock(const std::vector<int32_t>& images, const std::vector<int64_t>& tracks, int num_known,
                   const TriangulateOptions& triangulate, bool with_cameras, MeanCameras* cameras) {
    const SurveyBlock block = CutOutBlock(matched_, posed_, tracks_, tracks, images, num_known, triangulate,
                                          options_.num_keypoints_adjusted, num_threads_);
    PosedImages posed = SelectImages(posed_, block.images);
    std::vector<Pose> drifted;
    for (const int i : block.images) drifted.push_back(problem_.images[i].drifted);
    const PosesOfPart adjusted = SurveyAdjuster(matched_, block.tracks, triangulate_, options_, num_threads_,
                                                progress_, bundle_options_.solved, &posed)
                                     .AdjustAsBlock(*this, drifted, block, with_cameras);
    for (size_t i = 0; i < block.images.size(); ++i) {
      if (block.is_fixed[i] != 0) continue;
      BundleProblem::Image& image = problem_.images[block.images[i]];
      image.cam_from_world = posed_.poses[block.images[i]] = adjusted.poses[i];
      image.drifted = adjusted.drifted[i];
      if (cameras != nullptr) cameras->Add(posed.camera_idx[i], posed.cameras[posed.camera_idx[i]]);
    }
  }

  void MoveAlong(int first, const Pose& now_from_world) {
    for (int i = first; i < posed_.num_images(); ++i) {
      BundleProblem::Image& image = problem_.images[i];
      image.cam_from_world = posed_.poses[i] = image.cam_from_world * now_from_world;
      image.drifted = image.drifted * now_from_world;
    }
  }

  // From poses freed from drift to those of the cameras.
  Pose MeanOffset() const {
    MeanRotation rotation;
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    for (const BundleProblem::Image& image : problem_.images) {
      const Pose offset = image.cam_from_world * image.drifted.Inverse();
      rotation.Add(offset.rotation);
      translation += offset.translation;
    }
    return {rotation.Mean(), translation / static_cast<double>(problem_.images.size())};
  }

  void MakeImages() {
    for (int i = 0; i < posed_.num_images(); ++i) {
      BundleProblem::Image image;
      image.camera_idx = posed_.camera_idx[i];
      image.stated = image.cam_from_world = image.drifted = posed_.stated[i];
      image.way_m = posed_.way_m[i];
      problem_.images.push_back(image);
    }
    problem_.is_offset_free = findings_.has_offset;
    problem_.offset_sigma_m = options_.offset_sigma_m;
    problem_.offset_sigma_deg = options_.offset_sigma_deg;
    problem_.cameras.resize(posed_.cameras.size());
    variants_.assign(posed_.cameras.size(), 0);
    for (const Camera& camera : posed_.cameras)
      candidates_.push_back(CameraVariants(camera, options_.camera_prior));
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

  const std::string& NameOf(int i) const { return matched_.images[posed_.feature_idx[i]].name; }
  const Keypoint& KeypointOf(const TrackElement& element) const {
    return matched_.features[posed_.feature_idx[element.image_idx]].keypoints[element.keypoint_idx];
  }

  // Those tracks that decide on poses and cameras.
  void Select(const std::vector<Triangulation>& triangulations) {
    selected_.clear();
    std::vector<Triangulation> chosen;
    for (const size_t t : ChooseTracks(tracks_, triangulations, std::vector<char>(posed_.num_images(), 1),
                                       options_.num_keypoints_adjusted)) {
      selected_.push_back(tracks_[t]);
      chosen.push_back(triangulations[t]);
    }
    Fill(chosen);
  }

  // Observations and points of the selected tracks.
  void Fill(const std::vector<Triangulation>& triangulations) {
    problem_.observations.clear();
    problem_.points.clear();
    scales_.clear();
    size_t num_seen = 0;  // at most
    for (const Triangulation& triangulation : triangulations)
      num_seen += Spread(triangulation.inliers).size();
    problem_.observations.reserve(num_seen);
    scales_.reserve(num_seen);
    std::vector<TrackElement> seen;  // per observation
    seen.reserve(num_seen);
    for (size_t t = 0; t < selected_.size(); ++t) {
      if (triangulations[t].outcome != TriangulateOutcome::kOk) continue;
      for (const int i : Spread(triangulations[t].inliers)) {
        const TrackElement& element = selected_[t][i];
        const Keypoint& keypoint = KeypointOf(element);
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
    ParallelForRuns(std::ssize(seen), kAtOnce, num_threads_, [&](int64_t begin, int64_t end) {
      for (int64_t k = begin; k < end; ++k)
        problem_.observations[k].ray = RayOfTrack(matched_, posed_, seen[k]);
    });
    SetCameras(variants_, false, &problem_);
    SetKeypointNoise();
  }

  void SetKeypointNoise() {
    std::vector<double> count(problem_.images.size(), 0);
    for (size_t i = 0; i < problem_.observations.size(); ++i) {
      problem_.observations[i].sigma_px = findings_.keypoints.SigmaPx(scales_[i]);
      ++count[problem_.observations[i].image_idx];
    }
    for (size_t i = 0; i < problem_.images.size(); ++i)
      problem_.images[i].dispersion = findings_.keypoints.Dispersion(count[i]);
  }

  // The variants' parameters as blocks about the cameras as stated, where `afresh`, or as they are.
  void SetCameras(const std::vector<int>& variants, bool afresh, BundleProblem* problem) const {
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
  double FocalGradient(int camera) const {
    const double num_turns = 2.0 / 3 * (evidence_.own_deg.num_determined + evidence_.walk_deg.num_determined);
    const auto of_camera = std::count(posed_.camera_idx.begin(), posed_.camera_idx.end(), camera);
    return num_turns * static_cast<double>(of_camera) / std::max(1, posed_.num_images()) /
           posed_.cameras[camera].MeanFocal();
  }

  void Adjust(BundleEvidence* evidence) {
    AdjustBundle(bundle_options_, &problem_, evidence);
    for (int i = 0; i < posed_.num_images(); ++i) posed_.poses[i] = problem_.images[i].cam_from_world;
    for (size_t c = 0; c < problem_.cameras.size(); ++c) {
      const CameraBlock& block = problem_.cameras[c];
      for (size_t k = 0; k < block.free.size(); ++k)
        posed_.cameras[c].params[block.free[k]] += block.delta[k];
    }
    if (!is_learning_) return;  // tracks are selected anew
    findings_.keypoints = MeasureKeypointNoise(problem_, scales_);
    Fill(TriangulateTracks(matched_, selected_, posed_, triangulate_, num_threads_));
  }

  void LearnNoise() {
    for (int round = 0; round < options_.num_rounds && !progress_.Cancelled(); ++round) {
      Adjust(&evidence_);
      progress_.Advance();
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
    const bool is_side_by_side = NumThreads(num_threads_) <= num_adjustments;
    BundleOptions options = bundle_options_;
    if (is_side_by_side) options.num_threads = 1;
    ParallelFor(num_adjustments, is_side_by_side ? num_threads_ : 1, [&](int64_t i) { adjust(i, options); });
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
      Fill(TriangulateTracks(matched_, selected_, posed_, triangulate_, num_threads_));
      Adjust(nullptr);
    }
    return changed;
  }

  // Whether it is more than chance, and worth it beside the part that an image's keypoints share.
  bool IsGain(const LeftOutGain& gain) const {
    return gain.part > kMinGainOfShared * findings_.keypoints.correlation + kMinGain &&
           gain.part > kMinGainSigmas * gain.standard_error;
  }

  // Turns and moves everything so that the stated poses, freed from drift, are where they were stated, in the
  // mean: a walk has no frame of its own.
  void KeepFrame() {
    MeanRotation turn;
    for (const BundleProblem::Image& image : problem_.images)
      turn.Add(image.stated.rotation.conjugate() * image.drifted.rotation);
    const Eigen::Quaterniond stated_from_drifted = turn.Mean();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    for (const BundleProblem::Image& image : problem_.images)
      shift += image.stated.Center() - stated_from_drifted * image.drifted.Center();
    const Pose frame{stated_from_drifted, shift / std::max<double>(1, problem_.images.size())};
    const Pose back = frame.Inverse();
    for (int i = 0; i < posed_.num_images(); ++i) posed_.poses[i] = problem_.images[i].cam_from_world * back;
    posed_.camera_from_given = problem_.camera_from_given;
  }

  const MatchedFeatures& matched_;
  const std::vector<Track>& tracks_;
  const TriangulateOptions& triangulate_;
  const AdjustSurveyOptions& options_;
  BundleOptions bundle_options_;
  int num_threads_;
  Progress& progress_;
  PosedImages& posed_;
  std::vector<std::vector<CameraVariant>> candidates_;  // per camera
  std::vector<int> variants_;                           // per camera: the one taken
  std::vector<Track> selected_;
  std::vector<double> scales_;  // per observation
  BundleProblem problem_;
  BundleEvidence evidence_;
  SurveyFindings findings_;
  bool is_learning_ = true;
};

}  // namespace

KeypointNoise MeasureSurvey(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                            const TriangulateOptions& triangulate, const AdjustSurveyOptions& options,
                            int num_threads, const PosedImages& posed) {
  SubSurvey sub = Restrict(posed, tracks, ImagesToLearnFrom(posed, options.num_images_learnt));
  const std::vector<Triangulation> triangulations =
      TriangulateTracks(matched, sub.tracks, sub.posed, triangulate, num_threads);
  NoProgress progress;
  return SurveyAdjuster(matched, sub.tracks, triangulate, options, num_threads, progress, nullptr, &sub.posed)
      .Measure(triangulations);
}

SurveyFindings AdjustSurvey(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                            const TriangulateOptions& first, const TriangulateOptions& triangulate,
                            const AdjustSurveyOptions& options, int num_threads, Progress& progress,
                            SolvedFile* solved, PosedImages* posed) {
  SubSurvey sub = Restrict(*posed, tracks, ImagesToLearnFrom(*posed, options.num_images_learnt));
  const std::vector<Triangulation> triangulations =
      TriangulateTracks(matched, sub.tracks, sub.posed, first, num_threads);
  const SurveyFindings findings =
      SurveyAdjuster(matched, sub.tracks, triangulate, options, num_threads, progress, solved, &sub.posed)
          .Learn(triangulations);
  if (progress.Cancelled()) return findings;
  SurveyAdjuster(matched, tracks, triangulate, options, num_threads, progress, solved, posed)
      .Apply(findings, first);
  return findings;
}

}  // namespace cairn::group_classes
