#pragma once

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::reconstruct {

// Points that these images see, and no other.
struct ModelSight {
  std::vector<int> images;
  int num_points = 0;
};

// A model of images that stand at places, none of them turned, and see points.
inline ColmapModel ModelOfSights(const std::vector<std::string>& names,
                                 const std::vector<Eigen::Vector3d>& places,
                                 const std::vector<ModelSight>& sights) {
  ColmapModel model;
  for (size_t i = 0; i < names.size(); ++i) {
    ModelImage& image = model.images.emplace_back();
    image.image_id = static_cast<ImageId>(i + 1);
    image.name = names[i];
    image.cam_from_world.translation = -places[i];
  }
  for (const ModelSight& sight : sights) {
    for (int p = 0; p < sight.num_points; ++p) {
      ModelPoint& point = model.points.emplace_back();
      point.point_id = model.points.size();
      for (const int i : sight.images) point.track.emplace_back(static_cast<ImageId>(i + 1), 0);
    }
  }
  return model;
}

inline std::vector<int> AllOfModel(const ColmapModel& model) {
  std::vector<int> order;
  for (size_t i = 0; i < model.images.size(); ++i) order.push_back(static_cast<int>(i));
  return order;
}

// "0.jpg", "1.jpg", ...
inline std::vector<std::string> NumberedNames(int num, const std::string& folder = "") {
  std::vector<std::string> names;
  for (int i = 0; i < num; ++i) names.push_back(fmt::format("{}{}.jpg", folder, i));
  return names;
}

// A metre apart along x.
inline std::vector<Eigen::Vector3d> PlacesInARow(int num) {
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < num; ++i) places.emplace_back(i, 0, 0);
  return places;
}

// Each image and the next.
inline std::vector<ModelSight> SightsOfNext(int num, int num_points) {
  std::vector<ModelSight> sights;
  for (int i = 0; i + 1 < num; ++i) sights.push_back({{i, i + 1}, num_points});
  return sights;
}

inline Verdict JudgeModels(const std::vector<ColmapModel>& models, const std::vector<Reject>& rejects = {},
                           const JudgeOptions& options = {}) {
  JudgedModels judged{.models = &models, .cam_from_world = {}, .rejects = rejects, .is_metric = true};
  for (const ModelImage& image : models[0].images) judged.cam_from_world.push_back(image.cam_from_world);
  return Judge(judged, options);
}

}  // namespace cairn::reconstruct
