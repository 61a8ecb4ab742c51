#include "sim/render/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::sim {
namespace {

// Pixels in which surfaces meet are the mean of this many rays squared.
constexpr int kEdgeSamples = 3;
// A pixel averages a surface over this many times its own width: a lens is never as sharp as its
// sensor's grid.
constexpr float kLensWidthPx = 1.5f;
// Stands for "no surface" beside the values of RayHit::face.
constexpr int kNoFace = -3;
// Walls are darker towards the floor: brightness there, as part of that below the ceiling.
constexpr double kBrightnessAtFloor = 0.8;

// The surface that a ray meets, and its grey value averaged over the pixel's footprint; `step_x` and `step_y`
// are the changes of the ray per pixel to the right and down.
struct Shade {
  int face = kNoFace;
  float value = 0;
};
Shade TraceRay(const Building& building, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray,
               const Eigen::Vector3d& step_x, const Eigen::Vector3d& step_y) {
  const std::optional<RayHit> hit = CastRay(building, origin, ray);
  if (!hit) return {};
  const Surface& surface = building.SurfaceOf(hit->face);
  const Eigen::Vector3d point = origin + hit->distance * ray;
  const int normal_axis = 3 - surface.u_axis - surface.v_axis;
  // On the plane n.p = const the hit moves by t (s - r (n.s) / (n.r)) when the ray r changes by s.
  const double inverse = 1 / ray[normal_axis];
  const auto footprint = [&](const Eigen::Vector3d& step) {
    const double along = step[normal_axis] * inverse;
    const double u = hit->distance * (step[surface.u_axis] - ray[surface.u_axis] * along);
    const double v = hit->distance * (step[surface.v_axis] - ray[surface.v_axis] * along);
    return Eigen::Vector2f(static_cast<float>(surface.u_scale * u), static_cast<float>(surface.v_scale * v));
  };
  const Eigen::Vector2f texel(static_cast<float>(surface.u_offset + surface.u_scale * point[surface.u_axis]),
                              static_cast<float>(surface.v_offset + surface.v_scale * point[surface.v_axis]));
  const float value = building.textures[surface.texture].Sample(texel, kLensWidthPx * footprint(step_x),
                                                                kLensWidthPx * footprint(step_y));
  const double light =
      normal_axis == 2 ? 1 : kBrightnessAtFloor + (1 - kBrightnessAtFloor) * point.z() / building.height_m;
  return {hit->face, value * surface.brightness * static_cast<float>(light)};
}

}  // namespace

Renderer::Renderer(const Building& building, const Camera& camera)
    : building_(building), camera_(camera), rays_(static_cast<size_t>(camera.width) * camera.height) {
  const bool sees_behind = camera.model == CameraModel::kOpenCvFisheye || camera.model >= CameraModel::kFov;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      Eigen::Vector3f& out = rays_[static_cast<size_t>(y) * camera.width + x];
      out.setConstant(std::numeric_limits<float>::quiet_NaN());
      const Eigen::Vector2d pixel(x + 0.5, y + 0.5);
      if (sees_behind) {
        if (const auto bearing = BearingFromImage(camera, pixel)) out = bearing->cast<float>();
      } else if (const auto ray = CameraFromImage(camera, pixel)) {
        out = ray->cast<float>().homogeneous();
      }
    }
  }
}

cv::Mat Renderer::RenderFloat(const Pose& cam_from_world) const {
  return RenderFloat([&](int) { return cam_from_world; });
}

cv::Mat Renderer::RenderFloat(const std::function<Pose(int)>& cam_from_world) const {
  const int width = camera_.width, height = camera_.height;
  std::vector<Eigen::Vector3d> origins;
  std::vector<Eigen::Matrix3d> world_from_cams;
  for (int y = 0; y < height; ++y) {
    const Pose pose = cam_from_world(y);
    origins.push_back(pose.Center());
    world_from_cams.push_back(pose.rotation.toRotationMatrix().transpose());
  }
  const auto ray_at = [&](int x, int y) { return rays_[static_cast<size_t>(y) * width + x]; };
  // Ray of a pixel and its change per pixel, in the world frame.
  struct SteppedRay {
    Eigen::Vector3d ray, step_x, step_y;
  };
  // Step to the next pixel in a direction; at the border, and beside pixels without a ray, from the
  // previous pixel.
  const auto step = [&](int x, int y, int dx, int dy) {
    const auto is_inside = [&](int px, int py) { return px >= 0 && py >= 0 && px < width && py < height; };
    Eigen::Vector3f change = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
    if (is_inside(x + dx, y + dy)) change = ray_at(x + dx, y + dy) - ray_at(x, y);
    if (!change.allFinite() && is_inside(x - dx, y - dy)) change = ray_at(x, y) - ray_at(x - dx, y - dy);
    if (!change.allFinite()) change.setZero();
    return Eigen::Vector3d(world_from_cams[y] * change.cast<double>());
  };
  const auto pixel_ray = [&](int x, int y) {
    return SteppedRay{world_from_cams[y] * ray_at(x, y).cast<double>(), step(x, y, 1, 0), step(x, y, 0, 1)};
  };

  cv::Mat image(height, width, CV_32FC1);
  cv::Mat faces(height, width, CV_32SC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const SteppedRay pixel = pixel_ray(x, y);
      Shade shade;
      if (std::isfinite(pixel.ray.x()))
        shade = TraceRay(building_, origins[y], pixel.ray, pixel.step_x, pixel.step_y);
      image.at<float>(y, x) = shade.value;
      faces.at<int>(y, x) = shade.face;
    }
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int face = faces.at<int>(y, x);
      const bool is_edge =
          face != kNoFace &&
          ((x > 0 && faces.at<int>(y, x - 1) != face) || (x + 1 < width && faces.at<int>(y, x + 1) != face) ||
           (y > 0 && faces.at<int>(y - 1, x) != face) || (y + 1 < height && faces.at<int>(y + 1, x) != face));
      if (!is_edge) continue;
      const SteppedRay pixel = pixel_ray(x, y);
      const Eigen::Vector3d step_x = pixel.step_x / kEdgeSamples, step_y = pixel.step_y / kEdgeSamples;
      float sum = 0;
      for (int j = 0; j < kEdgeSamples; ++j) {
        for (int i = 0; i < kEdgeSamples; ++i) {
          const double right = i - 0.5 * (kEdgeSamples - 1), down = j - 0.5 * (kEdgeSamples - 1);
          sum += TraceRay(building_, origins[y], pixel.ray + right * step_x + down * step_y, step_x, step_y)
                     .value;
        }
      }
      image.at<float>(y, x) = sum / (kEdgeSamples * kEdgeSamples);
    }
  }
  return image;
}

cv::Mat Renderer::Render(const Pose& cam_from_world) const {
  cv::Mat image;
  RenderFloat(cam_from_world).convertTo(image, CV_8U);
  return image;
}

}  // namespace cairn::sim
