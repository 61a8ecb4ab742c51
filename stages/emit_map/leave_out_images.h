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

// A survey image that plays the robot's: what it shows, and where it was.
struct TrialImage {
  Camera camera;
  Pose cam_from_world;
  Features features;
};

// The survey without some of its images, so that what a map is good for can be tried on them before any
// held-out image is looked at.
struct LeftOutSurvey {
  Classes classes;  // without the images' observations; classes left with fewer than two are left out
  std::vector<TrialImage> images;
};

// Leaves out every n-th run of four images, at most about `max_num_images`, and never more than one of four:
// images taken one after the other see the same, and a robot stands somewhere between places, not beside an
// image.  The descriptors of classes that they saw are those of the others alone; places stay (one ray of
// many).  `matches_path`: matches.db, for the features.  Errors: those of OpenColmapDatabase; NoData (fewer
// than twelve survey images).
Result<LeftOutSurvey> LeaveOutImages(const Classes& classes, const std::string& matches_path,
                                     int max_num_images);

// What a map is made of beside its classes, all of one survey.
struct SurveyParts {
  World world;
  Decomposition decomposition;
  std::optional<Appearance> appearance;
};

// The parts without what `classes`, those of a LeftOutSurvey, lack: images of stations, features of the world
// and of regions (numbered anew, in their order), and kept nodes of the appearance graph whose images are all
// left out, for which their neighbours are kept.  Stations, areas and regions stay.  O(parts).
SurveyParts PartsOf(const Classes& classes, SurveyParts parts);

// How a map fares on them.
struct LeftOutTrial {
  int num_tried = 0;
  int num_right = 0;          // localized within the limits
  double mean_margin = 0;     // of all: inliers of the right ones, 50 at most, over 50
  double median_error_m = 0;  // of those localized right; 0 where there is none

  double RightRatio() const { return num_tried > 0 ? static_cast<double>(num_right) / num_tried : 0; }
};
struct LeftOutLimits {
  double max_error_m = 0.1;
  double max_error_deg = 5;
};
// Localizes them in a map of the survey that lacks them.  Same result for any number of threads.
// Errors: InvalidArgument (CheckMapRows), Corrupt.
Result<LeftOutTrial> TryLeftOutImages(MapRows rows, const std::vector<TrialImage>& images,
                                      const LeftOutLimits& limits, int num_threads);

}  // namespace cairn::emit_map
