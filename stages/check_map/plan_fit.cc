#include "stages/check_map/plan_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "core/base/quantiles.h"
#include "core/geometry/floor_pose.h"

namespace cairn::check_map {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr int kMaxNumLandmarks = 1500;
constexpr int kMinNumLandmarks = 30;
constexpr double kMaxNumCells = 4e6;
constexpr double kCoarseScaleM = 0.5, kFineScaleM = 0.15;
// A motion has to gain this much to count: landmarks are an imperfect sample of the walls.
constexpr double kMinGainRatio = 1.05;

// Distances from the nearest wall, up to kMaxWallDistanceM, at the middles of cells, accurate to
// about a cell.
class WallDistances {
 public:
  explicit WallDistances(const FloorPlan& plan) {
    Vec2 low = plan.walls[0].start, high = low;
    for (const PlanWall& wall : plan.walls) {
      low = low.cwiseMin(wall.start.cwiseMin(wall.end));
      high = high.cwiseMax(wall.start.cwiseMax(wall.end));
    }
    low_ = low.array() - kMaxWallDistanceM;
    const Vec2 size = high - low_ + Vec2::Constant(kMaxWallDistanceM);
    cell_ = std::max({0.02, std::sqrt(size.x() * size.y() / kMaxNumCells), size.maxCoeff() / kMaxNumCells});
    num_columns_ = static_cast<int>(size.x() / cell_) + 1;
    num_rows_ = static_cast<int>(size.y() / cell_) + 1;
    cv::Mat free(num_rows_, num_columns_, CV_8U, cv::Scalar(1));
    constexpr int kShift = 4;  // ends to sixteenths of a cell; a cell's middle is its whole number
    const auto at = [&](const Vec2& place) {
      const Vec2 cell = ((place - low_) / cell_).array() - 0.5;
      return cv::Point(cvRound(std::ldexp(cell.x(), kShift)), cvRound(std::ldexp(cell.y(), kShift)));
    };
    for (const PlanWall& wall : plan.walls)
      cv::line(free, at(wall.start), at(wall.end), cv::Scalar(0), 1, cv::LINE_8, kShift);
    cv::distanceTransform(free, distances_, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  }

  double At(const Vec2& place) const {
    const Vec2 at = (place - low_) / cell_;
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < num_columns_ && at.y() < num_rows_))
      return kMaxWallDistanceM;
    const float cells = distances_.at<float>(static_cast<int>(at.y()), static_cast<int>(at.x()));
    return std::min(kMaxWallDistanceM, cells * cell_);
  }

 private:
  Vec2 low_;
  double cell_ = 0;
  int num_columns_ = 0, num_rows_ = 0;
  cv::Mat distances_;  // in cells
};

// A motion of the landmarks about their middle.
struct Motion {
  Vec2 shift = Vec2::Zero();
  double turn_rad = 0;
};

class Fitter {
 public:
  Fitter(const FloorPlan& plan, std::vector<Vec2> places, const PlanFitOptions& options)
      : distances_(plan), places_(std::move(places)), options_(options) {
    for (const Vec2& place : places_) center_ += place / static_cast<double>(places_.size());
    for (Vec2& place : places_) {
      place -= center_;
      radius_ = std::max(radius_, place.norm());
    }
  }

  const Vec2& center() const { return center_; }

  std::vector<double> Distances(const Motion& motion) const {
    const Eigen::Rotation2Dd turn(motion.turn_rad);
    std::vector<double> distances;
    for (const Vec2& place : places_)
      distances.push_back(distances_.At(turn * place + center_ + motion.shift));
    return distances;
  }

  double Score(const Motion& motion, double scale_m) const {
    const Eigen::Matrix2d turn = Eigen::Rotation2Dd(motion.turn_rad).toRotationMatrix();
    const Vec2 middle = center_ + motion.shift;
    double score = 0;
    for (const Vec2& place : places_) {
      const double ratio = distances_.At(turn * place + middle) / scale_m;
      score += std::max(0.0, 1 - ratio * ratio);
    }
    return score;
  }

