#include "core/camera/panorama.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "core/base/text.h"

namespace cairn {
namespace {

double HeadingOf(int view, int num_views) { return 2 * std::numbers::pi * view / num_views; }

// Grey value at a pixel (COLMAP's), which wraps around in x and stops at the poles.
float SampleWrapped(const cv::Mat& image, const Eigen::Vector2d& pixel) {
  const double x = pixel.x() - 0.5, y = pixel.y() - 0.5;
  const double left = std::floor(x), top = std::floor(y);
  const auto right_weight = static_cast<float>(x - left), low_weight = static_cast<float>(y - top);
  const auto column = [&](int offset) {
    const int i = static_cast<int>(left) + offset;
    return ((i % image.cols) + image.cols) % image.cols;
  };
  const auto row_value = [&](int offset) {
    const int j = std::clamp(static_cast<int>(top) + offset, 0, image.rows - 1);
    const uchar* row = image.ptr<uchar>(j);
    return (1 - right_weight) * row[column(0)] + right_weight * row[column(1)];
  };
  return (1 - low_weight) * row_value(0) + low_weight * row_value(1);
}

}  // namespace

OptionTable DescribeOptions(PanoramaOptions* options) {
  return {{.name = "num_panorama_views",
           .value = &options->num_panorama_views,
           .help = "pinhole views that an equirectangular panorama is cut into",
           .min = 3,
           .max = 36},
          {.name = "panorama_view_deg",
           .value = &options->panorama_view_deg,
           .help = "width and height of each view, degrees; wider than 360 / num_panorama_views",
           .min = 20,
           .max = 120}};
}

Status CheckPanoramaOptions(const PanoramaOptions& options) {
  if (options.num_panorama_views * options.panorama_view_deg >= 360) return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "option panorama_view_deg = {:g}: {} views of it leave gaps in a panorama; expected at least {:g}",
      options.panorama_view_deg, options.num_panorama_views, 360.0 / options.num_panorama_views);
}

std::string PanoramaViewName(const std::string& panorama_name, int view, int num_views) {
  return fmt::format("{}#{}of{}", panorama_name, view, num_views);
}

std::optional<PanoramaView> ParsePanoramaViewName(const std::string& name) {
  const size_t mark = name.rfind('#');
  if (mark == std::string::npos) return std::nullopt;
  const size_t of = name.find("of", mark);
  if (of == std::string::npos) return std::nullopt;
  PanoramaView view{name.substr(0, mark), 0, 0};
  const std::string_view text = name;
  if (!ParseNumber(text.substr(mark + 1, of - mark - 1), &view.view) ||
      !ParseNumber(text.substr(of + 2), &view.num_views) || view.view < 0 || view.view >= view.num_views) {
    return std::nullopt;
  }
  return view;
}

Pose ViewFromPanorama(int view, int num_views) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(-HeadingOf(view, num_views), Eigen::Vector3d::UnitY())),
          Eigen::Vector3d::Zero()};
}

std::optional<Pose> FindPose(const std::map<std::string, Pose>& cam_from_world_by_name,
                             const std::string& name) {
  if (const auto pose = cam_from_world_by_name.find(name); pose != cam_from_world_by_name.end()) {
    return pose->second;
  }
  const std::optional<PanoramaView> view = ParsePanoramaViewName(name);
  if (!view) return std::nullopt;
  const auto pose = cam_from_world_by_name.find(view->panorama_name);
  if (pose == cam_from_world_by_name.end()) return std::nullopt;
  return ViewFromPanorama(view->view, view->num_views) * pose->second;
}

Camera PanoramaViewCamera(const Camera& panorama, const PanoramaOptions& options) {
  Camera camera;
  camera.camera_id = panorama.camera_id;
  camera.model = CameraModel::kPinhole;
  const double focal = panorama.width / (2 * std::numbers::pi);
  const double half = std::round(focal * std::tan(0.5 * RadFromDeg(options.panorama_view_deg)));
  camera.width = camera.height = std::max(1, static_cast<int>(2 * half));
  camera.params = {focal, focal, 0.5 * camera.width, 0.5 * camera.height};
  return camera;
}

cv::Mat CutPanoramaView(const cv::Mat& panorama, const Camera& view_camera, int view, int num_views) {
  Camera camera;
  camera.model = CameraModel::kEquirectangular;
  camera.width = panorama.cols;
  camera.height = panorama.rows;
  const Eigen::Matrix3d panorama_from_view =
      ViewFromPanorama(view, num_views).rotation.toRotationMatrix().transpose();
  cv::Mat image(view_camera.height, view_camera.width, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector3d bearing = *BearingFromImage(view_camera, {x + 0.5, y + 0.5});
      const Eigen::Vector2d pixel = *ImageFromCamera(camera, panorama_from_view * bearing);
      image.at<uchar>(y, x) = cv::saturate_cast<uchar>(SampleWrapped(panorama, pixel));
    }
  }
  return image;
}

void KeepSectorOfView(const Camera& view_camera, int num_views, Features* features) {
  const double half_width = view_camera.FocalX() * std::tan(std::numbers::pi / num_views);
  const double center = view_camera.PrincipalPoint().x();
  Eigen::Index num_kept = 0;
  for (size_t i = 0; i < features->keypoints.size(); ++i) {
    const double offset = features->keypoints[i].x - center;
    if (offset < -half_width || offset >= half_width) continue;
    features->keypoints[num_kept] = features->keypoints[i];
    features->descriptors.row(num_kept) = features->descriptors.row(static_cast<Eigen::Index>(i)).eval();
    ++num_kept;
  }
  features->keypoints.resize(num_kept);
  features->descriptors.conservativeResize(num_kept, Eigen::NoChange);
}

}  // namespace cairn
