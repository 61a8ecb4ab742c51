#include "stages/match_features/two_views/guided_match.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include <Eigen/Dense>

#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/features/descriptor_distance.h"
#include "core/features/wide_clones.h"
#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::match_features {
namespace {

// The two best candidates seen so far; of equal dot products the smaller index wins, in any order.
class BestTwoCandidates {
 public:
  void Offer(int32_t dot, int32_t idx) {
    const int64_t key = int64_t{dot} * (int64_t{1} << 32) | static_cast<uint32_t>(~idx);
    second_ = std::max(second_, std::min(best_, key));
    best_ = std::max(best_, key);
  }

  bool IsEmpty() const { return best_ < 0; }
  int32_t idx() const { return ~static_cast<int32_t>(best_); }
  // Dot products; below 0: there is none.
  int32_t best() const { return static_cast<int32_t>(best_ >> 32); }
  int32_t second() const { return static_cast<int32_t>(second_ >> 32); }

 private:
  int64_t best_ = -1, second_ = -1;  // dot products, then indices turned around
};

// How keypoints change from the first image to the second, from the inliers.
class KeypointChange {
 public:
  KeypointChange(const GuidedView& view1, const GuidedView& view2, const std::vector<Match>& inliers,
                 const GuidedMatchOptions& options)
      : keypoints1_(*view1.keypoints),
        keypoints2_(*view2.keypoints),
        max_log_ratio_(std::log(options.max_scale_ratio)),
        max_turn_(RadFromDeg(options.max_turn_deg)) {
    if (inliers.empty()) return;
    std::vector<double> log_ratios;
    double sine = 0, cosine = 0;
    for (const Match& match : inliers) {
      log_ratios.push_back(LogRatio(match));
      sine += std::sin(Turn(match));
      cosine += std::cos(Turn(match));
    }
    log_ratio_ = UpperMedian(std::move(log_ratios));
    turn_ = std::atan2(sine, cosine);
  }

  bool Explains(const Match& match) const {
    return std::abs(LogRatio(match) - log_ratio_) <= max_log_ratio_ &&
           std::abs(std::remainder(Turn(match) - turn_, 2 * std::numbers::pi)) <= max_turn_;
  }

 private:
  double LogRatio(const Match& match) const {
    const float scale1 = keypoints1_[match.idx1].scale, scale2 = keypoints2_[match.idx2].scale;
    return scale1 > 0 && scale2 > 0 ? std::log(scale2 / scale1)
                                    : 0;  // not measured: nothing speaks against it
  }
  double Turn(const Match& match) const {
    return keypoints2_[match.idx2].orientation - keypoints1_[match.idx1].orientation;
  }

  const PooledVector<Keypoint>& keypoints1_;
  const PooledVector<Keypoint>& keypoints2_;
  const double max_log_ratio_, max_turn_;
  double log_ratio_ = 0, turn_ = 0;
};

// Best two of every keypoint of both images over the pairs that are offered, and the matches that follow.
class CandidateMatcher {
 public:
  CandidateMatcher(const GuidedView& view1, const GuidedView& view2, const std::vector<Match>& inliers,
                   const GuidedMatchOptions& options)
      : options_(options),
        change_(view1, view2, inliers, options),
        space_(view1.space),
        least_dot_(LeastDotWithin(options.max_angle_rad, space_)),
        descriptors1_(*view1.descriptors),
        descriptors2_(*view2.descriptors),
        is_matched1_(view1.bearings->size(), 0),
        is_matched2_(view2.bearings->size(), 0),
        best1_(view1.bearings->size()),
        best2_(view2.bearings->size()),
        matches_(inliers) {
    for (const Match& match : inliers) is_matched1_[match.idx1] = is_matched2_[match.idx2] = 1;
  }

  bool IsMatched1(int idx1) const { return is_matched1_[idx1] != 0; }
  bool IsMatched2(int idx2) const { return is_matched2_[idx2] != 0; }
  // A pair whose keypoints are both matched is not needed: neither can be part of a new match.
  bool IsNeeded(int idx1, int idx2) const { return !(is_matched1_[idx1] && is_matched2_[idx2]); }

