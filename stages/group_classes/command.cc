#include "stages/group_classes/command.h"

#include "core/line/memory.h"
#include "stages/group_classes/group_classes.h"

namespace cairn::group_classes {
namespace {

// Bytes of memory per byte of the input file.
constexpr double kMemoryPerFileByte = 3;

struct Arguments {
  std::string matches;
  std::string capture;
  std::string output;
  GroupClassesOptions options;
  OptionArguments option_arguments;
};

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture));
  CAIRN_RETURN_IF_ERROR(CheckMemoryForFile("grouping the matches", arguments.matches, kMemoryPerFileByte,
                                           environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(MatchedFeatures matched, ReadMatchedFeatures(arguments.matches));
  // A reconstruction refines the database's cameras, with the same numbers, along with the poses.
  if (capture.frame && capture.frame->is_reconstructed) {
    for (const auto& [camera_id, camera] : capture.cameras) matched.cameras[camera_id] = camera;
  }
  CAIRN_ASSIGN_OR_RETURN(
      const GroupClassesResult result,
      GroupClasses(matched, capture, arguments.options, environment.num_threads, *environment.progress));
  CAIRN_RETURN_IF_ERROR(WriteClasses(result.classes, arguments.output, result.dropped_items));
  const Classes& classes = result.classes;
  environment.report->in = {{"images", static_cast<int64_t>(classes.images.size())},
                            {"tracks", result.num_tracks}};
  environment.report->out = {{"classes", static_cast<int64_t>(classes.classes.size())}};
  AddDropped("classes", classes.dropped, environment.report);
  std::string dropped;
  for (const auto& [reason, count] : classes.dropped)
    dropped += fmt::format("{}{} {}", dropped.empty() ? "" : ", ", count, reason);
  *environment.out << fmt::format("group_classes: {} tracks, {} classes kept, dropped: {}\n",
                                  result.num_tracks, classes.classes.size(),
                                  dropped.empty() ? "none" : dropped);
  if (result.poses_refined) {
    const Pose& offset = classes.camera_from_given;
    *environment.out << fmt::format("group_classes: poses refined, reprojection error {:.2f} -> {:.2f} px, ",
                                    result.initial_rms_px, result.final_rms_px);
    *environment.out << fmt::format(
        "offset {:.1f} cm / {:.2f} deg, stated poses off by {:.1f} cm / {:.2f} deg an axis, focal length x "
        "{:.4f}\n",
        100 * offset.translation.norm(), RotationErrorDeg(offset, Pose()), 100 * classes.stated_pose_sigma_m,
        classes.stated_pose_sigma_deg,
        classes.cameras.front().FocalX() / matched.cameras.begin()->second.FocalX());
  } else {
    *environment.out << fmt::format("group_classes: poses as stated, reprojection error {:.2f} px\n",
                                    result.final_rms_px);
  }
  return Ok();
}

}  // namespace

Command GroupClassesCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {.name = "group-classes",
          .summary = "Group matching keypoints into triangulated feature classes (stage 3)",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser.Add("matches", arguments->matches, "COLMAP database with verified matches")
                    .Required()
                    .Type("matches.db");
                parser.Add("--capture", arguments->capture, "Capture folder with the survey's poses")
                    .Required()
                    .Type("CAPTURE");
                parser.Add("-o,--output", arguments->output, "File to write").Required().Type("classes.db");
                arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
              },
          .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); }};
}

}  // namespace cairn::group_classes
