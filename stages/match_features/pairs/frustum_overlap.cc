#include "stages/match_features/pairs/frustum_overlap.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "core/base/parallel.h"
#include "core/features/wide_clones.h"
#include "core/structure/points.h"

namespace cairn::match_features {
namespace {

constexpr int kGridColumns = 6;
constexpr int kGridRows = 5;
constexpr int kNumDepths = 5;
// Of the cone in which a camera sees: pixels of each border that are looked at, and how much wider it is
// taken.
constexpr int kNumBorderPixels = 16;
constexpr double kConeMargin_deg = 2;
// By how much a sample may miss a limit, as part of it, and of the angle's squared cosine: what stands
// exactly on one, as many do between the stations of a lattice, counts however the last bits are rounded,
// which is another matter on each processor.
constexpr double kSlack = 1e-9;

// x² with the sign of x: compares cosines without a square root.
double SignedSquare(double x) { return x * std::abs(x); }

// Whether a coordinate of a pixel is within an image of that size.
bool IsWithin(double x, int size_px) { return std::abs(x - 0.5 * size_px) <= (0.5 + kSlack) * size_px; }

// When a camera sees a sample well enough.
struct Limits {
  double min_cosine_square;  // signed
  double max_squared_ratio;
};

Limits LimitsOf(const FrustumOverlapOptions& options) {
  return {SignedSquare(std::cos(RadFromDeg(options.max_view_angle_deg))) - kSlack,
          options.max_scale_ratio * options.max_scale_ratio * (1 + kSlack)};
}

// What the overlaps of a camera's images are computed from, in the camera's frame.
struct SampledCamera {
  Camera camera;
  // Points on rays through a grid of pixels, at depths in geometric progression from near to far.
  std::vector<double> x, y, z, squared_distance;
  // No camera farther than this from the center sees a sample well enough, metres.
  double reach_m = 0;
  // Signed square of the cosine of an angle to the axis beyond which the camera sees nothing.
  double cone_square = -1;
};

double ConeSquare(const Camera& camera) {
  double largest_rad = 0;
  const auto look = [&](double x, double y) {
    const auto bearing = BearingFromImage(camera, {x, y});
    largest_rad =
        std::max(largest_rad, bearing ? std::acos(std::clamp(bearing->z(), -1.0, 1.0)) : std::numbers::pi);
  };
  for (int i = 0; i <= kNumBorderPixels; ++i) {
    const double part = static_cast<double>(i) / kNumBorderPixels;
    for (const double side : {0.0, 1.0}) {
      look(part * camera.width, side * camera.height);
      look(side * camera.width, part * camera.height);
    }
  }
  return SignedSquare(std::cos(std::min(std::numbers::pi, largest_rad + RadFromDeg(kConeMargin_deg)))) -
         kSlack;
}

SampledCamera Sample(const Camera& camera, const FrustumOverlapOptions& options) {
  SampledCamera sampled = {.camera = camera, .cone_square = ConeSquare(camera)};
  double largest_squared = 0;
  for (int row = 0; row < kGridRows; ++row) {
    for (int column = 0; column < kGridColumns; ++column) {
      const Eigen::Vector2d pixel((column + 0.5) / kGridColumns * camera.width,
                                  (row + 0.5) / kGridRows * camera.height);
      const auto ray = CameraFromImage(camera, pixel);
      if (!ray) continue;
      for (int d = 0; d < kNumDepths; ++d) {
        const double depth =
            options.near_m * std::pow(options.far_m / options.near_m, d / (kNumDepths - 1.0));
        const Eigen::Vector3d point = depth * ray->homogeneous();
        sampled.x.push_back(point.x());
        sampled.y.push_back(point.y());
        sampled.z.push_back(point.z());
        sampled.squared_distance.push_back(point.squaredNorm());
        largest_squared = std::max(largest_squared, point.squaredNorm());
      }
    }
  }
  // The third side of a triangle whose other sides and the angle between them are as large as allowed.
  const Limits limits = LimitsOf(options);
  const double cosine =
      std::copysign(std::sqrt(std::abs(limits.min_cosine_square)), limits.min_cosine_square);
  sampled.reach_m = std::sqrt(largest_squared * (1 + limits.max_squared_ratio -
                                                 2 * std::sqrt(limits.max_squared_ratio) * cosine)) *
                    (1 + kSlack);
  return sampled;
}

// An image's place among the others.
struct PlacedCamera {
  const SampledCamera* sampled = nullptr;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // world frame
  Eigen::Matrix3d cam_from_world = Eigen::Matrix3d::Identity();
};

// A second camera, in the frame of the first, and what it is to see samples well enough.
struct Sight {
  double center_x, center_y, center_z;
  double axis_x, axis_y, axis_z;
  double cone_square;
  Limits limits;
};

// Lists the samples that a second camera may see well enough: rays at no more than the angle, of distances of
// no more than the ratio, and in its cone.  Returns their number.
CAIRN_WIDE_CLONES int ListCandidates(const double* x, const double* y, const double* z,
                                     const double* squared_distance, int num_samples, const Sight& sight,
                                     int32_t* candidates) {
  constexpr int kAtOnce = 16;
  const double center_x = sight.center_x, center_y = sight.center_y, center_z = sight.center_z;
  const double axis_x = sight.axis_x, axis_y = sight.axis_y, axis_z = sight.axis_z;
  const double cone_square = sight.cone_square, min_cosine_square = sight.limits.min_cosine_square;
  const double max_squared_ratio = sight.limits.max_squared_ratio;
  int num_candidates = 0;
  for (int begin = 0; begin < num_samples; begin += kAtOnce) {
    const int num = std::min(kAtOnce, num_samples - begin);
    double lacking[kAtOnce];  // less than 0 where one of the conditions does not hold
    for (int k = 0; k < num; ++k) {
      const int i = begin + k;
      const double x2 = x[i] - center_x, y2 = y[i] - center_y, z2 = z[i] - center_z;
      const double squared1 = squared_distance[i], squared2 = x2 * x2 + y2 * y2 + z2 * z2;
      const double product = x[i] * x2 + y[i] * y2 + z[i] * z2;
      const double ahead = axis_x * x2 + axis_y * y2 + axis_z * z2;
      const double angle = product * std::abs(product) - min_cosine_square * squared1 * squared2;
      const double cone = ahead * std::abs(ahead) - cone_square * squared2;
      const double nearer = max_squared_ratio * squared2 - squared1;
      const double farther = max_squared_ratio * squared1 - squared2;
      lacking[k] = (angle - std::abs(angle)) + (cone - std::abs(cone)) + (nearer - std::abs(nearer)) +
                   (farther - std::abs(farther));
    }
    for (int k = 0; k < num; ++k) {
      candidates[num_candidates] = begin + k;
      num_candidates += lacking[k] >= 0 ? 1 : 0;
    }
  }
  return num_candidates;
}

// Samples of a first camera's frustum that a second may see well enough.
struct Candidates {
  std::vector<int32_t> idxs;  // the first `num`
  int num = 0;
};

// Compares frusta; keeps the memory that it needs.
class OverlapCounter {
 public:
  explicit OverlapCounter(const FrustumOverlapOptions& options)
      : min_overlap_ratio_(options.min_overlap_ratio), limits_(LimitsOf(options)) {}

