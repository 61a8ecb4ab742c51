#include "pipeline/commands/commands.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include <spdlog/spdlog.h>

#include "core/base/printable.h"
#include "core/capture/bag_file.h"
#include "core/files/database.h"
#include "pipeline/build/footage.h"
#include "pipeline/exchange/bags/import_bag.h"
#include "pipeline/exchange/film/import_film.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/write_capture.h"

namespace cairn::pipeline {
namespace {

struct ImportArguments {
  std::string source;
  std::string output;
  ImportOptions options;
  HoldOut hold_out;
  std::string link = "symbolic";
  std::string keyframes = "auto";
  std::string topic, odometry, imu;
  std::vector<double> camera_on_robot, imu_on_camera;  // x y z, then the quaternion x y z w
  std::optional<Argument> max_time_gap;  // whether it is given: bags have a default of their own
};

// Films and bags have frames of their own: what is said of files, poses and lists is not for them.
Status CheckIsForFrames(const ImportArguments& arguments, const char* kind) {
  const ImportArguments unsaid;
  const std::pair<bool, const char*> given[] = {
      {!arguments.options.images_folder.empty(), "--images"},
      {!arguments.options.sequence.empty(), "--sequence"},
      {!arguments.options.sensors.empty(), "--sensors"},
      {arguments.hold_out.every != unsaid.hold_out.every, "--every"},
      {!arguments.hold_out.queries_path.empty(), "--queries"},
      {arguments.link != unsaid.link, "--link"},
  };
  for (const auto& [is_given, option] : given) {
    if (is_given) {
      return MakeError(ErrorCode::kInvalidArgument, "{} is for data sets, and {} is a {}; leave it out",
                       option, arguments.source, kind);
    }
  }
  return Ok();
}

Status RunFilmImport(const ImportArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(CheckIsForFrames(arguments, "film"));
  if (arguments.max_time_gap->IsGiven()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--max-time-gap-s is for poses and odometry, and {} is a film; leave it out",
                     arguments.source);
  }
  CAIRN_ASSIGN_OR_RETURN(const WantedFrames wanted, ParseFrameChoice(arguments.keyframes));
  const FilmOptions options = {
      .choice = wanted.choice, .every_s = wanted.every_s, .camera = arguments.options.camera};
  CAIRN_ASSIGN_OR_RETURN(const FilmReport report, ImportFilm(arguments.source, options, arguments.output,
                                                             environment.num_threads, *environment.progress));
  for (const std::string& warning : report.warnings) spdlog::warn("{}", warning);
  const KeyframeStats& frames = report.frames;
  environment.report->in = {{"frames", frames.num_frames}};
  environment.report->out = {{"images", frames.num_keyframes}};
  *environment.out << fmt::format("import: {} frames in {:.1f} s, {} images of {} x {} pixels",
                                  frames.num_frames, report.duration_s, frames.num_keyframes, report.width,
                                  report.height);
  if (options.choice == FrameChoice::kKeyframes) {
    *environment.out << fmt::format("; {} frames are blurred, {} blank, {} repeated; {} cuts",
                                    frames.num_blurred, frames.num_blank, frames.num_repeated,
                                    frames.cuts.size());
  }
  *environment.out << "\n";
  return Ok();
}

Status RunBagImport(const ImportArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(CheckIsForFrames(arguments, "bag"));
  CAIRN_ASSIGN_OR_RETURN(const WantedFrames wanted, ParseFrameChoice(arguments.keyframes));
  BagOptions options = {.topic = arguments.topic,
                        .odometry = arguments.odometry,
                        .imu = arguments.imu,
                        .camera = arguments.options.camera,
                        .choice = wanted.choice,
                        .every_s = wanted.every_s};
  if (arguments.max_time_gap->IsGiven()) options.max_time_gap_s = arguments.options.max_time_gap_s;
  if (!arguments.camera_on_robot.empty()) {
    const Result<Pose> pose = CameraOnRobot(arguments.camera_on_robot);
    if (!pose.ok())
      return MakeError(ErrorCode::kInvalidArgument, "--camera-on-robot: {}", pose.error().message);
    options.base_from_camera = *pose;
  }
  if (!arguments.imu_on_camera.empty()) {
    const Result<Pose> pose = CameraOnRobot(arguments.imu_on_camera);
    if (!pose.ok())
      return MakeError(ErrorCode::kInvalidArgument, "--imu-on-camera: {}", pose.error().message);
    options.camera_from_imu = *pose;
  }
  CAIRN_ASSIGN_OR_RETURN(const BagReport report,
                         ImportBag(arguments.source, options, arguments.output, *environment.progress));
  for (const std::string& warning : report.warnings) spdlog::warn("{}", Printable(warning));
  environment.report->in = {{"frames", report.num_messages}};
  environment.report->out = {{"images", report.num_images}};
  *environment.out << Printable(
      fmt::format("import: {} of {} images of {}, {} of them with odometry, {} cameras\n", report.num_images,
                  report.num_messages, report.topic, report.num_with_odometry, report.num_cameras));
  if (report.num_imu_samples > 0)
    *environment.out << fmt::format("import: {} samples of an IMU\n", report.num_imu_samples);
  return Ok();
}

// A folder of one of the data sets may have a bag in it too.  What a SQLite file lacks to be a bag is said by
// the reader of bags.
bool IsForBags(const ImportArguments& arguments) {
  if (arguments.options.layout != "auto") return arguments.options.layout == "bag";
  return (IsBag(arguments.source) || IsSqliteFile(arguments.source)) && !DetectLayout(arguments.source).ok();
}

Status RunImport(const ImportArguments& arguments, const CommandEnvironment& environment) {
  if (IsForBags(arguments)) return RunBagImport(arguments, environment);
  if (!arguments.topic.empty() || !arguments.odometry.empty() || !arguments.camera_on_robot.empty() ||
      !arguments.imu.empty() || !arguments.imu_on_camera.empty()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--topic, --odometry, --camera-on-robot, --imu and --imu-on-camera are for bags, and {} is none; "
        "leave them out",
        arguments.source);
  }
  std::error_code error;
  const bool is_file = std::filesystem::is_regular_file(arguments.source, error);
  if (arguments.options.layout == "film" || (arguments.options.layout == "auto" && is_file))
    return RunFilmImport(arguments, environment);
  if (arguments.keyframes != ImportArguments().keyframes) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--keyframes is for films and bags, and {} is neither; leave it out", arguments.source);
  }
  CAIRN_ASSIGN_OR_RETURN(ImportedSurvey survey, ReadSurvey(arguments.source, arguments.options));
  CAIRN_RETURN_IF_ERROR(ChooseQueries(arguments.hold_out, &survey));
  const ImageTransfer transfer = arguments.link == "copy"   ? ImageTransfer::kCopy
                                 : arguments.link == "hard" ? ImageTransfer::kHardLink
                                                            : ImageTransfer::kSymbolicLink;
  CAIRN_RETURN_IF_ERROR(WriteImportedCapture(survey, transfer, arguments.output, *environment.progress));
  for (const std::string& note : survey.notes) spdlog::warn("{}", note);
  if (!survey.left_out.empty()) {
    spdlog::warn("{} frames left out, listed in {}/left_out.txt; the first, {}: {}", survey.left_out.size(),
                 arguments.output, survey.left_out[0].name, survey.left_out[0].reason);
  }
  const auto num_queries = std::count_if(survey.images.begin(), survey.images.end(),
                                         [](const ImportedImage& image) { return image.is_query; });
  *environment.out << fmt::format("import: {} survey images, {} queries, {} cameras, {} frames left out\n",
                                  survey.images.size() - num_queries, num_queries, survey.cameras.size(),
                                  survey.left_out.size());
  return Ok();
}

