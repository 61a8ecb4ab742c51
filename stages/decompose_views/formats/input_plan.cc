#include "stages/decompose_views/formats/input_plan.h"

namespace cairn::decompose_views {

double TwiceArea(const std::vector<Eigen::Vector2d>& ring) {
  double sum = 0;
  for (size_t i = 0; i < ring.size(); ++i) {
    const Eigen::Vector2d a = ring[i] - ring[0], b = ring[(i + 1) % ring.size()] - ring[0];
    sum += a.x() * b.y() - a.y() * b.x();
  }
  return sum;
}

}  // namespace cairn::decompose_views
