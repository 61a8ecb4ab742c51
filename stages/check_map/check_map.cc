#include "stages/check_map/check_map.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <tuple>
#include <utility>

#include <Eigen/LU>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/features/sift.h"
#include "core/images/image_file.h"
#include "runtime/localize/refine.h"
#include "stages/check_map/truth_fit.h"

namespace cairn::check_map {
namespace {

using Clock = std::chrono::steady_clock;

double MillisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

// Pixels of a held-out image.
Result<cv::Mat> ReadPixels(const HeldOutImage& image) {
  CAIRN_ASSIGN_OR_RETURN(cv::Mat grey, ReadGreyImage(image.path));
  if (image.view)
    grey = CutPanoramaView(grey, image.view->camera, image.view->of.view, image.view->of.num_views);
  if (grey.cols != image.camera.width || grey.rows != image.camera.height) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {} x {} px, but its camera takes {} x {} px",
                     image.path, grey.cols, grey.rows, image.camera.width, image.camera.height);
  }
  return grey;
}

// Localizes in two steps so that SIFT's time is known.
Result<Localization> LocalizeTimed(const std::shared_ptr<const Map>& map, const HeldOutImage& image,
                                   const LocalizerOptions& options, HeldOutResult* result) {
  Features features;
  cv::Mat grey;
  if (image.features) {
    CAIRN_ASSIGN_OR_RETURN(features, ReadCaptureFeatures(*image.features, image.camera));
  } else {
    CAIRN_ASSIGN_OR_RETURN(grey, ReadPixels(image));
  }
  const Clock::time_point start = Clock::now();
  if (!image.features && image.finder) {
    CAIRN_ASSIGN_OR_RETURN(features, image.finder->Find(grey));
  } else if (!image.features) {
    CAIRN_ASSIGN_OR_RETURN(features, ExtractSift(grey, options.sift));
  }
  result->sift_ms = MillisecondsSince(start);
  Result<Localization> localization =
      Localizer(map, options).LocalizeFeatures(std::move(features), image.camera);
  result->total_ms = MillisecondsSince(start);
  return localization;
}

HeldOutResult TryImage(const std::shared_ptr<const Map>& map, const HeldOutImage& image,
                       const CheckMapOptions& options) {
  HeldOutResult result;
  result.name = image.name;
  result.true_cam_from_world = image.cam_from_world;
  Result<Localization> localization = LocalizeTimed(map, image, options.localizer, &result);
  if (!localization.ok()) {
    result.rejected = localization.error().message;
    return result;
  }
  result.localization = std::move(*localization);
  if (result.localization.has_fix() && image.cam_from_world) {
    const Pose& found = result.localization.cam_from_world;
    result.error_m = CenterErrorM(found, *image.cam_from_world);
    result.error_deg = RotationErrorDeg(found, *image.cam_from_world);
    const Vector6d error = PerturbationBetween(found, *image.cam_from_world);
    Matrix6d covariance = result.localization.covariance;
    const auto truth_variance = [](double given, double of_survey) {
      return std::pow(given < 0 ? of_survey : given, 2);
    };
    if (options.truth_has_map_scale) {
      covariance.bottomRightCorner<3, 3>() -=
          result.localization.scale_sigma_m * result.localization.scale_sigma_m.transpose();
    }
    covariance.diagonal().head<3>().array() +=
        truth_variance(RadFromDeg(options.truth_sigma_deg), RadFromDeg(map->head().stated_pose_sigma_deg));
    covariance.diagonal().tail<3>().array() +=
        truth_variance(options.truth_sigma_m, map->head().stated_pose_sigma_m);
    result.nees = error.dot(covariance.inverse() * error);
  }
  return result;
}

