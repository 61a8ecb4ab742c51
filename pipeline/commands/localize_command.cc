#include "pipeline/commands/commands.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "core/atlas/atlas_file.h"
#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/capture/capture.h"
#include "core/colmap/image_list.h"
#include "core/colmap/rig_config.h"
#include "core/features/features.h"
#include "core/images/image_file.h"
#include "core/learned/feature_finder.h"
#include "pipeline/commands/in_atlas.h"
#include "pipeline/commands/localization_json.h"
#include "pipeline/commands/localize_arguments.h"
#include "pipeline/commands/odometry.h"
#include "pipeline/commands/query_images.h"
#include "pipeline/commands/visual_answer.h"
#include "pipeline/program/json_text.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/robot_log/robot_log.h"

namespace cairn::pipeline {
namespace {

// An image, or with --rig the reference camera's, and which way was up at it.
struct Asked {
  std::string image;
  Result<std::optional<SensedUp>> up = std::optional<SensedUp>();
};

// An image's answer.
struct Answer {
  std::string image;
  CameraId camera_id = 0;
  Pose cam_from_rig;  // of the image's camera, where the fix is a rig's
  Result<Localization> localization = Error{};
  std::optional<Result<TrackedVisualPose>> visual;
  std::optional<Disagreement> disagreement;  // where both have a fix
  std::optional<UncertainPose> believed;     // without a fix: where odometry has the camera
  std::optional<QueryFrame> frame;           // where frames are logged
  double seconds = 0;                        // of the processor, without reading the image
};

// Processor time of this thread.
double ThreadSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// How fast this computer does the work that budget_ms bounds (LocalizerOptions::core_speed).
class CoreSpeed {
 public:
  void Add(const Answer& answer) {
    if (!answer.localization.ok() || !(answer.localization->work_ms > 0) || !(answer.seconds > 0)) return;
    work_ms_.push_back(answer.localization->work_ms);
    ms_.push_back(1000 * answer.seconds);
    speeds_.push_back(work_ms_.back() / ms_.back());
  }
  void Report() const {
    if (speeds_.empty()) return;
    // A tenth of the images takes longer than their work on a core of this speed.
    constexpr double kSlow = 0.1;
    spdlog::info(
        "work of {:.1f} ms on the median, {:.1f} at most, took {:.1f} and {:.1f} ms of processor time; nine "
        "images in ten take no longer than their work with --core-speed {:.2f}",
        Median(work_ms_), Quantile(work_ms_, 1), Median(ms_), Quantile(ms_, 1), Quantile(speeds_, kSlow));
  }

 private:
  std::vector<double> work_ms_, ms_, speeds_;
};

// What follows a camera from frame to frame; none where there is no sequence.
struct Trackers {
  std::optional<SureTracker> in_space;
  std::optional<VisualTracker> on_floor;
  std::optional<Odometry> odometry;
  double period_s = 0;

  static Result<Trackers> Make(const LocalizeArguments& arguments, const std::shared_ptr<const Map>& map) {
    Trackers trackers;
    if (!arguments.is_sequence) return trackers;
    if (arguments.estimator != "visual-map") {
      CAIRN_ASSIGN_OR_RETURN(
          trackers.in_space,
          SureTracker::Make(map, arguments.options, arguments.tracker_options, arguments.sure_options));
    }
    if (!arguments.odometry_path.empty()) {
      CAIRN_ASSIGN_OR_RETURN(trackers.odometry, Odometry::Read(arguments.odometry_path));
    }
    trackers.period_s = arguments.period_s;
    if (arguments.estimator == "pnp") return trackers;
    VisualTrackerOptions options = arguments.visual_tracker_options;
    options.votes = arguments.tracker_options.votes;
    CAIRN_ASSIGN_OR_RETURN(trackers.on_floor,
                           VisualTracker::Make(map, arguments.visual_options, options,
                                               arguments.filter_options, arguments.estimate_options));
    return trackers;
  }