  // Of the first image's keypoint with keypoints of the second one.
  void Offer(int idx1, std::span<const int32_t> all_idx2) {
    dots_.resize(std::max(dots_.size(), all_idx2.size()));
    DescriptorDots(descriptors1_.row(idx1).data(), descriptors2_, all_idx2, space_, dots_.data());
    for (size_t k = 0; k < all_idx2.size(); ++k) {
      best1_[idx1].Offer(dots_[k], all_idx2[k]);
      best2_[all_idx2[k]].Offer(dots_[k], idx1);
    }
  }

  std::vector<Match> Matches() && {
    for (uint32_t idx1 = 0; idx1 < best1_.size(); ++idx1) {
      if (is_matched1_[idx1] || !Passes(best1_[idx1])) continue;
      const uint32_t idx2 = best1_[idx1].idx();
      if (is_matched2_[idx2] || best2_[idx2].idx() != static_cast<int32_t>(idx1)) continue;
      if (Passes(best2_[idx2]) && change_.Explains({idx1, idx2})) matches_.push_back({idx1, idx2});
    }
    std::sort(matches_.begin(), matches_.end());
    return std::move(matches_);
  }

 private:
  bool Passes(const BestTwoCandidates& candidates) const {
    if (candidates.IsEmpty() || candidates.best() < least_dot_) return false;
    const double best = DescriptorAngleRad(candidates.best(), space_);
    return best <= options_.max_angle_rad &&
           (candidates.second() < 0 ||
            best <= options_.max_ratio * DescriptorAngleRad(candidates.second(), space_));
  }

  const GuidedMatchOptions& options_;
  const KeypointChange change_;
  const DescriptorSpace space_;
  const int32_t least_dot_;
  const DescriptorMatrix& descriptors1_;
  const DescriptorMatrix& descriptors2_;
  std::vector<uint8_t> is_matched1_, is_matched2_;
  std::vector<BestTwoCandidates> best1_, best2_;
  std::vector<int32_t> dots_;
  std::vector<Match> matches_;
};

// Keypoints of the second image by classes of their distance to the epipole, and by the angle of their
// epipolar plane about the baseline.
class EpipolarPencil {
 public:
  // Class k: sine of the angle to the epipole in (2^-(k+1), 2^-k], the last: below.
  static constexpr int kNumClasses = 6;
  static constexpr double LeastSine(int c) { return c == kNumClasses - 1 ? 0 : 0.5 / (1 << c); }
  bool IsEmpty(int c) const { return begin_[c * kNumBins] == begin_[(c + 1) * kNumBins]; }

  // An epipolar line of the second image: the normal of its plane, and what a keypoint may be off it.
  struct Line {
    Eigen::Vector3d normal;
    double squared_norm = 0, max_squared_error = 0;
  };

  EpipolarPencil(const std::vector<Eigen::Vector3d>& bearings2, const Eigen::Matrix3d& M,
                 const Eigen::Vector3d& epipole2, const CandidateMatcher& matcher)
      : basis_(TangentBasis(epipole2)), begin_(kNumClasses * kNumBins + 1, 0) {
    std::vector<int> bins(bearings2.size(), -1);
    for (size_t j = 0; j < bearings2.size(); ++j) {
      if (!bearings2[j].allFinite()) continue;
      const Eigen::Vector3d normal = epipole2.cross(bearings2[j]);
      const double sine = normal.norm();
      int c = 0;
      while (c < kNumClasses - 1 && sine <= LeastSine(c)) ++c;
      bins[j] = c * kNumBins + BinOf(AngleOf(normal));
      ++begin_[bins[j] + 1];
    }
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    for (PooledVector<double>* values : {&x_, &y_, &z_, &squared_norm1_}) values->resize(begin_.back());
    idx_.resize(begin_.back());
    is_matched_.resize(begin_.back());
    std::vector<int> next(begin_.begin(), begin_.end() - 1);
    for (size_t j = 0; j < bearings2.size(); ++j) {
      if (bins[j] < 0) continue;
      const int k = next[bins[j]]++;
      const Eigen::Vector3d& bearing = bearings2[j];
      x_[k] = bearing.x(), y_[k] = bearing.y(), z_[k] = bearing.z();
      squared_norm1_[k] = (M.transpose() * bearing).squaredNorm();
      idx_[k] = static_cast<int32_t>(j);
      is_matched_[k] = matcher.IsMatched2(static_cast<int>(j)) ? 1 : 0;
    }
  }

