#include "runtime/laser/view_order.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/geometry/pose.h"
#include "core/plan/visible_walls.h"

namespace cairn {
namespace {

// Steps after which a region's walls seen through several windows are given up.
constexpr int kMaxOrderSteps = 20000;

class OrderSearch {
 public:
  OrderSearch(const Views& views, const std::vector<VisibleStretch>& stretches,
              const std::vector<ScanSegment>& segments, const std::vector<int>& order, double tolerance_rad,
              const std::function<bool(int, LabelIdx)>& fits)
      : segments_(segments), order_(order), tolerance_rad_(tolerance_rad), fits_(fits) {
    for (const VisibleStretch& stretch : stretches) {
      const Eigen::Vector2d along =
          LabelEnd(views.plan, stretch.label) - LabelStart(views.plan, stretch.label);
      walls_.push_back({stretch.label, std::atan2(along.y(), along.x()), false});
    }
    for (Wall& wall : walls_) {
      wall.seen_again = std::count_if(walls_.begin(), walls_.end(),
                                      [&](const Wall& other) { return other.label == wall.label; }) > 1;
    }
  }

  std::optional<std::vector<OrderedLabels>> Run() {
    OrderedLabels labels(segments_.size(), -1);
    for (size_t first = 0; first < walls_.size(); ++first) Extend(0, first, 0, &labels);
    if (num_steps_ > kMaxOrderSteps) return std::nullopt;
    std::sort(found_.begin(), found_.end());
    found_.erase(std::unique(found_.begin(), found_.end()), found_.end());
    return std::move(found_);
  }

 private:
  struct Wall {
    LabelIdx label;
    double angle;
    bool seen_again;
  };

  // Gives the segment at `place` of the order the wall `first + passed`, around the circle.
  void Extend(size_t place, size_t first, size_t passed, OrderedLabels* labels) {
    if (++num_steps_ > kMaxOrderSteps) return;
    const Wall& wall = walls_[(first + passed) % walls_.size()];
    const int segment = order_[place];
    const double heading = wall.angle - segments_[segment].Angle();
    if (place == 0) heading_ = heading;
    if (std::abs(WrapAngle(heading - heading_)) > tolerance_rad_ || !fits_(segment, wall.label)) return;
    if (wall.seen_again && std::find(labels->begin(), labels->end(), wall.label) != labels->end()) return;
    (*labels)[segment] = wall.label;
    if (place + 1 == order_.size()) {
      if (OnlySeenAgain(first, passed + 1)) found_.push_back(*labels);
    } else {
      // Windows of walls that are also seen elsewhere may be skipped.
      for (size_t next = passed + 1; next < walls_.size(); ++next) {
        Extend(place + 1, first, next, labels);
        if (!walls_[(first + next) % walls_.size()].seen_again) break;
      }
    }
    (*labels)[segment] = -1;
  }

  bool OnlySeenAgain(size_t first, size_t passed) const {
    while (passed < walls_.size() && walls_[(first + passed) % walls_.size()].seen_again) ++passed;
    return passed == walls_.size();
  }

  const std::vector<ScanSegment>& segments_;
  const std::vector<int>& order_;
  double tolerance_rad_;
  const std::function<bool(int, LabelIdx)>& fits_;
  std::vector<Wall> walls_;
  double heading_ = 0;
  int num_steps_ = 0;
  std::vector<OrderedLabels> found_;
};

}  // namespace

std::vector<int> SegmentsInOrder(const std::vector<ScanSegment>& segments) {
  std::vector<int> order(segments.size());
  std::iota(order.begin(), order.end(), 0);
  const auto bearing = [&](int i) {
    const Eigen::Vector2d middle = segments[i].Middle();
    return std::atan2(middle.y(), middle.x());
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return bearing(a) < bearing(b); });
  return order;
}

std::optional<std::vector<OrderedLabels>> LabelsInOrder(const Views& views, FaceIdx face,
                                                        const std::vector<ScanSegment>& segments,
                                                        const std::vector<int>& order, double tolerance_rad,
                                                        const std::function<bool(int, LabelIdx)>& fits) {
  const std::vector<LabelIdx> labels = views.LabelSet(face);
  const std::vector<VisibleStretch> stretches = VisibleStretches(views.plan, labels, views.Centroid(face));
  std::vector<LabelIdx> shown;
  for (const VisibleStretch& stretch : stretches) shown.push_back(stretch.label);
  std::sort(shown.begin(), shown.end());
  shown.erase(std::unique(shown.begin(), shown.end()), shown.end());
  if (shown != labels) return std::nullopt;
  if (labels.size() != segments.size()) return std::vector<OrderedLabels>{};
  return OrderSearch(views, stretches, segments, order, tolerance_rad, fits).Run();
}

}  // namespace cairn