  // It drove, and time passed, whether or not this image can be read.
  Status MoveTo(const std::string& image) {
    const bool believes = in_space && in_space->belief();
    if (believes && period_s > 0) CAIRN_RETURN_IF_ERROR(in_space->Elapse(period_s));
    if (!odometry) return Ok();
    return odometry->MoveToNext(image, [&](const Eigen::Vector2d& way_m, double turn_left_rad) -> Status {
      if (in_space) CAIRN_RETURN_IF_ERROR(in_space->Move(way_m, turn_left_rad));
      return on_floor ? on_floor->Move(way_m, turn_left_rad) : Ok();
    });
  }

  // Which way is up there.
  Status SenseUp(const Result<std::optional<SensedUp>>& told, QueryFrame* frame) {
    CAIRN_ASSIGN_OR_RETURN(const std::optional<SensedUp> up, told);
    if (!up) return Ok();
    frame->set_up(*up);
    return in_space ? in_space->SenseUp(up->direction, up->sigma_deg) : Ok();
  }

  // Where odometry has a camera that was not found.
  std::optional<UncertainPose> Believed(const Result<Localization>& found) const {
    const bool has_fix = found.ok() && found->has_fix();
    return odometry && in_space && !has_fix ? in_space->Believed() : std::nullopt;
  }
};

// By the visual map and, with --estimator both, by PnP too.
Answer LocateByViews(const Asked& asked, const std::shared_ptr<const Map>& map, const VisualMap& visual,
                     const CameraChoice& cameras, const LocalizeArguments& arguments, Trackers* trackers) {
  Answer answer{.image = asked.image};
  const auto locate = [&]() -> Result<TrackedVisualPose> {
    CAIRN_RETURN_IF_ERROR(trackers->MoveTo(asked.image));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(asked.image));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, cameras.ForImage(grey.cols, grey.rows));
    answer.camera_id = camera.camera_id;
    const Localizer localizer(map, arguments.options);
    answer.frame.emplace(localizer, grey, camera);
    CAIRN_RETURN_IF_ERROR(trackers->SenseUp(asked.up, &*answer.frame));
    CAIRN_ASSIGN_OR_RETURN(const Query* query, answer.frame->WithAllFeatures());
    if (trackers->in_space) {
      CAIRN_ASSIGN_OR_RETURN(answer.localization, trackers->in_space->TrackFrame(&*answer.frame));
    } else if (arguments.estimator == "both") {
      CAIRN_ASSIGN_OR_RETURN(answer.localization, localizer.LocalizeQuery(*query, std::nullopt));
    }
    if (trackers->on_floor) return trackers->on_floor->See(*query);
    CAIRN_ASSIGN_OR_RETURN(const auto seen, visual.Match(*query));
    CAIRN_ASSIGN_OR_RETURN(VisualPose pose, EstimateVisualPose(visual, seen, arguments.estimate_options));
    return TrackedVisualPose{std::move(pose)};
  };
  answer.visual = locate();
  if (arguments.log_folder.empty()) answer.frame.reset();
  answer.believed = trackers->Believed(answer.localization);
  if (!answer.visual->ok()) {
    answer.localization = answer.visual->error();
  } else if (arguments.estimator == "visual-map") {
    answer.localization = Localization();  // none in space
  } else if (answer.localization->has_fix() && (*answer.visual)->pose.flag == VisualFlag::kNone) {
    answer.disagreement =
        Compare(FloorFixOf(*answer.localization, map->head().floor_from_world), (*answer.visual)->pose);
  }
  return answer;
}

// What the cameras of a rig see.
Answer LocalizeRigImages(const Asked& asked, const std::vector<RigCamera>& rig,
                         const std::shared_ptr<const Map>& map, const CameraChoice& cameras,
                         const LocalizeArguments& arguments) {
  Answer answer{.image = asked.image};
  answer.localization = [&]() -> Result<Localization> {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<RigImage> images, ReadRigImages(asked.image, rig, cameras));
    answer.camera_id = images.front().camera.camera_id;
    answer.cam_from_rig = rig.front().cam_from_rig;
    CAIRN_ASSIGN_OR_RETURN(const std::optional<SensedUp> up, asked.up);
    answer.seconds = -ThreadSeconds();
    return Localizer(map, arguments.options).LocalizeRig(images, std::nullopt, up);
  }();
  answer.seconds += ThreadSeconds();
  return answer;
}

