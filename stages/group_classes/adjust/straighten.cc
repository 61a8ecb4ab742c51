#include "stages/group_classes/adjust/straighten.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "core/base/parallel.h"
#include "stages/group_classes/adjust/blocks.h"
#include "stages/group_classes/adjust/parts.h"
#include "stages/group_classes/adjust/survey_adjuster.h"
#include "stages/group_classes/tracks/sub_survey.h"

namespace cairn::group_classes {
namespace {

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

class Straightener : public SurveyAdjuster {
 public:
  using SurveyAdjuster::SurveyAdjuster;

  // Adjusts everything by what was learnt.
  void Apply(const SurveyFindings& findings, const TriangulateOptions& first) {
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
    const std::vector<int> rounds =
        NumPartsOfRounds(posed_.num_images(), context_.options.num_images_at_once);
    for (const int num_parts : rounds) AdjustParts(num_parts, first);
    if (!rounds.empty()) {
      bundle_options_.initial_trust_region_radius = kTrustInStraightened;
      bundle_options_.points_follow = true;
      bundle_options_.num_steps_at_once = kNumStepsAtOnce;
    }
    if (posed_.num_images() > context_.options.num_images_together) {
      AdjustBlocks(first);
      if (!context_.progress.Cancelled()) KeepFrame();
      return;
    }
    if (context_.progress.Cancelled()) return;
    context_.progress.Begin("adjust all poses", 2 * int64_t{context_.options.max_num_iterations},
                            "steps at most");
    bundle_options_.steps = &context_.progress;
    Select(TriangulateAll(first));
    Adjust(nullptr);
    if (!context_.progress.Cancelled()) {  // again, with all that agrees now, and to the end
      bundle_options_.function_tolerance = BundleOptions().function_tolerance;
      Select(TriangulateAll(context_.triangulate));
      Adjust(nullptr);
    }
    context_.progress.End();
    KeepFrame();
  }

  // Adjusts poses alone by what was learnt of the whole, from those that are known, where they were freed
  // from drift.
  PosesOfPart AdjustPart(const Straightener& whole, const std::vector<Pose>& drifted,
                         const TriangulateOptions& first) {
    TakeOver(whole, drifted);
    Select(TriangulateAll(first));
    Adjust(nullptr);
    return {posed_.poses, DriftedPoses()};
  }

  // Adjusts a block's poses by its tracks; its cameras, too, where `with_cameras`.
  PosesOfPart AdjustAsBlock(const Straightener& whole, const std::vector<Pose>& drifted, SurveyBlock* block,
                            bool with_cameras) {
    TakeOver(whole, drifted);
    bundle_options_ = whole.bundle_options_;
    for (size_t i = 0; i < problem_.images.size(); ++i) problem_.images[i].is_fixed = block->is_fixed[i] != 0;
    if (with_cameras) {
      candidates_ = whole.candidates_;
      variants_ = whole.variants_;
    }
    selected_ = std::move(block->tracks);
    Fill(std::exchange(block->triangulations, {}));
    Adjust(nullptr);
    return {posed_.poses, DriftedPoses()};
  }

 private:
  void TakeOver(const Straightener& whole, const std::vector<Pose>& drifted) {
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
    AdjustContext of_part = context_;
    of_part.num_threads = 1;
    context_.progress.Begin("straighten poses", num_parts, "parts");
    ParallelFor(num_parts, context_.num_threads, [&](int64_t p) {
      if (context_.progress.Cancelled()) return;
      std::vector<int> images(begins[p + 1] - begins[p]);
      std::iota(images.begin(), images.end(), begins[p]);
      SubSurvey sub = {SelectImages(posed_, images), std::move(tracks[p])};
      parts[p] =
          Straightener(of_part, sub.tracks, &sub.posed)
              .AdjustPart(*this, {drifted.begin() + begins[p], drifted.begin() + begins[p + 1]}, first);
      context_.progress.Advance();
    });
    context_.progress.End();
    if (context_.progress.Cancelled()) return;
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
    for (int round = 0; round < kNumRoundsOfBlocks && !context_.progress.Cancelled(); ++round) {
      const bool is_last = round == kNumRoundsOfBlocks - 1;
      if (is_last) bundle_options_.function_tolerance = BundleOptions().function_tolerance;
      const std::vector<std::vector<int32_t>> blocks =
          BlocksOfRound(posed_, round, context_.options.num_images_together);
      const std::vector<std::vector<int64_t>> tracks_of =
          TracksOfBlocks(tracks_, blocks, posed_.num_images());
      MeanCameras cameras(posed_.cameras);
      context_.progress.Begin("adjust poses", std::ssize(blocks), "blocks");
      for (size_t b = 0; b < blocks.size() && !context_.progress.Cancelled(); ++b) {
        if (round == 0) {
          const int last = blocks[b].back();
          const Pose before = problem_.images[last].drifted;
          AdjustBlock(blocks[b], tracks_of[b], last + 1, first, false, nullptr);
          // Again, with all that agrees now.
          AdjustBlock(blocks[b], tracks_of[b], last + 1, context_.triangulate, true, &cameras);
          MoveAlong(last + 1, before.Inverse() * problem_.images[last].drifted);
        } else {
          AdjustBlock(blocks[b], tracks_of[b], posed_.num_images(), context_.triangulate, !is_last,
                      is_last ? nullptr : &cameras);
        }
        context_.progress.Advance();
      }
      context_.progress.End();
      if (is_last || context_.progress.Cancelled()) break;
      posed_.cameras = cameras.Mean();
      if (findings_.has_offset) posed_.camera_from_given = problem_.camera_from_given = MeanOffset();
    }
  }

  // `num_known`: images that are there by now.  `cameras`: gets those of the block; may be null.
  void AdjustBlock(const std::vector<int32_t>& images, const std::vector<int64_t>& tracks, int num_known,
                   const TriangulateOptions& triangulate, bool with_cameras, MeanCameras* cameras) {
    SurveyBlock block = CutOutBlock(context_.matched, posed_, tracks_, tracks, images, num_known, triangulate,
                                    context_.options.num_keypoints_adjusted, context_.num_threads);
    PosedImages posed = SelectImages(posed_, block.images);
    std::vector<Pose> drifted;
    for (const int i : block.images) drifted.push_back(problem_.images[i].drifted);
    const PosesOfPart adjusted =
        Straightener(context_, block.tracks, &posed).AdjustAsBlock(*this, drifted, &block, with_cameras);
    for (size_t i = 0; i < block.images.size(); ++i) {
      if (block.is_fixed[i] != 0) continue;
      BundleProblem::Image& image = problem_.images[block.images[i]];
      image.cam_from_world = posed_.poses[block.images[i]] = adjusted.poses[i];
      image.drifted = adjusted.drifted[i];
      if (cameras != nullptr) cameras->Add(posed.camera_idx[i], posed.cameras[posed.camera_idx[i]]);
    }
  }

  void MoveAlong(int first, const Pose& before_from_now) {
    for (int i = first; i < posed_.num_images(); ++i) {
      BundleProblem::Image& image = problem_.images[i];
      image.cam_from_world = posed_.poses[i] = image.cam_from_world * before_from_now;
      image.drifted = image.drifted * before_from_now;
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
};

}  // namespace

void StraightenSurvey(const AdjustContext& context, const std::vector<Track>& tracks,
                      const TriangulateOptions& first, const SurveyFindings& findings, PosedImages* posed) {
  Straightener(context, tracks, posed).Apply(findings, first);
}

}  // namespace cairn::group_classes
