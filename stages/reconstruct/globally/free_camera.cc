#include "stages/reconstruct/globally/free_camera.h"

#include "core/base/pooled.h"
#include "core/structure/camera_sensitivity.h"

namespace cairn::reconstruct {
namespace {

constexpr double kGuessedFocalSigma = 0.3, kStatedFocalSigma = 0.03, kDistortionSigma = 0.1;

}  // namespace

FreeCamera FreeOf(const Camera& stated, const MapGloballyOptions& options) {
  FreeCamera camera{.camera = stated, .stated = stated, .free = {}, .sigma = {}};
  if (options.refine_distortion && stated.model == CameraModel::kSimplePinhole) {
    camera.camera.model = CameraModel::kSimpleRadial;
    camera.camera.params.push_back(0);
    camera.stated = camera.camera;
  }
  if (stated.model == CameraModel::kEquirectangular) return camera;
  const int num_focals = NumFocals(camera.stated.model);
  const PooledVector<double>& params = camera.stated.params;
  for (int p = 0; p < num_focals && options.refine_focal_length; ++p) {
    camera.free.push_back(p);
    camera.sigma.push_back(params[p] * (stated.has_focal_prior ? kStatedFocalSigma : kGuessedFocalSigma));
  }
  for (int p = num_focals + 2; p < static_cast<int>(params.size()) && options.refine_distortion; ++p) {
    camera.free.push_back(p);
    camera.sigma.push_back(kDistortionSigma);
  }
  return camera;
}

}  // namespace cairn::reconstruct
