#include "runtime/atlas/atlas_localizer.h"

#include <algorithm>
#include <deque>
#include <utility>

#include "core/atlas/atlas_file.h"
#include "core/base/no_throw.h"
#include "core/blocks/map_rows.h"
#include "core/features/sift.h"
#include "runtime/atlas/code_index.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/place_evidence.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

double OddsOf(double probability) {
  constexpr double kAlmostOne = 1 - 1e-12;
  return probability / (1 - std::min(probability, kAlmostOne));
}

// Of exclusive explanations, each with its odds against none of them being right.  Those that explain nearly
// as much of the image as the best one does have its odds: what a map alone says of a fix depends on what
// else is in it.
void ShareProbability(double alike_ratio, AtlasAnswer* answer) {
  int most = 0;
  for (const AtlasHypothesis& hypothesis : answer->hypotheses)
    most = std::max(most, hypothesis.found.num_inliers);
  const auto is_alike = [&](const AtlasHypothesis& hypothesis) {
    return hypothesis.found.num_inliers >= alike_ratio * most;
  };
  double of_alike = 0;
  for (const AtlasHypothesis& hypothesis : answer->hypotheses) {
    if (is_alike(hypothesis)) of_alike = std::max(of_alike, OddsOf(hypothesis.found.probability));
  }
  const auto odds_of = [&](const AtlasHypothesis& hypothesis) {
    return is_alike(hypothesis) ? of_alike : OddsOf(hypothesis.found.probability);
  };
  double sum = 0;
  for (const AtlasHypothesis& hypothesis : answer->hypotheses) sum += odds_of(hypothesis);
  for (AtlasHypothesis& hypothesis : answer->hypotheses)
    hypothesis.probability = ProbabilityAmong(odds_of(hypothesis), sum - odds_of(hypothesis));
  answer->elsewhere = 1 / (1 + sum);
  std::stable_sort(
      answer->hypotheses.begin(), answer->hypotheses.end(),
      [](const AtlasHypothesis& a, const AtlasHypothesis& b) { return a.probability > b.probability; });
}

}  // namespace

OptionTable DescribeOptions(AtlasLocalizerOptions* o) {
  return {
      {.name = "max_num_maps",
       .value = &o->max_num_maps,
       .help = "most maps of an atlas in which an image is localized",
       .min = 1,
       .max = kMaxAtlasMaps},
      {.name = "sure_probability",
       .value = &o->sure_probability,
       .help =
           "a fix with this probability is taken without asking maps that know other features of the image",
       .min = 0,
       .max = 1},
      {.name = "rival_ratio",
       .value = &o->rival_ratio,
       .help = "others: less than this part of those that its own map knows",
       .min = 0,
       .max = 1},
  };
}

AtlasLocalizer::AtlasLocalizer(std::shared_ptr<const Atlas> atlas, const LocalizerOptions& localizer_options,
                               const AtlasLocalizerOptions& options)
    : atlas_(std::move(atlas)), localizer_options_(localizer_options), options_(options) {}

Result<AtlasAnswer> AtlasLocalizer::Localize(const cv::Mat& grey, const std::optional<Camera>& camera) {
  return WithoutExceptions("localization", [&]() -> Result<AtlasAnswer> {
    if (camera && (camera->width != grey.cols || camera->height != grey.rows)) {
      return MakeError(ErrorCode::kInvalidArgument, "the image has {} x {} px, its camera {} x {}", grey.cols,
                       grey.rows, camera->width, camera->height);
    }
    CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, localizer_options_.sift));
    return LocalizeFeatures(features, grey.cols, grey.rows, camera);
  });
}

Result<AtlasAnswer> AtlasLocalizer::LocalizeFeatures(const Features& features, int width, int height,
                                                     const std::optional<Camera>& camera) {
  return WithoutExceptions("localization", [&]() -> Result<AtlasAnswer> {
    AtlasLocalizerOptions checked = options_;
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
    if (localizer_options_.budget_ms > 0)
      return MakeError(
          ErrorCode::kUnsupported,
          "budget_ms bounds the work of an answer in one map, and an atlas tries several; localize "
          "in a map, or leave it out");
    const std::vector<MapScore> ranked = atlas_->Rank(features);
    AtlasAnswer answer;
    double best_probability = 0;
    std::vector<int32_t> best_features;
    // In turn those with most evidence, and, at once, those that look like what was found.
    struct Next {
      int map;
      std::vector<int32_t> features;  // that it has
      bool is_look_alike;
    };
    std::deque<Next> next;
    for (const MapScore& each : ranked) next.push_back({each.map, each.features, false});
    while (!next.empty()) {
      const Next now = std::move(next.front());
      next.pop_front();
      if (!now.is_look_alike) {
        if (static_cast<int>(answer.maps_tried.size()) >= options_.max_num_maps) continue;
        const int num_shared = NumShared(now.features, best_features);
        const bool is_rival =
            num_shared > 0 && num_shared >= options_.rival_ratio * static_cast<double>(best_features.size());
        if (best_probability >= options_.sure_probability && !is_rival) continue;
      }
      CAIRN_ASSIGN_OR_RETURN(const auto map, atlas_->OpenMap(now.map));
      Result<Camera> own = camera ? Result<Camera>(*camera) : map->CameraForSize(width, height);
      if (!own.ok()) {
        if (answer.best_failure.message.empty()) answer.best_failure.message = own.error().message;
        continue;
      }
      answer.maps_tried.push_back(now.map);
      Localizer localizer(map, localizer_options_);
      CAIRN_ASSIGN_OR_RETURN(Localization found, localizer.LocalizeFeatures(features, *own));
      if (found.probability <= 0 || !found.has_places()) {
        if (answer.maps_tried.size() == 1) answer.best_failure = std::move(found);
        continue;
      }
      if (found.probability > best_probability) {
        best_probability = found.probability;
        best_features = now.features;
      }
      CAIRN_ASSIGN_OR_RETURN(const int32_t image, ImageNearFix(*map, found));
      for (const int other : atlas_->MapsLike(now.map, image)) {
        const bool is_known =
            std::find(answer.maps_tried.begin(), answer.maps_tried.end(), other) != answer.maps_tried.end();
        std::erase_if(next, [&](const Next& queued) { return queued.map == other; });
        if (!is_known) next.push_front({other, {}, true});
      }
      answer.hypotheses.push_back({.map = now.map, .found = std::move(found)});
    }
    ShareProbability(localizer_options_.accept.max_second_pose_ratio, &answer);
    return answer;
  });
}

}  // namespace cairn