Answer LocalizeImage(const Asked& asked, const std::shared_ptr<const Map>& map, const CameraChoice& cameras,
                     const LocalizeArguments& arguments) {
  Answer answer{.image = asked.image};
  answer.localization = [&]() -> Result<Localization> {
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(asked.image));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, cameras.ForImage(grey.cols, grey.rows));
    answer.camera_id = camera.camera_id;
    Localizer localizer(map, arguments.options);
    CAIRN_ASSIGN_OR_RETURN(const std::optional<SensedUp> up, asked.up);
    answer.seconds = -ThreadSeconds();
    if (arguments.log_folder.empty()) return localizer.Localize(grey, camera, std::nullopt, up);
    answer.frame.emplace(localizer, grey, camera);
    if (up) answer.frame->set_up(*up);
    CAIRN_ASSIGN_OR_RETURN(const Query* query, answer.frame->WithAllFeatures());
    return localizer.LocalizeQuery(*query, std::nullopt);
  }();
  answer.seconds += ThreadSeconds();
  return answer;
}

// By features that another program found, or that a model finds: one of the two.
Answer LocalizeByFeatures(const Asked& asked, const GivenFeatures* given, const FeatureFinder* finder,
                          const std::shared_ptr<const Map>& map, const CameraChoice& cameras,
                          const LocalizeArguments& arguments) {
  Answer answer{.image = asked.image};
  answer.localization = [&]() -> Result<Localization> {
    Features features;
    Camera camera;
    if (given != nullptr) {
      CAIRN_ASSIGN_OR_RETURN(features, given->Find(asked.image));
      CAIRN_ASSIGN_OR_RETURN(camera, given->CameraOf(asked.image, cameras, map->head()));
    } else {
      CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(asked.image));
      CAIRN_ASSIGN_OR_RETURN(camera, cameras.ForImage(grey.cols, grey.rows));
      CAIRN_ASSIGN_OR_RETURN(features, finder->Find(grey));
    }
    answer.camera_id = camera.camera_id;
    CAIRN_ASSIGN_OR_RETURN(const std::optional<SensedUp> up, asked.up);
    return Localizer(map, arguments.options).LocalizeFeatures(std::move(features), camera, std::nullopt, up);
  }();
  return answer;
}

// The same for the next frame of a sequence.
Answer TrackImage(const Asked& asked, const std::shared_ptr<const Map>& map, const CameraChoice& cameras,
                  const LocalizeArguments& arguments, Trackers* trackers) {
  Answer answer{.image = asked.image};
  answer.localization = [&]() -> Result<Localization> {
    CAIRN_RETURN_IF_ERROR(trackers->MoveTo(asked.image));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(asked.image));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, cameras.ForImage(grey.cols, grey.rows));
    answer.camera_id = camera.camera_id;
    answer.frame.emplace(Localizer(map, arguments.options), grey, camera);
    CAIRN_RETURN_IF_ERROR(trackers->SenseUp(asked.up, &*answer.frame));
    answer.seconds = -ThreadSeconds();
    return trackers->in_space->TrackFrame(&*answer.frame);
  }();
  answer.seconds += ThreadSeconds();
  if (arguments.log_folder.empty()) answer.frame.reset();
  answer.believed = trackers->Believed(answer.localization);
  return answer;
}

nlohmann::ordered_json PnpJson(const Answer& answer) {
  nlohmann::ordered_json json = {{"image", answer.image}};
  if (answer.localization.ok()) {
    json.update(LocalizationJson(*answer.localization));
  } else {
    json = ErrorJson(answer.image, answer.localization.error());
  }
  if (answer.believed) json["believed"] = PoseJson(answer.believed->pose, answer.believed->covariance);
  return json;
}

nlohmann::ordered_json AnswerJson(const Answer& answer, const LocalizeArguments& arguments) {
  if (!answer.visual) return PnpJson(answer);
  if (!answer.visual->ok()) return ErrorJson(answer.image, answer.visual->error());
  const nlohmann::ordered_json on_floor =
      arguments.is_sequence ? TrackedJson(**answer.visual) : VisualJson((*answer.visual)->pose);
  if (arguments.estimator == "visual-map") {
    nlohmann::ordered_json json = {{"image", answer.image}};
    json.update(on_floor);
    return json;
  }
  nlohmann::ordered_json json = PnpJson(answer);
  json["visual_map"] = on_floor;
  if (answer.disagreement) json["disagreement"] = DisagreementJson(*answer.disagreement);
  return json;
}

