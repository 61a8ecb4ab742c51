#include "stages/reconstruct/register_to_others.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "core/capture/sessions.h"
#include "stages/reconstruct/globally/part_model.h"
#include "stages/reconstruct/odometry.h"
#include "stages/reconstruct/registration/register_sessions.h"

namespace cairn::reconstruct {
namespace {

// What all images see, as a model: for the verdict.
ColmapModel ModelOfRegistered(const MapperInput& input, const Registration& found) {
  ModelProblem problem;
  std::map<CameraId, int> index;
  for (const auto& [camera_id, camera] : found.cameras) {
    index.emplace(camera_id, static_cast<int>(problem.cameras.size()));
    problem.cameras.push_back({camera, camera, {}, {}});
  }
  std::vector<int> images(input.images.size());
  std::iota(images.begin(), images.end(), 0);
  for (const int i : images) {
    problem.cam_from_world.push_back(found.cam_from_world[i].value_or(Pose()));
    problem.camera_idx.push_back(index.at(input.images[i].camera_id));
  }
  return ModelOfPart(input, images, problem, found.seen.tracks, found.seen.triangulations);
}

void CollectRegistered(const MapperInput& input, const Capture& capture, const Registration& found,
                       int hold_out_every, ReconstructResult* result) {
  result->cameras = capture.cameras;
  for (const CaptureImage& image : capture.images) {
    if (image.cam_from_world) result->images.push_back(image);
  }
  result->queries = capture.queries;
  size_t num_joined = 0;
  for (size_t i = 0; i < input.images.size(); ++i) {
    const DatabaseImage& image = input.images[i];
    if (SessionOfImage(capture.registered, image.name) < 0) continue;
    if (!found.cam_from_world[i]) {
      result->rejects.push_back({image.name, "not registered: " + found.reasons[i]});
      continue;
    }
    result->cameras.insert_or_assign(image.camera_id, found.cameras.at(image.camera_id));
    const bool is_held_out = hold_out_every > 0 && ++num_joined % static_cast<size_t>(hold_out_every) == 0;
    (is_held_out ? result->queries : result->images)
        .push_back({image.name, image.camera_id, found.cam_from_world[i]});
  }
  const auto by_name = [](const auto& a, const auto& b) { return a.name < b.name; };
  std::sort(result->images.begin(), result->images.end(), by_name);
  std::sort(result->queries.begin(), result->queries.end(), by_name);
  std::sort(result->rejects.begin(), result->rejects.end(), by_name);
}

}  // namespace

Result<ColmapModel> RegisterToOthers(const MapperInput& input, const Capture& capture,
                                     const ReconstructOptions& options, int num_threads, Progress& progress,
                                     ReconstructResult* result) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<ImageMotion> motions, OdometryMotions(input, capture));
  CAIRN_ASSIGN_OR_RETURN(const Registration found,
                         RegisterSessions(input, capture, motions,
                                          {.refine_focal_length = options.mapper.refine_focal_length,
                                           .refine_distortion = options.mapper.refine_distortion},
                                          num_threads, progress));
  result->sessions = found.sessions;
  result->frame = capture.frame.value_or(CaptureFrame());
  result->frame.is_reconstructed = false;
  result->frame.has_refined_cameras = true;
  CollectRegistered(input, capture, found, options.hold_out_every, result);
  if (options.hold_out_every > 0 && result->queries.empty()) {
    const auto num_joined = std::count_if(found.sessions.begin(), found.sessions.end(),
                                          [](const auto& session) { return session.num_joined > 0; });
    return MakeError(
        ErrorCode::kNoData,
        "hold_out_every = {}: of {} registered sessions {} are joined, with too few images to hold one "
        "out; a smaller number holds out more, and without it runs of the survey are left out",
        options.hold_out_every, found.sessions.size(), num_joined);
  }
  for (const RegisteredSession& session : found.sessions) {
    if (session.num_joined > 0) continue;
    if (session.num_images == 0) {
      result->warnings.push_back(
          fmt::format("{}: session '{}' has no image with features, each for the reason that "
                      "extract_features gave: it is "
                      "not in the map",
                      capture.root, session.name));
      continue;
    }
    result->warnings.push_back(fmt::format(
        "{}: none of the {} images of session '{}' were joined to the other captures: it is not in the map",
        capture.root, session.num_images, session.name));
  }
  return ModelOfRegistered(input, found);
}

}  // namespace cairn::reconstruct