  // Of the samples of `from`.
  double Overlap(const PlacedCamera& from, const PlacedCamera& other) {
    Look(from, other, &there_);
    return Count(from, other, there_);
  }

  // Mean of both overlaps, where one of them is large enough; otherwise less than 0.
  double MeanOverlap(const PlacedCamera& a, const PlacedCamera& b) {
    Look(a, b, &there_);
    Look(b, a, &back_);
    if (std::max(PartOf(there_.num, a), PartOf(back_.num, b)) < min_overlap_ratio_) return -1;
    const double there = Count(a, b, there_), back = Count(b, a, back_);
    return std::max(there, back) >= min_overlap_ratio_ ? 0.5 * (there + back) : -1;
  }

 private:
  void Look(const PlacedCamera& from, const PlacedCamera& other, Candidates* candidates) const {
    const SampledCamera& sampled = *from.sampled;
    const Eigen::Vector3d way = other.center - from.center;
    candidates->num = 0;
    if (way.squaredNorm() > sampled.reach_m * sampled.reach_m) return;
    candidates->idxs.resize(sampled.x.size() + 1);  // one more is written than counts
    const Eigen::Vector3d center = from.cam_from_world * way;
    const Eigen::Vector3d axis = from.cam_from_world * other.cam_from_world.row(2).transpose();
    const Sight sight = {
        center.x(), center.y(), center.z(), axis.x(), axis.y(), axis.z(), other.sampled->cone_square,
        limits_};
    candidates->num =
        ListCandidates(sampled.x.data(), sampled.y.data(), sampled.z.data(), sampled.squared_distance.data(),
                       static_cast<int>(sampled.x.size()), sight, candidates->idxs.data());
  }

