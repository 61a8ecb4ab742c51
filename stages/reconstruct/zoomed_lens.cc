#include "stages/reconstruct/zoomed_lens.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/quantiles.h"
#include "core/base/text.h"
#include "stages/reconstruct/view_graph/calibrate_from_pairs.h"

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

// Images that follow each other: as many, every so many, with at least so many pairs of which at most so many
// are asked.
constexpr int kRunLength = 16, kRunStep = 8;
constexpr size_t kMinNumPairs = 20, kMaxNumAsked = 40;
// Of the ladder of focal lengths every other one.
constexpr int kNumCosts = (kNumLadderFocals + 1) / 2;
constexpr double kMinFocalFactor = 1.2, kMinCostDifference = 0.6;

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

// Images of a camera that follow each other, and the mean cost of their pairs by each focal length.
struct Run {
  int first = 0, last = 0;  // in the order of names
  std::array<double, kNumCosts> cost = {};
  int best = 0;  // of the costs
};

double FocalOf(const Camera& camera, int i) { return FocalOfLadder(camera, 2 * i); }

// Pairs within a run, of one camera.
std::optional<Run> RunOf(const Camera& camera, int first, int last,
                         const std::vector<const TwoViewGeometry*>& pairs) {
  if (pairs.size() < kMinNumPairs) return std::nullopt;
  Run run{first, last};
  double weight = 0;
  const size_t stride = 1 + (pairs.size() - 1) / kMaxNumAsked;
  for (size_t p = 0; p < pairs.size(); p += stride) {
    const double of_pair = std::sqrt(static_cast<double>(pairs[p]->inliers.size()));
    weight += of_pair;
    for (int i = 0; i < kNumCosts; ++i) {
      const double focal = FocalOf(camera, i);
      run.cost[i] += of_pair * FocalCost(pairs[p]->F, camera, focal, camera, focal);
    }
  }
  for (double& cost : run.cost) cost /= weight;
  run.best = static_cast<int>(std::min_element(run.cost.begin(), run.cost.end()) - run.cost.begin());
  return run;
}

// `place`: of the camera's images, in the order of their names.
std::vector<Run> RunsOf(const MapperInput& input, const Camera& camera, size_t num_images,
                        const std::map<ImageId, int>& place) {
  // By the earlier image.
  std::vector<std::vector<std::pair<int, const TwoViewGeometry*>>> pairs(num_images);
  for (const TwoViewGeometry& geometry : input.geometries) {
    const auto one = place.find(geometry.image_id1), other = place.find(geometry.image_id2);
    if (one == place.end() || other == place.end() || !TellsFocalLengths(geometry)) continue;
    const auto [earlier, later] = std::minmax(one->second, other->second);
    if (later - earlier < kRunLength) pairs[earlier].emplace_back(later, &geometry);
  }
  std::vector<Run> runs;
  for (int first = 0; first + kRunLength <= static_cast<int>(num_images); first += kRunStep) {
    const int last = first + kRunLength - 1;
    std::vector<const TwoViewGeometry*> within;
    for (int i = first; i <= last; ++i) {
      for (const auto& [later, geometry] : pairs[i]) {
        if (later <= last) within.push_back(geometry);
      }
    }
    if (const std::optional<Run> run = RunOf(camera, first, last, within)) runs.push_back(*run);
  }
  return runs;
}

// By how much two runs contradict each other; 0 where their focal lengths are nearly the same.
double CostDifference(const Camera& camera, const Run& a, const Run& b) {
  const double longer = FocalOf(camera, std::max(a.best, b.best)),
               shorter = FocalOf(camera, std::min(a.best, b.best));
  if (longer < kMinFocalFactor * shorter) return 0;
  return std::min(a.cost[b.best] - a.cost[a.best], b.cost[a.best] - b.cost[b.best]);
}

}  // namespace

std::string ZoomedPart(const MapperInput& input) {
  std::map<CameraId, std::vector<const DatabaseImage*>> of_cameras;
  for (const DatabaseImage& image : input.images) of_cameras[image.camera_id].push_back(&image);
  for (const auto& [camera_id, images] : of_cameras) {
    if (images.size() < kRunLength) continue;
    std::vector<std::string> names;
    for (const DatabaseImage* image : images) names.push_back(image->name);
    const std::vector<int> order = NaturalOrder(names);
    std::map<ImageId, int> place;
    for (size_t i = 0; i < order.size(); ++i) place[images[order[i]]->image_id] = static_cast<int>(i);
    const Camera& camera = input.cameras.at(camera_id);
    const std::vector<Run> runs = RunsOf(input, camera, names.size(), place);
    double most = kMinCostDifference;
    const Run *one = nullptr, *other = nullptr;
    for (size_t a = 0; a < runs.size(); ++a) {
      for (size_t b = a + 1; b < runs.size(); ++b) {
        const double difference = CostDifference(camera, runs[a], runs[b]);
        if (difference < most) continue;
        most = difference;
        one = &runs[a];
        other = &runs[b];
      }
    }
    if (one == nullptr) continue;
    const auto said = [&](const Run& run) {
      return fmt::format("from {} to {} about {:.0f} px", names[order[run.first]], names[order[run.last]],
                         FocalOf(camera, run.best));
    };
    return fmt::format(
        "images differ in focal length, {}, {}: the lens zoomed, or they are of several cameras; a map takes "
        "one focal length for all, and its places are not to be trusted; take the images with a fixed focal "
        "length, or give those of each as a [[capture]] of its own",
        said(*one), said(*other));
  }
  return "";
}

std::string ZoomedLens(const MapperInput& input) {
  const std::map<ImageId, int> index_of = IndexOf(input);
  int64_t num_zoomed = 0, num_others = 0;
  for (const TwoViewGeometry& geometry : input.geometries) {
    const int image1 = index_of.at(geometry.image_id1), image2 = index_of.at(geometry.image_id2);
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
