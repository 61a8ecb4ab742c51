#include "stages/reconstruct/uneven_steps.h"

#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "core/base/quantiles.h"
#include "core/base/text.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumSteps = 25, kMinNumPieces = 2;
constexpr double kUneven = 4;

}  // namespace

std::string UnevenSteps(const ColmapModel& model) {
  std::vector<std::string> names;
  for (const ModelImage& image : model.images) names.push_back(image.name);
  const std::vector<int> order = NaturalOrder(names);
  std::vector<double> steps;
  for (size_t i = 1; i < order.size(); ++i) {
    steps.push_back(
        CenterErrorM(model.images[order[i - 1]].cam_from_world, model.images[order[i]].cam_from_world));
  }
  const auto num_steps = static_cast<int>(steps.size());
  if (num_steps < kMinNumPieces * kNumSteps) return "";
  const double typical = UpperMedian(steps);
  double most = kUneven;
  int at = -1;
  bool is_short = false;
  for (int first = 0; first + kNumSteps <= num_steps; ++first) {
    const double local = UpperMedian({steps.begin() + first, steps.begin() + first + kNumSteps});
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
      names[order[at]], names[order[at + kNumSteps]], most, is_short ? "short" : "long");
}

}  // namespace cairn::reconstruct
