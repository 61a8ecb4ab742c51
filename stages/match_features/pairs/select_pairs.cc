#include "stages/match_features/pairs/select_pairs.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"

namespace cairn::match_features {
namespace {

constexpr int kGridColumns = 6;
constexpr int kGridRows = 5;
constexpr int kNumDepths = 5;

// What the overlap with other images is computed from.
struct Frustum {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // world frame
  std::vector<Eigen::Vector3d> samples;              // world frame
  // No camera farther than this from the center sees a sample well enough, metres.
  double reach_m = 0;
};

// Points on rays through a grid of pixels, at depths in geometric progression from near to far.
Frustum SampleFrustum(const PosedCamera& image, const FrustumOverlapOptions& options) {
  const Pose world_from_cam = image.cam_from_world.Inverse();
  Frustum frustum = {.center = world_from_cam.translation};
  double largest_distance_m = 0;
  for (int row = 0; row < kGridRows; ++row) {
    for (int column = 0; column < kGridColumns; ++column) {
      const Eigen::Vector2d pixel((column + 0.5) / kGridColumns * image.camera.width,
                                  (row + 0.5) / kGridRows * image.camera.height);
      const auto ray = CameraFromImage(image.camera, pixel);
      if (!ray) continue;
      for (int d = 0; d < kNumDepths; ++d) {
        const double depth =
            options.near_m * std::pow(options.far_m / options.near_m, d / (kNumDepths - 1.0));
        frustum.samples.push_back(world_from_cam *
                                  Eigen::Vector3d(ray->x() * depth, ray->y() * depth, depth));
        largest_distance_m = std::max(largest_distance_m, (frustum.samples.back() - frustum.center).norm());
      }
    }
  }
  // The third side of a triangle whose other sides and the angle between them are as large as allowed.
  const double ratio = options.max_scale_ratio;
  const double cosine = std::cos(RadFromDeg(options.max_view_angle_deg));
  frustum.reach_m = largest_distance_m * std::sqrt(1 + ratio * ratio - 2 * ratio * cosine) * (1 + 1e-9);
  return frustum;
}

// x² with the sign of x: compares cosines without a square root.
double SignedSquare(double x) { return x * std::abs(x); }

double Overlap(const Frustum& frustum, const PosedCamera& image2, const Eigen::Vector3d& center2,
               const FrustumOverlapOptions& options) {
  if (frustum.samples.empty() || (center2 - frustum.center).squaredNorm() > frustum.reach_m * frustum.reach_m)
    return 0;
  const double min_cosine_sign_squared = SignedSquare(std::cos(RadFromDeg(options.max_view_angle_deg)));
  const double max_squared_ratio = options.max_scale_ratio * options.max_scale_ratio;
  int num_seen = 0;
  for (const Eigen::Vector3d& sample : frustum.samples) {
    const Eigen::Vector3d ray1 = sample - frustum.center, ray2 = sample - center2;
    const double squared1 = ray1.squaredNorm(), squared2 = ray2.squaredNorm();
    if (SignedSquare(ray1.dot(ray2)) < min_cosine_sign_squared * squared1 * squared2) continue;
    if (std::max(squared1, squared2) > max_squared_ratio * std::min(squared1, squared2)) continue;
    const auto pixel = ImageFromCamera(image2.camera, image2.cam_from_world * sample);
    if (pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() <= image2.camera.width &&
        pixel->y() <= image2.camera.height) {
      ++num_seen;
    }
  }
  return static_cast<double>(num_seen) / static_cast<double>(frustum.samples.size());
}

}  // namespace

double FrustumOverlap(const PosedCamera& image1, const PosedCamera& image2,
                      const FrustumOverlapOptions& options) {
  return Overlap(SampleFrustum(image1, options), image2, image2.cam_from_world.Center(), options);
}

IndexPairs ExhaustivePairs(int num_images) {
  IndexPairs pairs;
  pairs.reserve(static_cast<size_t>(num_images) * std::max(0, num_images - 1) / 2);
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < num_images; ++j) pairs.emplace_back(i, j);
  }
  return pairs;
}

IndexPairs SequencePairs(const std::vector<int>& order, int window) {
  IndexPairs pairs;
  const int num_images = static_cast<int>(order.size());
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < num_images && j - i <= window; ++j) {
      pairs.emplace_back(std::min(order[i], order[j]), std::max(order[i], order[j]));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

Result<OverlapRanking> RankOverlaps(const std::vector<PosedCamera>& images,
                                    const FrustumOverlapOptions& options, int num_threads,
                                    Progress& progress) {
  const int num_images = static_cast<int>(images.size());
  std::vector<Frustum> frusta(num_images);
  ParallelFor(num_images, num_threads, [&](int64_t i) { frusta[i] = SampleFrustum(images[i], options); });
  OverlapRanking ranking(num_images);
  progress.Begin("rank overlaps", num_images, "images");
  ParallelFor(num_images, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    for (int other = static_cast<int>(i) + 1; other < num_images; ++other) {
      const double forward = Overlap(frusta[i], images[other], frusta[other].center, options);
      const double backward = Overlap(frusta[other], images[i], frusta[i].center, options);
      if (std::max(forward, backward) >= options.min_overlap_ratio)
        ranking[i].push_back({other, static_cast<float>(0.5 * (forward + backward))});
    }
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while ranking overlaps");
  for (int idx = 0; idx < num_images; ++idx) {
    for (const auto [other, overlap] : ranking[idx]) {
      if (other > idx) ranking[other].push_back({idx, overlap});
    }
  }
  ParallelFor(num_images, num_threads, [&](int64_t i) {
    std::sort(ranking[i].begin(), ranking[i].end(), [](const OverlapPartner& a, const OverlapPartner& b) {
      return std::pair(-a.overlap, a.idx) < std::pair(-b.overlap, b.idx);
    });
  });
  return ranking;
}

IndexPairs FrustumPairs(const OverlapRanking& ranking) {
  IndexPairs pairs;
  for (int idx = 0; idx < static_cast<int>(ranking.size()); ++idx) {
    for (const OverlapPartner& partner : ranking[idx]) {
      if (partner.idx > idx) pairs.emplace_back(idx, partner.idx);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

IndexPairs FrustumSeeds(const OverlapRanking& ranking, int num_best, int num_spread) {
  std::vector<std::vector<int>> partners(ranking.size());
  for (size_t idx = 0; idx < ranking.size(); ++idx) {
    const auto num_ranked = static_cast<int64_t>(ranking[idx].size());
    const int64_t num_first = std::min<int64_t>(num_best, num_ranked);
    const int64_t num_others = std::min<int64_t>(num_spread, num_ranked - num_first);
    for (int64_t rank = 0; rank < num_first; ++rank) partners[idx].push_back(ranking[idx][rank].idx);
    for (int64_t k = 0; k < num_others; ++k) {
      const int64_t rank = num_first + (2 * k + 1) * (num_ranked - num_first) / (2 * num_others);
      partners[idx].push_back(ranking[idx][rank].idx);
    }
  }
  return PairsFromPartners(partners);
}

IndexPairs PairsFromPartners(const std::vector<std::vector<int>>& partners) {
  IndexPairs pairs;
  for (int i = 0; i < static_cast<int>(partners.size()); ++i) {
    for (const int j : partners[i]) pairs.emplace_back(std::min(i, j), std::max(i, j));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace cairn::match_features
