#pragma once

#include <vector>

#include "core/colmap/colmap_model.h"

namespace cairn::reconstruct {

// An image, and how many points it sees that another one sees too.
struct CommonPoints {
  int image = 0;
  int num_points = 0;
};

// Which images of a model see the same points.  Images are numbered as the caller orders them.
class Covisibility {
 public:
  // `order`: of each image its index in the model.
  Covisibility(const ColmapModel& model, const std::vector<int>& order);

  int num_images() const { return static_cast<int>(points_.size()); }
  int NumPoints(int image) const { return static_cast<int>(points_[image].size()); }

  // Points that one of the images [first1, end1) and one of [first2, end2) see.
  int NumCommon(int first1, int end1, int first2, int end2) const;

  // Points that one of the images [first, end) and one of all others see.
  int NumCommonWithOthers(int first, int end) const;

  // All other images that see at least `min_num_points` of the image's points, ascending.  O(observations of
  // its points).
  std::vector<CommonPoints> WithCommonPoints(int image, int min_num_points) const;

 private:
  std::vector<int> PointsOf(int first, int end) const;

  std::vector<std::vector<int>> points_;  // per image, ascending
  std::vector<std::vector<int>> images_;  // per point, ascending
};

}  // namespace cairn::reconstruct
