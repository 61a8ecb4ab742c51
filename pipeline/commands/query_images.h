#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/camera/camera.h"
#include "core/colmap/rig_config.h"
#include "core/feature_files/feature_files.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"

namespace cairn::pipeline {

// Errors: InvalidArgument where both --camera and --cameras are given.
Status CheckCameraArguments(const std::string& camera, const std::string& cameras_path);

// The camera to use for an image size: given on the command line, else the map's.
class CameraChoice {
 public:
  // `camera`: as --camera has it, of all images; `cameras_path`: as --cameras, chosen by size; empty: not
  // given.  `map`: null where there is none.  Errors: InvalidArgument (no camera), and those of
  // ReadCamerasText.
  static Result<CameraChoice> Make(const std::string& camera, const std::string& cameras_path,
                                   std::shared_ptr<const Map> map);

  // REQUIRES: a map.  Errors: InvalidArgument, NotFound: several cameras or none take such images.
  Result<Camera> ForImage(int width, int height) const;
  // Whether all images have the one of --camera.
  bool is_one() const { return camera_.has_value(); }
  // Whether any was given on the command line.
  bool is_given() const { return is_one() || !cameras_.empty(); }
  // The same without the map's: nothing where none was given on the command line.
  Result<std::optional<Camera>> GivenForImage(int width, int height) const;

 private:
  std::shared_ptr<const Map> map_;
  std::optional<Camera> camera_;
  std::map<CameraId, Camera> cameras_;
};

// Features of images that another program found, `cairn localize --features`.
class GivenFeatures {
 public:
  // Errors: those of FeatureFiles::Open.
  static Result<GivenFeatures> Open(const std::string& path, const std::string& descriptors);

  const DescriptorKind& kind() const { return files_.kind(); }
  // Those of an image, by its name or by the end of its path.  Errors: NotFound, and those of FeatureFiles.
  Result<Features> Find(const std::string& image) const;
  // Its camera: given for all, or the map's only one, or that of its size, which its file says.  Errors:
  // InvalidArgument.
  Result<Camera> CameraOf(const std::string& image, const CameraChoice& cameras, const MapHead& head) const;

 private:
  explicit GivenFeatures(FeatureFiles files) : files_(std::move(files)) {}

  FeatureFiles files_;
};

// The images that the cameras of a rig took at the same time as the reference camera took this one, each with
// its camera: the rig's file's, else that of its size.  Errors: those of NameInRig, ReadGreyImage, ForImage.
Result<std::vector<RigImage>> ReadRigImages(const std::string& image, const std::vector<RigCamera>& rig,
                                            const CameraChoice& cameras);

// Names one by one from the arguments, then the list file; "-" stands for the lines of stdin.
class ImageNames {
 public:
  // Errors: InvalidArgument without any, and those of ReadFile.
  static Result<ImageNames> Make(std::vector<std::string> names, const std::string& list_path);

  // Up to `count` names; only one at a time from stdin, so that it is answered before the next is read.
  std::vector<std::string> Next(size_t count);

 private:
  std::vector<std::string> names_;
  size_t position_ = 0;
};

}  // namespace cairn::pipeline
