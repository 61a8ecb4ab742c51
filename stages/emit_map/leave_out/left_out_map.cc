#include "stages/emit_map/leave_out/left_out_map.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/promise/expected_matches.h"
#include "core/promise/landmark_order.h"
#include "stages/emit_map/choose/trials.h"
#include "stages/emit_map/leave_out/place_anew.h"

namespace cairn::emit_map {
namespace {

std::vector<size_t> Marked(const std::vector<char>& marks) {
  std::vector<size_t> pool;
  for (size_t i = 0; i < marks.size(); ++i) {
    if (marks[i] != 0) pool.push_back(i);
  }
  return pool;
}

// The landmarks of a map whose landmarks are chosen by trials; nothing where they are all that may be.
Result<std::optional<std::vector<char>>> Choose(const WholeMap& whole, const Classes& classes,
                                                const SurveyParts& parts, int num_threads) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<char> all, KeptClasses(whole.classes, whole.parts.world,
                                                                  whole.parts.decomposition, whole.options));
  CAIRN_ASSIGN_OR_RETURN(std::vector<char> may_keep,
                         KeptClasses(classes, parts.world, parts.decomposition, whole.options));
  std::vector<size_t> pool = Marked(may_keep);
  const double part = static_cast<double>(whole.rows.landmarks.size()) /
                      static_cast<double>(std::max<size_t>(1, Marked(all).size()));
  const auto num_kept = static_cast<size_t>(std::ceil(part * static_cast<double>(pool.size())));
  if (num_kept >= pool.size()) return std::optional(std::move(may_keep));
  LandmarkOrder order(classes, LearnMatches(classes, {}, num_threads), std::move(pool), {}, num_threads);
  return std::optional(MarkThese(order.First(num_kept), classes.classes.size()));
}

}  // namespace

Result<MapRows> MakeLeftOutMap(const WholeMap& whole, const LeftOutImages& which, int num_threads) {
  CAIRN_ASSIGN_OR_RETURN(LeftOutSurvey survey, LeaveOutImages(whole.classes, whole.matches_path, which));
  PlaceAnew(whole.classes, whole.triangulation, num_threads, &survey.classes);
  const SurveyParts parts = PartsOf(survey.classes, whole.parts);
  EmitMapOptions options = whole.options;
  options.visual_map = false;
  std::optional<std::vector<char>> keep;
  if (options.landmarks == "fewest" || options.max_bytes > 0) {
    CAIRN_ASSIGN_OR_RETURN(keep, Choose(whole, survey.classes, parts, num_threads));
  }
  CAIRN_ASSIGN_OR_RETURN(MapRows rows,
                         EmitMap(survey.classes, parts.world, parts.decomposition, whole.vocabulary, options,
                                 parts.appearance ? &*parts.appearance : nullptr, keep ? &*keep : nullptr));
  rows.name = whole.rows.name;
  rows.writer = whole.rows.writer;
  rows.instruction_set = whole.rows.instruction_set;
  rows.seed = whole.rows.seed;
  rows.stage_options = whole.rows.stage_options;
  rows.frame = whole.rows.frame;
  rows.sessions = whole.rows.sessions;
  rows.covariance_scale = whole.rows.covariance_scale;
  rows.keypoint_correlation = whole.rows.keypoint_correlation;
  rows.stated_pose_sigma_m = 0;
  rows.stated_pose_sigma_deg = 0;
  return rows;
}

std::vector<CaptureImage> TriedImages(const Classes& classes, const LeftOutImages& which) {
  std::vector<CaptureImage> images;
  for (const size_t i : which.tried) {
    const SurveyImage& image = classes.images[i];
    images.push_back({.name = image.name,
                      .camera_id = image.camera_id,
                      .cam_from_world = classes.camera_from_given.Inverse() * image.cam_from_world});
  }
  return images;
}

}  // namespace cairn::emit_map
