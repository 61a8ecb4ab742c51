#include "runtime/localize/match.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/blocks/map_blocks.h"
#include "core/camera/pixel_ray.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_matcher.h"
#include "core/work/work_budget.h"
#include "runtime/localize/refine.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// Keypoints of the query in square cells, for those near a pixel.
class KeypointGrid {
 public:
  KeypointGrid(const Query& query, double cell_px) : query_(query), cell_px_(cell_px) {
    num_columns_ = static_cast<int>(query.camera.width / cell_px) + 1;
    num_rows_ = static_cast<int>(query.camera.height / cell_px) + 1;
    first_of_cell_.assign(static_cast<size_t>(num_columns_) * num_rows_ + 1, 0);
    const size_t num = query.features.keypoints.size();
    for (size_t i = 0; i < num; ++i) {
      if (query.rays[i]) ++first_of_cell_[CellOf(query.features.keypoints[i])];
    }
    // Where each cell ends; counted down to where it begins.
    std::partial_sum(first_of_cell_.begin(), first_of_cell_.end(), first_of_cell_.begin());
    keypoints_.resize(first_of_cell_.back());
    for (size_t i = num; i-- > 0;) {
      if (query.rays[i])
        keypoints_[--first_of_cell_[CellOf(query.features.keypoints[i])]] = static_cast<KeypointIdx>(i);
    }
  }

  template <typename Visit>
  void VisitNear(const Eigen::Vector2d& pixel, double radius_px, const Visit& visit) const {
    for (int row = Clamp(pixel.y() - radius_px, num_rows_); row <= Clamp(pixel.y() + radius_px, num_rows_);
         ++row) {
      for (int col = Clamp(pixel.x() - radius_px, num_columns_);
           col <= Clamp(pixel.x() + radius_px, num_columns_); ++col) {
        const size_t cell = static_cast<size_t>(row) * num_columns_ + col;
        for (uint32_t k = first_of_cell_[cell]; k < first_of_cell_[cell + 1]; ++k) {
          const KeypointIdx i = keypoints_[k];
          const Keypoint& keypoint = query_.features.keypoints[i];
          const double dx = keypoint.x - pixel.x(), dy = keypoint.y - pixel.y();
          if (dx * dx + dy * dy <= radius_px * radius_px) visit(i);
        }
      }
    }
  }

 private:
  int Clamp(double coordinate, int count) const {
    return static_cast<int>(std::clamp(coordinate / cell_px_, 0.0, static_cast<double>(count - 1)));
  }
  size_t CellOf(const Keypoint& keypoint) const {
    return static_cast<size_t>(Clamp(keypoint.y, num_rows_)) * num_columns_ + Clamp(keypoint.x, num_columns_);
  }

  const Query& query_;
  double cell_px_;
  int num_columns_ = 0;
  int num_rows_ = 0;
  PooledVector<uint32_t> first_of_cell_;  // in keypoints_; one more than there are cells
  PooledVector<KeypointIdx> keypoints_;   // by cell
};

bool ScaleFits(const Keypoint& keypoint, const MapLandmark& landmark, double depth_m, double focal_px,
               double max_ratio) {
  if (landmark.scale_m <= 0 || keypoint.scale <= 0) return true;  // not known
  const double ratio = keypoint.scale * depth_m / (landmark.scale_m * focal_px);
  return ratio <= max_ratio && ratio * max_ratio >= 1;
}

