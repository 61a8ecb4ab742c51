#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/capture_frame.h"
#include "core/error.h"
#include "core/pose.h"

namespace cairn {

// An image of a capture: its file is ROOT/images/NAME (in a flat folder ROOT/NAME).
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
  std::vector<Reject> rejects;        // named in images.txt, but missing or with a pose that is none
  std::vector<std::string> warnings;  // e.g. image files that neither list names
  bool has_poses = false;
  std::optional<CaptureFrame> frame;  // of frame.json, if there is one

  std::string ImagePath(const CaptureImage& image) const { return images_folder + "/" + image.name; }
};

// Reads the COLMAP text layout (images/, cameras.txt, images.txt, optional queries.txt and frame.json) or a
// flat folder of images: then cameras come from EXIF, else f = 1.2 max(w, h), said in `warnings`.  Image
// files are looked for, not decoded. Errors: NotFound (no such folder), NoData (no image), Corrupt (a list
// that cannot be parsed; file and line), Unsupported (camera model).
Result<Capture> ReadCapture(const std::string& root);

// One image list in COLMAP's images.txt form: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line that
// may be empty.  Poses with NaN or a quaternion whose norm differs from 1 by more than 0.01 go to `rejects`;
// smaller differences are normalised away.  Names with a control character go to `rejects` too.
Result<std::vector<CaptureImage>> ReadImagesText(const std::string& path, std::vector<Reject>* rejects);
// REQUIRES: every image has a pose.  Ids are 1, 2, ... in the given order.  Errors: InvalidArgument (a name
// with a control character: CheckListedName), Io.
Status WriteImagesText(const std::string& path, const std::vector<CaptureImage>& images);
Result<std::map<CameraId, Camera>> ReadCamerasText(const std::string& path);
Status WriteCamerasText(const std::string& path, const std::map<CameraId, Camera>& cameras);
// One camera as "MODEL,W,H,P1,P2,..." (the form of --camera).
Result<Camera> ParseCamera(const std::string& text);

}  // namespace cairn
