#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/colmap/colmap_model.h"
#include "stages/reconstruct/globally/part_mapper.h"
#include "stages/reconstruct/view_graph/image_motion.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

struct GlobalMap {
  // Of each part that pairs or motions join, most images first (ties: more points), in frames and scales of
  // their own.
  std::vector<ColmapModel> models;
  // Whether the largest part is a drive, whose images follow each other by name: then what looks alike bends
  // nothing.  Without an order, pairs of places that look alike in most of an image may.
  bool is_drive = false;
  std::string why_no_odometry;  // why motions have no say, if there are any and they have none
};

// Poses of all images at once instead of one after the other [Pan, Barath, Pollefeys & Schönberger, "Global
// structure-from-motion revisited" (GLOMAP), ECCV 2024]: focal lengths that are guesses from the pairs,
// relative poses, wrong pairs cut, rotations averaged, lengths of ways averaged, places that these lead to,
// then bundle adjustments, each with tracks triangulated anew; all anew where the first of these find another
// focal length.  `motions` are measurements in all of that: they join what no match joins, and give the
// scale.  Every part that pairs or motions join becomes a model.  Returns them, most images first (ties: more
// points), in frames and scales of their own.  The same for any number of threads.
// Errors: NoData (no pair of images has a relative pose); Cancelled.
Result<GlobalMap> MapGlobally(const MapperInput& input, const std::vector<ImageMotion>& motions,
                              const MapGloballyOptions& options, int num_threads, Progress& progress);

}  // namespace cairn::reconstruct