// The log, where one is written.
Result<std::optional<RobotLog>> OpenLog(const LocalizeArguments& arguments, const Map& map) {
  std::optional<RobotLog> log;
  if (arguments.log_folder.empty()) return log;
  RobotLogOptions options{.keep_images = arguments.log_images};
  if (arguments.log_mb_per_day > 0) options.max_mb_per_day = arguments.log_mb_per_day;
  CAIRN_ASSIGN_OR_RETURN(RobotLog opened,
                         RobotLog::Open(arguments.log_folder, map.head(), options, ReadMachineClocks()));
  log.emplace(std::move(opened));
  return log;
}

// A log that can no longer be written does not keep a robot from knowing where it is.
void OfferToLog(Answer* answer, std::optional<RobotLog>* log) {
  if (!*log || !answer->frame || !answer->localization.ok() || !answer->localization->has_fix()) return;
  const Pose& cam_from_world = answer->localization->cam_from_world;
  const MachineClocks now = ReadMachineClocks();
  const Result<bool> kept = [&]() -> Result<bool> {
    if (!(*log)->IsWanted(cam_from_world, now)) return false;
    const auto query = answer->frame->WithAllFeaturesForLog();
    if (!query.ok()) return false;  // no fault of the log
    return (*log)->Offer({.features = &(*query)->features,
                          .camera = &(*query)->camera,
                          .cam_from_world = cam_from_world,
                          .image_path = answer->image},
                         now);
  }();
  if (kept.ok()) return;
  spdlog::warn("nothing is logged from here on: {}", kept.error().message);
  log->reset();
}