  // Of a plane's normal, in [-pi, pi].
  double AngleOf(const Eigen::Vector3d& normal) const {
    return std::atan2(normal.dot(basis_.col(1)), normal.dot(basis_.col(0)));
  }

  // Adds the keypoints of a class near the line, whose angle is within `width` of its plane's, both ways
  // around; only those without a match, or all.
  void AddNear(int c, double angle, double width, const Line& line, bool only_unmatched,
               std::vector<int32_t>* near) const {
    const int first_bin = c * kNumBins;
    if (width >= kHalfTurn) return AddRange(first_bin, first_bin + kNumBins, line, only_unmatched, near);
    const double low = angle - width, high = angle + width;
    AddRange(first_bin + BinOf(low), first_bin + BinOf(high) + 1, line, only_unmatched, near);
    if (low < -kHalfTurn)
      AddRange(first_bin + BinOf(low + 2 * kHalfTurn), first_bin + kNumBins, line, only_unmatched, near);
    if (high > kHalfTurn)
      AddRange(first_bin, first_bin + BinOf(high - 2 * kHalfTurn) + 1, line, only_unmatched, near);
  }

 private:
  static constexpr double kHalfTurn = std::numbers::pi;
  static constexpr int kNumBins = 1024;

  // The first or last one for an angle beyond half a turn.
  static int BinOf(double angle) {
    return std::clamp(static_cast<int>((angle + kHalfTurn) * (kNumBins / (2 * kHalfTurn))), 0, kNumBins - 1);
  }

  void AddRange(int first_bin, int end_bin, const Line& line, bool only_unmatched,
                std::vector<int32_t>* near) const {
    const int begin = begin_[first_bin], num = begin_[end_bin] - begin;
    if (num <= 0) return;
    const size_t before = near->size();
    near->resize(before + num);
    const int num_near =
        SelectNear(&x_[begin], &y_[begin], &z_[begin], &squared_norm1_[begin], &idx_[begin],
                   only_unmatched ? &is_matched_[begin] : nullptr, num, line, near->data() + before);
    near->resize(before + num_near);
  }

  // The Sampson error in tangent planes (core/geometry/two_view_error.h) of `num` keypoints, several at once.
  CAIRN_WIDE_CLONES static int SelectNear(const double* x, const double* y, const double* z,
                                          const double* squared_norm1, const int32_t* idx,
                                          const uint8_t* is_matched, int num, const Line& line,
                                          int32_t* near) {
    constexpr int kAtOnce = 16;
    const double nx = line.normal.x(), ny = line.normal.y(), nz = line.normal.z();
    const double squared_norm2 = line.squared_norm, max_squared_error = line.max_squared_error;
    int num_near = 0;
    for (int begin = 0; begin < num; begin += kAtOnce) {
      const int end = std::min(kAtOnce, num - begin);
      double beyond[kAtOnce];
      for (int k = 0; k < end; ++k) {
        const double residual = x[begin + k] * nx + (y[begin + k] * ny + z[begin + k] * nz);
        const double squared_residual = residual * residual;
        const double gradient2 = squared_norm1[begin + k] + squared_norm2 - 2 * squared_residual;
        beyond[k] = squared_residual - max_squared_error * gradient2;
      }
      for (int k = 0; k < end; ++k) {
        near[num_near] = idx[begin + k];
        const bool is_taken = is_matched != nullptr && is_matched[begin + k] != 0;
        num_near += beyond[k] <= 0 && !is_taken ? 1 : 0;
      }
    }
    return num_near;
  }

  Eigen::Matrix<double, 3, 2> basis_;
  std::vector<int> begin_;  // per class and bin, and the end
  // By class, bin and index; squared_norm1_: of the plane's normal in the first image.
  PooledVector<double> x_, y_, z_, squared_norm1_;
  PooledVector<int32_t> idx_;
  PooledVector<uint8_t> is_matched_;
};

// A keypoint of the second image with what it is sorted by: its height.
struct SortedKeypoint {
  double key = 0;
  int idx = 0;
  friend auto operator<=>(const SortedKeypoint&, const SortedKeypoint&) = default;
};

// At least the angle of a sine in [0, 1]: the arc sine is x + sum_k c_k x^(2k + 1) with c_k > 0 that sum up
// to pi / 2 - 1.
double AngleBound(double sine) { return sine + (std::numbers::pi / 2 - 1) * sine * sine * sine; }

}  // namespace

