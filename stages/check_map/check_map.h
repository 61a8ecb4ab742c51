#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/base/progress.h"
#include "core/blocks/map_findings.h"
#include "core/camera/camera.h"
#include "core/camera/panorama.h"
#include "core/capture/capture_features.h"
#include "core/geometry/pose.h"
#include "core/learned/feature_finder.h"
#include "core/options/options.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"
#include "stages/check_map/plan_fit.h"

namespace cairn::check_map {

// Tries a map on images that it was not made from: how many are localized, how accurately, how certain the
// map is, and whether images of another place are refused.  Where no images were held out, runs of the
// survey's images try maps that lack them (core/map/left_out_folder.h), as the map itself would be without
// them.  Before: emit_map, leave_out.  The last stage: its figures are sealed into the map.
struct CheckMapOptions {
  // A fix farther than this from the truth is wrong: it counts against precision.  REQUIRES: > 0
  double gross_error_m = 0.5;
  double gross_error_deg = 10;
  // Gate: smallest part of the held-out images that must be localized, and of the fixes that must not be
  // gross errors.  REQUIRES: in [0, 1]
  double min_localized_ratio = 0;
  double min_precision_ratio = 0;
  // Gate: the same within each region, over the held-out images at its stations; regions with fewer than
  // min_region_held_out such images are not checked.  REQUIRES: in [0, 1]; >= 1
  double min_region_localized_ratio = 0;
  double min_region_precision_ratio = 0;
  int min_region_held_out = 5;
  // An image belongs to the nearest station whose heading is within this of its own, if that station is no
  // farther than this many times the stations' spacing (region_figures.h).  REQUIRES: in [0, 180]; >= 0
  double max_station_heading_deg = 45;
  double max_station_distance_ratio = 1.5;
  // Gate: the map's floor plan must fit its landmarks (plan_fit.h).
  bool plan_must_fit = false;
  PlanFitOptions plan;
  // Pose of the laser in the camera's floor frame: ahead, to the left (m), counter-clockwise (degrees).
  double scan_x_m = 0;
  double scan_y_m = 0;
  double scan_heading_deg = 0;
  // Standard deviation per axis of the true poses, which the normalised error counts beside the fix's own
  // covariance; below 0: as the survey's stated poses were found to err, for truth of the same source.
  double truth_sigma_m = -1;
  double truth_sigma_deg = -1;
  // Whether the true poses have the map's own scale, as those that the reconstruction found do: then the
  // error of its scale is no part of a fix's.
  bool truth_has_map_scale = true;
  LocalizerOptions localizer;
};
OptionTable DescribeOptions(CheckMapOptions* options);

// An image to localize.  An image without a true pose shows another place and must be refused.
struct HeldOutImage {
  std::string name;
  std::string path;
  Camera camera;
  std::optional<Pose> cam_from_world;
  // Of a left-out image that is a view of a panorama (core/camera/panorama.h): `path` is the panorama's.
  struct View {
    PanoramaView of;
    Camera camera;  // by which the view was cut when the survey was compiled
  };
  std::optional<View> view = std::nullopt;
  // Of an image without a file: where its features are.
  std::optional<FeaturesRow> features = std::nullopt;
  // Of a map whose features a model finds; null: SIFT.
  std::shared_ptr<const FeatureFinder> finder = nullptr;
};

struct HeldOutResult {
  std::string name;
  std::optional<Pose> true_cam_from_world;
  std::optional<StationIdx> station;  // where it was taken: filled by FindStations (region_figures.h)
  std::string rejected;  // why the image could not be tried (unreadable, wrong size); empty otherwise
  Localization localization;
  // Fixes of images with a true pose: distance of the camera centres, angle, normalised estimation
  // error squared.
  double error_m = 0;
  double error_deg = 0;
  double nees = 0;
  double sift_ms = 0;
  double total_ms = 0;  // SIFT included, decoding not
  bool has_fix() const { return rejected.empty() && localization.has_fix(); }
};

// A map, and images that it was not made from.
struct MapTrial {
  std::shared_ptr<const Map> map;
  std::vector<HeldOutImage> images;
};

// From this probability of being right on a fix counts as nearly certain.
inline constexpr double kNearlyCertain = 0.99;

// REQUIRES: a fix of an image with a true pose
bool IsGrossError(const HeldOutResult& result, const CheckMapOptions& options);

struct CheckMapReport {
  std::vector<HeldOutResult> images;  // in the given order
  // Figures without times, by name: those that the map's self-test stores.  Ratios are of the images tried;
  // those that need a fix are left out where there is none.
  //   num_held_out, num_localized, localized_ratio, median_error_m, median_error_deg, p90_error_m,
  //   p90_error_deg, within_5cm_5deg_ratio, within_10cm_2deg_ratio, within_10cm_5deg_ratio, num_gross_errors,
  //   precision_ratio, mean_probability (of the fixes, beside precision_ratio), num_nearly_certain and
  //   num_nearly_certain_gross_errors (fixes of kNearlyCertain or more, and those of them that are wrong),
  //   mean_nees, median_nees, nees_low, nees_high (95 % band of the mean for 6 degrees
  //   of freedom); similarity_ and rig_: median and 90th percentile of what remains when a similarity between
  //   the frames of truth and map is fitted, and an offset between their cameras too (truth_fit.h)
  // and of a map whose retrieval finds kept images alone, beside the same map's with all
  // images (AddFullFigures):
  //   num_by_retrieval, all_images_num_by_retrieval: fixes from landmarks that retrieval led to, not from all
  //   landmarks of the map; all_images_num_localized, all_images_localized_ratio, all_images_precision_ratio
  // and of a map with a promise what AddPromiseFigures (promise_figures.h) says; and of a map with a floor
  // plan what AddPlanFigures (plan_fit.h) and CompareWithPlan (plan_agreement.h) say.
  std::map<std::string, double> figures;
  // and of left-out runs: num_left_out_runs; then the images are the survey's own, num_held_out counts those
  // that were tried, and their true poses are those that the map has for them.
  std::string plan_verdict;  // PlanVerdict; empty where there is no floor plan
  std::string why_none;      // why no run was left out; else empty
  // The same by region, of images with a true pose: filled by SummarizeRegions (region_figures.h).
  std::vector<RegionSelfTest> regions;
  // Means over the images tried.
  double mean_sift_ms = 0;
  double mean_total_ms = 0;
};

// Localizes every image of every trial in its map, several at a time, one localizer per image.  Same figures
// for any number of threads.  An unreadable image is listed as rejected and counts as not localized.
// Errors: InvalidArgument (an option), Cancelled.
Result<CheckMapReport> CheckMaps(const std::vector<MapTrial>& trials, const CheckMapOptions& options,
                                 int num_threads, Progress& progress);
// The same of one map.
Result<CheckMapReport> CheckMap(const std::shared_ptr<const Map>& map,
                                const std::vector<HeldOutImage>& images, const CheckMapOptions& options,
                                int num_threads, Progress& progress);

// Whether the report is of runs of the survey's images.
bool IsOfLeftOutRuns(const CheckMapReport& report);

// Adds to a sparse map's figures what the same map would do with all images as documents.
void AddFullFigures(const CheckMapReport& full, CheckMapReport* sparse);

// Whether the figures pass the gate.  Errors: Gate, naming the figure, its region, the value found and the
// value required; also where a value is required but there was no image to measure it.
Status CheckGate(const CheckMapReport& report, const CheckMapOptions& options);

}  // namespace cairn::check_map
