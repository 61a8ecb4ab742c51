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
// Steps that turn by more on the median are short because the camera turns.
constexpr double kTurningDeg = 1;

struct Step {
  double length = 0, turn_deg = 0;
};

std::vector<Step> StepsOf(const ColmapModel& model, const std::vector<int>& order) {
  std::vector<Step> steps;
  for (size_t i = 1; i < order.size(); ++i) {
    const Pose &from = model.images[order[i - 1]].cam_from_world, &to = model.images[order[i]].cam_from_world;
    steps.push_back({CenterErrorM(from, to), RotationErrorDeg(from, to)});
  }
  return steps;
}

double MedianOf(std::span<const Step> steps, double Step::*value) {
  std::vector<double> values;
  for (const Step& step : steps) values.push_back(step.*value);
  return UpperMedian(values);
}

}  // namespace

std::string UnevenSteps(const ColmapModel& model) {
  std::vector<std::string> names;
  for (const ModelImage& image : model.images) names.push_back(image.name);
  const std::vector<int> order = NaturalOrder(names);
  const std::vector<Step> steps = StepsOf(model, order);
  const auto num_steps = static_cast<int>(steps.size());
  if (num_steps < kMinNumPieces * kNumSteps) return "";
  const double typical = MedianOf(steps, &Step::length);
  double most = kUneven;
  int at = -1;
  bool is_short = false;
  for (int first = 0; first + kNumSteps <= num_steps; ++first) {
    const auto piece = std::span(steps).subspan(first, kNumSteps);
    const double local = MedianOf(piece, &Step::length);
    if (!(local > 0) || !(typical > 0)) continue;
    if (local < typical && MedianOf(piece, &Step::turn_deg) > kTurningDeg) continue;
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
      names[order[at]], names[order[at + kNumSteps]], most, is_short ? "short" : "long");
}

}  // namespace cairn::reconstruct
