#include "stages/reconstruct/verdict/covisibility.h"

#include <algorithm>
#include <iterator>
#include <map>

namespace cairn::reconstruct {

Covisibility::Covisibility(const ColmapModel& model, const std::vector<int>& order) : points_(order.size()) {
  std::map<ImageId, int> number;
  for (size_t i = 0; i < order.size(); ++i)
    number.emplace(model.images[order[i]].image_id, static_cast<int>(i));
  for (const ModelPoint& point : model.points) {
    std::vector<int>& images = images_.emplace_back();
    for (const auto& [image_id, keypoint] : point.track) {
      if (const auto found = number.find(image_id); found != number.end()) images.push_back(found->second);
    }
    std::sort(images.begin(), images.end());
    images.erase(std::unique(images.begin(), images.end()), images.end());
    for (const int image : images) points_[image].push_back(static_cast<int>(images_.size()) - 1);
  }
}

std::vector<int> Covisibility::PointsOf(int first, int end) const {
  std::vector<int> points;
  for (int i = first; i < end; ++i) points.insert(points.end(), points_[i].begin(), points_[i].end());
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return points;
}

int Covisibility::NumCommon(int first1, int end1, int first2, int end2) const {
  const std::vector<int> points1 = PointsOf(first1, end1), points2 = PointsOf(first2, end2);
  std::vector<int> common;
  std::set_intersection(points1.begin(), points1.end(), points2.begin(), points2.end(),
                        std::back_inserter(common));
  return static_cast<int>(common.size());
}

int Covisibility::NumCommonWithOthers(int first, int end) const {
  return static_cast<int>(std::count_if(images_.begin(), images_.end(), [&](const std::vector<int>& seen_by) {
    const auto of_range = std::lower_bound(seen_by.begin(), seen_by.end(), first);
    const bool is_in_range = of_range != seen_by.end() && *of_range < end;
    return is_in_range && (seen_by.front() < first || seen_by.back() >= end);
  }));
}

std::vector<CommonPoints> Covisibility::WithCommonPoints(int image, int min_num_points) const {
  std::vector<int> num_points(points_.size(), 0);
  for (const int point : points_[image]) {
    for (const int other : images_[point]) ++num_points[other];
  }
  std::vector<CommonPoints> found;
  for (int other = 0; other < num_images(); ++other) {
    if (other != image && num_points[other] >= min_num_points) found.push_back({other, num_points[other]});
  }
  return found;
}

}  // namespace cairn::reconstruct
