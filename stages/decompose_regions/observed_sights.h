#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/world/feature_class.h"
#include "stages/decompose_regions/choose_features.h"

namespace cairn::decompose_regions {

// A landmark as one survey image sees it.
struct SightInformation {
  size_t image = 0;                  // position in Classes::images
  Eigen::Matrix<double, 2, 6> root;  // I_lv = root' root (choose_features.h)
};

// The sights of a class with weight p_l = `distinctiveness`, in [0, 1].  An image in which the class lies at
// the camera's own centre is left out.  Errors: InvalidArgument, naming an image or camera that does
// not exist.
Result<std::vector<SightInformation>> SightsOf(const FeatureClass& feature_class, double distinctiveness,
                                               const Classes& classes, const ChooseFeaturesOptions& options);

// The information that the landmarks taken so far give each survey image about its pose.
class PoseInformation {
 public:
  PoseInformation(size_t num_images, const ChooseFeaturesOptions& options);
  // What a landmark would add to the sum over images of log det; >= 0.
  double Gain(const std::vector<SightInformation>& sights) const;
  void Add(const std::vector<SightInformation>& sights);

 private:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  struct View {
    Matrix6d information;  // A_0 + sum of I_lv
    Matrix6d covariance;   // its inverse
  };
  std::vector<View> views_;
};

}  // namespace cairn::decompose_regions