// What remains of the errors when the frames of truth and map are fitted to each other.
void SummarizeFits(const std::vector<HeldOutResult>& images, std::map<std::string, double>* figures) {
  std::vector<FixAndTruth> fixes;
  for (const HeldOutResult& image : images) {
    if (image.has_fix() && image.true_cam_from_world)
      fixes.push_back({image.localization.cam_from_world, *image.true_cam_from_world});
  }
  for (const auto& [prefix, with_offset] : {std::pair("similarity", false), std::pair("rig", true)}) {
    const std::optional<TruthFit> fit = FitTruth(fixes, with_offset);
    if (!fit) return;
    const auto set = [&](const char* name, double value) {
      (*figures)[fmt::format("{}_{}", prefix, name)] = value;
    };
    set("median_error_m", Quantile(fit->errors_m, 0.5));
    set("median_error_deg", Quantile(fit->errors_deg, 0.5));
    set("p90_error_m", Quantile(fit->errors_m, 0.9));
    set("p90_error_deg", Quantile(fit->errors_deg, 0.9));
    set("scale", fit->truth_from_map.scale);
    if (with_offset) {
      set("offset_m", fit->truth_cam_from_cam.Center().norm());
      set("offset_deg", RotationErrorDeg(fit->truth_cam_from_cam, Pose()));
    }
  }
}

void SummarizeErrors(const std::vector<HeldOutResult>& images, const CheckMapOptions& options,
                     std::map<std::string, double>* figures) {
  std::vector<double> errors_m, errors_deg, nees;
  int within_5cm_5deg = 0, within_10cm_2deg = 0, within_10cm_5deg = 0, num_gross_errors = 0;
  double sum_nees = 0, sum_probability = 0;
  int num_nearly_certain = 0, num_certain_gross_errors = 0;
  for (const HeldOutResult& image : images) {
    if (!image.has_fix()) continue;
    errors_m.push_back(image.error_m);
    errors_deg.push_back(image.error_deg);
    nees.push_back(image.nees);
    sum_nees += image.nees;
    sum_probability += image.localization.probability;
    const bool is_nearly_certain = image.localization.probability >= kNearlyCertain;
    num_nearly_certain += is_nearly_certain ? 1 : 0;
    num_certain_gross_errors += is_nearly_certain && IsGrossError(image, options) ? 1 : 0;
    within_5cm_5deg += image.error_m <= 0.05 && image.error_deg <= 5 ? 1 : 0;
    within_10cm_2deg += image.error_m <= 0.1 && image.error_deg <= 2 ? 1 : 0;
    within_10cm_5deg += image.error_m <= 0.1 && image.error_deg <= 5 ? 1 : 0;
    num_gross_errors += IsGrossError(image, options) ? 1 : 0;
  }
  const double num_images = static_cast<double>(images.size());
  const double num_fixes = static_cast<double>(errors_m.size());
  auto& f = *figures;
  f["num_held_out"] = num_images;
  f["num_localized"] = num_fixes;
  if (images.empty()) return;
  f["localized_ratio"] = num_fixes / num_images;
  f["within_5cm_5deg_ratio"] = within_5cm_5deg / num_images;
  f["within_10cm_2deg_ratio"] = within_10cm_2deg / num_images;
  f["within_10cm_5deg_ratio"] = within_10cm_5deg / num_images;
  f["num_gross_errors"] = num_gross_errors;
  if (errors_m.empty()) return;
  f["precision_ratio"] = 1 - num_gross_errors / num_fixes;
  f["mean_probability"] = sum_probability / num_fixes;
  f["num_nearly_certain"] = num_nearly_certain;
  f["num_nearly_certain_gross_errors"] = num_certain_gross_errors;
  f["median_error_m"] = Quantile(errors_m, 0.5);
  f["median_error_deg"] = Quantile(errors_deg, 0.5);
  f["p90_error_m"] = Quantile(errors_m, 0.9);
  f["p90_error_deg"] = Quantile(errors_deg, 0.9);
  f["mean_nees"] = sum_nees / num_fixes;
  f["median_nees"] = Quantile(nees, 0.5);
  const double band = 1.96 * std::sqrt(2 * 6 / num_fixes);  // chi-square of 6 degrees of freedom: variance 12
  f["nees_low"] = std::max(0.0, 6 - band);
  f["nees_high"] = 6 + band;
  SummarizeFits(images, figures);
}

// Reports the first region with enough images that is below its gate.
Status CheckRegionGate(const CheckMapReport& report, const CheckMapOptions& options) {
  for (const RegionSelfTest& row : report.regions) {
    if (row.region == kOutsideRegions || row.num_held_out < options.min_region_held_out) continue;
    for (const auto& [name, found, least] :
         {std::tuple("localized_ratio", row.LocalizedRatio(), options.min_region_localized_ratio),
          std::tuple("precision_ratio", row.PrecisionRatio(), options.min_region_precision_ratio)}) {
      if (found >= least) continue;
      return MakeError(ErrorCode::kGate,
                       "below the gate: {} of region {} is {:.3f} ({} of its {} {} images are "
                       "localized, {} of them wrong), at least {:.3f} is required",
                       name, row.region, found, row.num_localized, row.num_held_out,
                       IsOfLeftOutRuns(report) ? "left-out" : "held-out", row.num_gross_errors, least);
    }
  }
  return Ok();
}

}  // namespace

