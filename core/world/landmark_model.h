#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace cairn {

// How a landmark's image depends on where the camera stands, for one heading: a generative model
// z(x) = f(x) + e of the visual map [Sala06 §VI-C: after Sim & Dudek].  No 3-D point and no calibration: it
// interpolates what the survey saw.  Here f is a linear trend plus a Gaussian process with a squared
// exponential kernel, which has the reference's scattered-data interpolation as the limit of no noise, and
// whose cross-validation has a closed form.

// What a landmark looked like from a place on the floor.
struct Sight {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // floor frame, metres
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();   // x px, y px, log2 of the scale in px
};

// The kernel: k(a, b) = exp(-|a - b|^2 / (2 length^2)) + noise (a = b); chosen from few values, so that
// indices of the values are stored.
struct KernelShape {
  int length = 0;  // index in kKernelLengthsM
  int noise = 0;   // index in kKernelNoises
  friend bool operator==(const KernelShape&, const KernelShape&) = default;
};
inline constexpr double kKernelLengthsM[] = {0.5, 1, 2, 4, 8};
inline constexpr double kKernelNoises[] = {1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1};
inline constexpr int kNumKernelLengths = 5, kNumKernelNoises = 6;
// Fewest sights that a model interpolates.
inline constexpr int kMinNumSights = 3;

class LandmarkModel {
 public:
  struct Prediction {
    Eigen::Vector3d seen;                  // as Sight::seen
    Eigen::Matrix<double, 3, 2> gradient;  // d seen / d place
  };

  // Nothing where there are fewer than kMinNumSights, or the numbers do not determine a model (two sights at
  // one place without noise).  The trend is a constant where places are few or on one line.  O(sights^3).
  static std::optional<LandmarkModel> Make(const std::vector<Sight>& sights, const KernelShape& shape);

  Prediction Predict(const Eigen::Vector2d& place) const;

  // Per sight (columns): what is predicted without it, less what was seen [closed form: (Q z)_i / Q_ii with
  // Q = K^-1 - K^-1 H (H^T K^-1 H)^-1 H^T K^-1, H the trend's basis].
  static std::optional<Eigen::Matrix3Xd> LeaveOneOutErrors(const std::vector<Sight>& sights,
                                                           const KernelShape& shape);

 private:
  std::vector<Eigen::Vector2d> places_;
  Eigen::Matrix3Xd weights_;           // per place
  Eigen::Matrix<double, 3, 3> trend_;  // of (1, x - middle, y - middle)
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double inverse_squared_length_ = 0;
};

// The shape whose predictions of left-out sights are best, and how good they are.
struct KernelChoice {
  KernelShape shape;
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();  // root mean square leave-one-out errors, as Sight::seen
};
// Nothing where no shape makes a model.  O(sights^3) per shape.
std::optional<KernelChoice> ChooseKernel(const std::vector<Sight>& sights);

}  // namespace cairn
