#include "stages/reconstruct/view_graph/calibrate_from_pairs.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/SVD>

#include "core/structure/camera_sensitivity.h"

namespace cairn::reconstruct {
namespace {

// Ladder of focal lengths, as parts of the image's longer side.
constexpr double kMinFocalRatio = 0.3, kMaxFocalRatio = 4;
constexpr int kNumSweeps = 10, kNumRefineSteps = 12;
// Difference of the two singular values over their mean that counts as that of a good pair.
constexpr double kGoodDifference = 0.02;
// What is likely of a focal length before anything is seen: as a part of the longer side, the logarithm's
// standard deviation, and how much that counts beside the pairs' mean cost.  Cameras that turn on the spot or
// walk about have a cost that is lower by 1 to 4 at the right one; one that drives straight ahead has nearly
// the same everywhere.
constexpr double kLikelyFocalRatio = 0.8, kLogSigma = 0.35, kWeightOfLikely = 0.2;

// A pair with a fundamental matrix, of two cameras.
struct FocalPair {
  const Eigen::Matrix3d* F;
  CameraId camera1, camera2;
  double weight;
};

class FocalSearch {
 public:
  explicit FocalSearch(const MapperInput& input) : cameras_(input.cameras) {
    for (const auto& [camera_id, camera] : cameras_) focals_[camera_id] = camera.MeanFocal();
    const std::map<ImageId, int> index = IndexOf(input);
    for (const TwoViewGeometry& geometry : input.geometries) {
      if (!TellsFocalLengths(geometry)) continue;
      const CameraId camera1 = input.images[index.at(geometry.image_id1)].camera_id,
                     camera2 = input.images[index.at(geometry.image_id2)].camera_id;
      if (cameras_.at(camera1).has_focal_prior && cameras_.at(camera2).has_focal_prior) continue;
      pairs_.push_back(
          {&geometry.F, camera1, camera2, std::sqrt(static_cast<double>(geometry.inliers.size()))});
    }
  }

  std::map<CameraId, Camera> Search() {
    for (int sweep = 0; sweep < kNumSweeps; ++sweep) {
      bool changed = false;
      for (auto& [camera_id, camera] : cameras_) {
        if (!camera.has_focal_prior && SearchCamera(camera_id, camera)) changed = true;
      }
      if (!changed || cameras_.size() == 1) break;
    }
    for (auto& [camera_id, camera] : cameras_) {
      if (camera.has_focal_prior) continue;
      const double ratio = focals_[camera_id] / camera.MeanFocal();
      for (int p = 0; p < NumFocals(camera.model); ++p) camera.params[p] *= ratio;
    }
    return cameras_;
  }

 private:
  double Cost(CameraId camera_id, double focal) const {
    double cost = 0, weight = 0;
    for (const FocalPair& pair : pairs_) {
      if (pair.camera1 != camera_id && pair.camera2 != camera_id) continue;
      const auto focal_of = [&](CameraId id) { return id == camera_id ? focal : focals_.at(id); };
      cost += pair.weight * FocalCost(*pair.F, cameras_.at(pair.camera1), focal_of(pair.camera1),
                                      cameras_.at(pair.camera2), focal_of(pair.camera2));
      weight += pair.weight;
    }
    const Camera& camera = cameras_.at(camera_id);
    const double from_likely =
        std::log(focal / (kLikelyFocalRatio * std::max(camera.width, camera.height))) / kLogSigma;
    return (weight > 0 ? cost / weight : 0) + kWeightOfLikely * from_likely * from_likely;
  }

  bool SearchCamera(CameraId camera_id, const Camera& camera) {
    const auto focal_at = [&](double i) { return FocalOfLadder(camera, i); };
    double best = -1, least = 0;
    for (int i = 0; i < kNumLadderFocals; ++i) {
      const double cost = Cost(camera_id, focal_at(i));
      if (best >= 0 && !(cost < least)) continue;
      best = i, least = cost;
    }
    double width = 0.5;
    for (int refine = 0; refine < kNumRefineSteps; ++refine, width *= 0.5) {
      for (const double at : {best - width, best + width}) {
        const double cost = Cost(camera_id, focal_at(at));
        if (cost < least) best = at, least = cost;
      }
    }
    const bool changed = focals_[camera_id] != focal_at(best);
    focals_[camera_id] = focal_at(best);
    return changed;
  }

  std::map<CameraId, Camera> cameras_;
  std::map<CameraId, double> focals_;
  std::vector<FocalPair> pairs_;
};

}  // namespace

Eigen::Matrix3d CalibrationMatrix(double focal, const Eigen::Vector2d& centre) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = K(1, 1) = focal;
  K(0, 2) = centre.x();
  K(1, 2) = centre.y();
  return K;
}

double FocalCost(const Eigen::Matrix3d& F, const Camera& camera1, double focal1, const Camera& camera2,
                 double focal2) {
  const Eigen::Matrix3d E = CalibrationMatrix(focal2, camera2.PrincipalPoint()).transpose() * F *
                            CalibrationMatrix(focal1, camera1.PrincipalPoint());
  const Eigen::Vector3d values = E.jacobiSvd().singularValues();
  const double difference = 2 * (values[0] - values[1]) / std::max(values[0] + values[1], 1e-300);
  return std::log1p(difference * difference / (kGoodDifference * kGoodDifference));
}

bool TellsFocalLengths(const TwoViewGeometry& geometry) {
  return !geometry.F.isZero() && geometry.config != TwoViewConfig::kPlanarOrPanoramic;
}

double FocalOfLadder(const Camera& camera, double i) {
  const double side = std::max(camera.width, camera.height);
  const double step = std::log(kMaxFocalRatio / kMinFocalRatio) / (kNumLadderFocals - 1);
  return side * kMinFocalRatio * std::exp(step * i);
}

std::map<CameraId, Camera> CalibrateFromPairs(const MapperInput& input) {
  return FocalSearch(input).Search();
}

}  // namespace cairn::reconstruct