bool IsGrossError(const HeldOutResult& result, const CheckMapOptions& options) {
  return !(result.error_m <= options.gross_error_m &&
           result.error_deg <= options.gross_error_deg);  // nor NaN
}

OptionTable DescribeOptions(CheckMapOptions* o) {
  OptionTable table = {
      {.name = "gross_error_m",
       .value = &o->gross_error_m,
       .help = "a fix farther off than this is wrong, m",
       .min = 1e-6},
      {.name = "gross_error_deg",
       .value = &o->gross_error_deg,
       .help = "a fix turned by more than this is wrong, degrees",
       .min = 1e-6},
      {.name = "min_localized_ratio",
       .value = &o->min_localized_ratio,
       .help = "gate: smallest part of the held-out images that must be localized",
       .min = 0,
       .max = 1},
      {.name = "min_precision_ratio",
       .value = &o->min_precision_ratio,
       .help = "gate: smallest part of the fixes that must not be wrong",
       .min = 0,
       .max = 1},
      {.name = "min_region_localized_ratio",
       .value = &o->min_region_localized_ratio,
       .help = "gate: smallest part of each region's held-out images that must be localized",
       .min = 0,
       .max = 1},
      {.name = "min_region_precision_ratio",
       .value = &o->min_region_precision_ratio,
       .help = "gate: smallest part of each region's fixes that must not be wrong",
       .min = 0,
       .max = 1},
      {.name = "min_region_held_out",
       .value = &o->min_region_held_out,
       .help = "gate: regions with fewer held-out images than this are not checked",
       .min = 1},
      {.name = "max_station_heading_deg",
       .value = &o->max_station_heading_deg,
       .help = "figures of regions: a held-out image stands at the nearest station whose heading is within "
               "this of its own, degrees",
       .min = 0,
       .max = 180},
      {.name = "max_station_distance_ratio",
       .value = &o->max_station_distance_ratio,
       .help = "figures of regions: a held-out image farther from that station than this many times the "
               "stations' spacing is at none",
       .min = 0},
  };
  table.push_back({.name = "truth_sigma_m",
                   .value = &o->truth_sigma_m,
                   .help = "standard deviation of the true places, m per axis; below 0: that of the survey's "
                           "stated poses",
                   .min = -1});
  table.push_back({.name = "truth_sigma_deg",
                   .value = &o->truth_sigma_deg,
                   .help = "the same of the true rotations, degrees per axis; below 0: that of the survey's "
                           "stated poses",
                   .min = -1});
  table.push_back({.name = "truth_has_map_scale",
                   .value = &o->truth_has_map_scale,
                   .help = "the true poses have the map's own scale, as those of a reconstruction do; false: "
                           "they are in metres of their own, and the normalised error counts how well the "
                           "map's scale is known"});
  table.push_back({.name = "plan_must_fit",
                   .value = &o->plan_must_fit,
                   .help = "gate: where the map has a floor plan, its walls must fit the landmarks"});
  for (Option& option : DescribeOptions(&o->plan)) table.push_back(std::move(option));
  for (const auto& [name, value, help] :
       {std::tuple("scan_x_m", &o->scan_x_m, "with scans: distance of the laser ahead of the camera, m"),
        std::tuple("scan_y_m", &o->scan_y_m,
                   "with scans: distance of the laser to the left of the camera, m"),
        std::tuple("scan_heading_deg", &o->scan_heading_deg,
                   "with scans: turn of the laser's heading to the left of the camera's, degrees")}) {
    table.push_back({.name = name, .value = value, .help = help, .min = -1000, .max = 1000});
  }
  OptionTable localizer = DescribeOptions(&o->localizer);
  // Images of a survey come without gravity, and how fast a robot is nobody knows yet.
  std::erase_if(localizer, [](const Option& option) {
    return option.name == "floor_up_sigma_deg" || option.name == "max_up_sigmas" ||
           option.name == "budget_ms" || option.name == "core_speed";
  });
  table.insert(table.end(), localizer.begin(), localizer.end());
  return table;
}

