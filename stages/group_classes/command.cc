#include "stages/group_classes/command.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/capture/sessions.h"
#include "core/colmap/colmap_database.h"
#include "core/line/memory.h"
#include "stages/group_classes/adjust/solved_file.h"
#include "stages/group_classes/group_classes.h"

namespace cairn::group_classes {
namespace {

// Bytes of memory per byte of the input file, of which no more than a part is in memory at once where it is
// large; and what adjusting poses adds to that, per image that is adjusted at once (bench/scale/README.md)
// or, of a survey of few images, per byte of the file.
constexpr double kMemoryPerFileByte = 0.8, kMemoryPerLargeFileByte = 0.15, kFixedMemory = 600.0 * (1 << 20);
constexpr double kMemoryPerImageAdjusted = 150e3, kMemoryPerFileByteAdjusted = 0.8;
// Keypoints of an image with which that was measured.
constexpr int kNumKeypointsAdjusted = 100;

// Images whose poses are adjusted at the same time, at most, weighed by their keypoints.
double NumAdjustedAtOnce(const Capture& capture, int64_t num_images, const GroupClassesOptions& options,
                         int num_threads) {
  const bool is_reconstructed = capture.frame && capture.frame->is_reconstructed;
  if (options.refine_poses == "never" || (options.refine_poses == "auto" && is_reconstructed)) return 0;
  const AdjustSurveyOptions& adjustment = options.adjustment;
  const int64_t in_parts = int64_t{NumThreads(num_threads)} * adjustment.num_images_at_once / 3;
  const int64_t at_once =
      std::max({int64_t{adjustment.num_images_together}, in_parts, int64_t{adjustment.num_images_learnt}});
  const double weight = static_cast<double>(adjustment.num_keypoints_adjusted) / kNumKeypointsAdjusted;
  return static_cast<double>(std::min(num_images, at_once)) * std::max(1.0, weight);
}

// Refuses what grouping has no room for.
Status CheckMemoryForMatches(const std::string& matches, double num_adjusted, int64_t memory_mib) {
  return CheckMemoryForFile(
      "grouping the matches", matches,
      [&](double file) {
        return std::min(kMemoryPerFileByte * file, kMemoryPerLargeFileByte * file + kFixedMemory) +
               std::min(kMemoryPerImageAdjusted * num_adjusted, kMemoryPerFileByteAdjusted * file);
      },
      memory_mib);
}

Result<int64_t> CountImages(const std::string& matches) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches));
  return WithDatabaseErrors(matches, [&]() -> Result<int64_t> {
    CAIRN_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(database));
    return std::ssize(images);
  });
}

struct Arguments {
  std::string matches;
  std::string capture;
  std::string output;
  std::string sessions;
  GroupClassesOptions options;
  OptionArguments option_arguments;
};

// What was found out about poses and cameras, a line each.
std::string AdjustmentText(const GroupClassesResult& result, const MatchedFeatures& matched) {
  if (!result.poses_refined) {
    return fmt::format("group_classes: poses and cameras as stated, reprojection error {:.2f} px\n",
                       result.final_rms_px);
  }
  const SurveyFindings& findings = result.findings;
  const Classes& classes = result.classes;
  std::string text = fmt::format("group_classes: reprojection error {:.2f} -> {:.2f} px; ",
                                 result.initial_rms_px, result.final_rms_px);
  if (findings.pose_gain > 0) {
    text += fmt::format(
        "stated poses err by {:.2f} cm, {:.3f} deg each and drift by {:.2f} cm, {:.3f} deg in a metre "
        "(square root); they were moved by {:.1f} cm, {:.2f} deg an axis; left-out keypoints' variance is "
        "{:.1f} % smaller\n",
        100 * findings.noise.own_m, findings.noise.own_deg, 100 * findings.noise.walk_m,
        findings.noise.walk_deg, 100 * classes.stated_pose_sigma_m, classes.stated_pose_sigma_deg,
        100 * findings.pose_gain);
  } else {
    text += "stated poses are exact as far as the images tell, and stay\n";
  }
  if (findings.has_offset) {
    const Pose& offset = classes.camera_from_given;
    text += fmt::format("group_classes: the cameras are {:.1f} cm, {:.2f} deg off the stated poses\n",
                        100 * offset.translation.norm(), RotationErrorDeg(offset, Pose()));
  }
  for (size_t c = 0; c < findings.cameras.size(); ++c) {
    const CameraFinding& finding = findings.cameras[c];
    if (finding.variant.empty()) continue;
    const Camera& camera = classes.cameras[c];
    std::vector<std::string> params;
    for (size_t p = 0; p < camera.params.size(); ++p) {
      const auto free = std::find(finding.free.begin(), finding.free.end(), static_cast<int>(p));
      const size_t k = free - finding.free.begin();
      params.push_back(k < finding.sigma.size()
                           ? fmt::format("{:.6g} +- {:.2g}", camera.params[p], finding.sigma[k])
                           : fmt::format("{:.6g}", camera.params[p]));
    }
    text += fmt::format(
        "group_classes: camera {} differs in {} from what is stated ({}): {} {}; left-out keypoints' "
        "variance "
        "is {:.1f} % smaller\n",
        camera.camera_id, finding.variant, CameraModelName(matched.cameras.at(camera.camera_id).model),
        CameraModelName(camera.model), fmt::join(params, ", "), 100 * finding.gain);
  }
  return text;
}