  // Part of the samples that are candidates and within the other's image.
  static double Count(const PlacedCamera& from, const PlacedCamera& other, const Candidates& candidates) {
    const SampledCamera& sampled = *from.sampled;
    const Camera& camera = other.sampled->camera;
    const Eigen::Matrix3d other_from_cam = other.cam_from_world * from.cam_from_world.transpose();
    const Eigen::Vector3d translation = other.cam_from_world * (from.center - other.center);
    int num_seen = 0;
    for (int k = 0; k < candidates.num; ++k) {
      const int i = candidates.idxs[k];
      const Eigen::Vector3d sample(sampled.x[i], sampled.y[i], sampled.z[i]);
      const auto pixel = ImageFromCamera(camera, other_from_cam * sample + translation);
      num_seen += pixel && IsWithin(pixel->x(), camera.width) && IsWithin(pixel->y(), camera.height) ? 1 : 0;
    }
    return PartOf(num_seen, from);
  }

  static double PartOf(int num, const PlacedCamera& from) {
    const size_t num_samples = from.sampled->x.size();
    return num_samples == 0 ? 0.0 : static_cast<double>(num) / static_cast<double>(num_samples);
  }

  double min_overlap_ratio_;
  Limits limits_;
  Candidates there_, back_;
};

// The images with what is computed of each camera once.
class PlacedImages {
 public:
  PlacedImages(const std::vector<PosedCamera>& images, const FrustumOverlapOptions& options) {
    for (const PosedCamera& image : images) {
      const Camera& camera = image.camera;
      const auto [entry, is_new] =
          cameras_.try_emplace({static_cast<int>(camera.model), camera.width, camera.height,
                                std::vector<double>(camera.params.begin(), camera.params.end())});
      if (is_new) entry->second = Sample(camera, options);
      placed_.push_back(
          {&entry->second, image.cam_from_world.Center(), image.cam_from_world.rotation.toRotationMatrix()});
    }
  }

  const PlacedCamera& operator[](int idx) const { return placed_[idx]; }
  double LargestReach() const {
    double reach_m = 0;
    for (const auto& [key, sampled] : cameras_) reach_m = std::max(reach_m, sampled.reach_m);
    return reach_m;
  }
  std::vector<Eigen::Vector3d> Centers() const {
    std::vector<Eigen::Vector3d> centers;
    for (const PlacedCamera& image : placed_) centers.push_back(image.center);
    return centers;
  }

 private:
  std::map<std::tuple<int, int, int, std::vector<double>>, SampledCamera> cameras_;
  std::vector<PlacedCamera> placed_;
};

}  // namespace

double FrustumOverlap(const PosedCamera& image1, const PosedCamera& image2,
                      const FrustumOverlapOptions& options) {
  const PlacedImages placed({image1, image2}, options);
  return OverlapCounter(options).Overlap(placed[0], placed[1]);
}

Status RankOverlaps(const std::vector<PosedCamera>& images, const std::vector<int>& idxs,
                    const FrustumOverlapOptions& options, int num_threads, Progress& progress,
                    const TakeRanking& take) {
  const int num_images = static_cast<int>(images.size());
  const PlacedImages placed(images, options);
  const std::vector<Eigen::Vector3d> centers = placed.Centers();
  const double reach_m = placed.LargestReach();
  // Without a smallest overlap all images are partners of all others.
  const bool has_reach = options.min_overlap_ratio > 0 && reach_m > 0;
  const PointGrid grid(centers, has_reach ? reach_m : 1.0);
  progress.Begin("rank overlaps", std::ssize(idxs), "images");
  ParallelFor(std::ssize(idxs), num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const int idx = idxs[i];
    OverlapCounter counter(options);
    std::vector<OverlapPartner> partners;
    const auto look_at = [&](int other) {
      if (other == idx) return;
      // Of two images always from the same one, so that both have the same overlap with each other.
      const double overlap = counter.MeanOverlap(placed[std::min(idx, other)], placed[std::max(idx, other)]);
      if (overlap >= 0) partners.push_back({other, static_cast<float>(overlap)});
    };
    if (has_reach) {
      grid.ForNear(centers[idx], [&](int other, double) { look_at(other); });
    } else {
      for (int other = 0; other < num_images; ++other) look_at(other);
    }
    std::sort(partners.begin(), partners.end(), [](const OverlapPartner& a, const OverlapPartner& b) {
      return std::pair(-a.overlap, a.idx) < std::pair(-b.overlap, b.idx);
    });
    take(idx, partners);
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while ranking overlaps");
  return Ok();
}

}  // namespace cairn::match_features