Result<CheckMapReport> CheckMap(const std::shared_ptr<const Map>& map,
                                const std::vector<HeldOutImage>& images, const CheckMapOptions& options,
                                int num_threads, Progress& progress) {
  return CheckMaps({{map, images}}, options, num_threads, progress);
}

bool IsOfLeftOutRuns(const CheckMapReport& report) { return report.figures.contains(kLeftOutRunsFigure); }

Result<CheckMapReport> CheckMaps(const std::vector<MapTrial>& trials, const CheckMapOptions& options,
                                 int num_threads, Progress& progress) {
  CheckMapOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  std::vector<std::pair<const MapTrial*, const HeldOutImage*>> images;
  for (const MapTrial& trial : trials) {
    for (const HeldOutImage& image : trial.images) images.emplace_back(&trial, &image);
  }
  CheckMapReport report;
  report.images.resize(images.size());
  progress.Begin("localizing", static_cast<int64_t>(images.size()), "images");
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    report.images[i] = TryImage(images[i].first->map, *images[i].second, options);
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "localizing held-out images was stopped");
  SummarizeErrors(report.images, options, &report.figures);
  int num_tried = 0;
  for (const HeldOutResult& image : report.images) {
    if (!image.rejected.empty()) continue;
    ++num_tried;
    report.mean_sift_ms += image.sift_ms;
    report.mean_total_ms += image.total_ms;
  }
  report.mean_sift_ms /= std::max(1, num_tried);
  report.mean_total_ms /= std::max(1, num_tried);
  return report;
}

void AddFullFigures(const CheckMapReport& full, CheckMapReport* sparse) {
  const auto num_by_retrieval = [](const CheckMapReport& report) {
    return static_cast<double>(
        std::count_if(report.images.begin(), report.images.end(), [](const HeldOutResult& image) {
          return image.has_fix() && image.localization.scope != Scope::kAll;
        }));
  };
  sparse->figures["num_by_retrieval"] = num_by_retrieval(*sparse);
  sparse->figures["all_images_num_by_retrieval"] = num_by_retrieval(full);
  for (const char* name : {"num_localized", "localized_ratio", "precision_ratio"}) {
    const auto figure = full.figures.find(name);
    if (figure != full.figures.end()) sparse->figures[std::string("all_images_") + name] = figure->second;
  }
}

Status CheckGate(const CheckMapReport& report, const CheckMapOptions& options) {
  const auto fits = report.figures.find("plan_fits");
  if (options.plan_must_fit && fits != report.figures.end() && fits->second == 0) {
    return MakeError(ErrorCode::kGate,
                     "below the gate: the floor plan does not fit the landmarks: it is off by {:.2f} m and "
                     "{:.1f} deg, {:.0f} % of them lie on its walls; correct it, or the poses",
                     report.figures.at("plan_shift_m"), report.figures.at("plan_turn_deg"),
                     100 * report.figures.at("plan_on_walls_ratio"));
  }
  const double most_asked =
      std::max({options.min_localized_ratio, options.min_precision_ratio, options.min_region_localized_ratio,
                options.min_region_precision_ratio});
  if (report.images.empty() && most_asked > 0) {
    return MakeError(ErrorCode::kGate,
                     "below the gate: a ratio of at least {:.3f} is required, but there are no held-out "
                     "images{}; list some in queries.txt, or remove the gate",
                     most_asked, report.why_none.empty() ? "" : " and no left-out runs: " + report.why_none);
  }
  const auto check = [&](const std::string& name, double least) -> Status {
    if (least <= 0) return Ok();
    const auto figure = report.figures.find(name);
    const double found = figure == report.figures.end() ? 0 : figure->second;
    if (found >= least) return Ok();
    return MakeError(ErrorCode::kGate, "below the gate: {} is {:.3f}, at least {:.3f} is required", name,
                     found, least);
  };
  CAIRN_RETURN_IF_ERROR(check("localized_ratio", options.min_localized_ratio));
  CAIRN_RETURN_IF_ERROR(check("precision_ratio", options.min_precision_ratio));
  return CheckRegionGate(report, options);
}

}  // namespace cairn::check_map
