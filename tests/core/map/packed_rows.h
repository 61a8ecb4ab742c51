#pragma once

#include <algorithm>
#include <cmath>

#include "core/base/random.h"
#include "tests/core/map/full_rows.h"

namespace cairn {

// 1500 landmarks, so two blocks, and 70 images, two blocks too, each of which sees a stretch of them with
// gaps.
inline MapRows PackedRows(int step = 24) {
  MapRows rows = FullRows();
  rows.findings = {};
  rows.lower_bound.reset();
  rows.regions.clear();
  rows.stations.clear();
  rows.station_edges.clear();
  rows.appearance.clear();
  rows.vocabulary = {};
  rows.documents = "all";
  rows.views = {};
  rows.visual_map = {};
  rows.landmarks.clear();
  Random random(7);
  constexpr int kNumLandmarks = 1500, kNumImages = 70;
  rows.descriptors.resize(kNumLandmarks, kSiftDescriptorDim);
  for (Eigen::Index i = 0; i < rows.descriptors.size(); ++i)
    rows.descriptors.data()[i] = static_cast<uint8_t>(std::min(255.0, 30 * std::abs(random.Normal(0, 1))));
  for (int i = 0; i < kNumLandmarks; ++i) {
    MapLandmark landmark;
    landmark.class_id = static_cast<ClassId>(i * 7 + i % 3);
    landmark.position = {random.Uniform(-5, 5), random.Uniform(0, 3), random.Uniform(100, 110)};
    const Eigen::Quaterniond axes =
        Eigen::Quaterniond(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1))
            .normalized();
    Eigen::Vector3d variances;
    for (double& variance : variances) variance = std::pow(10, random.Uniform(-6, -3));
    landmark.covariance =
        axes.toRotationMatrix() * variances.asDiagonal() * axes.toRotationMatrix().transpose();
    landmark.scale_m = i == 3 ? 0 : random.Uniform(0.001, 0.1);
    landmark.num_observations = 3 + i % 20;
    rows.landmarks.push_back(landmark);
  }
  const MapImage image = rows.images[0];
  rows.images.clear();
  for (int i = 0; i < kNumImages; ++i) {
    rows.images.push_back(image);
    rows.images[i].image_id = static_cast<ImageId>(i + 1);
    rows.images[i].station = -1;
    rows.images[i].landmarks.clear();
    for (int k = 20 * i; k < std::min(kNumLandmarks, 20 * i + 100); ++k) {
      if (random.Uniform(0, 1) < 0.6) rows.images[i].landmarks.push_back(k);
    }
  }
  rows.descriptor_code = QuantizeByTransform(step, &rows.descriptors);
  return rows;
}

}  // namespace cairn