Status RunLocalize(const LocalizeArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  const bool is_atlas = IsAtlasFile(arguments.map_path);
  CAIRN_RETURN_IF_ERROR(CheckLocalizeArguments(arguments, is_atlas));
  cv::setNumThreads(1);  // images in parallel, each on one thread
  if (is_atlas) {
    CAIRN_ASSIGN_OR_RETURN(ImageNames names, ImageNames::Make(arguments.images, arguments.list_path));
    CAIRN_ASSIGN_OR_RETURN(const CameraChoice cameras,
                           CameraChoice::Make(arguments.camera, arguments.cameras_path, nullptr));
    return LocalizeInAtlas(arguments.map_path, cameras, arguments.options, arguments.atlas_options, &names,
                           environment);
  }
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(arguments.map_path));
  std::shared_ptr<const VisualMap> visual;
  if (arguments.estimator != "pnp") {
    CAIRN_ASSIGN_OR_RETURN(visual, VisualMap::Open(map, arguments.visual_options));
  }
  CAIRN_ASSIGN_OR_RETURN(const CameraChoice cameras,
                         CameraChoice::Make(arguments.camera, arguments.cameras_path, map));
  CAIRN_ASSIGN_OR_RETURN(ImageNames names, ImageNames::Make(arguments.images, arguments.list_path));

  std::vector<CaptureImage> poses;
  std::optional<Error> first_error;
  int num_images = 0, num_failed = 0, num_places = 0;
  CoreSpeed speed;
  CAIRN_ASSIGN_OR_RETURN(Trackers trackers, Trackers::Make(arguments, map));
  CAIRN_ASSIGN_OR_RETURN(std::optional<RobotLog> log, OpenLog(arguments, *map));
  std::optional<Gravity> gravity;
  if (!arguments.gravity.path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(gravity, Gravity::Read(arguments.gravity));
  }
  std::vector<RigCamera> rig;
  if (!arguments.rig_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(rig, ReadRigConfig(arguments.rig_path));
  }
  std::shared_ptr<const FeatureFinder> finder;
  if (!arguments.model_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(finder, FeatureFinder::Make(arguments.options.sift, arguments.model_path));
    CAIRN_RETURN_IF_ERROR(CheckSameKind(finder->kind(), map->head().descriptor_kind, arguments.model_path));
  }
  std::optional<GivenFeatures> given;
  if (!arguments.features_path.empty()) {
    const DescriptorKind& kind = map->head().descriptor_kind;
    // Floating-point numbers do not say whether they are dense: the map does.
    const bool is_dense = arguments.descriptors == "auto" && kind.type == DescriptorType::kDense;
    CAIRN_ASSIGN_OR_RETURN(
        given, GivenFeatures::Open(arguments.features_path, is_dense ? "dense" : arguments.descriptors));
    CAIRN_RETURN_IF_ERROR(CheckSameKind(given->kind(), kind, arguments.features_path));
  }
  const size_t batch_size =
      arguments.is_sequence ? 1 : 4 * static_cast<size_t>(NumThreads(environment.num_threads));
  for (std::vector<std::string> batch; !(batch = names.Next(batch_size)).empty();) {
    std::vector<Asked> asked;
    for (const std::string& image : batch) {
      asked.push_back({image});
      if (!gravity) continue;
      const Result<SensedUp> up = gravity->Next(image);
      asked.back().up = up.ok() ? Result<std::optional<SensedUp>>(std::optional(*up)) : up.error();
    }
    std::vector<Answer> answers(batch.size());
    ParallelFor(static_cast<int64_t>(batch.size()), environment.num_threads, [&](int64_t i) {
      answers[i] = visual            ? LocateByViews(asked[i], map, *visual, cameras, arguments, &trackers)
                   : given || finder ? LocalizeByFeatures(asked[i], given ? &*given : nullptr, finder.get(),
                                                          map, cameras, arguments)
                   : !rig.empty()    ? LocalizeRigImages(asked[i], rig, map, cameras, arguments)
                   : arguments.is_sequence ? TrackImage(asked[i], map, cameras, arguments, &trackers)
                                           : LocalizeImage(asked[i], map, cameras, arguments);
    });
    for (Answer& answer : answers) {
      *environment.out << JsonText(AnswerJson(answer, arguments)) << "\n" << std::flush;
      OfferToLog(&answer, &log);
      ++num_images;
      speed.Add(answer);
      if (answer.visual && answer.visual->ok() && (*answer.visual)->pose.flag == VisualFlag::kNone)
        ++num_places;
      if (!answer.localization.ok()) {
        ++num_failed;
        if (!first_error) first_error = answer.localization.error();
      } else if (answer.localization->has_fix()) {
        const std::string name = std::filesystem::path(answer.image).filename().string();
        if (const Status status = CheckListedName(arguments.output_path, name);
            !arguments.output_path.empty() && !status.ok()) {
          spdlog::warn("{}", status.error().message);
          continue;
        }
        poses.push_back({.name = name,
                         .camera_id = answer.camera_id,
                         .cam_from_world = answer.cam_from_rig * answer.localization->cam_from_world});
      }
    }
    if (environment.progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "localizing was stopped");
  }
  if (!arguments.output_path.empty()) CAIRN_RETURN_IF_ERROR(WriteImagesText(arguments.output_path, poses));
  if (arguments.estimator != "visual-map")
    spdlog::info("{} of {} images localized", poses.size(), num_images);
  if (arguments.options.budget_ms > 0) speed.Report();
  if (visual) spdlog::info("{} of {} images localized by the visual map", num_places, num_images);
  if (log) spdlog::info("{} frames were added to the log {}", log->num_kept(), arguments.log_folder);
  if (!first_error) {
    if (gravity) CAIRN_RETURN_IF_ERROR(gravity->CheckAllRead());
    return trackers.odometry ? trackers.odometry->CheckAllRead() : Ok();
  }
  return MakeError(first_error->code, "{} of {} images could not be tried; the first: {}", num_failed,
                   num_images, first_error->message);
}

}  // namespace