  // Tries motions over the whole range, then refines the best.
  Motion Best() const {
    const double step_m = kCoarseScaleM / 2;
    const double step_rad = std::clamp(step_m / std::max(1.0, radius_), RadFromDeg(0.1), RadFromDeg(1.0));
    const int num_shifts = static_cast<int>(std::ceil(options_.plan_max_shift_m / step_m));
    const int num_turns = static_cast<int>(std::ceil(RadFromDeg(options_.plan_max_turn_deg) / step_rad));
    Motion best;
    double best_score = Score(best, kCoarseScaleM);
    for (int turn = -num_turns; turn <= num_turns; ++turn) {
      for (int x = -num_shifts; x <= num_shifts; ++x) {
        for (int y = -num_shifts; y <= num_shifts; ++y) {
          const Motion motion{{x * step_m, y * step_m}, turn * step_rad};
          const double score = Score(motion, kCoarseScaleM);
          if (score > best_score) best = motion, best_score = score;
        }
      }
    }
    best = Refined(best, step_m, step_rad);
    // Where the plan is nearly right, refining from there may give a higher value.
    const Motion near = Refined({}, step_m, step_rad);
    return Score(near, kFineScaleM) >= Score(best, kFineScaleM) ? near : best;
  }

 private:
  // Takes steps along the axes while they gain, then halves them.
  Motion Refined(Motion motion, double step_m, double step_rad) const {
    double score = Score(motion, kFineScaleM);
    for (; step_m > 0.005; step_m /= 2, step_rad /= 2) {
      for (bool gains = true; gains;) {
        gains = false;
        for (const Motion& step :
             {Motion{{step_m, 0}, 0}, Motion{{-step_m, 0}, 0}, Motion{{0, step_m}, 0},
              Motion{{0, -step_m}, 0}, Motion{{0, 0}, step_rad}, Motion{{0, 0}, -step_rad}}) {
          const Motion moved{motion.shift + step.shift, motion.turn_rad + step.turn_rad};
          const double moved_score = Score(moved, kFineScaleM);
          if (moved_score <= score) continue;
          motion = moved, score = moved_score, gains = true;
        }
      }
    }
    return motion;
  }

  WallDistances distances_;
  std::vector<Vec2> places_;  // from the center
  Vec2 center_ = Vec2::Zero();
  double radius_ = 0;
  const PlanFitOptions& options_;
};

// Floor places of landmarks near the cameras' height, evenly sampled.
std::vector<Vec2> LandmarkPlaces(const MapRows& rows, double band_m) {
  std::vector<double> heights;
  for (const MapImage& image : rows.images)
    heights.push_back((rows.floor_from_world * image.cam_from_world.Center()).z());
  if (heights.empty()) return {};
  const double middle = UpperMedian(std::move(heights));
  std::vector<Vec2> places;
  for (const MapLandmark& landmark : rows.landmarks) {
    const Eigen::Vector3d place = rows.floor_from_world * landmark.position;
    if (std::abs(place.z() - middle) <= band_m) places.emplace_back(place.head<2>());
  }
  const size_t step = places.size() / kMaxNumLandmarks + 1;
  std::vector<Vec2> some;
  for (size_t i = 0; i < places.size(); i += step) some.push_back(places[i]);
  return some;
}

double Ratio(int part, int whole) { return static_cast<double>(part) / std::max(1, whole); }

}  // namespace

OptionTable DescribeOptions(PlanFitOptions* o) {
  return {
      {.name = "plan_wall_distance_m",
       .value = &o->plan_wall_distance_m,
       .help = "floor plan: a landmark this close to a wall lies on it, m",
       .min = 1e-3,
       .max = kMaxWallDistanceM},
      {.name = "plan_height_band_m",
       .value = &o->plan_height_band_m,
       .help = "floor plan: landmarks this far above or below the cameras' median height are compared with "
               "the walls, m",
       .min = 0.01},
      {.name = "plan_max_shift_m",
       .value = &o->plan_max_shift_m,
       .help = "floor plan: largest shift that is tried for the best fit, m",
       .min = 0.1,
       .max = 10},
      {.name = "plan_max_turn_deg",
       .value = &o->plan_max_turn_deg,
       .help = "floor plan: largest turn that is tried for the best fit, degrees",
       .min = 0.1,
       .max = 45},
      {.name = "plan_tolerance_m",
       .value = &o->plan_tolerance_m,
       .help = "floor plan: it does not fit if it fits better shifted by more than this, m",
       .min = 0.01},
      {.name = "plan_tolerance_deg",
       .value = &o->plan_tolerance_deg,
       .help = "floor plan: it does not fit if it fits better turned by more than this, degrees",
       .min = 0.05},
      {.name = "min_plan_on_walls_ratio",
       .value = &o->min_plan_on_walls_ratio,
       .help = "floor plan: it does not fit if a smaller part of the landmarks lies on its walls, however it "
               "is moved",
       .min = 0,
       .max = 1},
  };
}

