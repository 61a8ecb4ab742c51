#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/capture.h"
#include "stages/reconstruct/globally/map_globally.h"
#include "stages/reconstruct/registration/posed_input.h"

namespace cairn::reconstruct {

// What became of a session that was registered to the others' poses.
struct RegisteredSession {
  std::string name;
  int num_images = 0;  // with features
  int num_joined = 0;
  // Of these: that see enough of what other sessions' images see.  The others are bridged.
  int num_supported = 0;
};

struct Registration {
  std::map<CameraId, Camera> cameras;               // those of registered sessions refined
  std::vector<std::optional<Pose>> cam_from_world;  // per image of the input; stated ones as they were
  std::vector<std::string> reasons;                 // per image: why it has no pose
  std::vector<RegisteredSession> sessions;
  SeenPoints seen;  // by all of them
};

// Finds the poses of sessions without poses, or with poses in frames of their own, in the frame of the images
// of `capture` that have one, from matches.  Each session is first mapped by itself (globally/map_globally.h;
// posed ones are taken as they are), each piece of it is placed as a whole (place_piece.h), and what is
// placed is adjusted together with the points that it shares with the posed images, which are held.  Images
// that no piece has are placed alone.  What is joined helps to join what is not; nothing is forced: a piece
// that too few images support, or that another place explains half as well, is left out with its reason.
//
// `motions`: what odometry says.  The same for any number of threads.  Errors: Unsupported (a session of
// panoramas), Cancelled.
Result<Registration> RegisterSessions(const MapperInput& input, const Capture& capture,
                                      const std::vector<ImageMotion>& motions,
                                      const MapGloballyOptions& options, int num_threads, Progress& progress);

}  // namespace cairn::reconstruct