Command LocalizeCommand() {
  auto arguments = std::make_shared<LocalizeArguments>();
  return {
      .name = "localize",
      .summary = "Say where images were taken, as JSON lines",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "Map, or an atlas of maps").Required().Type("MAP");
            parser.Add("images", arguments->images, "Image files; '-' reads names from stdin").Type("IMAGE");
            parser.Add("--list", arguments->list_path, "File with an image's name per line").Type("FILE");
            parser
                .Add("-o,--output", arguments->output_path,
                     "Write the poses found in COLMAP's images.txt form too")
                .Type("poses.txt");
            parser.Add("--camera", arguments->camera, "Camera of the images [the map's camera of that size]")
                .Type("MODEL,W,H,P...");
            parser.Add("--cameras", arguments->cameras_path, "cameras.txt; chosen by image size")
                .Type("FILE");
            parser.AddFlag("--sequence", arguments->is_sequence,
                           "The images are frames in order: follow the camera from one to the next");
            parser
                .Add("--odometry", arguments->odometry_path,
                     "With --sequence: a line for each image, how the camera moved over the floor since the "
                     "one before: metres ahead, metres to the left, degrees turned to the left; frames "
                     "without a fix then say where it is by that (believed)")
                .Type("FILE");
            arguments->gravity.Add(
                parser,
                "A line for each image, which way was up: a direction in the camera's frame (with --rig the "
                "rig's), to the right, down and ahead, of any length; no pose tilts the camera then, and "
                "where "
                "up is known well, two landmarks make one, not three");
            parser
                .Add("--rig", arguments->rig_path,
                     "COLMAP's rig_config.json: the images are of the rig's reference camera, those that its "
                     "other cameras took at the same time have the same names behind other prefixes, and a "
                     "pose is the rig's, from all of them")
                .Type("FILE");
            parser
                .Add("--features", arguments->features_path,
                     "Features of the images that another program found, as of the map's survey: a COLMAP "
                     "database, a "
                     "kapture folder, a folder of IMAGE.npz, or a capture with features.db; images may be "
                     "names alone")
                .Type("SOURCE");
            parser
                .Add("--model", arguments->model_path,
                     "Learned model that found the features of the map's survey ([extract_features] model): "
                     "it finds "
                     "those of the images, too")
                .Type("FILE.onnx");
            parser
                .Add("--descriptors", arguments->descriptors,
                     "With --features: what its descriptors are, as for `cairn features` [auto]")
                .Type("KIND");
            parser
                .Add("--period", arguments->period_s,
                     "With --min-place-probability: seconds from image to image [1]")
                .Range(1e-6, 1e6)
                .Type("S");
            parser
                .Add("--estimator", arguments->estimator,
                     "pnp: poses in space from landmarks' positions; visual-map: places on the floor from "
                     "how landmarks look from each place (the map needs a visual map); both: and how far "
                     "they disagree [pnp]")
                .OneOf({"pnp", "visual-map", "both"});
            parser
                .Add(
                    "--log", arguments->log_folder,
                    "Add frames with a fix to this folder, a capture that a recipe may name: their features, "
                    "poses and cameras, of places that differ (docs/robots.md)")
                .Type("FOLDER");
            parser
                .Add("--log-max-mb-per-day", arguments->log_mb_per_day,
                     "With --log: largest growth in any 24 hours, 10^6 bytes [50]")
                .Range(1.0, 1e6)
                .Type("MB");
            parser.AddFlag("--log-images", arguments->log_images,
                           "With --log: keep the images of these frames, too");
            OptionTable options = DescribeOptions(&arguments->options);
            for (const OptionTable& more :
                 {DescribeOptions(&arguments->tracker_options),
                  DescribeOptions(&arguments->tracker_options.votes),
                  DescribeOptions(&arguments->visual_options), DescribeOptions(&arguments->estimate_options),
                  DescribeOptions(&arguments->visual_tracker_options),
                  DescribeOptions(&arguments->filter_options), DescribeOptions(&arguments->sure_options),
                  DescribeOptions(&arguments->atlas_options)}) {
              options.insert(options.end(), more.begin(), more.end());
            }
            arguments->option_arguments.Add(
                parser, options,
                {"max_num_features", "max_image_side_px", "min_num_inliers", "max_sigma_m", "max_sigma_deg",
                 "max_distance_from_survey_m", "exclude_look_alikes", "min_place_probability", "budget_ms"});
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunLocalize(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
