#include "stages/check_map/command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>
#include <opencv2/core/utility.hpp>

#include "core/blocks/map_documents.h"
#include "core/capture/capture.h"
#include "core/features/features.h"
#include "core/files/file.h"
#include "core/files/output_path.h"
#include "core/learned/feature_finder.h"
#include "core/map/left_out_folder.h"
#include "runtime/scans/read_scans.h"
#include "stages/check_map/check_map.h"
#include "stages/check_map/plan_agreement.h"
#include "stages/check_map/promise_figures.h"
#include "stages/check_map/region_figures.h"
#include "stages/check_map/report.h"

namespace cairn::check_map {
namespace {

namespace fs = std::filesystem;

// Focal lengths that differ by less may be two statements about one camera.
constexpr double kSameFocalRatio = 0.1;

struct Arguments {
  std::string map_path;
  std::string queries_path;
  std::string left_out_path;
  std::string capture_path;
  std::vector<std::string> foreign_paths;
  std::string scans_path;
  std::string model_path;
  std::string output_path;
  std::string details_path;
  bool json = false;
  CheckMapOptions options;
  OptionArguments option_arguments;
};

// What the map's images showed of the camera, if it is the same one as far as its statement tells; else the
// capture's.
Result<Camera> CameraOf(const CaptureImage& image, const Capture& capture, const MapHead& rows) {
  const auto given = capture.cameras.find(image.camera_id);
  if (given == capture.cameras.end()) {
    return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which cameras.txt lacks", capture.root,
                     image.name, image.camera_id);
  }
  for (const Camera& camera : rows.cameras) {
    if (camera.camera_id == image.camera_id && camera.width == given->second.width &&
        camera.height == given->second.height &&
        std::abs(camera.MeanFocal() / given->second.MeanFocal() - 1) < kSameFocalRatio) {
      return camera;
    }
  }
  return given->second;
}

// An image of a capture: its file, or its features.
HeldOutImage ImageOf(const CaptureImage& image, const Capture& capture, Camera camera) {
  HeldOutImage held_out{image.name, capture.ImagePath(image), std::move(camera), image.cam_from_world};
  if (const FeaturesRow* row = capture.FeaturesOf(image); row != nullptr) held_out.features = *row;
  return held_out;
}

Result<std::vector<HeldOutImage>> ReadHeldOutImages(const std::string& list, const Capture& capture,
                                                    const MapHead& rows) {
  std::vector<Reject> rejects;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<CaptureImage> queries, ReadImagesText(list, &rejects));
  for (const Reject& reject : rejects) spdlog::warn("{}: {}: {}", list, reject.name, reject.reason);
  std::vector<HeldOutImage> images;
  for (const CaptureImage& query : queries) {
    CAIRN_ASSIGN_OR_RETURN(Camera camera, CameraOf(query, capture, rows));
    images.push_back(ImageOf(query, capture, std::move(camera)));
  }
  return images;
}

// Images of the survey that a map lacks, with the cameras that it has for them.
Result<std::vector<HeldOutImage>> ReadLeftOutImages(const std::string& list, const Capture& capture,
                                                    const MapHead& head) {
  const auto find = [](const std::vector<Camera>& cameras, CameraId camera_id) {
    return std::find_if(cameras.begin(), cameras.end(),
                        [&](const Camera& camera) { return camera.camera_id == camera_id; });
  };
  std::vector<Reject> rejects;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<CaptureImage> listed, ReadImagesText(list, &rejects));
  std::vector<HeldOutImage> images;
  for (const CaptureImage& row : listed) {
    const auto camera = find(head.cameras, row.camera_id);
    if (camera == head.cameras.end()) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which the map beside it lacks", list,
                       row.name, row.camera_id);
    }
    HeldOutImage image = ImageOf(row, capture, *camera);
    if (const std::optional<PanoramaView> view = ParsePanoramaViewName(row.name)) {
      const auto stated = find(head.stated_cameras, row.camera_id);
      image.path = capture.ImagePath({.name = view->panorama_name});
      image.view = {*view, stated == head.stated_cameras.end() ? *camera : *stated};
    }
    images.push_back(std::move(image));
  }
  return images;
}

// The maps that are tried, and the images that try them: the map itself, or those of left-out runs.
struct Trials {
  std::vector<MapTrial> trials;
  std::vector<MapRows> rows;  // of the maps of left-out runs
  int num_left_out_runs = 0;
  std::string why_none;
  std::map<std::string, std::string> stage_options;  // of leave_out
};

