// `cairn features`: features that another program found, into a capture.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <spdlog/spdlog.h>

#include "core/capture/capture.h"
#include "core/capture/capture_features.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/feature_files/feature_files.h"
#include "core/features/descriptor_kind_table.h"
#include "core/features/features.h"
#include "core/files/database.h"
#include "pipeline/commands/commands.h"

namespace cairn::pipeline {
namespace {

struct FeaturesArguments {
  std::string source, capture;
  std::string descriptors = "auto";
};

struct Counts {
  int64_t num_images = 0, num_features = 0, num_missing = 0;
  std::string first_missing;
};

Result<Counts> WriteFeatures(const FeatureFiles& files, const Capture& capture, const std::string& path,
                             Progress& progress) {
  Counts counts;
  std::vector<CaptureImage> images;
  for (const auto* list : {&capture.images, &capture.queries}) {
    for (const CaptureImage& image : *list) {
      if (capture.cameras.contains(image.camera_id)) images.push_back(image);  // without: a reject anyway
    }
  }
  std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  images.erase(std::unique(images.begin(), images.end(),
                           [](const auto& a, const auto& b) { return a.name == b.name; }),
               images.end());
  progress.Begin("take features", static_cast<int64_t>(images.size()), "images");
  const Status status = WriteDatabase(path, kColmapSchema, [&](SQLite::Database& database) -> Status {
    StateDescriptorKind(database, files.kind());
    for (const auto& [camera_id, camera] : capture.cameras) WriteDatabaseCamera(database, camera);
    for (const CaptureImage& image : images) {
      if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "taking features was stopped");
      CAIRN_ASSIGN_OR_RETURN(const std::optional<Features> features, files.Find(image.name));
      progress.Advance();
      if (!features) {
        if (counts.num_missing++ == 0) counts.first_missing = image.name;
        continue;
      }
      const auto image_id = static_cast<ImageId>(++counts.num_images);
      WriteDatabaseImage(database, {image_id, image.name, image.camera_id});
      WriteDatabaseFeatures(database, image_id, *features);
      counts.num_features += std::ssize(features->keypoints);
    }
    if (counts.num_images > 0) return Ok();
    return MakeError(ErrorCode::kNoData, "no features of any of the {} images of {}{}", images.size(),
                     capture.root,
                     images.empty() ? "" : fmt::format("; it has names such as '{}'", images.front().name));
  });
  progress.End();
  CAIRN_RETURN_IF_ERROR(status);
  return counts;
}

// The capture's images, whether they have files or not.
Result<Capture> ReadListed(const std::string& root) {
  std::error_code error;
  if (!std::filesystem::exists(root + "/images.txt", error) ||
      std::filesystem::exists(root + "/" + kRegisterFile, error)) {
    return ReadCapture(root);
  }
  Capture capture{.root = root};
  CAIRN_ASSIGN_OR_RETURN(capture.cameras, ReadCamerasText(root + "/cameras.txt"));
  CAIRN_ASSIGN_OR_RETURN(capture.images, ReadImagesText(root + "/images.txt", &capture.rejects));
  if (std::filesystem::exists(root + "/queries.txt", error)) {
    CAIRN_ASSIGN_OR_RETURN(capture.queries, ReadImagesText(root + "/queries.txt", &capture.rejects));
  }
  return capture;
}

Status RunFeatures(const FeaturesArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const FeatureFiles files,
                         FeatureFiles::Open(arguments.source, arguments.descriptors));
  const std::string path = arguments.capture + "/" + kFeaturesFile;
  std::error_code error;
  if (std::filesystem::exists(arguments.capture + "/" + kFeaturesFolder, error)) {
    return MakeError(
        ErrorCode::kUnsupported,
        "{}: a joined capture, whose sessions have features of their own; give them to the captures that "
        "it is made of",
        arguments.capture);
  }
  if (std::filesystem::exists(path, error)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: the capture has features already; move them away to give it others", path);
  }
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadListed(arguments.capture));
  for (const auto& [camera_id, camera] : capture.cameras) {
    if (camera.model == CameraModel::kEquirectangular) {
      return MakeError(
          ErrorCode::kUnsupported,
          "{}: camera {} takes panoramas, whose views have features, not they themselves; give the views "
          "and their PINHOLE camera",
          arguments.capture, camera_id);
    }
  }
  Result<Counts> counts = WriteFeatures(files, capture, path, *environment.progress);
  if (!counts.ok()) return MakeError(counts.error().code, "{}: {}", arguments.source, counts.error().message);
  if (counts->num_missing > 0) {
    spdlog::warn("{}: no features of {} images; the first: {}", arguments.source, counts->num_missing,
                 counts->first_missing);
  }
  environment.report->in = {{"images", counts->num_images + counts->num_missing}};
  environment.report->out = {{"images", counts->num_images}, {"keypoints", counts->num_features}};
  *environment.out << fmt::format("features: {} images of a {}, {} features of the kind '{}'\n",
                                  counts->num_images, files.layout(), counts->num_features,
                                  ToString(files.kind()));
  return Ok();
}

}  // namespace

Command FeaturesCommand() {
  const auto arguments = std::make_shared<FeaturesArguments>();
  return {
      .name = "features",
      .summary = "Take the features that another program found into a capture, in place of SIFT's",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser
                .Add("source", arguments->source,
                     "COLMAP database, kapture folder (or that of one type of descriptors in it), or folder "
                     "of "
                     "IMAGE.npz with the arrays keypoints and descriptors")
                .Required()
                .Type("SOURCE");
            parser.Add("capture", arguments->capture, "Capture folder, where features.db is written")
                .Required()
                .Type("CAPTURE");
            parser
                .Add("--descriptors", arguments->descriptors,
                     "What they are: auto|sift|float|dense|binary, and in a second word what made them "
                     "('binary "
                     "orb'); auto: "
                     "as the files say, else bytes are sift (128) or binary (fewer) [auto]")
                .Type("KIND");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunFeatures(*arguments, environment); },
      .stage = "features",
  };
}

}  // namespace cairn::pipeline