void AddArguments(ArgumentParser& parser, ImportArguments* arguments) {
  parser.Add("source", arguments->source, "Film, ROS bag, or folder of a data set or of a COLMAP model")
      .Required()
      .Type("SOURCE");
  parser.Add("-o,--output", arguments->output, "Capture folder to write").Required().Type("CAPTURE");
  parser
      .Add("--format", arguments->options.layout,
           "auto|colmap|tum|7scenes|kitti|euroc|kapture|film|bag; auto: by the files that are there [auto]")
      .OneOf({"auto", "colmap", "tum", "7scenes", "kitti", "euroc", "kapture", "film", "bag"})
      .Type("FORMAT");
  parser
      .Add("--camera", arguments->options.camera,
           "Camera of all images, in COLMAP's pixels [as the data set or camera_info states; of a film: not "
           "known]")
      .Type("MODEL,W,H,P...");
  parser
      .Add("--keyframes", arguments->keyframes,
           "Frames of a film or bag that become images: auto|all|SECONDS between two; auto: sharp ones from "
           "which "
           "enough of the last is seen [auto]")
      .Type("WHICH");
  parser.Add("--topic", arguments->topic, "bag: topic of the images [the only one]").Type("TOPIC");
  parser
      .Add("--odometry", arguments->odometry,
           "bag: topic of the odometry; none: without [the only one, if there is one]")
      .Type("TOPIC");
  parser
      .Add("--camera-on-robot", arguments->camera_on_robot,
           "bag: the camera's optical frame (x right, y down, z ahead) in the odometry's child frame, metres "
           "and quaternion [as /tf and /tf_static state]")
      .Values(7)
      .SeparatedByCommas()
      .Type("X,Y,Z,QX,QY,QZ,QW");
  parser.Add("--imu", arguments->imu, "bag: topic of the IMU; none: without [the only one, if there is one]")
      .Type("TOPIC");
  parser
      .Add("--imu-on-camera", arguments->imu_on_camera,
           "bag: the IMU's frame in the camera's optical frame, metres and quaternion [as /tf and /tf_static "
           "state, "
           "else found from turns]")
      .Values(7)
      .SeparatedByCommas()
      .Type("X,Y,Z,QX,QY,QZ,QW");
  parser
      .Add("--images", arguments->options.images_folder,
           "colmap: folder of the images [images/ in or beside the model]")
      .Type("FOLDER");
  parser.Add("--sequence", arguments->options.sequence, "kitti: the sequence [the only one]").Type("NN");
  parser
      .Add("--sensors", arguments->options.sensors,
           "Cameras to import: kitti image_0,image_1,.., euroc cam0,cam1, kapture sensor ids [the first; "
           "kapture: all]")
      .SeparatedByCommas()
      .Type("NAME,...");
  arguments->max_time_gap =
      parser
          .Add("--max-time-gap-s", arguments->options.max_time_gap_s,
               "tum, euroc, bag: a frame's pose lies between stated poses at most this far from it, seconds "
               "[0.02; bag: 0.2]")
          .NonNegative()
          .Type("FLOAT");
  parser.Add("--every", arguments->hold_out.every, "Hold out every N-th image as a query [none]")
      .Range(2, 1000000000)
      .Type("N");
  parser
      .Add("--queries", arguments->hold_out.queries_path,
           "Hold out the images that this file names, one per line [7scenes: TestSplit.txt]")
      .Type("FILE");
  parser
      .Add("--link", arguments->link, "symbolic|hard|copy: how image files come into the capture [symbolic]")
      .OneOf({"symbolic", "hard", "copy"})
      .Type("HOW");
}

}  // namespace

Command ImportCommand() {
  auto arguments = std::make_shared<ImportArguments>();
  return {
      .name = "import",
      .summary =
          "Make a capture of a film, a ROS bag, a COLMAP model, TUM RGB-D, 7-Scenes, KITTI, EuRoC or kapture",
      .add_arguments = [arguments](ArgumentParser& parser) { AddArguments(parser, arguments.get()); },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunImport(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