// How far from its projection a landmark, at `point` in the camera's frame, may appear, px.
double GuidedRadius(const MapLandmark& landmark, const Eigen::Vector3d& point, const Pose& cam_from_world,
                    double focal_px, const MatchOptions& options) {
  if (point.z() <= 0) return options.guided_radius_px;  // beyond 90 degrees no keypoint has a ray
  Eigen::Matrix<double, 2, 3> ray_from_point;
  ray_from_point << 1, 0, -point.x() / point.z(), 0, 1, -point.y() / point.z();
  const Eigen::Matrix<double, 2, 3> pixel_from_world =
      focal_px / point.z() * ray_from_point * cam_from_world.rotation.toRotationMatrix();
  const Eigen::Matrix2d covariance = pixel_from_world * landmark.covariance * pixel_from_world.transpose();
  const double half_trace = 0.5 * covariance.trace();
  const double largest =
      half_trace + std::sqrt(std::max(0.0, half_trace * half_trace - covariance.determinant()));
  return std::sqrt(options.guided_radius_px * options.guided_radius_px +
                   options.guided_radius_sigmas * options.guided_radius_sigmas * largest);
}

// A landmark where a pose puts it in the image, or beyond its edge.
struct ProjectedLandmark {
  size_t k = 0;  // position in the set
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double depth = 0;
  double radius_px = 0;  // how far from there it is looked for
};

// Looks for landmarks near their projections at a pose.
class GuidedSearch {
 public:
  GuidedSearch(const Query& query, const LandmarkSet& landmarks, const Pose& cam_from_world,
               const MatchOptions& options)
      : query_(query),
        landmarks_(landmarks),
        options_(options),
        grid_(query, std::max(8.0, options.guided_radius_px)) {
    const double diagonal_px = std::hypot(query.camera.width, query.camera.height);
    const double focal_px = query.camera.MeanFocal();
    if (!Spend(query.work.get(), Work::kProject, landmarks.idx.size())) return;
    projected_.reserve(landmarks.idx.size());
    for (size_t k = 0; k < landmarks.idx.size(); ++k) {
      const MapLandmark& landmark = landmarks.landmarks[k];
      const Eigen::Vector3d point = cam_from_world * landmark.position;
      if (const auto pixel = PixelOf(query, point)) {
        projected_.push_back(
            {k, *pixel, DepthOfScale(query.camera, point),
             std::min(GuidedRadius(landmark, point, cam_from_world, focal_px, options), diagonal_px)});
      }
    }
  }

  // Each as far beside its projection as so many times its radius, where that is in the image.
  PooledVector<Correspondence> Match(const Eigen::Vector2d& moved_in_radii) const {
    const double focal_px = query_.camera.MeanFocal();
    const DescriptorSpace& space = query_.packed.space();
    const double min_dot = DotAtAngle(options_.guided_max_angle_rad, space);
    struct Best {
      int32_t dot = -1;
      LandmarkIdx landmark = 0;
    };
    PooledVector<Best> best_of_keypoint(query_.features.keypoints.size());
    size_t num_found = 0;
    for (const ProjectedLandmark& at : projected_) {
      const Eigen::Vector2d pixel = at.pixel + at.radius_px * moved_in_radii;
      if (!IsInImage(pixel, query_.camera)) continue;
      const uint8_t* descriptor = landmarks_.descriptors.row(static_cast<Eigen::Index>(at.k)).data();
      std::pair<int32_t, int64_t> best{-1, -1};  // dot product, keypoint
      size_t num_near = 1;
      grid_.VisitNear(pixel, at.radius_px, [&](KeypointIdx i) {
        ++num_near;
        if (!ScaleFits(query_.features.keypoints[i], landmarks_.landmarks[at.k], at.depth, focal_px,
                       options_.guided_max_scale_ratio))
          return;
        const int32_t dot = DescriptorDot(query_.features.descriptors.row(i).data(), descriptor, space);
        if (dot > best.first || (dot == best.first && i < best.second)) best = {dot, i};
      });
      if (!Spend(query_.work.get(), Work::kNear, num_near)) break;
      if (best.second < 0 || best.first < min_dot) continue;
      Best& known = best_of_keypoint[best.second];
      if (known.dot < 0) ++num_found;
      if (best.first > known.dot) known = {best.first, landmarks_.idx[at.k]};
    }
    PooledVector<Correspondence> correspondences;
    correspondences.reserve(num_found);
    for (size_t i = 0; i < best_of_keypoint.size(); ++i) {
      if (best_of_keypoint[i].dot >= 0)
        correspondences.push_back({static_cast<KeypointIdx>(i), best_of_keypoint[i].landmark});
    }
    return correspondences;
  }

