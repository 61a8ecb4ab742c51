#include "pipeline/commands/commands.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/blocks/map_head.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "core/images/image_file.h"
#include "pipeline/commands/open_plan.h"
#include "pipeline/commands/query_images.h"
#include "pipeline/program/json_text.h"
#include "runtime/belief/image_places.h"
#include "runtime/belief/plan_tracker.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"
#include "runtime/scans/read_scans.h"
#include "stages/decompose_views/picture.h"

namespace cairn::pipeline {
namespace {

using nlohmann::ordered_json;

// Places that are told, and drawn.
constexpr double kLeastTold = 0.001;
constexpr size_t kMaxNumTold = 20, kMaxNumDrawn = 6;
// The way is drawn where the place was as sure as this.
constexpr double kSure = 0.9;

struct FollowArguments {
  std::string views;
  std::string scans;
  int start = 0;
  std::string images;
  std::string camera;
  std::string cameras_path;
  std::vector<double> laser;  // empty: at the camera
  std::string svg;
  ScanSegmentsOptions segment_options;
  PlanTrackerOptions options;
  OptionArguments option_arguments;
};

// What the robot's camera says: image i was taken with scan i.
class FollowedImages {
 public:
  // Errors: those of ReadFile, Map::Open and CameraChoice::Make; InvalidArgument.
  static Result<FollowedImages> Open(const FollowArguments& arguments, size_t num_scans) {
    FollowedImages opened;
    CAIRN_ASSIGN_OR_RETURN(const std::string list, ReadFile(arguments.images));
    for (const std::string_view line : SplitLines(list)) opened.names_.emplace_back(Trim(line));
    if (opened.names_.size() != num_scans) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: {} lines for {} scans of {}; the image on line i was taken with scan i (an empty "
                       "line: none)",
                       arguments.images, opened.names_.size(), num_scans, arguments.scans);
    }
    Result<std::shared_ptr<const Map>> map = Map::Open(arguments.views);
    if (!map.ok())
      return MakeError(map.error().code, "--images are localized in a map: {}", map.error().message);
    opened.map_ = std::move(*map);
    CAIRN_ASSIGN_OR_RETURN(opened.cameras_,
                           CameraChoice::Make(arguments.camera, arguments.cameras_path, opened.map_));
    opened.localizer_.emplace(opened.map_);
    if (!arguments.laser.empty())
      opened.robot_in_camera_ = {{arguments.laser[0], arguments.laser[1]}, RadFromDeg(arguments.laser[2])};
    return opened;
  }

  // Nothing where none was taken.
  Result<std::optional<Localization>> Localize(size_t scan) {
    if (names_[scan].empty()) return std::optional<Localization>();
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(names_[scan]));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, cameras_->ForImage(grey.cols, grey.rows));
    CAIRN_ASSIGN_OR_RETURN(Localization found, localizer_->Localize(grey, camera));
    return std::optional<Localization>(std::move(found));
  }
  std::vector<PossiblePlace> Places(const Localization& found) const {
    return PlacesOf(found, map_->head(), robot_in_camera_);
  }

 private:
  std::vector<std::string> names_;
  std::shared_ptr<const Map> map_;
  std::optional<CameraChoice> cameras_;
  std::optional<Localizer> localizer_;
  PlanarPose robot_in_camera_;
};

ordered_json PlacesJson(const PoseBelief& belief) {
  ordered_json places = ordered_json::array();
  for (const PossiblePlace& place : belief.places()) {
    if (place.probability < kLeastTold || places.size() == kMaxNumTold) break;
    places.push_back(
        {{"x", place.pose.position.x()},
         {"y", place.pose.position.y()},
         {"heading_deg", DegFromRad(place.pose.heading_rad)},
         {"probability", place.probability},
         {"determined", IsDetermined(place.covariance)},
         {"covariance", std::vector<double>(place.covariance.data(), place.covariance.data() + 9)}});
  }
  return places;
}

// The ways along which the place was sure, and the places in the end.
decompose_views::ViewsOverlay Overlay(std::vector<std::vector<Eigen::Vector2d>> ways,
                                      const PoseBelief& belief, int num_scans) {
  decompose_views::ViewsOverlay overlay;
  std::erase_if(ways, [](const auto& way) { return way.size() < 2; });
  overlay.paths = std::move(ways);
  for (const PossiblePlace& place : belief.places()) {
    if (place.probability < 0.01 || overlay.robots.size() == kMaxNumDrawn) break;
    overlay.robots.push_back(
        {place.pose.position, place.pose.heading_rad, fmt::format("{:.0f} %", 100 * place.probability)});
  }
  overlay.captions = {fmt::format("{} scans", num_scans),
                      fmt::format("its way where {:.0f} % sure", 100 * kSure)};
  return overlay;
}

// By the wheels from one scan to the next.  Errors: InvalidArgument (a log without odometry).
Result<FloorMotion> MotionTo(const ScanView& scan, const ScanView& before, const std::string& log) {
  if (!scan.odometry || !before.odometry) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} has no odometry (ODOM lines, or FLASER lines that state it); scans of which nobody "
                     "knows how the robot drove between them are located one by one: cairn plan locate",
                     log);
  }
  const PlanarPose moved = MotionBetween(*before.odometry, *scan.odometry);
  return FloorMotion{moved.position, moved.heading_rad};
}

