#include "pipeline/commands/localize_arguments.h"

#include <algorithm>

#include "pipeline/commands/query_images.h"

namespace cairn::pipeline {
namespace {

// Refuses options that only another estimator, a sequence or odometry reads.
Status CheckWhatIsRead(const LocalizeArguments& arguments) {
  CAIRN_RETURN_IF_ERROR(CheckCameraArguments(arguments.camera, arguments.cameras_path));
  VoteOptions of_vote;
  RegionTrackerOptions of_tracker;
  VisualMapOptions of_map;
  VisualEstimateOptions of_estimate;
  VisualTrackerOptions of_visual_tracker;
  VisualFilterOptions of_filter;
  const auto refuse = [&](const std::vector<OptionTable>& tables, const char* why) -> Status {
    for (const OptionTable& table : tables)
      CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(NamesOf(table), why));
    return Ok();
  };
  if (arguments.estimator == "pnp") {
    CAIRN_RETURN_IF_ERROR(refuse({DescribeOptions(&of_map), DescribeOptions(&of_estimate),
                                  DescribeOptions(&of_visual_tracker), DescribeOptions(&of_filter)},
                                 "is for --estimator visual-map or both; give one of them, or leave it out"));
  }
  if (arguments.odometry_path.empty()) {
    WheelErrorOptions of_wheels;
    std::vector<std::string> names = NamesOf(DescribeOptions(&of_wheels));
    names.insert(names.end(), {"min_prior_sigma_m", "min_prior_sigma_deg", "place_way_sigma_ratio",
                               "place_turn_sigma_ratio", "place_way_sigma_m", "place_turn_sigma_deg"});
    CAIRN_RETURN_IF_ERROR(
        arguments.option_arguments.RefuseGiven(names, "is for odometry; give --odometry, or leave it out"));
  } else {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"place_reach_links"}, "is for images without odometry; leave it out"));
  }
  CAIRN_RETURN_IF_ERROR(arguments.gravity.Check(
      arguments.option_arguments, {"floor_up_sigma_deg", "max_up_sigmas", "place_map_up_sigma_deg"}));
  if (arguments.estimator != "pnp") {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"budget_ms", "core_speed"}, "bounds the work of --estimator pnp alone; leave it out"));
  }
  if (arguments.sure_options.min_place_probability == 0 && arguments.period_s > 0)
    return MakeError(ErrorCode::kInvalidArgument,
                     "--period is for --min-place-probability; give it, 0.9 say, or leave this out");
  if (!arguments.is_sequence) {
    SureTrackerOptions of_sure;
    CAIRN_RETURN_IF_ERROR(
        refuse({DescribeOptions(&of_vote), DescribeOptions(&of_tracker), DescribeOptions(&of_visual_tracker),
                DescribeOptions(&of_filter), DescribeOptions(&of_sure)},
               "is for frames in order; give --sequence, or leave it out"));
    if (!arguments.odometry_path.empty())
      return MakeError(ErrorCode::kInvalidArgument,
                       "--odometry is for frames in order; give --sequence, or leave it out");
    return Ok();
  }
  if (arguments.estimator == "visual-map") {
    SureTrackerOptions of_sure;
    CAIRN_RETURN_IF_ERROR(refuse({DescribeOptions(&of_tracker), DescribeOptions(&of_sure)},
                                 "is for --estimator pnp or both; give one of them, or leave it out"));
  }
  return arguments.odometry_path.empty()
             ? arguments.option_arguments.RefuseGiven(
                   {"odometry_way_ratio", "odometry_turn_ratio", "odometry_sigma_m", "odometry_sigma_deg"},
                   "is the error of odometry; give --odometry, or leave it out")
             : arguments.option_arguments.RefuseGiven({"unknown_way_sigma_m", "unknown_turn_sigma_deg"},
                                                      "is for frames without odometry; leave it out");
}

// Refuses what does not go with the cameras of a rig.
Status CheckForRig(const LocalizeArguments& arguments) {
  if (arguments.rig_path.empty()) return Ok();
  const char* refused = arguments.is_sequence           ? "--sequence follows one camera"
                        : arguments.estimator != "pnp"  ? "--estimator: a visual map is asked by one camera"
                        : !arguments.log_folder.empty() ? "--log keeps frames of one camera"
                        : !arguments.camera.empty()
                            ? "--camera is one camera, of images that may be of several"
                            : nullptr;
  if (refused == nullptr) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{}, and --rig is of several; leave one of them out",
                   refused);
}