 private:
  const Query& query_;
  const LandmarkSet& landmarks_;
  const MatchOptions& options_;
  KeypointGrid grid_;
  PooledVector<ProjectedLandmark> projected_;
};

}  // namespace

OptionTable DescribeOptions(MatchOptions* o) {
  OptionTable table = {
      {.name = "max_ratio",
       .value = &o->max_ratio,
       .help = "largest ratio of best to second-best descriptor angle, both ways",
       .min = 1e-3,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->max_angle_rad,
       .help = "largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "guided_radius_px",
       .value = &o->guided_radius_px,
       .help = "a landmark is looked for this near to its projection, px",
       .min = 0.1},
      {.name = "guided_radius_sigmas",
       .value = &o->guided_radius_sigmas,
       .help = "plus this many standard deviations of its own position, projected",
       .min = 0},
      {.name = "guided_max_angle_rad",
       .value = &o->guided_max_angle_rad,
       .help = "guided matching: largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "guided_max_scale_ratio",
       .value = &o->guided_max_scale_ratio,
       .help = "largest ratio of a keypoint's scale to the predicted one, either way",
       .min = 1},
      {.name = "guided_num_images",
       .value = &o->guided_num_images,
       .help = "survey images whose landmarks are looked for; 0: no guided matching",
       .min = 0},
      {.name = "guided_widest",
       .value = &o->guided_widest,
       .help = "where few matches led to a pose, landmarks are first looked for this many times as far from "
               "their projections, then half as far, and so on; 1: not",
       .min = 1,
       .max = 64},
      {.name = "guided_sure_num_inliers",
       .value = &o->guided_sure_num_inliers,
       .help = "so many matches are not few",
       .min = 0},
      {.name = "guided_max_num_rounds",
       .value = &o->guided_max_num_rounds,
       .help = "most rounds of guided matching, each at the pose that the one before refined",
       .min = 1},
  };
  AddCondition({"guided_widest", {"not 1"}}, {"guided_sure_num_inliers"}, &table);
  return table;
}

PooledVector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                            const MatchOptions& options) {
  const DescriptorMatcherOptions matcher_options{
      .max_ratio = options.max_ratio, .max_angle_rad = options.max_angle_rad, .mutual = true};
  if (!Spend(query.work.get(), Work::kDescriptorPair, query.features.keypoints.size() * landmarks.idx.size()))
    return {};
  PooledVector<Correspondence> correspondences;
  for (const Match& match : MatchDescriptors(query.packed, landmarks.packed, matcher_options)) {
    if (query.rays[match.idx1]) correspondences.push_back({match.idx1, landmarks.idx[match.idx2]});
  }
  return correspondences;
}

Result<PooledVector<LandmarkIdx>> CovisibleLandmarks(const Map& map, std::span<const LandmarkIdx> seen,
                                                     const MatchOptions& options, int64_t max_num,
                                                     WorkBudget* work) {
  PooledVector<int32_t> image_blocks;  // those that a landmark's block names
  int64_t ordinal = -1;
  for (const LandmarkIdx landmark : seen) {
    const int64_t next = map.directory().OrdinalOf(BlockKind::kLandmarks, landmark);
    if (next == ordinal) continue;
    ordinal = next;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Landmarks(ordinal));
    image_blocks.insert(image_blocks.end(), block->image_blocks.begin(), block->image_blocks.end());
  }
  SortUnique(&image_blocks);
  PooledVector<std::pair<int, int32_t>> order;
  for (const int32_t image_block : image_blocks) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(image_block));
    for (size_t i = 0; i < block->images.size(); ++i) {
      if (!Spend(work, Work::kListed, block->images[i].landmarks.size() + seen.size()))
        return PooledVector<LandmarkIdx>(seen.begin(), seen.end());
      const int num_shared = NumShared(block->images[i].landmarks, seen);
      if (num_shared > 0) order.emplace_back(-num_shared, block->first + static_cast<int32_t>(i));
    }
  }
  std::sort(order.begin(), order.end());
  PooledVector<LandmarkIdx> landmarks(seen.begin(), seen.end());
  for (size_t i = 0; i < order.size() && static_cast<int>(i) < options.guided_num_images; ++i) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(order[i].second));
    if (i > 0 && static_cast<int64_t>(landmarks.size() + image->landmarks.size()) > max_num) break;
    landmarks.insert(landmarks.end(), image->landmarks.begin(), image->landmarks.end());
  }
  SortUnique(&landmarks);
  return landmarks;
}

