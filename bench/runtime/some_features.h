#pragma once

#include "core/base/random.h"
#include "core/camera/camera.h"
#include "core/features/features.h"

namespace cairn {

// Features of no image: 60 of them, always the same.
inline Features SomeFeatures(const Camera& camera) {
  Random random(1);
  Features features;
  features.descriptors.resize(60, kSiftDescriptorDim);
  for (int i = 0; i < 60; ++i) {
    features.keypoints.push_back({static_cast<float>(random.Uniform(0, camera.width)),
                                  static_cast<float>(random.Uniform(0, camera.height)), 2, 0});
    for (int k = 0; k < kSiftDescriptorDim; ++k) {
      features.descriptors(i, k) = static_cast<uint8_t>(random.UniformInt(0, 60));
    }
  }
  return features;
}

}  // namespace cairn
