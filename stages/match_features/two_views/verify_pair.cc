#include "stages/match_features/two_views/verify_pair.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <Eigen/Dense>

#include "core/base/quantiles.h"
#include "core/geometry/estimate_two_view.h"
#include "core/geometry/relative_pose.h"
#include "core/geometry/two_view_error.h"

namespace cairn::match_features {
namespace {

// Error limits of a pair as angles.
struct Limits {
  double epipolar = 0, homography = 0, prior = 0;  // rad
};

// The models that the matches support, on bearings.
struct Model {
  TwoViewConfig config = TwoViewConfig::kDegenerate;
  std::optional<Eigen::Matrix3d> E, F, H;
  // Which model's inliers are kept: E or F, else H.
  bool is_homography = false;
  std::vector<int> inliers;

  const Eigen::Matrix3d& Epipolar() const { return E ? *E : *F; }
};

Correspondences CollectCorrespondences(const ViewForVerification& view1, const ViewForVerification& view2,
                                       std::span<const Match> matches) {
  Correspondences c;
  for (size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector3d& bearing1 = (*view1.bearings)[matches[i].idx1];
    const Eigen::Vector3d& bearing2 = (*view2.bearings)[matches[i].idx2];
    if (bearing1.allFinite() && bearing2.allFinite()) c.Add(bearing1, bearing2, static_cast<int>(i));
  }
  return c;
}

std::vector<int> EpipolarInliers(const Eigen::Matrix3d& M, const Correspondences& c, double max_error) {
  std::vector<int> inliers;
  for (int i = 0; i < c.size(); ++i) {
    if (SquaredSampsonError(M, c.bearings1[i], c.bearings2[i]) <= max_error * max_error) inliers.push_back(i);
  }
  return inliers;
}

std::vector<int> HomographyInliers(const Eigen::Matrix3d& H, const Correspondences& c, double max_error) {
  std::vector<int> inliers;
  for (int i = 0; i < c.size(); ++i) {
    if (SquaredTransferError(H, c.bearings1[i], c.bearings2[i]) <= max_error * max_error)
      inliers.push_back(i);
  }
  return inliers;
}

Correspondences Subset(const Correspondences& c, const std::vector<int>& indices) {
  Correspondences subset;
  for (const int i : indices) subset.Add(c.bearings1[i], c.bearings2[i], c.match_idx[i]);
  return subset;
}

bool IsPart(size_t num, double ratio, size_t num_all) {
  return static_cast<double>(num) > ratio * static_cast<double>(num_all);
}

// Whether the rays of a match can show the same thing from the stated poses: seen from the same side, and
// meeting in front of both cameras, up to the poses' error.
bool CanMeet(const Pose& stated, const Eigen::Vector3d& bearing1, const Eigen::Vector3d& bearing2,
             const Limits& limits, const VerifyPairOptions& options) {
  const Eigen::Vector3d ray1 = stated.rotation * bearing1;
  if (!(ray1.dot(bearing2) >= std::cos(RadFromDeg(options.max_ray_angle_deg)))) return false;
  if (stated.translation.norm() < options.min_baseline_m) return true;
  return RaysConverge(ray1, bearing2, -stated.translation, limits.prior);
}

// Without a baseline there are no epipolar lines: a match must lie where the rotation takes it.
Model TurnedCamera(const Pose& stated, const Correspondences& c, const Limits& limits) {
  Model model;
  model.is_homography = true;
  const Correspondences near =
      Subset(c, HomographyInliers(stated.rotation.toRotationMatrix(), c, limits.prior));
  if (near.size() < 3) return model;
  Eigen::Quaterniond rotation = RefineRotation(stated.rotation, near, limits.prior / 4, 3);
  rotation = RefineRotation(rotation, near, limits.homography / 2, 3);
  model.H = rotation.toRotationMatrix();
  model.inliers = HomographyInliers(*model.H, c, limits.homography);
  model.config = TwoViewConfig::kPanoramic;
  return model;
}

// Planar and panoramic pairs among those with an essential matrix and a known baseline.
void RecogniseHomography(const Pose& pose, const Correspondences& c, const Limits& limits,
                         const VerifyPairOptions& options, Model* model) {
  const Correspondences inliers = Subset(c, model->inliers);
  const Eigen::Matrix3d R =
      RefineRotation(pose.rotation, inliers, limits.homography / 2, 3).toRotationMatrix();
  const size_t num_inliers = model->inliers.size();
  if (IsPart(HomographyInliers(R, inliers, limits.homography).size(), options.min_homography_ratio,
             num_inliers)) {
    model->config = TwoViewConfig::kPanoramic;
    model->H = R;
    return;
  }
  // A few samples show that no homography has most of the inliers: 30 samples miss one with 4 of 5 inliers
  // once in 10 million.
  constexpr int kNumSamples = 30;
  model->H = EstimateHomography(inliers, {limits.homography, kNumSamples});
  if (model->H && IsPart(HomographyInliers(*model->H, inliers, limits.homography).size(),
                         options.min_homography_ratio, num_inliers)) {
    model->config = TwoViewConfig::kPlanar;
  }
}

Model PosedCameras(const Pose& stated, const Correspondences& c, const Limits& limits,
                   const VerifyPairOptions& options) {
  if (stated.translation.norm() < options.min_baseline_m) return TurnedCamera(stated, c, limits);
  Model model;
  const Correspondences near = Subset(c, EpipolarInliers(EssentialMatrix(stated), c, limits.prior));
  if (near.size() < options.min_num_inliers) return model;
  Pose pose = stated;
  // The scale shrinks from a quarter of the prior's error to half of an inlier's.
  for (const double scale : {limits.prior / 4, limits.epipolar, limits.epipolar / 2, limits.epipolar / 2})
    pose = RefineRelativePose(pose, near, scale, 3);
  model.E = EssentialMatrix(pose);
  model.inliers = EpipolarInliers(*model.E, c, limits.epipolar);
  if (static_cast<int>(model.inliers.size()) < options.min_num_inliers) return model;
  model.config = TwoViewConfig::kCalibrated;
  RecogniseHomography(pose, c, limits, options, &model);
  return model;
}

// The essential matrix of USAC, refined over all bearings where that gains inliers.
void EstimateCalibrated(const Correspondences& c, const Limits& limits, Model* model) {
  const auto E = EstimateEssentialMatrix(c, {.max_error_rad = limits.epipolar});
  if (!E) return;
  model->E = E;
  model->inliers = EpipolarInliers(*E, c, limits.epipolar);
  const Correspondences near = Subset(c, EpipolarInliers(*E, c, 2 * limits.epipolar));
  if (near.size() < 8) return;
  const Eigen::Matrix3d refined =
      EssentialMatrix(RefineRelativePose(PoseFromEssentialMatrix(*E, near), near, limits.epipolar / 2, 6));
  std::vector<int> inliers = EpipolarInliers(refined, c, limits.epipolar);
  if (inliers.size() < model->inliers.size()) return;
  model->E = refined;
  model->inliers = std::move(inliers);
}

// COLMAP 3.8's choice between the models.
Model UnposedCameras(bool has_intrinsics, const Correspondences& c, const Limits& limits,
                     const VerifyPairOptions& options) {
  Model model;
  if (c.size() < options.min_num_inliers) return model;
  if (has_intrinsics) EstimateCalibrated(c, limits, &model);
  const auto is_enough = [&](const std::vector<int>& inliers) {
    return static_cast<int>(inliers.size()) >= options.min_num_inliers;
  };
  // If E explains nearly all matches, no F can be better.
  if (!model.E || !IsPart(model.inliers.size(), options.min_essential_ratio, c.size())) {
    const auto F = EstimateFundamentalMatrix(c, {.max_error_rad = limits.epipolar});
    std::vector<int> inliers = F ? EpipolarInliers(*F, c, limits.epipolar) : std::vector<int>();
    if (!is_enough(model.inliers) ||
        !IsPart(model.inliers.size(), options.min_essential_ratio, inliers.size())) {
      model.E.reset();
      model.F = F;
      model.inliers = std::move(inliers);
    }
  }
  model.H = EstimateHomography(c, {.max_error_rad = limits.homography});
  std::vector<int> on_homography =
      model.H ? HomographyInliers(*model.H, c, limits.homography) : std::vector<int>();
  if (is_enough(model.inliers)) {
    model.config = IsPart(on_homography.size(), options.min_homography_ratio, model.inliers.size())
                       ? TwoViewConfig::kPlanarOrPanoramic
                   : model.E ? TwoViewConfig::kCalibrated
                             : TwoViewConfig::kUncalibrated;
  } else if (is_enough(on_homography)) {
    model.config = TwoViewConfig::kPlanarOrPanoramic;
    model.is_homography = true;
    model.E.reset();
    model.F.reset();
    model.inliers = std::move(on_homography);
  }
  return model;
}

Model EightPointCameras(bool has_intrinsics, const Correspondences& c, const Limits& limits) {
  Model model;
  // [Booij06 §III] a link: the local space can be reconstructed from the two images
  const auto M = EstimateByEightPoints(c, has_intrinsics, {.max_error_rad = limits.epipolar});
  if (!M) return model;
  (has_intrinsics ? model.E : model.F) = M;
  model.inliers = EpipolarInliers(*M, c, limits.epipolar);
  model.config = has_intrinsics ? TwoViewConfig::kCalibrated : TwoViewConfig::kUncalibrated;
  return model;
}

std::vector<Match> GuidedInliers(const ViewForVerification& view1, const ViewForVerification& view2,
                                 const Model& model, const Limits& limits, const std::vector<Match>& inliers,
                                 const VerifyPairOptions& options) {
  const GuidedView guided1{view1.keypoints, view1.bearings, view1.descriptors, view1.space},
      guided2{view2.keypoints, view2.bearings, view2.descriptors, view2.space};
  if (model.is_homography)
    return GuideByHomography(guided1, guided2, *model.H, limits.homography, inliers, options.guided);
  return GuideByEpipolarLines(guided1, guided2, model.Epipolar(), limits.epipolar, inliers, options.guided);
}

bool IsOnBorder(const Camera& camera, const Keypoint& keypoint, double border_ratio) {
  const double border = border_ratio * std::hypot(camera.width, camera.height);
  return !(keypoint.x >= border && keypoint.x <= camera.width - border && keypoint.y >= border &&
           keypoint.y <= camera.height - border);
}

// Whether most inliers are on the borders and keep their place up to one shift: of the shifts that single
// inliers propose, the best has enough followers.
bool IsWatermark(const ViewForVerification& view1, const ViewForVerification& view2,
                 const std::vector<Match>& inliers, const VerifyPairOptions& options) {
  std::vector<Eigen::Vector2d> shifts;
  size_t num_on_border = 0;
  for (const Match& match : inliers) {
    const Keypoint &k1 = (*view1.keypoints)[match.idx1], &k2 = (*view2.keypoints)[match.idx2];
    shifts.emplace_back(k2.x - k1.x, k2.y - k1.y);
    num_on_border += IsOnBorder(*view1.camera, k1, options.watermark_border_ratio) &&
                             IsOnBorder(*view2.camera, k2, options.watermark_border_ratio)
                         ? 1
                         : 0;
  }
  const double num_needed = options.min_watermark_ratio * static_cast<double>(inliers.size());
  if (static_cast<double>(num_on_border) < num_needed) return false;
  // A shift that most share is the median of both coordinates.
  const auto median = [&](int axis) {
    std::vector<double> values;
    for (const Eigen::Vector2d& shift : shifts) values.push_back(shift[axis]);
    return UpperMedian(std::move(values));
  };
  const Eigen::Vector2d shift(median(0), median(1));
  const auto num_followers = std::count_if(shifts.begin(), shifts.end(), [&](const Eigen::Vector2d& s) {
    return (s - shift).norm() <= options.max_homography_error_px;
  });
  return static_cast<double>(num_followers) >= num_needed;
}

Eigen::Matrix3d Calibration(const Camera& camera) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = camera.FocalX();
  K(1, 1) = camera.FocalY();
  K.topRightCorner<2, 1>() = camera.PrincipalPoint();
  return K;
}

}  // namespace

