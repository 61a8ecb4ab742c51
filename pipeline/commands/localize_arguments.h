#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/line/command.h"
#include "pipeline/commands/odometry.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/drive/sure_tracker.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/visual_map/visual_estimate.h"
#include "runtime/visual_map/visual_filter.h"
#include "runtime/visual_map/visual_map.h"
#include "runtime/visual_map/visual_tracker.h"

namespace cairn::pipeline {

// What `cairn localize` was given.
struct LocalizeArguments {
  std::string map_path;
  std::vector<std::string> images;
  std::string list_path;
  std::string output_path;
  std::string camera;
  std::string cameras_path;
  bool is_sequence = false;
  std::string odometry_path;
  double period_s = 0;  // 0: not given
  GravityArguments gravity;
  std::string rig_path;
  std::string features_path;  // empty: found in the images
  std::string model_path;     // by this model; empty: SIFT
  std::string descriptors = "auto";
  std::string estimator = "pnp";
  std::string log_folder;
  double log_mb_per_day = 0;  // 0: the default
  bool log_images = false;
  LocalizerOptions options;
  VisualMapOptions visual_options;
  VisualEstimateOptions estimate_options;
  RegionTrackerOptions tracker_options;  // its votes are the visual map's too
  VisualTrackerOptions visual_tracker_options;
  VisualFilterOptions filter_options;
  SureTrackerOptions sure_options;
  AtlasLocalizerOptions atlas_options;
  OptionArguments option_arguments;
};

// Refuses what does not go together, and options that only another estimator, a sequence, odometry or an
// atlas reads.  Errors: InvalidArgument.
Status CheckLocalizeArguments(const LocalizeArguments& arguments, bool is_atlas);

}  // namespace cairn::pipeline
