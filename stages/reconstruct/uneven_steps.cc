#include "stages/reconstruct/uneven_steps.h"

#include <algorithm>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "core/base/quantiles.h"
#include "core/base/text.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumSteps = 25, kMinNumPieces = 2;
constexpr double kUneven = 4;
// A step that turns by more, and by so many times as much as half of them, is short because the camera turns.
constexpr double kMinTurnDeg = 1, kTurning = 3;

struct Step {
  int from = 0;  // in the order of the images
  double length = 0;
  double turn_deg = 0;
};

std::vector<Step> StepsStraightOn(const ColmapModel& model, const std::vector<int>& order) {
  std::vector<Step> steps;
  std::vector<double> turns_deg;
  for (size_t i = 1; i < order.size(); ++i) {
    const Pose &from = model.images[order[i - 1]].cam_from_world, &to = model.images[order[i]].cam_from_world;
    steps.push_back({static_cast<int>(i) - 1, CenterErrorM(from, to), RotationErrorDeg(from, to)});
    turns_deg.push_back(steps.back().turn_deg);
  }
  if (steps.empty()) return steps;
  const double max_turn_deg = std::max(kMinTurnDeg, kTurning * UpperMedian(turns_deg));
  std::erase_if(steps, [&](const Step& step) { return step.turn_deg > max_turn_deg; });
  return steps;
}

double MedianLength(std::span<const Step> steps) {
  std::vector<double> lengths;
  for (const Step& step : steps) lengths.push_back(step.length);
  return UpperMedian(lengths);
}

}  // namespace

std::string UnevenSteps(const ColmapModel& model) {
  std::vector<std::string> names;
  for (const ModelImage& image : model.images) names.push_back(image.name);
  const std::vector<int> order = NaturalOrder(names);
  const std::vector<Step> steps = StepsStraightOn(model, order);
  const auto num_steps = static_cast<int>(steps.size());
  if (num_steps < kMinNumPieces * kNumSteps) return "";
  const double typical = MedianLength(steps);
  double most = kUneven;
  int at = -1;
  bool is_short = false;
  for (int first = 0; first + kNumSteps <= num_steps; ++first) {
    const double local = MedianLength(std::span(steps).subspan(first, kNumSteps));
    if (!(local > 0) || !(typical > 0)) continue;
    const double ratio = std::max(local / typical, typical / local);
    if (ratio < most || (at >= 0 && ratio == most)) continue;
    most = ratio;
    at = first;
    is_short = local < typical;
  }
  if (at < 0) return "";
  return fmt::format(
      "from {} to {} the steps from image to image are {:.1f} times as {} as elsewhere: if the camera did "
      "not move so unevenly, the map is bent there; odometry.txt, or images with a view of both sides of a "
      "turn, mend that",
      names[order[steps[at].from]], names[order[steps[at + kNumSteps - 1].from + 1]], most,
      is_short ? "short" : "long");
}

}  // namespace cairn::reconstruct