Result<Trials> ReadTrials(const Arguments& arguments, const std::shared_ptr<const Map>& map,
                          const MapRows& rows) {
  Trials trials;
  const bool is_given = !arguments.queries_path.empty();
  if (!is_given && arguments.left_out_path.empty()) return trials;
  const std::string root =
      arguments.capture_path.empty() ? FolderOf(arguments.queries_path) : arguments.capture_path;
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(root));
  if (is_given) {
    CAIRN_ASSIGN_OR_RETURN(std::vector<HeldOutImage> images,
                           ReadHeldOutImages(arguments.queries_path, capture, rows));
    trials.trials.push_back({map, std::move(images)});
    return trials;
  }
  CAIRN_ASSIGN_OR_RETURN(const LeftOutFolder left_out, ReadLeftOutFolder(arguments.left_out_path));
  trials.num_left_out_runs = left_out.num_runs;
  trials.why_none = left_out.why_none;
  for (const LeftOutFolder::Round& round : left_out.rounds) {
    CAIRN_ASSIGN_OR_RETURN(MapRows without, ReadMapRows(round.map_path));
    CAIRN_ASSIGN_OR_RETURN(std::vector<HeldOutImage> images,
                           ReadLeftOutImages(round.list_path, capture, without));
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Map> map_without, Map::Open(round.map_path));
    trials.trials.push_back({std::move(map_without), std::move(images)});
    const auto options = without.stage_options.find("leave_out");
    if (options != without.stage_options.end()) trials.stage_options.insert(*options);
    trials.rows.push_back(std::move(without));
  }
  return trials;
}

// What finds the features of images to try the map with; null: SIFT, or those that the capture has.
Result<std::shared_ptr<const FeatureFinder>> FinderOf(const MapRows& rows, const Arguments& arguments) {
  if (arguments.model_path.empty()) return std::shared_ptr<const FeatureFinder>();
  CAIRN_ASSIGN_OR_RETURN(auto finder,
                         FeatureFinder::Make(arguments.options.localizer.sift, arguments.model_path));
  CAIRN_RETURN_IF_ERROR(CheckSameKind(finder->kind(), rows.descriptor_kind, arguments.model_path));
  return finder;
}

// Localizes the images and adds what is known of them; figures are of all trials together.
Result<CheckMapReport> CheckTrials(const Trials& trials, const MapRows& rows, const Arguments& arguments,
                                   const CommandEnvironment& environment) {
  CheckMapReport report;
  report.why_none = trials.why_none;
  if (trials.trials.empty()) return report;
  CAIRN_ASSIGN_OR_RETURN(
      report, CheckMaps(trials.trials, arguments.options, environment.num_threads, *environment.progress));
  if (rows.documents != "all") {
    std::vector<MapTrial> full = trials.trials;
    for (size_t i = 0; i < full.size(); ++i) {
      CAIRN_ASSIGN_OR_RETURN(full[i].map,
                             Map::FromRows(WithAllDocuments(trials.rows.empty() ? rows : trials.rows[i])));
    }
    CAIRN_ASSIGN_OR_RETURN(
        const CheckMapReport all_images,
        CheckMaps(full, arguments.options, environment.num_threads, *environment.progress));
    AddFullFigures(all_images, &report);
  }
  FindStations(rows, arguments.options, &report.images);
  report.regions = SummarizeRegions(rows, report.images, arguments.options);
  if (trials.num_left_out_runs > 0) {
    report.figures[kLeftOutRunsFigure] = trials.num_left_out_runs;
  } else if (rows.findings.promise) {  // which was made with left-out images
    AddPromiseFigures(rows, report.images, &report.figures);
  }
  return report;
}

Result<std::vector<HeldOutImage>> ReadForeignImages(const std::vector<std::string>& roots) {
  std::vector<HeldOutImage> images;
  for (const std::string& root : roots) {
    CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(root));
    for (const auto* list : {&capture.images, &capture.queries}) {
      for (const CaptureImage& image : *list) {
        const auto camera = capture.cameras.find(image.camera_id);
        if (camera == capture.cameras.end()) continue;  // ReadCapture has said so
        images.push_back(ImageOf(image, capture, camera->second));
        images.back().cam_from_world.reset();
      }
    }
  }
  return images;
}

void WarnOfRejects(const CheckMapReport& report) {
  for (const HeldOutResult& image : report.images) {
    if (!image.rejected.empty()) spdlog::warn("not tried: {}: {}", image.name, image.rejected);
  }
}

