#include "stages/match_features/guided_match.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/features/descriptor_distance.h"
#include "core/geometry/pose.h"
#include "core/geometry/two_view_error.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::match_features {
namespace {

// The two best candidates seen so far; of equal dot products the smaller index wins, in any order.
struct BestTwoCandidates {
  int32_t idx = -1, best = -1, second = -1;

  void Offer(int32_t dot, int32_t candidate) {
    if (dot > best || (dot == best && candidate < idx)) {
      second = best;
      best = dot;
      idx = candidate;
    } else {
      second = std::max(second, dot);
    }
  }
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

bool Passes(const BestTwoCandidates& candidates, const DescriptorSpace& space,
            const GuidedMatchOptions& options) {
  if (candidates.idx < 0) return false;
  const double best = DescriptorAngleRad(candidates.best, space);
  return best <= options.max_angle_rad &&
         (candidates.second < 0 || best <= options.max_ratio * DescriptorAngleRad(candidates.second, space));
}

// Best two of every keypoint of both images over the pairs that are offered, and the matches that follow.
class CandidateMatcher {
 public:
  CandidateMatcher(const GuidedView& view1, const GuidedView& view2, const std::vector<Match>& inliers,
                   const GuidedMatchOptions& options)
      : options_(options),
        change_(view1, view2, inliers, options),
        space_(view1.space),
        descriptors1_(*view1.descriptors),
        descriptors2_(*view2.descriptors),
        is_matched1_(view1.bearings->size(), 0),
        is_matched2_(view2.bearings->size(), 0),
        best1_(view1.bearings->size()),
        best2_(view2.bearings->size()),
        matches_(inliers) {
    for (const Match& match : inliers) is_matched1_[match.idx1] = is_matched2_[match.idx2] = 1;
  }

  // A pair whose keypoints are both matched is not needed: neither can be part of a new match.
  bool IsNeeded(int idx1, int idx2) const { return !(is_matched1_[idx1] && is_matched2_[idx2]); }

  void Offer(int idx1, int idx2) {
    const int32_t dot = DescriptorDot(descriptors1_.row(idx1).data(), descriptors2_.row(idx2).data(), space_);
    best1_[idx1].Offer(dot, idx2);
    best2_[idx2].Offer(dot, idx1);
  }

  std::vector<Match> Matches() && {
    for (uint32_t idx1 = 0; idx1 < best1_.size(); ++idx1) {
      if (is_matched1_[idx1] || !Passes(best1_[idx1], space_, options_)) continue;
      const uint32_t idx2 = best1_[idx1].idx;
      if (is_matched2_[idx2] || best2_[idx2].idx != static_cast<int32_t>(idx1)) continue;
      if (Passes(best2_[idx2], space_, options_) && change_.Explains({idx1, idx2}))
        matches_.push_back({idx1, idx2});
    }
    std::sort(matches_.begin(), matches_.end());
    return std::move(matches_);
  }

