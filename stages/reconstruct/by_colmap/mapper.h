#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/colmap/colmap_model.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// How COLMAP's incremental mapper is run [Schönberger, Frahm: Structure-from-Motion Revisited, CVPR 2016].
struct MapperOptions {
  // "global": all images at once (globally/map_globally.h), and COLMAP's where that joins too few of them;
  // "colmap": COLMAP's alone, image by image; "auto": as "global" where the images are a drive; else
  // COLMAP's, unless all at once many more are joined, or it is not installed.
  std::string mapper = "auto";
  // Time limit after which COLMAP's is ended, hours.  REQUIRES: > 0
  double max_hours = 12;
  // Whether it refines the cameras' parameters, which come from EXIF or a guess.  Distortion: one radial
  // parameter for cameras that are given without any.
  bool refine_focal_length = true;
  bool refine_distortion = true;
  // Whether a reconstruction may start from any two images, also where the camera moved straight ahead
  // between them or points are seen at small angles.  Such a start is less exact, and along a street or a
  // corridor often the only one.
  bool start_from_any_pair = false;
  // One thread, and the same bytes on every run.  False: all cores in bundle adjustment, faster for hundreds
  // of images, but no two runs give the same result.
  bool deterministic = true;
};

// Runs `colmap mapper` on a database of its own in `work_folder` (an existing folder; the caller removes what
// it leaves there): older versions cannot read every database that we can, and the mapper writes to the one
// that it reads.  Returns its models, most images first (ties: more points, then COLMAP's order), in the
// mapper's arbitrary frame and scale.  Errors: NotFound (no `colmap`); NoData (it found no pair of images to
// start from); Failed (with its last lines: it failed, took longer than max_hours, or left no model); Corrupt
// (a model that cannot be read); Cancelled.
Result<std::vector<ColmapModel>> RunMapper(const MapperInput& input, const std::string& images_folder,
                                           const MapperOptions& options, const std::string& work_folder,
                                           Progress& progress);

}  // namespace cairn::reconstruct