void ReportHeldOut(const CheckMapReport& held_out, StageReport* report) {
  report->in = {{IsOfLeftOutRuns(held_out) ? "left-out images" : "held-out images",
                 static_cast<int64_t>(held_out.images.size())}};
  const auto localized = held_out.figures.find("num_localized");
  if (localized != held_out.figures.end())
    report->out = {{"localized", static_cast<int64_t>(localized->second)}};
  std::vector<Reject> rejects;
  for (const HeldOutResult& image : held_out.images) {
    if (!image.rejected.empty()) rejects.push_back({image.name, image.rejected});
  }
  AddRejects("images", rejects, report);
}

Status Seal(MapRows rows, const CheckMapReport& report, const Trials& trials, const CheckMapOptions& checked,
            const std::string& path) {
  CheckMapOptions options = checked;
  rows.stage_options.insert(trials.stage_options.begin(), trials.stage_options.end());
  rows.sealed = true;
  if (!report.images.empty() || !report.plan_verdict.empty()) rows.self_test = report.figures;
  if (!report.images.empty()) {
    rows.findings.self_test_regions = report.regions;
    if (rows.findings.promise && !IsOfLeftOutRuns(report))
      rows.findings.promise->held_out = CalibrationCurve(PromiseOutcomes(rows, report.images));
  }
  rows.stage_options["check_map"] = OptionsToml(DescribeOptions(&options));
  return WriteMapRows(rows, path);
}

// Compares fixes and landmarks with the floor plan, where the map has one.
Status CheckPlan(const MapRows& rows, const Arguments& arguments, const CommandEnvironment& environment,
                 CheckMapReport* report) {
  if (rows.views.plan.walls.empty()) {
    if (arguments.scans_path.empty()) return Ok();
    return MakeError(ErrorCode::kInvalidArgument, "--scans {}: map '{}' has no floor plan to locate them in",
                     arguments.scans_path, rows.name);
  }
  const Result<PlanFit> fit = FitPlan(rows, arguments.options.plan);
  if (!fit.ok() && fit.error().code != ErrorCode::kNoData) return fit.error();
  if (fit.ok()) {
    AddPlanFigures(*fit, &report->figures);
    report->plan_verdict = PlanVerdict(*fit);
    if (!fit->fits) spdlog::warn("the floor plan {}", report->plan_verdict);
  } else {
    spdlog::warn("{}", fit.error().message);
  }
  std::vector<ScanView> scans;
  if (!arguments.scans_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(scans, ReadScans(arguments.scans_path, {}));
  }
  return CompareWithPlan(rows, report->images, scans, arguments.options, environment.num_threads,
                         *environment.progress, &report->figures);
}

