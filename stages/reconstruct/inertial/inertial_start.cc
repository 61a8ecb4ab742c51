#include "stages/reconstruct/inertial/inertial_start.h"

#include <algorithm>
#include <cmath>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "core/base/quantiles.h"
#include "core/geometry/rotations.h"

namespace cairn::reconstruct {
namespace {

constexpr size_t kMinNumSteps = 10;
// The clocks' difference is looked for so far, in such steps, seconds; where it explains the turns so much
// better than none, it is one.
constexpr double kMaxOffsetS = 0.3, kOffsetStepS = 0.01, kMinGain = 0.8;
// Turns are compared where there are so many, of so much together, rad.
constexpr double kMinTurnRad = 0.03, kMaxTurnRad = 2.5;
constexpr size_t kMinNumTurns = 5;
// Gyro and images turn by the same but for this factor; beyond it the gyro's unit is another.
constexpr double kMaxTurnRatio = 5;
// Part of the squared turns that noise may leave unexplained.
constexpr double kMaxLeftRatio = 0.3;
constexpr double kMaxTurnSigmaDeg = 3;
// What the linear problem takes steps to err by, beside the noise.
constexpr double kPlaceErrorM = 0.01, kSpeedErrorMPerS = 0.01;

int64_t NsOf(double seconds) { return std::llround(seconds * 1e9); }

std::string SpanText(int64_t first_ns, int64_t last_ns) {
  return fmt::format("{:.3f} to {:.3f} s", 1e-9 * static_cast<double>(first_ns),
                     1e-9 * static_cast<double>(last_ns));
}

// Steps between images that follow each other, where the IMU has no gap.
std::vector<InertialStep> StepsOf(const std::vector<TimedImage>& images, const ImuRecording& imu,
                                  const InertialOptions& options, double offset_s,
                                  const Eigen::Vector3d& gyro_bias) {
  std::vector<InertialStep> steps;
  for (size_t i = 0; i + 1 < images.size(); ++i) {
    const int64_t begin_ns = images[i].time_ns + NsOf(offset_s);
    const int64_t end_ns = images[i + 1].time_ns + NsOf(offset_s);
    if (end_ns <= begin_ns || end_ns - begin_ns > NsOf(options.max_step_s)) continue;
    const std::optional<Preintegrated> motion =
        Preintegrate(imu.samples, begin_ns, end_ns, gyro_bias, Eigen::Vector3d::Zero(), options.noise);
    if (motion) steps.push_back({i, i + 1, *motion});
  }
  return steps;
}

// The turns by the gyro alone since the first sample.
std::vector<Eigen::Quaterniond> TurnsSinceFirst(const std::vector<ImuSample>& samples) {
  std::vector<Eigen::Quaterniond> turns = {Eigen::Quaterniond::Identity()};
  for (size_t i = 1; i < samples.size(); ++i) {
    const double dt_s = 1e-9 * static_cast<double>(samples[i].time_ns - samples[i - 1].time_ns);
    const Eigen::Vector3d turn = 0.5 * dt_s * (samples[i - 1].gyro + samples[i].gyro);
    turns.push_back((turns.back() * QuaternionFromVector(turn)).normalized());
  }
  return turns;
}

Eigen::Quaterniond TurnAt(const std::vector<ImuSample>& samples, const std::vector<Eigen::Quaterniond>& turns,
                          int64_t time_ns) {
  const auto after = std::lower_bound(samples.begin(), samples.end(), time_ns,
                                      [](const ImuSample& s, int64_t time) { return s.time_ns < time; });
  if (after == samples.begin()) return turns.front();
  if (after == samples.end()) return turns.back();
  const auto i = static_cast<size_t>(after - samples.begin());
  const double part = static_cast<double>(time_ns - samples[i - 1].time_ns) /
                      static_cast<double>(samples[i].time_ns - samples[i - 1].time_ns);
  return turns[i - 1].slerp(part, turns[i]);
}

// Of the steps, as the clocks' difference would have them.
std::vector<TurnPair> TurnPairs(const std::vector<TimedImage>& images, const ImuRecording& imu,
                                const std::vector<Eigen::Quaterniond>& turns,
                                const std::vector<InertialStep>& steps, double offset_s) {
  std::vector<TurnPair> pairs;
  for (const InertialStep& step : steps) {
    const TimedImage &from = images[step.from], &to = images[step.to];
    const Eigen::Quaterniond before = TurnAt(imu.samples, turns, from.time_ns + NsOf(offset_s));
    const Eigen::Quaterniond after = TurnAt(imu.samples, turns, to.time_ns + NsOf(offset_s));
    const TurnPair pair = {VectorFromQuaternion(Eigen::Quaterniond(from.cam_from_model.rotation *
                                                                   to.cam_from_model.rotation.conjugate())),
                           VectorFromQuaternion(Eigen::Quaterniond(before.conjugate() * after)),
                           step.imu.dt_s};
    if (std::max(pair.of_camera.norm(), pair.of_imu.norm()) < kMaxTurnRad) pairs.push_back(pair);
  }
  return pairs;
}

// Whether gyro and images turn by as much.
Status CheckTurnRatio(const std::vector<TurnPair>& pairs) {
  std::vector<double> ratios;
  for (const TurnPair& pair : pairs) {
    if (std::max(pair.of_camera.norm(), pair.of_imu.norm()) > kMinTurnRad)
      ratios.push_back(pair.of_imu.norm() / std::max(1e-6, pair.of_camera.norm()));
  }
  if (ratios.size() < kMinNumTurns) return Ok();
  const double ratio = Median(ratios);
  if (ratio > 1 / kMaxTurnRatio && ratio < kMaxTurnRatio) return Ok();
  return MakeError(
      ErrorCode::kNoData,
      "the gyro turns {:.3g} times as far as the images: its columns 2 to 4 are rad/s, and its clock "
      "that of the images",
      ratio);
}

Status CheckTurn(const ImuTurn& turn, size_t num_pairs, bool is_stated) {
  if (!is_stated && DegFromRad(turn.sigma_rad) > kMaxTurnSigmaDeg) {
    return MakeError(
        ErrorCode::kNoData,
        "nothing says how the IMU is turned against the camera, which is not found from {} turns of "
        "the images, as they are about one axis at most: a line \"#imu_on_camera,X,Y,Z,QX,QY,QZ,QW\" "
        "states it (of a bag --imu-on-camera, or imu_on_camera in the recipe)",
        num_pairs);
  }
  if (turn.left_ratio > kMaxLeftRatio) {
    return MakeError(
        ErrorCode::kNoData,
        "the gyro's turns are not those of the images ({:.0f} % of them are left{}): another clock, "
        "another camera{}",
        100 * std::sqrt(turn.left_ratio), is_stated ? " after the stated turn" : "",
        is_stated ? ", or the IMU is not on it as imu_on_camera states" : "");
  }
  return Ok();
}

// Turn, bias and the clocks' difference.
Result<ImuTurn> FindTurn(const std::vector<TimedImage>& images, const ImuRecording& imu,
                         const std::vector<InertialStep>& steps, double* offset_s) {
  const std::vector<Eigen::Quaterniond> turns = TurnsSinceFirst(imu.samples);
  std::optional<Eigen::Quaterniond> stated;
  if (imu.cam_from_imu) stated = imu.cam_from_imu->rotation;
  const std::vector<TurnPair> pairs = TurnPairs(images, imu, turns, steps, 0);
  if (pairs.size() < kMinNumSteps) {
    return MakeError(ErrorCode::kNoData, "the images turn by more than {:.0f} degrees from one to the next",
                     DegFromRad(kMaxTurnRad));
  }
  CAIRN_RETURN_IF_ERROR(CheckTurnRatio(pairs));
  const ImuTurn without = FitImuTurn(pairs, stated);
  ImuTurn best = without;
  *offset_s = 0;
  for (double offset = -kMaxOffsetS; offset <= kMaxOffsetS; offset += kOffsetStepS) {
    const ImuTurn turn = FitImuTurn(TurnPairs(images, imu, turns, steps, offset), stated);
    if (turn.spread_rad >= best.spread_rad || turn.spread_rad >= kMinGain * without.spread_rad) continue;
    best = turn;
    *offset_s = offset;
  }
  CAIRN_RETURN_IF_ERROR(CheckTurn(best, pairs.size(), stated.has_value()));
  return best;
}

// Keeps the images that a step has.
void KeepImagesInSteps(const std::vector<TimedImage>& images, InertialStart* start) {
  std::vector<std::optional<size_t>> place(images.size());
  for (InertialStep& step : start->steps) {
    for (size_t* end : {&step.from, &step.to}) {
      std::optional<size_t>& at = place[*end];
      if (!at) {
        at = start->images.size();
        start->images.push_back(images[*end]);
        start->images.back().time_ns += NsOf(start->time_offset_s);
        start->image_idx.push_back(*end);
      }
      *end = *at;
    }
  }
}

// Speeds, gravity, scale: of each step, in its first image's axes [Qin18 eqs. 9 to 11],
//   s (c_j - c_i) - v_i dt - g dt^2 / 2 = R_i dp - (R_cj - R_ci) l,    v_j - v_i - g dt = R_i dv.
void SolveLinear(const InertialOptions& options, InertialStart* start) {
  const size_t num = start->images.size();
  const auto first_of_gravity = static_cast<int>(3 * num), of_scale = first_of_gravity + 3;
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd right(6 * start->steps.size() + 3 * num);
  right.setZero();
  int row = 0;
  const auto put = [&](int column, double value) { entries.emplace_back(row, column, value); };
  for (const InertialStep& step : start->steps) {
    const Pose &from = start->images[step.from].cam_from_model, &to = start->images[step.to].cam_from_model;
    const Preintegrated& imu = step.imu;
    const double dt = imu.dt_s;
    const double place_weight =
        1 / std::hypot(kPlaceErrorM, options.noise.accel_m_s2_rthz * std::sqrt(dt * dt * dt / 3));
    const double speed_weight =
        1 / std::hypot(kSpeedErrorMPerS, options.noise.accel_m_s2_rthz * std::sqrt(dt));
    const Eigen::Quaterniond model_from_imu = from.rotation.conjugate() * start->turn.cam_from_imu;
    const Eigen::Vector3d lever =
        to.rotation.conjugate() * start->imu_in_cam_m - from.rotation.conjugate() * start->imu_in_cam_m;
    const Eigen::Vector3d way = to.Center() - from.Center();
    const Eigen::Vector3d place = model_from_imu * imu.dp - lever, speed = model_from_imu * imu.dv;
    for (int axis = 0; axis < 3; ++axis, ++row) {
      put(of_scale, place_weight * way[axis]);
      put(static_cast<int>(3 * step.from) + axis, -place_weight * dt);
      put(first_of_gravity + axis, -place_weight * dt * dt / 2);
      right[row] = place_weight * place[axis];
    }
    for (int axis = 0; axis < 3; ++axis, ++row) {
      put(static_cast<int>(3 * step.to) + axis, speed_weight);
      put(static_cast<int>(3 * step.from) + axis, -speed_weight);
      put(first_of_gravity + axis, -speed_weight * dt);
      right[row] = speed_weight * speed[axis];
    }
  }
  Eigen::SparseMatrix<double> matrix(right.size(), of_scale + 1);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SparseMatrix<double> normal = matrix.transpose() * matrix;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(normal);
  const Eigen::VectorXd solution = factors.solve(matrix.transpose() * right);
  for (size_t i = 0; i < num; ++i) start->speeds.emplace_back(solution.segment<3>(static_cast<int>(3 * i)));
  start->gravity = solution.segment<3>(first_of_gravity);
  start->scale = solution[of_scale];
}

}  // namespace

Result<InertialStart> StartInertial(const std::vector<TimedImage>& images, const ImuRecording& imu,
                                    const InertialOptions& options) {
  InertialStart start;
  if (imu.cam_from_imu) start.imu_in_cam_m = imu.cam_from_imu->translation;
  std::vector<InertialStep> steps = StepsOf(images, imu, options, 0, Eigen::Vector3d::Zero());
  if (steps.size() < kMinNumSteps) {
    if (images.size() < 2) return MakeError(ErrorCode::kNoData, "{} images have a time", images.size());
    const int64_t first_ns = images.front().time_ns, last_ns = images.back().time_ns;
    const int64_t imu_first_ns = imu.samples.front().time_ns, imu_last_ns = imu.samples.back().time_ns;
    if (last_ns < imu_first_ns || imu_last_ns < first_ns) {
      return MakeError(
          ErrorCode::kNoData,
          "its times ({}) and those of the images' names ({}) are of two clocks; let both be of one",
          SpanText(imu_first_ns, imu_last_ns), SpanText(first_ns, last_ns));
    }
    return MakeError(
        ErrorCode::kNoData,
        "of {} images in a row, {} pairs at most {:g} s apart have samples all the time between them "
        "(at most {:g} s from one to the next); {} are wanted",
        images.size(), steps.size(), options.max_step_s, kMaxImuStepS, kMinNumSteps);
  }
  CAIRN_ASSIGN_OR_RETURN(start.turn, FindTurn(images, imu, steps, &start.time_offset_s));
  start.steps = StepsOf(images, imu, options, start.time_offset_s, start.turn.gyro_bias);
  if (start.steps.size() < kMinNumSteps)
    return MakeError(ErrorCode::kNoData, "it is over before the images are, by the clocks' difference");
  KeepImagesInSteps(images, &start);
  SolveLinear(options, &start);
  return start;
}

}  // namespace cairn::reconstruct
