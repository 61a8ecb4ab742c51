#include "stages/group_classes/adjust/camera_models.h"

#include <algorithm>
#include <cmath>

#include "core/structure/camera_sensitivity.h"

namespace cairn::group_classes {
namespace {

constexpr double kGuessedFocalRatio = 0.3;  // of a focal length that nobody stated

bool IsUndistorted(const Camera& camera) {
  return camera.model == CameraModel::kSimplePinhole || camera.model == CameraModel::kPinhole;
}

// The same camera in a model that has all of its parameters, and more.
Camera InModel(const Camera& camera, CameraModel model) {
  Camera wider = camera;
  wider.model = model;
  wider.params.assign(NumCameraParams(model), 0.0);
  const int from = NumFocals(camera.model), to = NumFocals(model);
  wider.params[0] = camera.FocalX();
  if (to == 2) wider.params[1] = camera.FocalY();
  // Principal point, then coefficients in the same order.
  for (size_t i = from; i < camera.params.size(); ++i) wider.params[i - from + to] = camera.params[i];
  return wider;
}

// Lower-case letters: f focal lengths, c principal point; digits: how many coefficients.
CameraVariant Variant(const std::string& name, const Camera& stated, CameraModel model, bool focal,
                      bool centre, int num_coefficients, const CameraPriorOptions& options) {
  CameraVariant variant{.name = name, .camera = InModel(stated, model), .free = {}, .sigma = {}};
  const double tightness = IsUndistorted(stated) ? 1 : 1 / options.calibrated_ratio;
  const int num_focals = NumFocals(model);
  const auto add = [&](int index, double sigma) {
    variant.free.push_back(index);
    variant.sigma.push_back(sigma);
  };
  for (int i = 0; i < num_focals && focal; ++i) {
    add(i, variant.camera.params[i] *
               (stated.has_focal_prior ? tightness * options.focal_sigma_ratio : kGuessedFocalRatio));
  }
  if (focal && num_focals == 2)
    variant.difference_sigma = tightness * options.aspect_sigma_ratio * variant.camera.MeanFocal();
  for (int i = 0; i < 2 && centre; ++i)
    add(num_focals + i, tightness * options.principal_point_sigma_ratio * stated.width);
  for (int i = 0; i < num_coefficients; ++i) add(num_focals + 2 + i, tightness * options.distortion_sigma);
  return variant;
}

}  // namespace

OptionTable DescribeOptions(CameraPriorOptions* o) {
  return {
      {.name = "focal_sigma_ratio",
       .value = &o->focal_sigma_ratio,
       .help = "standard deviation of a stated focal length, as a part of it",
       .min = 1e-6},
      {.name = "principal_point_sigma_ratio",
       .value = &o->principal_point_sigma_ratio,
       .help = "standard deviation of a stated principal point, as a part of the image's width",
       .min = 1e-6},
      {.name = "distortion_sigma",
       .value = &o->distortion_sigma,
       .help = "standard deviation of a distortion coefficient",
       .min = 1e-6},
      {.name = "calibrated_ratio",
       .value = &o->calibrated_ratio,
       .help = "these are this many times smaller for a camera that is stated with distortion",
       .min = 1},
  };
}

std::vector<CameraVariant> CameraVariants(const Camera& stated, const CameraPriorOptions& options) {
  std::vector<CameraVariant> variants = {{.name = "", .camera = stated, .free = {}, .sigma = {}}};
  const auto add = [&](const std::string& name, CameraModel model, bool focal, bool centre,
                       int num_coefficients) {
    variants.push_back(Variant(name, stated, model, focal, centre, num_coefficients, options));
  };
  const int num_coefficients = static_cast<int>(stated.params.size()) - NumFocals(stated.model) - 2;
  switch (stated.model) {
    case CameraModel::kEquirectangular:
      break;
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole: {
      // One focal length where one is stated.
      const bool is_square = stated.FocalX() == stated.FocalY();
      add("k1", is_square ? CameraModel::kSimpleRadial : CameraModel::kOpenCv, false, false, 1);
      add("f", is_square ? CameraModel::kSimplePinhole : stated.model, true, false, 0);
      add("f k1", is_square ? CameraModel::kSimpleRadial : CameraModel::kOpenCv, true, false, 1);
      add("f c k1", is_square ? CameraModel::kSimpleRadial : CameraModel::kOpenCv, true, true, 1);
      add("f c k1 k2", is_square ? CameraModel::kRadial : CameraModel::kOpenCv, true, true, 2);
      add("fx fy c k1 k2 p1 p2", CameraModel::kOpenCv, true, true, 4);
      break;
    }
    case CameraModel::kSimpleRadial:
    case CameraModel::kRadial:
      add("f", stated.model, true, false, 0);
      add("f c k", stated.model, true, true, num_coefficients);
      if (stated.model == CameraModel::kSimpleRadial) add("f c k1 k2", CameraModel::kRadial, true, true, 2);
      add("fx fy c k1 k2 p1 p2", CameraModel::kOpenCv, true, true, 4);
      break;
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
      add("f", stated.model, true, false, 0);
      add("f c k", stated.model, true, true, num_coefficients);
      add("fx fy c k1 k2 k3 k4", CameraModel::kOpenCvFisheye, true, true, 4);
      break;
    default:
      add("f", stated.model, true, false, 0);
      add("f c k", stated.model, true, true, num_coefficients);
      break;
  }
  return variants;
}

}  // namespace cairn::group_classes
