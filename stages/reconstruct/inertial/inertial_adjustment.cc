#include "stages/reconstruct/inertial/inertial_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>

#include <ceres/ceres.h>
#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "core/base/quantiles.h"
#include "core/base/random.h"
#include "core/geometry/rotations.h"
#include "core/structure/bundle_blocks.h"
#include "stages/reconstruct/inertial/inertial_costs.h"

namespace cairn::reconstruct {
namespace inertial {
namespace {

using Vector3d = Eigen::Vector3d;

// Least squares make the scale too small where images err, at most by these.
constexpr double kStarts[] = {1, 3, 9, 27};
constexpr double kBiasSpanS = 30;
constexpr double kHuberSigmas = 4;
constexpr double kUnknownTurnSigmaRad = 0.5;
constexpr int kMaxNumRounds = 15, kMaxNumIterations = 20;
constexpr double kConverged = 0.02;   // of a standard deviation, from round to round
constexpr double kScaleCounts = 0.5;  // a change of the scale by a standard deviation, beside those of these
constexpr int kNumProbes = 16;
// Where the images' errors alone would give this part of the information on the scale, there is none.
constexpr double kMaxNoiseRatio = 0.5;
constexpr int kNumParts = 12;
constexpr size_t kMinImagesOfParts = 60;
// Fewer do not show by how much parts disagree; 38 images of a drive, a second apart, are twice as far off as
// the noise says.
constexpr double kFewImagesFactor = 2;
// Standard deviations that residuals are never believed to be below.
constexpr double kLeastTurnSigmaRad = 1e-4, kLeastShiftOfStep = 1e-4;
// A reconstruction bends by this: of its up, whatever the noise says.
constexpr double kLeastUpSigmaRad = 0.01;
constexpr double kFirstTurnSigmaRad = 3e-3, kFirstShiftOfStep = 0.02;

enum Group { kImu, kTurns, kShifts, kNumGroups, kStated = kNumGroups };

// A block of residuals: what kind it is, and the image where it is.
struct BlockOfResiduals {
  ceres::ResidualBlockId id = nullptr;
  Group group = kStated;
  size_t image = 0;
  int num = 0;
};

// Standard deviations of the groups, as they turn out.
struct Sigmas {
  double imu_ratio = 1, turn_rad = kFirstTurnSigmaRad, shift = 0;
};

// The residuals and their derivatives at a place.
struct Linearized {
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian;
  Eigen::VectorXd residuals;
  std::vector<int> first_row;  // of each block of residuals
};

using Factors = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;

class InertialProblem {
 public:
  // Begins at so many times the start's scale.
  InertialProblem(const InertialStart& start, double times, bool is_turn_stated,
                  const InertialOptions& options)
      : start_(start), is_turn_stated_(is_turn_stated), options_(options) {
    frame_.scale = times * start.scale;
    frame_.cam_from_imu = start.turn.cam_from_imu;
    const Vector3d down = start.gravity.normalized();
    frame_.axes.col(2) = down;
    frame_.axes.col(0) = down.unitOrthogonal();
    frame_.axes.col(1) = down.cross(frame_.axes.col(0));
    std::vector<double> steps;
    for (const InertialStep& step : start.steps) {
      steps.push_back(
          CenterErrorM(start.images[step.from].cam_from_model, start.images[step.to].cam_from_model));
    }
    step_ = std::max(1e-12, Quantile(steps, 0.75));
    sigmas_.shift = kFirstShiftOfStep * step_;
    LayOut();
  }

  void Solve();
  // Whether all that images and IMU disagree by is taken for the IMU's noise.  No image is so exact: the
  // scale went to where the images' errors are small in metres, which is zero.
  bool HasCollapsed() const { return sigmas_.shift <= kLeastShiftOfStep * step_; }
  InertialAlignment Answer() const;

 private:
  double* Common() { return values_.data(); }
  double* BiasOf(size_t step) { return &values_[kCommon + kBias * span_of_step_[step]]; }
  double* ImageOf(size_t image) { return &values_[first_image_ + kImage * image]; }
  const double* ImageOf(size_t image) const { return &values_[first_image_ + kImage * image]; }

