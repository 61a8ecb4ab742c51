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

namespace cairn {
namespace {

double OddsOf(double probability) {
  constexpr double kAlmostOne = 1 - 1e-12;
  return probability / (1 - std::min(probability, kAlmostOne));
}

// Of exclusive explanations, each with its odds against none of them being right.
void ShareProbability(AtlasAnswer* answer) {
  double sum = 0;
  for (const AtlasHypothesis& hypothesis : answer->hypotheses) sum += OddsOf(hypothesis.found.probability);
  for (AtlasHypothesis& hypothesis : answer->hypotheses) {
    const double odds = OddsOf(hypothesis.found.probability);
    hypothesis.probability = ProbabilityAmong(odds, sum - odds);
  }
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
       .help = "a fix with this probability is taken without asking maps that know less of the image",
       .min = 0,
       .max = 1},
      {.name = "rival_score_ratio",
       .value = &o->rival_score_ratio,
       .help = "how much less: this part of what its own map knows",
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
    const std::vector<MapScore> ranked = atlas_->Rank(features);
    AtlasAnswer answer;
    std::optional<Error> no_camera;
    double best_probability = 0, best_score = 0;
    // In turn those that have most of the image, and, at once, those that look like what was found.
    std::deque<std::pair<int, double>> next;
    for (size_t i = 0; i < ranked.size() && i < static_cast<size_t>(options_.max_num_maps); ++i)
      next.emplace_back(ranked[i].map, ranked[i].score);
    while (!next.empty()) {
      const auto [map_idx, score] = next.front();
      next.pop_front();
      if (best_probability >= options_.sure_probability && score < options_.rival_score_ratio * best_score)
        continue;
      CAIRN_ASSIGN_OR_RETURN(const auto map, atlas_->OpenMap(map_idx));
      Result<Camera> own = camera ? Result<Camera>(*camera) : map->CameraForSize(width, height);
      if (!own.ok()) {
        no_camera = own.error();
        continue;
      }
      answer.maps_tried.push_back(map_idx);
      Localizer localizer(map, localizer_options_);
      CAIRN_ASSIGN_OR_RETURN(Localization found, localizer.LocalizeFeatures(features, *own));
      if (found.probability <= 0 || (!found.has_fix() && found.possible_poses.empty())) {
        if (answer.maps_tried.size() == 1) answer.best_failure = std::move(found);
        continue;
      }
      if (found.probability > best_probability) {
        best_probability = found.probability;
        best_score = score;
      }
      CAIRN_ASSIGN_OR_RETURN(const int32_t image, ImageNearFix(*map, found));
      for (const int other : atlas_->MapsLike(map_idx, image)) {
        const bool is_known =
            std::find(answer.maps_tried.begin(), answer.maps_tried.end(), other) != answer.maps_tried.end();
        std::erase_if(next, [&](const auto& queued) { return queued.first == other; });
        // As much of the image as this map has, so that it is asked.
        if (!is_known) next.emplace_front(other, best_score);
      }
      answer.hypotheses.push_back({.map = map_idx, .found = std::move(found)});
    }
    if (answer.maps_tried.empty() && no_camera) return *no_camera;
    ShareProbability(&answer);
    return answer;
  });
}

}  // namespace cairn
