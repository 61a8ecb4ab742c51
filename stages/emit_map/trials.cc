#include "stages/emit_map/trials.h"

#include <set>
#include <utility>

#include "core/base/parallel.h"
#include "core/promise/expectation.h"

namespace cairn::emit_map {
namespace {

// Positions of the classes that a map may have in a survey that lacks some.
std::vector<size_t> PoolIn(const LeftOutSurvey& survey, const Classes& classes,
                           const std::vector<char>& may_keep) {
  std::set<ClassId> ids;
  for (size_t i = 0; i < may_keep.size(); ++i) {
    if (may_keep[i] != 0) ids.insert(classes.classes[i].class_id);
  }
  std::vector<size_t> pool;
  for (size_t i = 0; i < survey.classes.classes.size(); ++i) {
    if (ids.contains(survey.classes.classes[i].class_id)) pool.push_back(i);
  }
  return pool;
}

}  // namespace

std::vector<char> MarkThese(const std::vector<size_t>& chosen, size_t num_classes) {
  std::vector<char> marks(num_classes, 0);
  for (const size_t i : chosen) marks[i] = 1;
  return marks;
}

Result<Trials> Trials::Make(const Classes& classes, const std::vector<char>& may_keep,
                            const std::string& matches_path, size_t max_num_left_out,
                            const LeftOutLimits& limits, const EmitKept& emit, int num_threads,
                            Progress& progress) {
  Trials trials(emit, limits, num_threads);
  CAIRN_ASSIGN_OR_RETURN(const auto rounds, ChooseLeftOut(classes, max_num_left_out));
  for (const LeftOutImages& round : rounds) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "choosing landmarks was stopped");
    CAIRN_ASSIGN_OR_RETURN(LeftOutSurvey left_out, LeaveOutImages(classes, matches_path, round));
    // The survey stays where it is: what is learnt from it refers to it.
    auto survey = std::make_unique<LeftOutSurvey>(std::move(left_out));
    const MatchModel model(survey->classes, {}, num_threads);
    std::vector<size_t> pool = PoolIn(*survey, classes, may_keep);
    std::vector<std::vector<ClassMatch>> matches(survey->images.size());
    ParallelFor(static_cast<int64_t>(matches.size()), num_threads, [&](int64_t i) {
      matches[i] =
          model.At(survey->images[i].camera, survey->images[i].cam_from_world, MatchModel::Where::kThere);
    });
    LandmarkOrder order(survey->classes, model.OfViews(num_threads), pool, {}, num_threads);
    LandmarkSights sights(survey->classes, KeypointErrors());
    trials.parts_.push_back({std::move(survey), std::move(pool), std::move(order), std::move(sights),
                             model.distance().depth(), std::move(matches)});
    progress.Advance();
  }
  progress.Advance(static_cast<int64_t>(kMaxNumRounds - rounds.size()));
  return trials;
}

Result<LeftOutTrial> Trials::Try(size_t n, int descriptor_bits) {
  LeftOutTrial sum;
  for (Part& part : parts_) {
    const Classes& classes = part.survey->classes;
    const std::vector<TrialImage>& images = part.survey->images;
    const std::vector<char> keep =
        MarkThese(n < part.pool.size() ? part.order.First(n) : part.pool, classes.classes.size());
    LeftOutTrial trial;
    trial.images.resize(images.size());
    if (!part.pool.empty()) {
      CAIRN_ASSIGN_OR_RETURN(MapRows rows, (*emit_)(classes, keep, descriptor_bits));
      CAIRN_ASSIGN_OR_RETURN(trial, TryLeftOutImages(std::move(rows), images, limits_, num_threads_));
    }
    for (size_t i = 0; i < images.size(); ++i) {
      fared_.push_back({ExpectationOf(part.sights, part.matches[i], keep, images[i].cam_from_world,
                                      images[i].camera.MeanFocal(), part.depth),
                        trial.images[i].is_right, trial.images[i].num_inliers, trial.images[i].error_m});
    }
    sum.Add(trial);
  }
  return sum;
}

}  // namespace cairn::emit_map