  void LayOut();
  void Build(ceres::Problem* problem);
  void AddStated(ceres::Problem* problem);
  void Rescale(const Linearized& at, const Factors& factors);
  double InformationOfNoise(const Linearized& at) const;
  Linearized Linearize(ceres::Problem* problem) const;

  const InertialStart& start_;
  const bool is_turn_stated_;
  const InertialOptions& options_;
  Frame frame_;
  double step_ = 1;  // a long one, model's unit
  Sigmas sigmas_;
  std::vector<double> values_;
  std::vector<double*> blocks_;
  std::vector<size_t> span_of_step_;
  std::vector<double> span_begins_s_;
  size_t first_image_ = 0;
  std::vector<BlockOfResiduals> residual_blocks_;
  double change_ = 0;  // in the last round: of standard deviations, and of the scale in its own
  double sigma_ = 0, parts_sigma_ = 0, up_sigma_rad_ = 0;
};

// Unknowns in one piece: Ceres orders blocks by their addresses, and another order is another rounding.
void InertialProblem::LayOut() {
  for (const InertialStep& step : start_.steps) {
    const double time_s =
        1e-9 * static_cast<double>(start_.images[step.from].time_ns - start_.images.front().time_ns);
    if (span_begins_s_.empty() || time_s >= span_begins_s_.back() + kBiasSpanS)
      span_begins_s_.push_back(time_s);
    span_of_step_.push_back(span_begins_s_.size() - 1);
  }
  first_image_ = kCommon + kBias * span_begins_s_.size();
  values_.assign(first_image_ + kImage * start_.images.size(), 0);
  for (int i = 0; i < 3; ++i) Common()[kPlace + i] = start_.imu_in_cam_m[i];
  blocks_.push_back(Common());
  for (size_t span = 0; span < span_begins_s_.size(); ++span) {
    double* bias = &values_[kCommon + kBias * span];
    for (int i = 0; i < 3; ++i) bias[i] = start_.turn.gyro_bias[i];
    blocks_.push_back(bias);
  }
  for (size_t i = 0; i < start_.images.size(); ++i) {
    for (int k = 0; k < 3; ++k) ImageOf(i)[kImageSpeed + k] = start_.speeds[i][k];
    blocks_.push_back(ImageOf(i));
  }
}

void InertialProblem::AddStated(ceres::Problem* problem) {
  const double place_sigma_m =
      is_turn_stated_ ? options_.stated_place_sigma_m : options_.unknown_place_sigma_m;
  const double turn_sigma_rad =
      is_turn_stated_ ? RadFromDeg(options_.stated_turn_sigma_deg) : kUnknownTurnSigmaRad;
  StatedCost<kCommon> common{};
  common.sigma.fill(1e3);  // of the scale and of gravity's direction nothing is known
  for (int i = 0; i < 3; ++i) {
    common.value[kPlace + i] = start_.imu_in_cam_m[i];
    common.sigma[kPlace + i] = place_sigma_m;
    common.sigma[kTurn + i] = turn_sigma_rad;
  }
  common.sigma[kClock] = options_.time_sigma_s;
  residual_blocks_.push_back(
      {problem->AddResidualBlock(new ceres::AutoDiffCostFunction<StatedCost<kCommon>, kCommon, kCommon>(
                                     new StatedCost<kCommon>(common)),
                                 nullptr, Common()),
       kStated, 0, kCommon});
  StatedCost<kBias> bias{};
  for (int i = 0; i < kBias; ++i)
    bias.sigma[i] = i < 3 ? options_.gyro_bias_sigma : options_.accel_bias_sigma;
  residual_blocks_.push_back(
      {problem->AddResidualBlock(
           new ceres::AutoDiffCostFunction<StatedCost<kBias>, kBias, kBias>(new StatedCost<kBias>(bias)),
           nullptr, blocks_[1]),
       kStated, 0, kBias});
  for (size_t span = 1; span < span_begins_s_.size(); ++span) {
    const double root = std::sqrt(span_begins_s_[span] - span_begins_s_[span - 1]);
    WalkCost walk{};
    for (int i = 0; i < kBias; ++i)
      walk.sigma[i] = root * (i < 3 ? options_.gyro_bias_walk : options_.accel_bias_walk);
    residual_blocks_.push_back(
        {problem->AddResidualBlock(
             new ceres::AutoDiffCostFunction<WalkCost, kBias, kBias, kBias>(new WalkCost(walk)), nullptr,
             blocks_[span], blocks_[span + 1]),
         kStated, 0, kBias});
  }
}

void InertialProblem::Build(ceres::Problem* problem) {
  residual_blocks_.clear();
  for (double* block : blocks_)
    problem->AddParameterBlock(block, block == Common() ? kCommon : block < ImageOf(0) ? kBias : kImage);
  for (size_t k = 0; k < start_.steps.size(); ++k) {
    const InertialStep& step = start_.steps[k];
    Matrix9d covariance = step.imu.covariance * (sigmas_.imu_ratio * sigmas_.imu_ratio);
    const Matrix9d root = covariance.llt().matrixL();
    auto* cost = new StepCost{frame_, start_.images[step.from], start_.images[step.to], step.imu,
                              root.triangularView<Eigen::Lower>().solve(Matrix9d::Identity())};
    residual_blocks_.push_back(
        {problem->AddResidualBlock(
             new ceres::AutoDiffCostFunction<StepCost, 9, kImage, kImage, kBias, kCommon>(cost), nullptr,
             ImageOf(step.from), ImageOf(step.to), BiasOf(k), Common()),
         kImu, step.from, 9});
  }
  for (size_t i = 0; i < start_.images.size(); ++i) {
    for (const auto& [group, first, sigma] : {std::tuple(kTurns, kImageTurn, sigmas_.turn_rad),
                                              std::tuple(kShifts, kImageShift, sigmas_.shift)}) {
      residual_blocks_.push_back(
          {problem->AddResidualBlock(
               new ceres::AutoDiffCostFunction<PartCost, 3, kImage>(new PartCost{first, sigma}),
               new ceres::HuberLoss(kHuberSigmas), ImageOf(i)),
           group, i, 3});
    }
  }
  AddStated(problem);
}

Linearized InertialProblem::Linearize(ceres::Problem* problem) const {
  ceres::Problem::EvaluateOptions evaluate;
  evaluate.parameter_blocks = blocks_;
  for (const BlockOfResiduals& block : residual_blocks_) evaluate.residual_blocks.push_back(block.id);
  std::vector<double> residuals;
  ceres::CRSMatrix crs;
  problem->Evaluate(evaluate, nullptr, &residuals, nullptr, &crs);
  Linearized at;
  at.residuals = Eigen::Map<const Eigen::VectorXd>(residuals.data(), std::ssize(residuals));
  at.jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      crs.num_rows, crs.num_cols, std::ssize(crs.values), crs.rows.data(), crs.cols.data(),
      crs.values.data());
  int row = 0;
  for (const BlockOfResiduals& block : residual_blocks_) {
    at.first_row.push_back(row);
    row += block.num;
  }
  return at;
}

// Information about the logarithm of the scale that errors of the images' places alone would seem to give,
// were the camera not accelerated at all: of shifts of one standard deviation, by random signs
// [Hutchinson90].
double InertialProblem::InformationOfNoise(const Linearized& at) const {
  const auto num = at.jacobian.cols();
  const Eigen::SparseMatrix<double> columns = at.jacobian;
  const Eigen::SparseMatrix<double> others = columns.rightCols(num - 1);  // all but kLogScale
  const Factors factors(Eigen::SparseMatrix<double>(others.transpose() * others));
  Random random(2);
  double information = 0;
  for (int probe = 0; probe < kNumProbes; ++probe) {
    Eigen::VectorXd shifts = Eigen::VectorXd::Zero(num);
    for (size_t i = 0; i < start_.images.size(); ++i) {
      for (size_t k = 0; k < 3; ++k)
        shifts[first_image_ + kImage * i + kImageShift + k] =
            (random.Bits() & 1) != 0 ? sigmas_.shift : -sigmas_.shift;
    }
    Eigen::VectorXd seen = at.jacobian * shifts;
    for (size_t k = 0; k < residual_blocks_.size(); ++k) {
      if (residual_blocks_[k].group != kImu) seen.segment(at.first_row[k], residual_blocks_[k].num).setZero();
    }
    const Eigen::VectorXd right = others.transpose() * seen;
    information += (seen.squaredNorm() - right.dot(factors.solve(right))) / kNumProbes;
  }
  return information;
}

// [Foerstner79]: sigma^2 grows by the group's squared residuals over its redundancy, its number less the part
// of the unknowns that it determines, tr(J_g H^-1 J_g^T), estimated by random signs [Hutchinson90].
void InertialProblem::Rescale(const Linearized& at, const Factors& factors) {
  std::array<double, kNumGroups> squares{}, num{}, trace{};
  for (size_t k = 0; k < residual_blocks_.size(); ++k) {
    const BlockOfResiduals& block = residual_blocks_[k];
    if (block.group == kStated) continue;
    const double of_block = at.residuals.segment(at.first_row[k], block.num).squaredNorm();
    squares[block.group] += block.group == kImu ? of_block : std::min(of_block, kHuberSigmas * kHuberSigmas);
    num[block.group] += block.num;
  }
  Random random(1);
  for (int group = 0; group < kNumGroups; ++group) {
    for (int probe = 0; probe < kNumProbes; ++probe) {
      Eigen::VectorXd signs = Eigen::VectorXd::Zero(at.residuals.size());
      for (size_t k = 0; k < residual_blocks_.size(); ++k) {
        if (residual_blocks_[k].group != group) continue;
        for (int i = 0; i < residual_blocks_[k].num; ++i)
          signs[at.first_row[k] + i] = (random.Bits() & 1) != 0 ? 1 : -1;
      }
      const Eigen::VectorXd right = at.jacobian.transpose() * signs;
      trace[group] += right.dot(factors.solve(right)) / kNumProbes;
    }
  }
  const auto ratio = [&](Group group) {
    return std::sqrt(squares[group] / std::max(1.0, num[group] - trace[group]));
  };
  const Sigmas before = sigmas_;
  sigmas_.imu_ratio = std::max(1.0, sigmas_.imu_ratio * ratio(kImu));
  sigmas_.turn_rad = std::max(kLeastTurnSigmaRad, sigmas_.turn_rad * ratio(kTurns));
  sigmas_.shift = std::max(kLeastShiftOfStep * step_, sigmas_.shift * ratio(kShifts));
  change_ = std::max({std::abs(std::log(sigmas_.imu_ratio / before.imu_ratio)),
                      std::abs(std::log(sigmas_.turn_rad / before.turn_rad)),
                      std::abs(std::log(sigmas_.shift / before.shift))});
}

void InertialProblem::Solve() {
  for (int round = 0; round < kMaxNumRounds; ++round) {
    const double log_scale_before = Common()[kLogScale];
    ceres::Problem problem;
    Build(&problem);
    ceres::Solver::Options options;
    options.max_num_iterations = kMaxNumIterations;
    SolveOnOneThread(options, &problem);
    const Linearized at = Linearize(&problem);
    const Eigen::SparseMatrix<double> normal = at.jacobian.transpose() * at.jacobian;
    const Factors factors(normal);
    Rescale(at, factors);
    const auto column = [&](int k) {
      return Eigen::VectorXd(factors.solve(Eigen::VectorXd::Unit(normal.cols(), k)));
    };
    const Eigen::VectorXd of_scale = column(kLogScale);
    change_ = std::max(change_, kScaleCounts * std::abs(Common()[kLogScale] - log_scale_before) /
                                    std::sqrt(of_scale[kLogScale]));
    if (round == 0 || (change_ > kConverged && round + 1 < kMaxNumRounds)) continue;
    const double information = 1 / of_scale[kLogScale], of_noise = InformationOfNoise(at);
    // Of a regression in which both sides err, the part that is not noise counts.
    sigma_ = of_noise > kMaxNoiseRatio * information ? INFINITY
                                                     : std::sqrt(information) / (information - of_noise);
    up_sigma_rad_ = std::sqrt(column(kDown)[kDown] + column(kDown + 1)[kDown + 1]);
    const Eigen::VectorXd influence = at.jacobian * of_scale;
    std::array<double, kNumParts> parts{};
    for (size_t k = 0; k < residual_blocks_.size(); ++k) {
      const BlockOfResiduals& block = residual_blocks_[k];
      if (block.group == kStated) continue;
      parts[block.image * kNumParts / start_.images.size()] +=
          influence.segment(at.first_row[k], block.num).dot(at.residuals.segment(at.first_row[k], block.num));
    }
    double sum_squares = 0;
    for (const double part : parts) sum_squares += part * part;
    parts_sigma_ = std::sqrt(sum_squares * kNumParts / (kNumParts - 1));
    break;
  }
}

InertialAlignment InertialProblem::Answer() const {
  InertialAlignment answer;
  const double* common = values_.data();
  answer.scale = frame_.scale * std::exp(common[kLogScale]);
  answer.noise_sigma_ratio = sigma_;
  answer.parts_sigma_ratio = parts_sigma_;
  const bool has_parts = start_.images.size() >= kMinImagesOfParts;
  answer.sigma_ratio = has_parts ? std::max(sigma_, parts_sigma_) : kFewImagesFactor * sigma_;
  answer.up = -(frame_.axes * Vector3d(common[kDown], common[kDown + 1], 1)).normalized();
  answer.up_sigma_rad = std::max(kLeastUpSigmaRad, up_sigma_rad_);
  answer.cam_from_imu = frame_.cam_from_imu *
                        QuaternionFromVector(Vector3d(common[kTurn], common[kTurn + 1], common[kTurn + 2]));
  answer.imu_in_cam_m = {common[kPlace], common[kPlace + 1], common[kPlace + 2]};
  const auto num_spans = static_cast<double>(span_begins_s_.size());
  for (size_t span = 0; span < span_begins_s_.size(); ++span) {
    const double* bias = &values_[kCommon + kBias * span];
    answer.gyro_bias += Vector3d(bias[0], bias[1], bias[2]) / num_spans;
    answer.accel_bias += Vector3d(bias[3], bias[4], bias[5]) / num_spans;
  }
  answer.time_offset_s = start_.time_offset_s + common[kClock];
  answer.place_sigma_m = sigmas_.shift * answer.scale;
  answer.turn_sigma_rad = sigmas_.turn_rad;
  answer.imu_noise_ratio = sigmas_.imu_ratio;
  answer.image_idx = start_.image_idx;
  for (size_t i = 0; i < start_.images.size(); ++i) {
    const double* shift = ImageOf(i) + kImageShift;
    const double length = Vector3d(shift[0], shift[1], shift[2]).norm();
    answer.residuals_m.push_back(answer.scale * length);
    answer.is_off.push_back(length > kHuberSigmas * sigmas_.shift);
  }
  return answer;
}

}  // namespace
}  // namespace inertial

InertialAlignment AdjustInertial(const InertialStart& start, bool is_turn_stated,
                                 const InertialOptions& options) {
  InertialAlignment answer;
  for (const double times : inertial::kStarts) {
    inertial::InertialProblem problem(start, times, is_turn_stated, options);
    problem.Solve();
    answer = problem.Answer();
    if (!problem.HasCollapsed()) return answer;
  }
  answer.sigma_ratio = INFINITY;
  return answer;
}

}  // namespace cairn::reconstruct
