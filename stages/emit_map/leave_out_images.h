#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/features/features.h"
#include "core/world/appearance.h"
#include "core/world/decomposition.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"

namespace cairn::emit_map {

// A survey image used as a robot's query: its features, and its true pose.
struct TrialImage {
  Camera camera;
  Pose cam_from_world;
  Features features;
};

// The survey without some of its images, so that a map can be tried on these before any held-out
// image is used.
struct LeftOutSurvey {
  Classes classes;  // without the images' observations; classes left with fewer than two are left out
  std::vector<TrialImage> images;
};

// Leaves out every n-th run of four images, at most about `max_num_images` and at most one image in four:
// images taken one after the other see the same things, and a robot stands between surveyed places, not at an
// image.  The descriptors of classes that they saw are computed from the other images alone; positions are
// kept (one ray of many).  `matches_path`: matches.db, for the features.  Errors: those of
// OpenColmapDatabase; NoData (fewer than twelve survey images).
Result<LeftOutSurvey> LeaveOutImages(const Classes& classes, const std::string& matches_path,
                                     int max_num_images);

// What a map is made of besides its classes, all of one survey.
struct SurveyParts {
  World world;
  Decomposition decomposition;
  std::optional<Appearance> appearance;
};

// The parts without what `classes`, those of a LeftOutSurvey, lack: images of stations, features of the world
// and of regions (renumbered, in their order), and kept nodes of the appearance graph whose images are all
// left out, for which their neighbours are kept.  Stations, areas and regions stay.  O(parts).
SurveyParts PartsOf(const Classes& classes, SurveyParts parts);

// The result of a map on the left-out images.
struct LeftOutTrial {
  int num_tried = 0;
  int num_right = 0;       // localized within the limits
  double mean_margin = 0;  // over all images: inliers of those localized right, at most 50, over 50; else 0
  double median_error_m = 0;  // of those localized right; 0 where there are none

  double RightRatio() const { return num_tried > 0 ? static_cast<double>(num_right) / num_tried : 0; }
};
struct LeftOutLimits {
  double max_error_m = 0.1;
  double max_error_deg = 5;
};
// Localizes the images in a map of the survey that lacks them.  Same result for any number of threads.
// Errors: InvalidArgument (CheckMapRows), Corrupt.
Result<LeftOutTrial> TryLeftOutImages(MapRows rows, const std::vector<TrialImage>& images,
                                      const LeftOutLimits& limits, int num_threads);

}  // namespace cairn::emit_map