Status CheckArguments(const FollowArguments& arguments) {
  if (arguments.images.empty() &&
      !(arguments.camera.empty() && arguments.cameras_path.empty() && arguments.laser.empty())) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--camera, --cameras and --laser-in-camera are of images; name these with --images");
  }
  return CheckCameraArguments(arguments.camera, arguments.cameras_path);
}

Status RunFollow(const FollowArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_RETURN_IF_ERROR(CheckArguments(arguments));
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Views> views,
                         OpenPlanFor(arguments.views, arguments.options.locator, environment));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<ScanView> scans,
                         ReadScans(arguments.scans, arguments.segment_options));
  const int num_scans = static_cast<int>(scans.size());
  if (arguments.start < 0 || arguments.start >= num_scans) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: --start {}: it has {} scan(s), numbered 0 to {}",
                     arguments.scans, arguments.start, num_scans, num_scans - 1);
  }
  std::optional<FollowedImages> images;
  if (!arguments.images.empty()) {
    CAIRN_ASSIGN_OR_RETURN(images, FollowedImages::Open(arguments, scans.size()));
  }
  auto tracker = PlanTracker::Make(*views, arguments.options);
  if (!tracker.ok())
    return MakeError(tracker.error().code, "{}: {}", arguments.views, tracker.error().message);
  environment.progress->Begin("follow", num_scans - arguments.start, "scans");
  std::vector<std::vector<Eigen::Vector2d>> ways(1);
  int64_t num_sure = 0;
  for (int i = arguments.start; i < num_scans; ++i) {
    if (environment.progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
    if (i > arguments.start) {
      CAIRN_ASSIGN_OR_RETURN(const FloorMotion motion, MotionTo(scans[i], scans[i - 1], arguments.scans));
      CAIRN_RETURN_IF_ERROR(tracker->Move(motion));
    }
    ordered_json line = {{"scan", i}, {"beams", scans[i].beams.size()}};
    const Status seen = tracker->SeeScan(scans[i]);
    if (!seen.ok() && seen.error().code != ErrorCode::kNoData)
      return MakeError(seen.error().code, "{}: scan {}: {}", arguments.scans, i, seen.error().message);
    if (!seen.ok()) line["reason"] = seen.error().message;
    if (images) {
      CAIRN_ASSIGN_OR_RETURN(const std::optional<Localization> found, images->Localize(i));
      if (found) {
        line["image"] = found->has_fix() ? "fix" : NoFixName(found->reason);
        tracker->SeeImage(images->Places(*found));
      }
    }
    const PoseBelief& belief = tracker->belief();
    line["places"] = PlacesJson(belief);
    line["elsewhere"] = belief.elsewhere();
    *environment.out << JsonText(line) << "\n";
    const bool is_sure = !belief.places().empty() && belief.places()[0].probability >= kSure &&
                         IsDetermined(belief.places()[0].covariance);
    num_sure += is_sure;
    if (is_sure) {
      ways.back().push_back(belief.places()[0].pose.position);
    } else if (!ways.back().empty()) {
      ways.emplace_back();
    }
    environment.progress->Advance();
  }
  environment.progress->End();
  if (!arguments.svg.empty()) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
        arguments.svg, decompose_views::DrawViews(
                           *views, Overlay(std::move(ways), tracker->belief(), num_scans - arguments.start),
                           /*regions=*/false)));
  }
  environment.report->in = {{"scans", num_scans - arguments.start}};
  environment.report->out = {{"scans where one place is sure", num_sure}};
  return Ok();
}

}  // namespace

Command FollowScansCommand() {
  auto arguments = std::make_shared<FollowArguments>();
  Command command;
  command.name = "follow";
  command.summary = "Find a robot in a floor plan by its scans and wheels, and follow it";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("views", arguments->views, "the plan (views.db, or a map that has it)")
        .Required()
        .Type("FILE");
    parser.Add("scans", arguments->scans, "Carmen log, or LaserScan and Odometry messages as JSON lines")
        .Required()
        .Type("FILE");
    parser.Add("--start", arguments->start, "number of the first scan, from 0").Type("INT");
    parser
        .Add("--images", arguments->images,
             "also localize images in the map: a list, the image on line i taken with scan i (empty: none)")
        .Type("FILE");
    parser.Add("--camera", arguments->camera, "camera of the images [the map's camera of that size]")
        .Type("MODEL,W,H,P...");
    parser.Add("--cameras", arguments->cameras_path, "cameras.txt; chosen by image size").Type("FILE");
    parser
        .Add("--laser-in-camera", arguments->laser,
             "where the laser is: metres ahead and to the left of the camera, degrees to the left")
        .Values(3)
        .SeparatedByCommas()
        .Type("X,Y,DEG");
    parser.Add("--svg", arguments->svg, "also draw the way over the plan").Type("FILE.svg");
    OptionTable table = DescribeOptions(&arguments->options);
    for (Option& option : DescribeOptions(&arguments->segment_options)) table.push_back(std::move(option));
    arguments->option_arguments.Add(parser, std::move(table),
                                    {"wheel_way_ratio", "wheel_turn_ratio", "wheel_drift_deg", "max_range_m",
                                     "surprise_ratio", "lost_ratio", "sigma_wall_m"});
  };
  command.run = [arguments](const CommandEnvironment& environment) {
    return RunFollow(*arguments, environment);
  };
  return command;
}

}  // namespace cairn::pipeline