PooledVector<Correspondence> MatchGuided(const Sighting& sighting, const LandmarkSet& landmarks,
                                         const Pose& rig_from_world, const MatchOptions& options) {
  PooledVector<Correspondence> matches;
  for (int image = 0; image < sighting.num_images(); ++image) {
    const Query& query = sighting.images[image];
    PooledVector<Correspondence> of_image =
        GuidedSearch(query, landmarks, query.cam_from_rig * rig_from_world, options).Match({0, 0});
    for (Correspondence& match : of_image) match.image = image;
    if (matches.empty()) {
      matches = std::move(of_image);
    } else {
      matches.insert(matches.end(), of_image.begin(), of_image.end());
    }
  }
  return matches;
}

GuidedMatches MatchGuidedInRounds(const Sighting& sighting, const LandmarkSet& landmarks,
                                  const PoseEstimate& first, const MatchOptions& options,
                                  const EstimateOptions& estimate_options,
                                  const RefineOptions& refine_options) {
  GuidedMatches best{MatchGuided(sighting, landmarks, first.cam_from_world, options), first.cam_from_world};
  const bool is_sure = static_cast<int>(first.inliers.size()) >= options.guided_sure_num_inliers;
  Pose pose = first.cam_from_world;
  for (double wider = is_sure ? 1 : options.guided_widest; wider > 1; wider /= 2) {
    MatchOptions wide = options;
    wide.guided_radius_px *= wider;
    const auto estimate =
        EstimatePose(MakeMeasurements(sighting, landmarks, MatchGuided(sighting, landmarks, pose, wide)),
                     estimate_options, refine_options, kRansacSeed, sighting.up, sighting.work);
    if (!estimate) break;
    pose = estimate->cam_from_world;
    PooledVector<Correspondence> matches = MatchGuided(sighting, landmarks, pose, options);
    if (matches.size() > best.matches.size()) best = {std::move(matches), pose};
  }
  for (int round = 1; round < options.guided_max_num_rounds; ++round) {
    const auto refined = RefinePose(MakeMeasurements(sighting, landmarks, best.matches), best.cam_from_world,
                                    refine_options, sighting.up, sighting.work);
    if (!refined) break;
    PooledVector<Correspondence> matches = MatchGuided(sighting, landmarks, *refined, options);
    if (matches.size() <= best.matches.size()) break;
    best = {std::move(matches), *refined};
  }
  return best;
}

double GuidedByChance(const Sighting& sighting, const LandmarkSet& landmarks, const Pose& rig_from_world,
                      const MatchOptions& options) {
  constexpr double kRadii = 4;
  double sum = 0;
  for (const Query& query : sighting.images) {
    const GuidedSearch search(query, landmarks, query.cam_from_rig * rig_from_world, options);
    for (const Eigen::Vector2d& aside : {Eigen::Vector2d(kRadii, 0), Eigen::Vector2d(-kRadii, 0),
                                         Eigen::Vector2d(0, kRadii), Eigen::Vector2d(0, -kRadii)}) {
      sum += static_cast<double>(search.Match(aside).size());
    }
  }
  return sum / 4;
}

}  // namespace cairn
