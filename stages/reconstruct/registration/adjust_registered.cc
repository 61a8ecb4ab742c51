#include "stages/reconstruct/registration/adjust_registered.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "stages/reconstruct/globally/adjust_model.h"
#include "stages/reconstruct/globally/free_camera.h"

namespace cairn::reconstruct {
namespace {

// From coarse to fine: the largest error of what is triangulated, whether cameras change, too, and whether
// points decide that no held image sees.  These wait until the camera is known: seen by a wrong one, images
// of one place stand apart, and their points hold them there.
struct AdjustRound {
  double max_error_px;
  bool adjust_cameras;
  bool has_own_points;
};
constexpr AdjustRound kAdjustRounds[] = {
    {24, false, false}, {12, true, false}, {6, true, true}, {4, true, true}};
// Keypoints of an image that decide.
constexpr int kNumDecidingKeypoints = 300;
// An image with fewer that held images see too is held by its session's own points from the beginning.
constexpr int kMinNumHeldKeypoints = 40;

bool IsSeenByHeld(const SeenPoints& seen, int track, const std::vector<bool>& is_held) {
  const std::vector<int>& inliers = seen.triangulations[track].inliers;
  return std::any_of(inliers.begin(), inliers.end(),
                     [&](int e) { return is_held[seen.tracks[track][e].image_idx]; });
}

// Which tracks may decide where those that no held image sees are for images that have little else.
std::vector<bool> MayDecide(const SeenPoints& seen, const std::vector<bool>& is_held) {
  std::vector<int> num_held(is_held.size(), 0);
  std::vector<bool> may_decide;
  for (size_t t = 0; t < seen.tracks.size(); ++t) {
    may_decide.push_back(IsSeenByHeld(seen, static_cast<int>(t), is_held));
    if (!may_decide.back()) continue;
    for (const int e : seen.triangulations[t].inliers) ++num_held[seen.tracks[t][e].image_idx];
  }
  for (size_t t = 0; t < seen.tracks.size(); ++t) {
    for (const int e : seen.triangulations[t].inliers)
      if (num_held[seen.tracks[t][e].image_idx] < kMinNumHeldKeypoints) may_decide[t] = true;
  }
  return may_decide;
}

// The tracks that decide, long ones first, and of each the elements whose images have too few keypoints so
// far.
void AddObservations(const PosedInput& posed, const SeenPoints& seen, const std::vector<bool>& is_held,
                     bool has_own_points, ModelProblem* problem) {
  const std::vector<bool> may_decide =
      has_own_points ? std::vector<bool>(seen.tracks.size(), true) : MayDecide(seen, is_held);
  std::vector<int> order(seen.tracks.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return seen.triangulations[a].inliers.size() > seen.triangulations[b].inliers.size();
  });
  std::vector<int> count(posed.input.images.size(), 0);
  for (const int t : order) {
    if (!may_decide[t]) continue;
    std::vector<TrackElement> chosen;
    bool is_free = false;
    for (const int e : seen.triangulations[t].inliers) {
      const TrackElement& element = seen.tracks[t][e];
      // What held images see holds the point: it costs little.
      if (!is_held[element.image_idx] && count[element.image_idx] >= kNumDecidingKeypoints) continue;
      is_free |= !is_held[element.image_idx];
      chosen.push_back(element);
    }
    if (!is_free || chosen.size() < 2) continue;
    for (const TrackElement& element : chosen) {
      ++count[element.image_idx];
      problem->observations.push_back(
          {element.image_idx, static_cast<int>(problem->points.size()), posed.PixelOf(element)});
    }
    problem->points.push_back(seen.triangulations[t].position);
  }
}

}  // namespace

SeenPoints AdjustRegistered(const std::vector<bool>& is_held, const MapGloballyOptions& options,
                            int num_threads, PosedInput* posed, Progress& progress) {
  ModelProblem problem;
  std::map<CameraId, int> index;
  std::set<CameraId> held_cameras;
  for (size_t i = 0; i < is_held.size(); ++i) {
    if (is_held[i]) held_cameras.insert(posed->input.images[i].camera_id);
  }
  for (const auto& [camera_id, camera] : posed->cameras) {
    index.emplace(camera_id, static_cast<int>(problem.cameras.size()));
    problem.cameras.push_back(held_cameras.contains(camera_id)
                                  ? FreeCamera{.camera = camera, .stated = camera, .free = {}, .sigma = {}}
                                  : FreeOf(camera, options));
  }
  problem.is_held = is_held;
  for (size_t i = 0; i < is_held.size(); ++i) {
    problem.camera_idx.push_back(index.at(posed->input.images[i].camera_id));
    problem.cam_from_world.push_back(posed->cam_from_world[i].value_or(Pose()));
  }
  for (const AdjustRound& round : kAdjustRounds) {
    if (progress.Cancelled()) return {};
    const SeenPoints seen = TriangulateSeen(*posed, round.max_error_px, num_threads);
    problem.points.clear();
    problem.observations.clear();
    AddObservations(*posed, seen, is_held, round.has_own_points, &problem);
    if (problem.observations.empty()) return seen;
    AdjustModel({.adjust_cameras = round.adjust_cameras, .num_threads = num_threads, .progress = &progress},
                &problem);
    for (size_t i = 0; i < is_held.size(); ++i) {
      if (posed->cam_from_world[i] && !is_held[i]) posed->cam_from_world[i] = problem.cam_from_world[i];
    }
    for (auto& [camera_id, camera] : posed->cameras) camera = problem.cameras[index.at(camera_id)].camera;
  }
  return TriangulateSeen(*posed, std::end(kAdjustRounds)[-1].max_error_px, num_threads);
}

}  // namespace cairn::reconstruct
