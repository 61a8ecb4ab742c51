#include "bench/vocabulary/synthetic_places.h"

#include <array>
#include <cmath>

#include "core/base/random.h"

namespace cairn {
namespace {

constexpr double kMeanValue = 45;  // of a descriptor of norm 512

using Values = std::array<float, kSiftDescriptorDim>;

// Adds noise that is nearly normal: sums of four uniform values of 4 bits, 16 bits each of a mixed counter.
void AddNoise(uint64_t seed, double sigma, Values& values) {
  // A sum of four values of 0 .. 15: mean 30, variance 4 (16^2 - 1) / 12 = 85.
  const auto scale = static_cast<float>(sigma * kMeanValue / std::sqrt(85.0));
  for (int i = 0; i < kSiftDescriptorDim; i += 4) {
    uint64_t bits = MixSeed(seed, static_cast<uint64_t>(i));
    for (int k = 0; k < 4; ++k, bits >>= 16) {
      const auto sum =
          static_cast<float>((bits & 15) + (bits >> 4 & 15) + (bits >> 8 & 15) + (bits >> 12 & 15));
      values[i + k] += scale * (sum - 30);
    }
  }
}

void ToNorm512(Values& values) {
  float squared_norm = 0;
  for (float& value : values) {
    value = std::max(0.f, value);
    squared_norm += value * value;
  }
  const float scale = squared_norm > 0 ? 512 / std::sqrt(squared_norm) : 0;
  for (float& value : values) value *= scale;
}

}  // namespace

DescriptorMatrix Families(const SyntheticPlaces& places) {
  Random random(MixSeed(places.seed, 0));
  DescriptorMatrix families(places.num_families, kSiftDescriptorDim);
  for (int row = 0; row < places.num_families; ++row) {
    Values values;
    for (float& value : values) value = static_cast<float>(std::pow(random.Uniform(), 3));
    ToNorm512(values);
    for (int i = 0; i < kSiftDescriptorDim; ++i) {
      families(row, i) = static_cast<uint8_t>(std::min(255.f, std::round(values[i])));
    }
  }
  return families;
}

DescriptorMatrix ViewOfPlace(const SyntheticPlaces& places, const DescriptorMatrix& families, int place,
                             int view, double clutter_ratio) {
  Random random(MixSeed(MixSeed(places.seed, 1), static_cast<uint64_t>(place) * 1000 + view));
  const uint64_t feature_seed = MixSeed(places.seed, 2);
  const int64_t first_own = int64_t{place} * places.num_features / 2;  // half of them: the next place's too
  DescriptorMatrix descriptors(places.num_features, kSiftDescriptorDim);
  for (int row = 0; row < places.num_features; ++row) {
    // Own features count from 0, common ones down from -1, clutter is numbered at random beyond all.
    int64_t feature = first_own + row;
    if (random.Uniform() < clutter_ratio) {
      feature = int64_t{1} << 40 | static_cast<int64_t>(random.Bits() >> 25);
    } else if (random.Uniform() < places.common_ratio) {
      feature = -1 - random.UniformInt(0, places.num_common - 1);
    }
    const uint64_t of_feature = MixSeed(feature_seed, static_cast<uint64_t>(feature));
    Values values;
    const auto family = static_cast<Eigen::Index>(of_feature % static_cast<uint64_t>(places.num_families));
    for (int i = 0; i < kSiftDescriptorDim; ++i) values[i] = families(family, i);
    AddNoise(of_feature, places.family_sigma, values);
    ToNorm512(values);
    AddNoise(random.Bits(), places.view_sigma, values);
    ToNorm512(values);
    for (int i = 0; i < kSiftDescriptorDim; ++i) {
      descriptors(row, i) = static_cast<uint8_t>(std::min(255.f, std::round(values[i])));
    }
  }
  return descriptors;
}

}  // namespace cairn