// Refuses what does not go with other features than SIFT's.
Status CheckForFeatures(const LocalizeArguments& arguments, bool is_atlas) {
  const bool are_given = !arguments.features_path.empty(), is_model = !arguments.model_path.empty();
  if (!are_given && arguments.descriptors != LocalizeArguments().descriptors) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--descriptors says what those of --features are; give --features, or leave it out");
  }
  if (!are_given && !is_model) return Ok();
  if (are_given && is_model) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--features gives the features that --model would find; leave one of them out");
  }
  const char* refused = is_atlas                ? "an atlas is asked with SIFT's features"
                        : arguments.is_sequence ? "--sequence follows SIFT's features"
                        : arguments.estimator != "pnp"
                            ? "--estimator: a visual map is asked with SIFT's features"
                        : !arguments.log_folder.empty() ? "--log keeps SIFT's features"
                        : !arguments.rig_path.empty()   ? "--rig finds SIFT's features in each of its images"
                                                        : nullptr;
  if (refused != nullptr) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}, and {} has others, of single images; leave one of them out", refused,
                     are_given ? "--features" : "--model");
  }
  SiftOptions of_sift;
  std::vector<std::string> unread = NamesOf(DescribeOptions(&of_sift));
  if (is_model) std::erase_if(unread, [](const std::string& name) { return name.starts_with("max_"); });
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
      unread, "is about finding SIFT's features, and these are others; leave it out"));
  return arguments.option_arguments.RefuseGiven(
      {"budget_ms", "core_speed"},
      "bounds the work of finding SIFT's features, too, and these are others; leave it out");
}

// Refuses what an atlas of many maps has no use for, or a single map.
Status CheckForAtlas(const LocalizeArguments& arguments, bool is_atlas) {
  if (!is_atlas) {
    AtlasLocalizerOptions of_atlas;
    return arguments.option_arguments.RefuseGiven(NamesOf(DescribeOptions(&of_atlas)),
                                                  "is for an atlas of several maps; leave it out");
  }
  const char* refused = !arguments.output_path.empty()  ? "-o: each map of an atlas has a frame of its own"
                        : arguments.is_sequence         ? "--sequence: frames are followed in one map"
                        : arguments.estimator != "pnp"  ? "--estimator: visual maps are asked one by one"
                        : !arguments.log_folder.empty() ? "--log: frames are logged for one map"
                        : !arguments.rig_path.empty()   ? "--rig: a rig is localized in one map"
                        : !arguments.gravity.path.empty()
                            ? "--gravity: each map of an atlas has an up of its own"
                            : nullptr;
  if (refused == nullptr) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}; leave it out, or give the map in which the image turns out to be", refused);
}

Status CheckEstimator(const LocalizeArguments& arguments) {
  if (arguments.estimator == "visual-map" && !arguments.output_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "-o writes poses in space, and --estimator visual-map finds places on the floor; use "
                     "--estimator both");
  }
  if (arguments.estimator == "visual-map" && !arguments.gravity.path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--gravity is for poses in space, and --estimator visual-map finds places on the floor; "
                     "use --estimator both");
  }
  if (arguments.estimator == "visual-map" && !arguments.log_folder.empty()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--log keeps frames with their poses in space, and --estimator visual-map finds places on "
        "the floor; use --estimator both");
  }
  if (arguments.log_folder.empty() && (arguments.log_mb_per_day > 0 || arguments.log_images)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} says what a log keeps; give --log FOLDER, or leave it out",
                     arguments.log_mb_per_day > 0 ? "--log-max-mb-per-day" : "--log-images");
  }
  return Ok();
}

}  // namespace

Status CheckLocalizeArguments(const LocalizeArguments& arguments, bool is_atlas) {
  CAIRN_RETURN_IF_ERROR(CheckEstimator(arguments));
  CAIRN_RETURN_IF_ERROR(CheckWhatIsRead(arguments));
  CAIRN_RETURN_IF_ERROR(CheckForRig(arguments));
  CAIRN_RETURN_IF_ERROR(CheckForFeatures(arguments, is_atlas));
  return CheckForAtlas(arguments, is_atlas);
}

}  // namespace cairn::pipeline