// What each session says of the classes of the others, a line each.
std::string PersistenceText(const GroupClassesResult& result) {
  std::string text;
  for (size_t s = 0; s < result.sessions.size(); ++s) {
    const SessionPersistence& session = result.sessions[s];
    text += fmt::format(
        "group_classes: {} sees {} of {} classes of other sessions that it could see, {:.0f} % as readily as "
        "they; "
        "{:.1f} % are there\n",
        result.classes.sessions[s], session.num_seen, session.num_known, 100 * session.yield,
        100 * session.there_ratio);
  }
  if (!result.sessions.empty())
    text += fmt::format("group_classes: {} classes are probably gone; the place changed at {} places\n",
                        result.classes.vanished.size(), result.classes.changes.size());
  constexpr size_t kMaxLines = 10;
  const std::vector<PlaceChange>& changes = result.classes.changes;
  std::map<ImageId, std::string> names;
  for (const SurveyImage& image : result.classes.images) names[image.image_id] = image.name;
  const auto name_of = [&](ImageId image_id) { return image_id == 0 ? "no image" : names.at(image_id); };
  const auto moved_text = [&](const PlaceChange& change) {
    if (change.moved_to < 0) return std::string();
    const Eigen::Vector3d& to = changes[change.moved_to].position;
    return fmt::format(", {} of the gone are now around ({:.1f}, {:.1f}, {:.1f})", change.num_moved, to.x(),
                       to.y(), to.z());
  };
  for (size_t i = 0; i < std::min(changes.size(), kMaxLines); ++i) {
    const PlaceChange& change = changes[i];
    text += fmt::format(
        "group_classes: in {}, {:.1f} around ({:.1f}, {:.1f}, {:.1f}): {} classes gone, {} new{}; {} -> {}\n",
        result.classes.sessions[change.session], change.radius_m, change.position.x(), change.position.y(),
        change.position.z(), change.num_vanished, change.num_appeared, moved_text(change),
        name_of(change.image_before), name_of(change.image_after));
  }
  if (changes.size() > kMaxLines)
    text += fmt::format("group_classes: ... and {} more\n", changes.size() - kMaxLines);
  return text;
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture));
  const GroupClassesOptions& options = arguments.options;
  CAIRN_ASSIGN_OR_RETURN(const int64_t num_images, CountImages(arguments.matches));
  const double num_adjusted = NumAdjustedAtOnce(capture, num_images, options, environment.num_threads);
  Status fits = CheckMemoryForMatches(arguments.matches, num_adjusted, environment.memory_mib);
  if (!fits.ok() && CheckMemoryForMatches(arguments.matches, 0, environment.memory_mib).ok()) {
    return MakeError(fits.error().code,
                     "{}; adjusting poses takes a part of it, the less the smaller --num-images-together, "
                     "--num-images-at-once and --threads are: with --refine-poses never it fits",
                     fits.error().message);
  }
  CAIRN_RETURN_IF_ERROR(std::move(fits));
  CAIRN_ASSIGN_OR_RETURN(MatchedFeatures matched, ReadMatchedFeatures(arguments.matches));
  // A reconstruction refines the database's cameras, with the same numbers, along with the poses.  Of
  // panoramas the database has views.
  if (capture.frame && (capture.frame->is_reconstructed || capture.frame->has_refined_cameras)) {
    for (const auto& [camera_id, camera] : capture.cameras) {
      if (camera.model != CameraModel::kEquirectangular) matched.cameras[camera_id] = camera;
    }
  }
  std::vector<std::string> sessions;
  if (!arguments.sessions.empty()) {
    CAIRN_ASSIGN_OR_RETURN(sessions, ReadSessionsText(arguments.sessions));
  }
  SolvedFile solved(SolvedPath(arguments.output));
  const auto group_and_write = [&]() -> Result<GroupClassesResult> {
    CAIRN_ASSIGN_OR_RETURN(GroupClassesResult result,
                           GroupClasses(matched, capture, options, environment.num_threads,
                                        *environment.progress, &solved, sessions, arguments.output));
    CAIRN_RETURN_IF_ERROR(WriteClasses(result.classes, arguments.output, result.dropped_items));
    return result;
  };
  const Result<GroupClassesResult> grouped = group_and_write();
  // A run that was stopped goes on; one that failed leaves nothing behind, least of all on a full disk.
  if (grouped.ok() || grouped.error().code != ErrorCode::kCancelled) solved.Remove();
  if (!grouped.ok()) return grouped.error();
  const GroupClassesResult& result = *grouped;
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
  *environment.out << AdjustmentText(result, matched) << PersistenceText(result);
  return Ok();
}

}  // namespace

Command GroupClassesCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {
      .name = "group-classes",
      .summary = "Group matching keypoints into triangulated feature classes (stage 3)",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("matches", arguments->matches, "COLMAP database with verified matches")
                .Required()
                .Type("matches.db");
            parser.Add("--capture", arguments->capture, "Capture folder with the survey's poses")
                .Required()
                .Type("CAPTURE");
            parser
                .Add("--sessions", arguments->sessions,
                     "sessions.txt of the capture, in the order of time: image SESSION/NAME belongs to that "
                     "survey [one survey]")
                .Type("sessions.txt");
            parser.Add("-o,--output", arguments->output, "File to write").Required().Type("classes.db");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); }};
}

}  // namespace cairn::group_classes