 private:
  const GuidedMatchOptions& options_;
  const KeypointChange change_;
  const DescriptorSpace space_;
  const DescriptorMatrix& descriptors1_;
  const DescriptorMatrix& descriptors2_;
  std::vector<uint8_t> is_matched1_, is_matched2_;
  std::vector<BestTwoCandidates> best1_, best2_;
  std::vector<Match> matches_;
};

// A keypoint of the second image with what it is sorted by: the angle of its epipolar plane, or its height.
struct SortedKeypoint {
  double key = 0;
  int idx = 0;
  friend auto operator<=>(const SortedKeypoint&, const SortedKeypoint&) = default;
};
constexpr int kNumClasses =
    6;  // class k: sine of the angle to the epipole in (2^-(k+1), 2^-k], the last: below
using Pencil = std::array<std::vector<SortedKeypoint>, kNumClasses>;

double LeastSine(int c) { return c == kNumClasses - 1 ? 0 : std::ldexp(1.0, -(c + 1)); }

Pencil SortByPlane(const std::vector<Eigen::Vector3d>& bearings2, const Eigen::Vector3d& epipole2,
                   const Eigen::Matrix<double, 3, 2>& basis) {
  Pencil pencil;
  for (int idx = 0; idx < static_cast<int>(bearings2.size()); ++idx) {
    if (!bearings2[idx].allFinite()) continue;
    const Eigen::Vector3d normal = epipole2.cross(bearings2[idx]);
    const double sine = normal.norm();
    int c = 0;
    while (c < kNumClasses - 1 && sine <= LeastSine(c)) ++c;
    pencil[c].push_back({std::atan2(normal.dot(basis.col(1)), normal.dot(basis.col(0))), idx});
  }
  for (std::vector<SortedKeypoint>& entries : pencil) {
    std::sort(entries.begin(), entries.end());
  }
  return pencil;
}

// Calls visit(idx) for the entries within `width` of `angle`, both ways around.
template <typename Visit>
void VisitWindow(const std::vector<SortedKeypoint>& entries, double angle, double width, Visit visit) {
  constexpr double kTurn = 2 * std::numbers::pi;
  if (width >= std::numbers::pi) {
    for (const SortedKeypoint& entry : entries) visit(entry.idx);
    return;
  }
  for (const double shift : {-kTurn, 0.0, kTurn}) {
    const double low = angle + shift - width, high = angle + shift + width;
    if (high < -std::numbers::pi || low > std::numbers::pi) continue;
    auto entry = std::lower_bound(entries.begin(), entries.end(), low,
                                  [](const SortedKeypoint& e, double value) { return e.key < value; });
    for (; entry != entries.end() && entry->key <= high; ++entry) visit(entry->idx);
  }
}

}  // namespace

std::vector<Match> GuideByEpipolarLines(const GuidedView& view1, const GuidedView& view2,
                                        const Eigen::Matrix3d& M, double max_error_rad,
                                        const std::vector<Match>& inliers,
                                        const GuidedMatchOptions& options) {
  const std::vector<Eigen::Vector3d>&bearings1 = *view1.bearings, &bearings2 = *view2.bearings;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU);
  const double largest = svd.singularValues()[0];
  Eigen::Vector3d epipole2 = svd.matrixU().col(2);
  // Signs of M and of the epipole, chosen so that the planes of matches turn the same way.
  int sign = 0;
  for (const Match& match : inliers) {
    sign += epipole2.cross(bearings2[match.idx2]).dot(M * bearings1[match.idx1]) > 0 ? 1 : -1;
  }
  if (sign < 0) epipole2 = -epipole2;
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(epipole2);
  const Pencil pencil = SortByPlane(bearings2, epipole2, basis);
  std::vector<double> squared_norm1(bearings2.size());  // of the plane's normal in the first image
  for (size_t j = 0; j < bearings2.size(); ++j)
    squared_norm1[j] = (M.transpose() * bearings2[j]).squaredNorm();

  CandidateMatcher matcher(view1, view2, inliers, options);
  const double max_error2 = max_error_rad * max_error_rad;
  for (int i = 0; i < static_cast<int>(bearings1.size()); ++i) {
    const Eigen::Vector3d normal = M * bearings1[i];
    const double squared_norm2 = normal.squaredNorm();
    if (!(squared_norm2 > 0)) continue;  // the epipole itself, or NaN
    const double angle = std::atan2(normal.dot(basis.col(1)), normal.dot(basis.col(0)));
    const auto visit = [&](int j) {
      if (!matcher.IsNeeded(i, j)) return;
      const double residual = bearings2[j].dot(normal);
      const double squared_residual = residual * residual;
      const double gradient2 = squared_norm1[j] + squared_norm2 - 2 * squared_residual;
      if (squared_residual <= max_error2 * gradient2) matcher.Offer(i, j);
    };
    for (int c = 0; c < kNumClasses; ++c) {
      // residual = |normal| sin(angle to the epipole) sin(angle between the planes), and the gradient is at
      // most |normal|^2 + (largest sin(angle to the epipole))^2: beyond this width nothing passes the test.
      const double least_sine = LeastSine(c);
      const double sine =
          least_sine > 0
              ? max_error_rad * std::sqrt(1 / (least_sine * least_sine) + largest * largest / squared_norm2)
              : 1;
      VisitWindow(pencil[c], angle, sine < 1 ? std::asin(sine) : std::numbers::pi, visit);
    }
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
  for (int i = 0; i < static_cast<int>(bearings1.size()); ++i) {
    const Eigen::Vector3d predicted = (H * bearings1[i]).normalized();
    if (!predicted.allFinite()) continue;
    auto entry = std::lower_bound(by_height.begin(), by_height.end(), predicted.y() - max_error_rad,
                                  [](const SortedKeypoint& e, double value) { return e.key < value; });
    for (; entry != by_height.end() && entry->key <= predicted.y() + max_error_rad; ++entry) {
      if (matcher.IsNeeded(i, entry->idx) &&
          (predicted - bearings2[entry->idx]).squaredNorm() <= max_error_rad * max_error_rad) {
        matcher.Offer(i, entry->idx);
      }
    }
  }
  return std::move(matcher).Matches();
}

}  // namespace cairn::match_features
