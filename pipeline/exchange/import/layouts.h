#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

// Readers of public data sets' folder layouts, for `cairn import`.  Every pose becomes cam_from_world with
// COLMAP's camera axes, every principal point COLMAP's (OpenCV's calibrations count from the centre of the
// first pixel: half a pixel is added).  docs/colmap.md states each layout's convention.

struct ImportOptions {
  // colmap, tum, 7scenes, kitti, euroc, kapture; auto: by the files that are there.
  std::string layout = "auto";
  // MODEL,WIDTH,HEIGHT,PARAM,... in COLMAP's pixels, for all images; empty: as the data set states.
  std::string camera;
  // colmap: the folder with the images; empty: `images` in or beside the model's folders.
  std::string images_folder;
  // kitti: which of the folder's sequences; empty: the only one.
  std::string sequence;
  // kitti image_0 .. image_3, euroc cam0 .., kapture sensor ids; empty: kitti and euroc the first,
  // kapture all.
  std::vector<std::string> sensors;
  // tum, euroc: a frame's pose is interpolated between stated poses at most this far from it, seconds
  // [TUM's associate.py: 0.02].  REQUIRES: >= 0
  double max_time_gap_s = 0.02;
};

// A frame: the name that it gets in the capture, its file, camera and pose.
struct ImportedImage {
  std::string name;  // relative, parts joined by '/'
  std::string path;
  CameraId camera_id = 1;
  Pose cam_from_world;
  bool is_query = false;  // the data set itself holds it out
};

struct ImportedSurvey {
  std::map<CameraId, Camera> cameras;
  std::vector<ImportedImage> images;
  std::vector<Reject> left_out;    // frames without a usable pose or file, and why
  std::vector<std::string> notes;  // what was assumed
};

// Name of the layout of a folder.  Errors: NotFound (no such folder), Unsupported (none of the known ones;
// says what each would have).
Result<std::string> DetectLayout(const std::string& source);

// Reads a data set in any layout; image files are looked for but not decoded, except the first of each
// camera.  Errors: InvalidArgument (options), NotFound, Corrupt (a line that cannot be parsed; file and line;
// images of another size than their camera's), NoData (no frame has a pose).
Result<ImportedSurvey> ReadSurvey(const std::string& source, const ImportOptions& options);

// One layout each.  They leave missing files and image sizes to ReadSurvey.
Result<ImportedSurvey> ReadColmapSurvey(const std::string& source, const ImportOptions& options);
Result<ImportedSurvey> ReadTumSurvey(const std::string& source, const ImportOptions& options);
Result<ImportedSurvey> ReadSevenScenesSurvey(const std::string& source, const ImportOptions& options);
Result<ImportedSurvey> ReadKittiSurvey(const std::string& source, const ImportOptions& options);
Result<ImportedSurvey> ReadEurocSurvey(const std::string& source, const ImportOptions& options);
Result<ImportedSurvey> ReadKaptureSurvey(const std::string& source, const ImportOptions& options);

}  // namespace cairn::pipeline