Result<PlanFit> FitPlan(const MapRows& rows, const PlanFitOptions& options) {
  PlanFitOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (rows.views.plan.walls.empty())
    return MakeError(ErrorCode::kNoData, "map '{}' has no floor plan", rows.name);
  PlanFit fit;
  fit.num_images = static_cast<int>(rows.images.size());
  for (const MapImage& image : rows.images) {
    const Vec2 place = FloorPoseOf(image.cam_from_world, rows.floor_from_world).position;
    fit.num_images_free += rows.views.plan.Contains(place) ? 1 : 0;
  }
  std::vector<Vec2> places = LandmarkPlaces(rows, options.plan_height_band_m);
  if (places.size() < kMinNumLandmarks) {
    return MakeError(ErrorCode::kNoData,
                     "map '{}': {} landmarks within {} m of the cameras' height are too few to compare with "
                     "the floor plan's walls; {} are needed",
                     rows.name, places.size(), options.plan_height_band_m, kMinNumLandmarks);
  }
  fit.num_landmarks = static_cast<int>(places.size());
  const Fitter fitter(rows.views.plan, std::move(places), options);
  const auto num_on_walls = [&](const std::vector<double>& distances) {
    return static_cast<int>(std::count_if(distances.begin(), distances.end(), [&](double distance) {
      return distance <= options.plan_wall_distance_m;
    }));
  };
  const std::vector<double> distances = fitter.Distances({});
  fit.num_on_walls = num_on_walls(distances);
  fit.median_wall_distance_m = UpperMedian(distances);

  Motion best = fitter.Best();
  if (fitter.Score(best, kFineScaleM) < kMinGainRatio * fitter.Score({}, kFineScaleM)) best = {};
  fit.num_on_walls_moved = num_on_walls(fitter.Distances(best));
  // M p = R (p - c) + c + t for the landmarks is R^-1 (q - c) + c - R^-1 t for the plan.
  fit.center = fitter.center();
  fit.turn_deg = -DegFromRad(best.turn_rad);
  fit.shift = -(Eigen::Rotation2Dd(-best.turn_rad) * best.shift);
  fit.fits = fit.shift.norm() <= options.plan_tolerance_m &&
             std::abs(fit.turn_deg) <= options.plan_tolerance_deg &&
             Ratio(fit.num_on_walls_moved, fit.num_landmarks) >= options.min_plan_on_walls_ratio;
  return fit;
}

void AddPlanFigures(const PlanFit& fit, std::map<std::string, double>* figures) {
  auto& f = *figures;
  f["plan_num_landmarks"] = fit.num_landmarks;
  f["plan_on_walls_ratio"] = Ratio(fit.num_on_walls, fit.num_landmarks);
  f["plan_on_walls_ratio_moved"] = Ratio(fit.num_on_walls_moved, fit.num_landmarks);
  f["plan_median_wall_distance_m"] = fit.median_wall_distance_m;
  f["plan_shift_m"] = fit.shift.norm();
  f["plan_turn_deg"] = fit.turn_deg;
  f["plan_images_free_ratio"] = Ratio(fit.num_images_free, fit.num_images);
  f["plan_fits"] = fit.fits ? 1 : 0;
}

std::string PlanVerdict(const PlanFit& fit) {
  const std::string on_walls =
      fmt::format("{:.0f} % of {} landmarks lie on its walls",
                  100 * Ratio(fit.num_on_walls, fit.num_landmarks), fit.num_landmarks);
  if (fit.fits) return "fits: " + on_walls;
  if (fit.shift.norm() == 0 && fit.turn_deg == 0) return "does not fit, and no motion helps: " + on_walls;
  return fmt::format(
      "does not fit: {}, but {:.0f} % if it were turned by {:.2f} deg about ({:.2f}, {:.2f}), then shifted "
      "by ({:.2f}, {:.2f}) m",
      on_walls, 100 * Ratio(fit.num_on_walls_moved, fit.num_landmarks), fit.turn_deg, fit.center.x(),
      fit.center.y(), fit.shift.x(), fit.shift.y());
}

}  // namespace cairn::check_map
