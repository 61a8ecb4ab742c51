// Spoils a capture that is exact, to measure what stage 3 finds out (docs/poses.md):
//
//   spoil_survey IN OUT lens FX K1 K2 WIDTH HEIGHT FOCAL_RATIO OFF_PX
//     Its images (of a PINHOLE camera that sees more) as a lens of focal length FX with distortion k1 and k2
//     shows them, in WIDTH x HEIGHT pixels; the camera is stated as a PINHOLE whose focal length is
//     FOCAL_RATIO times as long and whose principal point is OFF_PX pixels off.  OUT/cameras.true.txt has the
//     true camera.
//   spoil_survey IN OUT drift CM DEG SEED
//     The survey's stated poses drift from image to image: a random walk of CM and DEG an axis of the camera,
//     in a square root of a metre of way, a turn by a radian being as long as a metre.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/random.h"
#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/geometry/rotations.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Where the picture of `lens` shows what `camera` saw, a pixel each.  Pixel centres are at half pixels.
void MapOfLens(const Camera& camera, const Camera& lens, cv::Mat* x, cv::Mat* y) {
  x->create(lens.height, lens.width, CV_32F);
  y->create(lens.height, lens.width, CV_32F);
  for (int row = 0; row < lens.height; ++row) {
    for (int column = 0; column < lens.width; ++column) {
      const auto ray = CameraFromImage(lens, {column + 0.5, row + 0.5});
      const auto pixel = ray ? ImageFromCamera(camera, ray->homogeneous()) : std::nullopt;
      x->at<float>(row, column) = pixel ? static_cast<float>(pixel->x() - 0.5) : -1;
      y->at<float>(row, column) = pixel ? static_cast<float>(pixel->y() - 0.5) : -1;
    }
  }
}

Status SpoilLens(const Capture& capture, const std::string& out, char** argv) {
  const Camera& camera = capture.cameras.begin()->second;
  Camera lens = camera, stated = camera;
  lens.model = CameraModel::kOpenCv;
  const double focal = std::atof(argv[4]);
  lens.width = stated.width = std::atoi(argv[7]);
  lens.height = stated.height = std::atoi(argv[8]);
  lens.params = {focal, focal, lens.width / 2.0, lens.height / 2.0, std::atof(argv[5]), std::atof(argv[6]),
                 0,     0};
  const double ratio = std::atof(argv[9]), off = std::atof(argv[10]);
  // Off to the right and up, 4 to 3.
  stated.params = {focal * ratio, focal * ratio, lens.params[2] + 0.8 * off, lens.params[3] - 0.6 * off};
  cv::Mat x, y;
  MapOfLens(camera, lens, &x, &y);
  for (const std::vector<CaptureImage>* images : {&capture.images, &capture.queries}) {
    for (const CaptureImage& image : *images) {
      const cv::Mat seen = cv::imread(capture.ImagePath(image), cv::IMREAD_UNCHANGED);
      cv::Mat shown;
      cv::remap(seen, shown, x, y, cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
      const std::string path = out + "/images/" + image.name;
      fs::create_directories(fs::path(path).parent_path());
      if (!cv::imwrite(path, shown, {cv::IMWRITE_JPEG_QUALITY, 97}))
        return Error{ErrorCode::kIo, path + ": cannot be written"};
    }
  }
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(out + "/cameras.true.txt", {{lens.camera_id, lens}}));
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(out + "/cameras.txt", {{stated.camera_id, stated}}));
  CAIRN_RETURN_IF_ERROR(WriteImagesText(out + "/images.txt", capture.images));
  return WriteImagesText(out + "/queries.txt", capture.queries);
}

Status SpoilPoses(Capture capture, const std::string& out, char** argv) {
  const double sigma_m = std::atof(argv[4]) / 100, sigma_rad = RadFromDeg(std::atof(argv[5]));
  Random random(std::strtoull(argv[6], nullptr, 10));
  const auto step = [&](double sigma) {
    Eigen::Vector3d step;
    for (double& value : step) value = random.Normal(0, sigma);
    return step;
  };
  Pose stated = *capture.images[0].cam_from_world, before = stated;
  for (CaptureImage& image : capture.images) {
    const Pose pose = *image.cam_from_world;
    const double root = std::sqrt(CenterErrorM(before, pose) + RadFromDeg(RotationErrorDeg(before, pose)));
    const Pose drift{QuaternionFromVector(step(sigma_rad * root)), step(sigma_m * root)};
    stated = drift * (pose * before.Inverse()) * stated;
    before = pose;
    image.cam_from_world = stated;
  }
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(out + "/cameras.txt", capture.cameras));
  CAIRN_RETURN_IF_ERROR(WriteImagesText(out + "/images.txt", capture.images));
  fs::create_directory_symlink(fs::absolute(capture.images_folder), out + "/images");
  return WriteImagesText(out + "/queries.txt", capture.queries);
}

Status Spoil(int argc, char** argv) {
  const std::string how = argc > 3 ? argv[3] : "";
  if (!(how == "lens" && argc == 11) && !(how == "drift" && argc == 7))
    return Error{
        ErrorCode::kInvalidArgument,
        "usage: spoil_survey IN OUT lens FX K1 K2 WIDTH HEIGHT FOCAL_RATIO OFF_PX | drift CM DEG SEED"};
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(argv[1]));
  fs::create_directories(argv[2]);
  return how == "lens" ? SpoilLens(capture, argv[2], argv) : SpoilPoses(capture, argv[2], argv);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  const cairn::Status status = cairn::Spoil(argc, argv);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
