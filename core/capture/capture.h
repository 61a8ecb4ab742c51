#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/capture/capture_features.h"
#include "core/capture/capture_frame.h"
#include "core/geometry/pose.h"

namespace cairn {

// An image of a capture: its file is ROOT/images/NAME (in a flat folder ROOT/NAME), or it has features
// instead.
struct CaptureImage {
  std::string name;
  CameraId camera_id = 0;
  std::optional<Pose> cam_from_world;  // none in a capture without poses
};

// Something of a capture that cannot be used: the image's name (or the file) and why.
struct Reject {
  std::string name;
  std::string reason;
};

// Images + cameras + (usually) poses of one survey.
struct Capture {
  std::string root;
  std::string images_folder;
  std::map<CameraId, Camera> cameras;
  std::vector<CaptureImage> images;   // the survey, ascending by name
  std::vector<CaptureImage> queries;  // held out, never compiled; ascending by name
  std::vector<Reject> rejects;        // named in images.txt, but missing or with an invalid pose
  std::vector<std::string> warnings;  // e.g. image files that neither list names
  std::vector<std::string> notes;     // what was found and is no fault: where focal lengths come from
  bool has_poses = false;             // of all images
  std::optional<CaptureFrame> frame;  // of frame.json, if there is one
  std::vector<std::string> sessions;  // of sessions.txt, if there is one, in the order of time
  // Sessions that are to be registered to the others (register.txt): their images have no pose in the frame.
  std::vector<std::string> registered;
  // Of those of their images that are posed in a frame of the session's own: cam_from_session, by name.
  std::map<std::string, Pose> own_poses;
  // Of images (and queries) that have no file, or that a database replaces: where their features are, by name
  // (capture_features.h).
  std::map<std::string, FeaturesRow> features;

  std::string ImagePath(const CaptureImage& image) const { return images_folder + "/" + image.name; }
  // Null: they are to be found in its file.
  const FeaturesRow* FeaturesOf(const CaptureImage& image) const {
    const auto found = features.find(image.name);
    return found == features.end() ? nullptr : &found->second;
  }
};

// Reads the COLMAP text layout (images/, cameras.txt, images.txt, optional queries.txt and frame.json); image
// files are looked for, not decoded.  Without images.txt the capture has no poses: its images are those of
// images/, else of the folder itself.  Each then has the camera of cameras.txt that has its size; without
// cameras.txt cameras come from EXIF, else f = 1.2 max(w, h), said in `warnings`.
// Beside images.txt, register.txt may name folders of images (a session's each) that images.txt leaves out:
// they are registered to the others later (stages/reconstruct/registration).  Such a session has the poses of
// poses/SESSION.txt, which are in a frame of its own, or none; then its cameras come from
// cameras/SESSION.txt, or as above.
// A listed image without a file is one of the features that features.db has of it (of a joined capture
// features/SESSION.db); without a list images are those of that database where there is no image file, with
// the cameras that it has for them.
//
// Errors: NotFound (no such folder; images.txt without cameras.txt), NoData (no image), Corrupt (a list that
// cannot be parsed; file and line), Unsupported (camera model), InvalidArgument (without images.txt:
// queries.txt, or different cameras of one image size; with it: a pose of a session that register.txt names);
// those of CaptureFeatures.
Result<Capture> ReadCapture(const std::string& root);

// In a folder with images.txt: which sessions have no pose there, a name a line.
inline constexpr const char* kRegisterFile = "register.txt";

// In the folder of a capture without poses: what wheels or a tracker say of its images
// (stages/reconstruct/known_places.h).
inline constexpr const char* kOdometryFile = "odometry.txt";
// And what an inertial measurement unit says meanwhile (stages/reconstruct/inertial/imu_file.h).
inline constexpr const char* kImuFile = "imu.csv";

// Where a capture of several sessions without poses has the cameras of one of them.
std::string SessionCamerasPath(const std::string& root, const std::string& session);
// The same of a session's IMU.
std::string SessionImuPath(const std::string& root, const std::string& session);
// And of its poses, where it is to be registered and has some: in images.txt's form, cam_from_session.
std::string SessionPosesPath(const std::string& root, const std::string& session);

// One image list in COLMAP's images.txt form: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line that
// may be empty.  Poses with NaN or a quaternion whose norm differs from 1 by more than 0.01 go to `rejects`;
// smaller differences are normalised away.  Names with a control character, or that lead out, go there too.
Result<std::vector<CaptureImage>> ReadImagesText(const std::string& path, std::vector<Reject>* rejects);
// REQUIRES: every image has a pose.  Ids are 1, 2, ... in the given order.  Errors: InvalidArgument (a name
// with a control character: CheckListedName), Io.
Status WriteImagesText(const std::string& path, const std::vector<CaptureImage>& images);

}  // namespace cairn