// Refuses arguments for held-out images or scans where there are none.
Status CheckWhatIsRead(const Arguments& arguments) {
  if (arguments.queries_path.empty() && arguments.left_out_path.empty() && !arguments.capture_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--capture {}: is used for the images of --queries or --left-out only; give --queries, "
                     "--left-out, or leave it out",
                     arguments.capture_path);
  }
  if (!arguments.left_out_path.empty() && arguments.capture_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--left-out {}: has the names of images; give --capture, which has the images",
                     arguments.left_out_path);
  }
  if (arguments.queries_path.empty() && !arguments.scans_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--scans {}: scan i was taken with held-out image i; give --queries, or leave it out",
                     arguments.scans_path);
  }
  if (arguments.queries_path.empty() && arguments.left_out_path.empty() && arguments.output_path.empty()) {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"min_localized_ratio", "min_precision_ratio", "min_region_localized_ratio",
         "min_region_precision_ratio", "min_region_held_out", "plan_must_fit"},
        "is a gate for held-out images or for a map that is sealed; give --queries or -o, or leave it out"));
  }
  if (arguments.scans_path.empty()) {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"scan_x_m", "scan_y_m", "scan_heading_deg"},
        "is the pose of the laser of --scans; give --scans, or leave it out"));
  }
  return Ok();
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_RETURN_IF_ERROR(CheckWhatIsRead(arguments));
  for (const std::string& path : {arguments.output_path, arguments.details_path}) {
    if (!path.empty()) CAIRN_RETURN_IF_ERROR(CheckCanBeReplaced(path));
  }
  cv::setNumThreads(1);  // images in parallel, each on one thread: times are for one core
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(arguments.map_path));
  CAIRN_ASSIGN_OR_RETURN(MapRows rows, ReadMapRows(arguments.map_path));
  if (rows.sealed && !arguments.output_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is already sealed; -o is for a map from emit-map",
                     arguments.map_path);
  }
  CAIRN_ASSIGN_OR_RETURN(Trials trials, ReadTrials(arguments, map, rows));
  std::shared_ptr<const FeatureFinder> finder;
  if (!trials.trials.empty() || !arguments.foreign_paths.empty()) {
    CAIRN_ASSIGN_OR_RETURN(finder, FinderOf(rows, arguments));
  }
  for (MapTrial& trial : trials.trials) {
    for (HeldOutImage& image : trial.images) image.finder = finder;
  }
  CAIRN_ASSIGN_OR_RETURN(CheckMapReport held_out, CheckTrials(trials, rows, arguments, environment));
  WarnOfRejects(held_out);
  CAIRN_RETURN_IF_ERROR(CheckPlan(rows, arguments, environment, &held_out));
  std::optional<CheckMapReport> foreign;
  if (!arguments.foreign_paths.empty()) {
    CAIRN_ASSIGN_OR_RETURN(std::vector<HeldOutImage> images, ReadForeignImages(arguments.foreign_paths));
    for (HeldOutImage& image : images) image.finder = finder;
    CAIRN_ASSIGN_OR_RETURN(
        foreign, CheckMap(map, images, arguments.options, environment.num_threads, *environment.progress));
    WarnOfRejects(*foreign);
  }
  const PrintedReport report{.rows = &rows,
                             .map_bytes = static_cast<int64_t>(fs::file_size(arguments.map_path)),
                             .held_out = &held_out,
                             .foreign = foreign ? &*foreign : nullptr,
                             .options = &arguments.options};
  *environment.out << (arguments.json ? ReportJson(report, true) : ReportText(report));
  // Also where the gate refuses the map, so that users can see why.
  if (!arguments.details_path.empty())
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.details_path, ReportJson(report, false)));
  ReportHeldOut(held_out, environment.report);
  if (!held_out.images.empty() || !arguments.output_path.empty())
    CAIRN_RETURN_IF_ERROR(CheckGate(held_out, arguments.options));
  if (arguments.output_path.empty()) return Ok();
  return Seal(std::move(rows), held_out, trials, arguments.options, arguments.output_path);
}

}  // namespace

Command CheckMapCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "check",
      .summary = "Localize held-out images in a map, print the figures, and seal the map",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "map").Required().Type("MAP");
            const Argument queries = parser
                                         .Add("--queries", arguments->queries_path,
                                              "held-out images with their poses (queries.txt)")
                                         .Type("queries.txt");
            parser
                .Add("--left-out", arguments->left_out_path,
                     "folder of cairn stage leave-out: maps without runs of the survey's images, which try "
                     "them")
                .Type("FOLDER")
                .Excludes(queries);
            parser
                .Add("--capture", arguments->capture_path,
                     "capture that has the images [the folder of queries.txt]")
                .Type("CAPTURE");
            parser
                .Add("--foreign", arguments->foreign_paths,
                     "capture or folder of images of another place: none may be localized")
                .Type("FOLDER");
            parser
                .Add("--model", arguments->model_path,
                     "Learned model that found the features of the map's survey ([extract_features] model): "
                     "it "
                     "finds those of the images, too")
                .Type("FILE.onnx");
            parser
                .Add("--scans", arguments->scans_path,
                     "Carmen log: laser scan i was taken with held-out image i; it is located in the floor "
                     "plan and compared with the fix")
                .Type("FILE");
            parser.Add("-o,--output", arguments->output_path, "sealed map to write, with the figures inside")
                .Type("MAP");
            parser.AddFlag("--json", arguments->json, "print JSON, every image included");
            parser
                .Add("--details", arguments->details_path,
                     "file to write the same JSON to, without times, for cairn report --check")
                .Type("FILE.json");
            arguments->option_arguments.Add(
                parser, DescribeOptions(&arguments->options),
                {"gross_error_m", "gross_error_deg", "min_localized_ratio", "min_precision_ratio",
                 "min_region_localized_ratio", "min_region_precision_ratio", "plan_must_fit", "truth_sigma_m",
                 "truth_sigma_deg", "scan_x_m", "scan_y_m", "scan_heading_deg"});
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
      .stage = "check_map",
      .former_names = {"check-map"},
  };
}

}  // namespace cairn::check_map