std::vector<Match> GuideByEpipolarLines(const GuidedView& view1, const GuidedView& view2,
                                        const Eigen::Matrix3d& M, double max_error_rad,
                                        const std::vector<Match>& inliers,
                                        const GuidedMatchOptions& options) {
  const std::vector<Eigen::Vector3d>&bearings1 = *view1.bearings, &bearings2 = *view2.bearings;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU);
  const double largest = svd.singularValues()[0];
  Eigen::Vector3d epipole2 = svd.matrixU().col(2);
  if (!epipole2.allFinite()) return inliers;
  // Signs of M and of the epipole, chosen so that the planes of matches turn the same way.
  int sign = 0;
  for (const Match& match : inliers) {
    sign += epipole2.cross(bearings2[match.idx2]).dot(M * bearings1[match.idx1]) > 0 ? 1 : -1;
  }
  if (sign < 0) epipole2 = -epipole2;
  CandidateMatcher matcher(view1, view2, inliers, options);
  const EpipolarPencil pencil(bearings2, M, epipole2, matcher);
  std::vector<int32_t> near;
  for (int i = 0; i < static_cast<int>(bearings1.size()); ++i) {
    const Eigen::Vector3d normal = M * bearings1[i];
    const EpipolarPencil::Line line{normal, normal.squaredNorm(), max_error_rad * max_error_rad};
    if (!(line.squared_norm > 0)) continue;  // the epipole itself, or NaN
    const double angle = pencil.AngleOf(normal);
    near.clear();
    for (int c = 0; c < EpipolarPencil::kNumClasses; ++c) {
      if (pencil.IsEmpty(c)) continue;
      // residual = |normal| sin(angle to the epipole) sin(angle between the planes), and the gradient is at
      // most |normal|^2 + (largest sin(angle to the epipole))^2: beyond this width nothing passes the test.
      const double least_sine = EpipolarPencil::LeastSine(c);
      const double sine = least_sine > 0 ? max_error_rad * std::sqrt(1 / (least_sine * least_sine) +
                                                                     largest * largest / line.squared_norm)
                                         : 1;
      pencil.AddNear(c, angle, sine < 1 ? AngleBound(sine) : std::numbers::pi, line, matcher.IsMatched1(i),
                     &near);
    }
    matcher.Offer(i, near);
  }
  return std::move(matcher).Matches();
}

std::vector<Match> GuideByHomography(const GuidedView& view1, const GuidedView& view2,
                                     const Eigen::Matrix3d& H, double max_error_rad,
                                     const std::vector<Match>& inliers, const GuidedMatchOptions& options) {
  const std::vector<Eigen::Vector3d>&bearings1 = *view1.bearings, &bearings2 = *view2.bearings;
  std::vector<SortedKeypoint> by_height;  // sorted by the y of the bearing
  for (int j = 0; j < static_cast<int>(bearings2.size()); ++j) {
    if (bearings2[j].allFinite()) by_height.push_back({bearings2[j].y(), j});
  }
  std::sort(by_height.begin(), by_height.end());
  CandidateMatcher matcher(view1, view2, inliers, options);
  std::vector<int32_t> near;
  for (int i = 0; i < static_cast<int>(bearings1.size()); ++i) {
    const Eigen::Vector3d predicted = (H * bearings1[i]).normalized();
    if (!predicted.allFinite()) continue;
    auto entry = std::lower_bound(by_height.begin(), by_height.end(), predicted.y() - max_error_rad,
                                  [](const SortedKeypoint& e, double value) { return e.key < value; });
    near.clear();
    for (; entry != by_height.end() && entry->key <= predicted.y() + max_error_rad; ++entry) {
      if (matcher.IsNeeded(i, entry->idx) &&
          (predicted - bearings2[entry->idx]).squaredNorm() <= max_error_rad * max_error_rad)
        near.push_back(entry->idx);
    }
    matcher.Offer(i, near);
  }
  return std::move(matcher).Matches();
}

}  // namespace cairn::match_features