std::optional<Pose> StatedRelativePose(const std::optional<Pose>& cam1_from_world,
                                       const std::optional<Pose>& cam2_from_world) {
  if (!cam1_from_world || !cam2_from_world) return std::nullopt;
  return *cam2_from_world * cam1_from_world->Inverse();
}

TwoViewGeometry VerifyPair(const ViewForVerification& view1, const ViewForVerification& view2,
                           std::span<const Match> matches, const VerifyPairOptions& options) {
  const double focal_px = 0.5 * (view1.camera->MeanFocal() + view2.camera->MeanFocal());
  const Limits limits{options.max_epipolar_error_px / focal_px, options.max_homography_error_px / focal_px,
                      options.max_prior_error_px / focal_px};
  const bool is_eight_point = options.two_view == "eight_point";
  const std::optional<Pose> stated =
      is_eight_point ? std::nullopt : StatedRelativePose(view1.cam_from_world, view2.cam_from_world);
  const auto cannot_meet = [&](const Match& match) {
    return stated &&
           !CanMeet(*stated, (*view1.bearings)[match.idx1], (*view2.bearings)[match.idx2], limits, options);
  };
  std::vector<Match> candidates(matches.begin(), matches.end());
  std::erase_if(candidates, cannot_meet);
  const Correspondences c = CollectCorrespondences(view1, view2, candidates);
  const bool has_intrinsics = view1.camera->has_focal_prior && view2.camera->has_focal_prior;
  const Model model = is_eight_point ? EightPointCameras(has_intrinsics, c, limits)
                      : stated       ? PosedCameras(*stated, c, limits, options)
                                     : UnposedCameras(has_intrinsics, c, limits, options);

  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kDegenerate;
  if (model.config == TwoViewConfig::kDegenerate ||
      static_cast<int>(model.inliers.size()) < options.min_num_inliers) {
    return geometry;
  }
  std::vector<Match> inliers;
  for (const int i : model.inliers) inliers.push_back(candidates[c.match_idx[i]]);
  if (IsWatermark(view1, view2, inliers, options)) {
    geometry.config = TwoViewConfig::kWatermark;
    return geometry;
  }
  const bool is_guided = options.guided_matching == "all" || (options.guided_matching == "posed" && stated);
  if (is_guided && view1.descriptors != nullptr && view2.descriptors != nullptr)
    inliers = GuidedInliers(view1, view2, model, limits, inliers, options);
  std::erase_if(inliers, cannot_meet);
  if (static_cast<int>(inliers.size()) < options.min_num_inliers) return geometry;
  geometry.config = model.config;
  std::sort(inliers.begin(), inliers.end());
  geometry.inliers = std::move(inliers);
  const Eigen::Matrix3d K1_inverse = Calibration(*view1.camera).inverse(), K2 = Calibration(*view2.camera);
  if (model.E) geometry.E = *model.E;
  if (model.E || model.F) geometry.F = K2.inverse().transpose() * model.Epipolar() * K1_inverse;
  if (model.H) geometry.H = K2 * *model.H * K1_inverse;
  return geometry;
}

}  // namespace cairn::match_features
