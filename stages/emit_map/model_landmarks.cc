#include "stages/emit_map/model_landmarks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/camera/camera_turn.h"
#include "core/geometry/floor_pose.h"
#include "stages/emit_map/learn_focal.h"

namespace cairn::emit_map {
namespace {

// Headings closer than this count as equal; a survey with more headings than this gets regular ones.
constexpr double kSameHeadingDeg = 5;
constexpr size_t kMaxNumOwnHeadings = 16;
constexpr double kDrivenHeadingStepDeg = 45;
// Largest number of sights on which kernels are compared.
constexpr size_t kNumSightsToCompare = 48;

// Cameras within this of their mean height count as equally high, metres.
constexpr double kSameHeightM = 0.005;

// Nine of ten squares of normal numbers lie below.
constexpr double kNineOfTen = 2.706;

// A turn may move a sight out of its image; farther outside than this it is not stored, px.
constexpr double kFarthestOutPx = 2000;

bool IsFarOut(const Eigen::Vector3d& from_middle, const Eigen::Vector2d& middle) {
  return (from_middle.head<2>().cwiseAbs() - middle).maxCoeff() > kFarthestOutPx;
}

// Rotation to a camera at the same place with the same heading but without pitch and roll.
Eigen::Matrix3d LevelFromCamera(const Pose& cam_from_world, const Pose& floor_from_world) {
  const double heading_rad = RadFromDeg(FloorPoseOf(cam_from_world, floor_from_world).heading_deg);
  const double c = std::cos(heading_rad), s = std::sin(heading_rad);
  Eigen::Matrix3d level_from_floor;
  level_from_floor << s, -c, 0, 0, 0, -1, c, s, 0;
  return level_from_floor *
         (floor_from_world.rotation * cam_from_world.rotation.conjugate()).toRotationMatrix();
}

struct PlacedSight {
  Sight sight;
  LandmarkSight stored;
};

CameraId MostUsedCamera(const MapRows& rows) {
  std::map<CameraId, int> counts;
  for (const MapImage& image : rows.images) ++counts[image.camera_id];
  return std::max_element(counts.begin(), counts.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

std::vector<double> FindHeadings(const std::vector<FloorPose>& poses) {
  std::vector<double> headings;
  for (const FloorPose& pose : poses) {
    const bool is_known = std::any_of(headings.begin(), headings.end(), [&](double heading) {
      return AngleBetweenDeg(heading, pose.heading_deg) < kSameHeadingDeg;
    });
    if (!is_known) headings.push_back(pose.heading_deg);
    if (headings.size() > kMaxNumOwnHeadings) break;
  }
  if (headings.size() > kMaxNumOwnHeadings) {
    headings.clear();
    for (double heading = 0; heading < 360; heading += kDrivenHeadingStepDeg) headings.push_back(heading);
  }
  // Rounded as the file stores them; slightly below a full turn becomes 0.
  for (double& heading : headings) {
    heading = std::round(heading * 100) / 100;
    if (heading >= 360) heading = 0;
  }
  std::sort(headings.begin(), headings.end());
  return headings;
}

int NearestHeading(const std::vector<double>& headings, double heading_deg) {
  int nearest = 0;
  for (int i = 1; i < static_cast<int>(headings.size()); ++i) {
    if (AngleBetweenDeg(headings[i], heading_deg) < AngleBetweenDeg(headings[nearest], heading_deg))
      nearest = i;
  }
  return nearest;
}

// Up to `count` sights, far from each other: beginning with the first, each is the farthest from
// those before.
std::vector<PlacedSight> Thin(std::vector<PlacedSight> sights, size_t count) {
  if (sights.size() <= count) return sights;
  std::vector<double> distance(sights.size(), std::numeric_limits<double>::infinity());
  std::vector<char> is_kept(sights.size(), 0);
  size_t next = 0;
  for (size_t i = 0; i < count; ++i) {
    is_kept[next] = 1;
    for (size_t k = 0; k < sights.size(); ++k)
      distance[k] = std::min(distance[k], (sights[k].sight.place - sights[next].sight.place).norm());
    next = std::max_element(distance.begin(), distance.end()) - distance.begin();
  }
  std::vector<PlacedSight> kept;
  for (size_t i = 0; i < sights.size(); ++i) {
    if (is_kept[i]) kept.push_back(sights[i]);
  }
  return kept;
}

std::vector<Sight> SightsOf(const std::vector<PlacedSight>& placed) {
  std::vector<Sight> sights;
  for (const PlacedSight& sight : placed) sights.push_back(sight.sight);
  return sights;
}

class Modeller {
 public:
  Modeller(const Classes& classes, const MapRows& rows, const EmitMapOptions& options)
      : rows_(rows), options_(options) {
    for (size_t i = 0; i < classes.classes.size(); ++i)
      class_of_id_[classes.classes[i].class_id] = &classes.classes[i];
    result_.camera_id = MostUsedCamera(rows);
    for (const Camera& camera : rows.cameras) {
      if (camera.camera_id == result_.camera_id) {
        middle_ = {0.5 * camera.width, 0.5 * camera.height};
        width_px_ = camera.width;
      }
    }
    std::vector<FloorPose> of_camera;
    std::vector<double> squared_tilts;
    const Pose given_from_camera = rows.camera_from_given.Inverse();
    for (size_t i = 0; i < rows.images.size(); ++i) {
      const MapImage& image = rows.images[i];
      image_of_id_[image.image_id] = static_cast<int32_t>(i);
      const Pose cam_from_world = given_from_camera * image.cam_from_world;
      poses_.push_back(FloorPoseOf(cam_from_world, rows.floor_from_world));
      heights_m_.push_back((rows.floor_from_world * cam_from_world.Center()).z());
      level_from_camera_.push_back(LevelFromCamera(cam_from_world, rows.floor_from_world));
      if (image.camera_id != result_.camera_id) continue;
      of_camera.push_back(poses_.back());
      const double lean = Eigen::AngleAxisd(level_from_camera_.back()).angle();
      squared_tilts.push_back(0.5 * lean * lean);  // of two axes
    }
    result_.errors.tilt_rad =
        static_cast<float>(std::sqrt(std::accumulate(squared_tilts.begin(), squared_tilts.end(), 0.0) /
                                     static_cast<double>(std::max<size_t>(squared_tilts.size(), 1))));
    mean_height_m_ =
        std::accumulate(heights_m_.begin(), heights_m_.end(), 0.0) / static_cast<double>(heights_m_.size());
    result_.headings_deg = FindHeadings(of_camera);
    LearnTurn();
  }

  Result<VisualMapData> Run(int num_threads) {
    result_.landmarks.resize(rows_.landmarks.size());
    ParallelFor(static_cast<int64_t>(rows_.landmarks.size()), num_threads,
                [&](int64_t i) { result_.landmarks[i] = ModelsOf(rows_.landmarks[i].class_id); });
    CAIRN_RETURN_IF_ERROR(RoundAsStored(&result_));
    return std::move(result_);
  }

 private:
  // Calls visit(image index, keypoint) for the class's observations by the camera.
  template <typename Visit>
  void VisitSights(ClassId class_id, const Visit& visit) const {
    const auto found = class_of_id_.find(class_id);
    if (found == class_of_id_.end()) return;
    for (const Observation& observation : found->second->observations) {
      const auto image = image_of_id_.find(observation.image_id);
      if (image == image_of_id_.end() || rows_.images[image->second].camera_id != result_.camera_id) continue;
      visit(image->second, observation.keypoint);
    }
  }

  void LearnTurn() {
    std::vector<std::vector<FloorSight>> landmarks;
    for (const auto& [class_id, feature_class] : class_of_id_) {
      std::vector<FloorSight>& sights = landmarks.emplace_back();
      VisitSights(class_id, [&](int32_t image, const Keypoint& keypoint) {
        const FloorPose& pose = poses_[image];
        const Eigen::Matrix3d& level = level_from_camera_[image];
        const Eigen::Vector2d px = Eigen::Vector2d(keypoint.x, keypoint.y) - middle_;
        sights.push_back({pose.position,
                          RadFromDeg(pose.heading_deg),
                          {level.block<1, 2>(0, 0).dot(px), level(0, 2)},
                          {level.block<1, 2>(2, 0).dot(px), level(2, 2)}});
      });
    }
    result_.focal_px = static_cast<float>(LearnFocal(landmarks, width_px_));
  }

  std::vector<HeadingModel> ModelsOf(ClassId class_id) const {
    std::map<int, std::vector<PlacedSight>> of_heading;
    VisitSights(class_id, [&](int32_t image, const Keypoint& keypoint) {
      const FloorPose& pose = poses_[image];
      const int heading = NearestHeading(result_.headings_deg, pose.heading_deg);
      const double turn_deg = std::remainder(result_.headings_deg[heading] - pose.heading_deg, 360);
      Eigen::Vector3d seen(keypoint.x - middle_.x(), keypoint.y - middle_.y(),
                           std::log2(std::max(keypoint.scale, 1e-3F)));
      if (std::abs(turn_deg) > kSameHeadingDeg || result_.focal_px > 0) {
        if (result_.focal_px == 0) return;
        const auto turned =
            TurnedSight(seen, CameraTurn(RadFromDeg(turn_deg)) * level_from_camera_[image], result_.focal_px);
        if (!turned) return;
        seen = *turned;
        if (IsFarOut(seen, middle_)) return;
      }
      seen.head<2>() += middle_;
      of_heading[heading].push_back({{pose.position, seen}, {image, seen.cast<float>()}});
    });
    size_t num_sights = 0;
    for (const auto& [heading, sights] : of_heading) num_sights += sights.size();
    std::vector<HeadingModel> models;
    for (auto& [heading, sights] : of_heading) {
      const size_t share = options_.max_num_sights * sights.size() / num_sights;
      if (auto model = ModelOf(heading, Thin(std::move(sights), std::max<size_t>(share, kMinNumSights))))
        models.push_back(std::move(*model));
    }
    return models;
  }

  // Moves sights to where a camera at the survey's mean height would have had them.  The size of the effect
  // follows from how things move sideways with the camera, which does not depend on heights.
  void LevelHeights(int heading, std::vector<PlacedSight>* placed) const {
    const auto is_level = [&](const PlacedSight& sight) {
      return std::abs(heights_m_[sight.stored.image] - mean_height_m_) < kSameHeightM;
    };
    if (result_.focal_px == 0 || std::all_of(placed->begin(), placed->end(), is_level)) return;
    const auto choice = ChooseKernel(SightsOf(Thin(*placed, kNumSightsToCompare)));
    if (!choice) return;
    const auto model = LandmarkModel::Make(SightsOf(*placed), choice->shape);
    if (!model) return;
    const double heading_rad = RadFromDeg(result_.headings_deg[heading]);
    for (PlacedSight& sight : *placed) {
      const double rise = RiseOf(model->Predict(sight.sight.place).gradient, heading_rad);
      sight.sight.seen.y() -= rise * (heights_m_[sight.stored.image] - mean_height_m_);
      sight.stored.seen = sight.sight.seen.cast<float>();
    }
    std::erase_if(*placed, [&](const PlacedSight& sight) {
      return IsFarOut(sight.sight.seen - Eigen::Vector3d(middle_.x(), middle_.y(), 0), middle_);
    });
  }

  std::optional<HeadingModel> ModelOf(int heading, std::vector<PlacedSight> placed) const {
    LevelHeights(heading, &placed);
    const auto choice = ChooseKernel(SightsOf(Thin(placed, kNumSightsToCompare)));
    if (!choice) return std::nullopt;
    const auto errors = LandmarkModel::LeaveOneOutErrors(SightsOf(placed), choice->shape);
    if (!errors) return std::nullopt;
    HeadingModel model{.heading = heading, .shape = choice->shape};
    // [Sala06 §VI-C: after Sim & Dudek] e's covariance from cross-validation, of nine in ten errors
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::VectorXd squares = errors->row(axis).cwiseAbs2();
      model.sigma[axis] = std::sqrt(Decile({squares.begin(), squares.end()}, 9) / kNineOfTen);
    }
    model.predicts_badly = model.sigma.head<2>().norm() > options_.bad_model_px;
    for (const PlacedSight& sight : placed) model.sights.push_back(sight.stored);
    return model;
  }

  const MapRows& rows_;
  const EmitMapOptions& options_;
  VisualMapData result_;
  std::map<ClassId, const FeatureClass*> class_of_id_;
  std::map<ImageId, int32_t> image_of_id_;
  std::vector<FloorPose> poses_;
  std::vector<double> heights_m_;
  double mean_height_m_ = 0;
  std::vector<Eigen::Matrix3d> level_from_camera_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  int width_px_ = 0;
};

}  // namespace

Result<VisualMapData> ModelLandmarks(const Classes& classes, const MapRows& rows,
                                     const EmitMapOptions& options, int num_threads) {
  if (rows.images.empty()) return MakeError(ErrorCode::kNoData, "visual map: the survey has no image");
  return Modeller(classes, rows, options).Run(num_threads);
}

}  // namespace cairn::emit_map
