#include "stages/emit_map/choose/trials.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/base/parallel.h"
#include "core/promise/expectation.h"
#include "stages/emit_map/previous/positions.h"

namespace cairn::emit_map {
namespace {

// Of more sessions, no more images are tried.
constexpr size_t kMaxNumSessionsTried = 3;

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

// Positions in a survey that lacks some of those of the whole one, in their order.
std::vector<size_t> FirstIn(const LeftOutSurvey& survey, const Classes& classes,
                            const std::vector<size_t>& first) {
  const auto index = IndexClasses(survey.classes);
  std::vector<size_t> there;
  for (const size_t i : first) {
    const auto found = index.find(classes.classes[i].class_id);
    if (found != index.end()) there.push_back(found->second);
  }
  return there;
}

}  // namespace

std::vector<char> MarkThese(const std::vector<size_t>& chosen, size_t num_classes) {
  std::vector<char> marks(num_classes, 0);
  for (const size_t i : chosen) marks[i] = 1;
  return marks;
}

Result<Trials> Trials::Make(const Classes& classes, const std::vector<char>& may_keep,
                            const std::vector<size_t>& first, const std::string& matches_path,
                            size_t max_num_left_out, const LeftOutLimits& limits, const EmitKept& emit,
                            int num_threads, Progress& progress) {
  Trials trials(emit, limits, num_threads);
  CAIRN_ASSIGN_OR_RETURN(const auto never_tried, NeverTried(classes, matches_path));
  const size_t num_sessions = std::clamp<size_t>(classes.sessions.size(), 1, kMaxNumSessionsTried);
  CAIRN_ASSIGN_OR_RETURN(const auto rounds,
                         ChooseLeftOut(classes, num_sessions * max_num_left_out, never_tried));
  trials.parts_.resize(rounds.size());
  CAIRN_RETURN_IF_ERROR(trials.ForParts([&](Part& part, size_t round, int threads) -> Status {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "choosing landmarks was stopped");
    CAIRN_ASSIGN_OR_RETURN(LeftOutSurvey left_out, LeaveOutImages(classes, matches_path, rounds[round]));
    // The survey stays where it is: what is learnt from it refers to it.
    part.survey = std::make_unique<LeftOutSurvey>(std::move(left_out));
    const LeftOutSurvey& survey = *part.survey;
    part.pool = PoolIn(survey, classes, may_keep);
    ExpectedMatches of_views;
    {
      const MatchModel model(survey.classes, {}, threads);
      std::vector<MatchModel::Look> looks;
      for (const TrialImage& image : survey.images)
        looks.push_back({&image.camera, image.cam_from_world, image.session});
      part.matches = model.At(looks, MatchModel::Where::kThere, threads);
      of_views = model.OfViews(threads);
    }
    part.depth = of_views.depth;
    LandmarkOrderOptions of_order;
    of_order.first = FirstIn(survey, classes, first);
    of_order.max_num_kept_sights /= rounds.size();  // of all parts together
    part.order.emplace(survey.classes, std::move(of_views), part.pool, of_order, threads);
    part.sights.emplace(survey.classes, KeypointErrors());
    progress.Advance();
    return Ok();
  }));
  progress.Advance(static_cast<int64_t>(kMaxNumRounds - rounds.size()));
  return trials;
}

Status Trials::ForParts(const std::function<Status(Part&, size_t, int)>& body) {
  const size_t num_threads = NumThreads(num_threads_);
  const size_t num_parts = std::max<size_t>(1, parts_.size());
  const auto threads_each = static_cast<int>((num_threads + num_parts - 1) / num_parts);
  std::vector<Status> statuses(parts_.size());
  ParallelFor(static_cast<int64_t>(parts_.size()), num_threads_,
              [&](int64_t i) { statuses[i] = body(parts_[i], i, threads_each); });
  for (const Status& status : statuses) CAIRN_RETURN_IF_ERROR(status);
  return Ok();
}

Result<LeftOutTrial> Trials::Try(size_t n, int descriptor_bits) {
  std::vector<LeftOutTrial> of_parts(parts_.size());
  std::vector<std::vector<PromiseTrial>> fared(parts_.size());
  CAIRN_RETURN_IF_ERROR(ForParts([&](Part& part, size_t p, int threads) -> Status {
    const Classes& classes = part.survey->classes;
    const std::vector<TrialImage>& images = part.survey->images;
    const std::vector<char> keep =
        MarkThese(n < part.pool.size() ? part.order->First(n) : part.pool, classes.classes.size());
    LeftOutTrial& trial = of_parts[p];
    trial.images.resize(images.size());
    if (!part.pool.empty()) {
      CAIRN_ASSIGN_OR_RETURN(MapRows rows, (*emit_)(classes, keep, descriptor_bits, nullptr));
      CAIRN_ASSIGN_OR_RETURN(trial, TryLeftOutImages(std::move(rows), images, limits_, threads));
    }
    for (size_t i = 0; i < images.size(); ++i) {
      fared[p].push_back({ExpectationOf(*part.sights, part.matches[i], keep, images[i].cam_from_world,
                                        images[i].camera.MeanFocal(), part.depth),
                          trial.images[i].is_right, trial.images[i].num_inliers, trial.images[i].error_m});
    }
    return Ok();
  }));
  LeftOutTrial sum;
  for (size_t p = 0; p < parts_.size(); ++p) {
    sum.Add(of_parts[p]);
    fared_.insert(fared_.end(), fared[p].begin(), fared[p].end());
  }
  return sum;
}

}  // namespace cairn::emit_map
