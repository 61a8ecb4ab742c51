#include "stages/reconstruct/zoomed_lens.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "core/base/quantiles.h"

namespace cairn::reconstruct {
namespace {

using Complex = std::complex<double>;

// Parts of the longer side.
constexpr double kMinMotionRatio = 0.01, kMaxCentreRatio = 0.25;
constexpr double kMaxResidualRatio = 0.1;  // of how far the scale moves points
constexpr double kMinZoomedRatio = 0.8;
constexpr int64_t kMinNumZoomed = 3;
// Matches that are off by more than so many times the median are none, when it is fitted again.
constexpr double kOutlierFactor = 3;

enum class PairMotion { kNone, kZoom, kOther };

// Matches of a pair, pixels from the middles of the pictures.
struct Points {
  std::vector<Complex> before, after;
};

struct PictureSimilarity {
  Complex a = 1, b = 0;
  Complex operator()(const Complex& point) const { return a * point + b; }
};

// Least squares.
PictureSimilarity Fit(const Points& points) {
  const auto num = static_cast<double>(points.before.size());
  Complex mean_before = 0, mean_after = 0;
  for (size_t i = 0; i < points.before.size(); ++i) {
    mean_before += points.before[i] / num;
    mean_after += points.after[i] / num;
  }
  Complex product = 0;
  double spread = 0;
  for (size_t i = 0; i < points.before.size(); ++i) {
    const Complex before = points.before[i] - mean_before;
    product += std::conj(before) * (points.after[i] - mean_after);
    spread += std::norm(before);
  }
  if (!(spread > 0)) return {};
  const Complex a = product / spread;
  return {a, mean_after - a * mean_before};
}

std::vector<double> Residuals(const Points& points, const PictureSimilarity& similarity) {
  std::vector<double> residuals;
  for (size_t i = 0; i < points.before.size(); ++i)
    residuals.push_back(std::abs(similarity(points.before[i]) - points.after[i]));
  return residuals;
}

// Fitted twice: the second time without outliers.
PictureSimilarity FitMost(const Points& points) {
  const PictureSimilarity first = Fit(points);
  const std::vector<double> residuals = Residuals(points, first);
  const double max_residual = kOutlierFactor * Median(residuals);
  Points near;
  for (size_t i = 0; i < residuals.size(); ++i) {
    if (residuals[i] > max_residual) continue;
    near.before.push_back(points.before[i]);
    near.after.push_back(points.after[i]);
  }
  return Fit(near);
}

PairMotion MotionOf(const Points& points, double longer_side) {
  std::vector<double> moved, radii;
  for (size_t i = 0; i < points.before.size(); ++i) {
    moved.push_back(std::abs(points.after[i] - points.before[i]));
    radii.push_back(std::abs(points.before[i]));
  }
  if (Median(moved) < kMinMotionRatio * longer_side) return PairMotion::kNone;
  const PictureSimilarity similarity = FitMost(points);
  const double growth = std::abs(std::log(std::abs(similarity.a))) * Median(radii);
  if (growth < kMinMotionRatio * longer_side) return PairMotion::kOther;
  const bool is_about_the_middle =
      std::abs(similarity.b) < kMaxCentreRatio * longer_side * std::abs(1.0 - similarity.a);
  const bool explains_all = Median(Residuals(points, similarity)) < kMaxResidualRatio * growth;
  return is_about_the_middle && explains_all ? PairMotion::kZoom : PairMotion::kOther;
}

}  // namespace

std::string ZoomedLens(const MapperInput& input) {
  std::map<ImageId, size_t> index_of;
  for (size_t i = 0; i < input.images.size(); ++i) index_of[input.images[i].image_id] = i;
  int64_t num_zoomed = 0, num_others = 0;
  for (const TwoViewGeometry& geometry : input.geometries) {
    const size_t image1 = index_of.at(geometry.image_id1), image2 = index_of.at(geometry.image_id2);
    const CameraId camera_id = input.images[image1].camera_id;
    if (camera_id != input.images[image2].camera_id || geometry.inliers.empty()) continue;
    const Camera& camera = input.cameras.at(camera_id);
    const Complex middle(0.5 * camera.width, 0.5 * camera.height);
    Points points;
    for (const Match& match : geometry.inliers) {
      const Keypoint& before = input.keypoints[image1][match.idx1];
      const Keypoint& after = input.keypoints[image2][match.idx2];
      points.before.push_back(Complex(before.x, before.y) - middle);
      points.after.push_back(Complex(after.x, after.y) - middle);
    }
    const PairMotion motion = MotionOf(points, std::max(camera.width, camera.height));
    num_zoomed += motion == PairMotion::kZoom;
    num_others += motion == PairMotion::kOther;
  }
  if (num_zoomed < kMinNumZoomed ||
      static_cast<double>(num_zoomed) < kMinZoomedRatio * static_cast<double>(num_zoomed + num_others))
    return "";
  return fmt::format(
      "{} of the {} pairs of images between which something moves differ by nothing but the picture's size, "
      "near and far alike: the lens zoomed, or the camera went straight at a flat wall; places cannot be "
      "found from this, and those of the map are not to be trusted; take the images with a fixed focal "
      "length, and walk past things at different distances",
      num_zoomed, num_zoomed + num_others);
}

}  // namespace cairn::reconstruct
