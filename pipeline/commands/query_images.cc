#include "pipeline/commands/query_images.h"

#include <iostream>
#include <utility>

#include "core/base/text.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "core/images/image_file.h"

namespace cairn::pipeline {

Status CheckCameraArguments(const std::string& camera, const std::string& cameras_path) {
  if (camera.empty() || cameras_path.empty()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "--camera is the camera of all images, --cameras has one for each size; leave one out");
}

Result<CameraChoice> CameraChoice::Make(const std::string& camera, const std::string& cameras_path,
                                        std::shared_ptr<const Map> map) {
  CameraChoice choice;
  choice.map_ = std::move(map);
  if (!camera.empty()) {
    CAIRN_ASSIGN_OR_RETURN(choice.camera_, ParseCamera(camera));
  }
  if (!cameras_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(choice.cameras_, ReadCamerasText(cameras_path));
  }
  return choice;
}

Result<Camera> CameraChoice::ForImage(int width, int height) const {
  CAIRN_ASSIGN_OR_RETURN(const std::optional<Camera> given, GivenForImage(width, height));
  return given ? Result<Camera>(*given) : map_->CameraForSize(width, height);
}

Result<std::optional<Camera>> CameraChoice::GivenForImage(int width, int height) const {
  if (camera_ || cameras_.empty()) return camera_;
  const Camera* found = nullptr;
  for (const auto& [camera_id, camera] : cameras_) {
    if (camera.width != width || camera.height != height) continue;
    if (found != nullptr) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "cameras {} and {} of --cameras both take {} x {} px; use --camera", found->camera_id,
                       camera_id, width, height);
    }
    found = &camera;
  }
  if (found != nullptr) return std::optional<Camera>(*found);
  return MakeError(ErrorCode::kNotFound, "no camera of --cameras takes {} x {} px", width, height);
}

Result<GivenFeatures> GivenFeatures::Open(const std::string& path, const std::string& descriptors) {
  CAIRN_ASSIGN_OR_RETURN(FeatureFiles files, FeatureFiles::Open(path, descriptors));
  return GivenFeatures(std::move(files));
}

Result<Features> GivenFeatures::Find(const std::string& image) const {
  for (std::string name = image;; name = name.substr(name.find('/') + 1)) {
    CAIRN_ASSIGN_OR_RETURN(std::optional<Features> features, files_.Find(name));
    if (features) return std::move(*features);
    if (name.find('/') == std::string::npos) break;
  }
  return MakeError(ErrorCode::kNotFound, "the {} of --features has no features of it", files_.layout());
}

Result<Camera> GivenFeatures::CameraOf(const std::string& image, const CameraChoice& cameras,
                                       const MapHead& head) const {
  if (cameras.is_one()) return cameras.ForImage(0, 0);
  if (!cameras.is_given() && head.cameras.size() == 1) return head.cameras.front();
  const Result<cv::Mat> grey = ReadGreyImage(image);
  if (grey.ok()) return cameras.ForImage(grey->cols, grey->rows);
  return MakeError(ErrorCode::kInvalidArgument,
                   "which camera took it? There is no image file to say its size ({}); give "
                   "--camera",
                   grey.error().message);
}

Result<std::vector<RigImage>> ReadRigImages(const std::string& image, const std::vector<RigCamera>& rig,
                                            const CameraChoice& cameras) {
  std::vector<RigImage> images;
  for (size_t i = 0; i < rig.size(); ++i) {
    CAIRN_ASSIGN_OR_RETURN(const std::string name, NameInRig(rig, i, image));
    RigImage of_camera{.cam_from_rig = rig[i].cam_from_rig};
    CAIRN_ASSIGN_OR_RETURN(of_camera.grey, ReadGreyImage(name));
    if (rig[i].camera) {
      of_camera.camera = *rig[i].camera;
      of_camera.camera.width = of_camera.grey.cols;
      of_camera.camera.height = of_camera.grey.rows;
    } else {
      const Result<Camera> of_size = cameras.ForImage(of_camera.grey.cols, of_camera.grey.rows);
      if (!of_size.ok()) {
        return MakeError(
            of_size.error().code,
            "{}: {}: or put 'camera_model_name' and 'camera_params' of {} into the file of --rig", name,
            of_size.error().message, rig[i].image_prefix);
      }
      of_camera.camera = *of_size;
    }
    images.push_back(std::move(of_camera));
  }
  return images;
}

Result<ImageNames> ImageNames::Make(std::vector<std::string> names, const std::string& list_path) {
  ImageNames all;
  all.names_ = std::move(names);
  if (!list_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const std::string list, ReadFile(list_path));
    for (const std::string_view line : SplitLines(list)) {
      if (!line.empty()) all.names_.emplace_back(line);
    }
  }
  if (all.names_.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "no image: name images, use --list FILE, or '-' for stdin");
  }
  return all;
}

std::vector<std::string> ImageNames::Next(size_t count) {
  std::vector<std::string> batch;
  while (batch.size() < count && position_ < names_.size()) {
    if (names_[position_] == "-") {
      if (!batch.empty()) return batch;
      std::string line;
      while (std::getline(std::cin, line) && line.empty()) {
      }
      if (!line.empty()) return {line};
      ++position_;
    } else {
      batch.push_back(names_[position_++]);
    }
  }
  return batch;
}

}  // namespace cairn::pipeline
