#include "stages/check_map/promise_figures.h"

#include <algorithm>
#include <optional>

#include "core/blocks/node_poses.h"
#include "core/promise/promise_nodes.h"

namespace cairn::check_map {
namespace {

std::string CurveText(const char* what, const std::vector<PromiseBin>& bins) {
  if (bins.empty()) return "";
  std::string text = fmt::format("  {:<22} promised  kept\n", what);
  for (const PromiseBin& bin : bins)
    text += fmt::format("  {:<22} {:>6.1f} % {:>5.1f} %  ({} of {} images)\n", "", 100 * bin.mean_promised,
                        100.0 * bin.num_kept / bin.num, bin.num_kept, bin.num);
  return text;
}

}  // namespace

std::vector<PromiseOutcome> PromiseOutcomes(const MapRows& rows, const std::vector<HeldOutResult>& images) {
  const MapPromise& promise = *rows.findings.promise;
  const std::vector<Pose> poses = NodePoses(rows);
  std::vector<PromiseOutcome> outcomes;
  for (const HeldOutResult& image : images) {
    if (!image.true_cam_from_world || !image.rejected.empty()) continue;
    const Pose cam_from_world = rows.camera_from_given * *image.true_cam_from_world;
    const std::optional<NearestNode> nearest = FindNearestNode(promise, poses, cam_from_world);
    if (!nearest || nearest->squared_distance >= kNodeReach * kNodeReach) continue;
    outcomes.push_back({promise.nodes[nearest->node].probability,
                        image.has_fix() && image.localization.num_inliers >= promise.terms.min_matches &&
                            image.error_m <= promise.terms.max_error_m &&
                            image.error_deg <= promise.terms.max_error_deg});
  }
  return outcomes;
}

void AddPromiseFigures(const MapRows& rows, const std::vector<HeldOutResult>& images,
                       std::map<std::string, double>* figures) {
  const std::vector<PromiseOutcome> outcomes = PromiseOutcomes(rows, images);
  int num_promised = 0, num_kept = 0;
  for (const PromiseOutcome& outcome : outcomes) {
    if (outcome.probability < rows.findings.promise->terms.probability) continue;
    ++num_promised;
    num_kept += outcome.is_kept ? 1 : 0;
  }
  const auto num_tried = std::count_if(images.begin(), images.end(), [](const HeldOutResult& image) {
    return image.true_cam_from_world && image.rejected.empty();
  });
  (*figures)["num_promised"] = num_promised;
  (*figures)["num_promised_kept"] = num_kept;
  (*figures)["num_beyond_promises"] = static_cast<double>(num_tried) - static_cast<double>(outcomes.size());
  if (num_promised > 0) (*figures)["promised_kept_ratio"] = static_cast<double>(num_kept) / num_promised;
}

std::string WhyNotPromised(const NodePromise& node, const MapPromise& promise) {
  const PromiseTerms& terms = promise.terms;
  if (node.probability >= terms.probability) return "";
  if (node.most_probable >= terms.probability)
    return "the map is smaller than the promise asks for: max_bytes leaves out what would keep it";
  const PromiseModel& model = promise.model;
  if (node.num_matches < model.match_ratio * model.NeededMatches(terms)) {
    return fmt::format(
        "{:.0f} matches are to be expected, {:.0f} are needed, and all that the survey saw there are too "
        "few: "
        "bare walls, blur, or an end of the survey; images taken around there would help",
        node.num_matches, model.match_ratio * model.NeededMatches(terms));
  }
  return "what is seen there fixes the place too loosely (far away, or all in one direction); nearer images "
         "would "
         "help";
}

std::string PromiseText(const MapPromise& promise, const std::string& unit) {
  const PromiseTerms& terms = promise.terms;
  std::string text = fmt::format(
      "promise\n  {:.0f} % of the images find at least {} landmarks and are localized within {:.3g} {}, "
      "{:.3g} "
      "deg,\n  where they are taken within {:.2g} {}, {:.2g} deg of one of {} places and headings; {} of "
      "these "
      "keep it\n  no map of this survey with fewer than {} landmarks keeps it where it can be kept\n",
      100 * terms.probability, terms.min_matches, terms.max_error_m, unit, terms.max_error_deg,
      kNodeReach * promise.radius_m, unit, kNodeReach * promise.radius_deg, promise.nodes.size(),
      promise.NumKept(), promise.landmarks_lower_bound);
  text += CurveText("left-out survey images", promise.left_out);
  text += CurveText("held-out images", promise.held_out);
  return text;
}

}  // namespace cairn::check_map
