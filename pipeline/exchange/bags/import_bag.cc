#include "pipeline/exchange/bags/import_bag.h"

#include <filesystem>
#include <memory>
#include <utility>

#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "pipeline/exchange/bags/bag_images.h"
#include "pipeline/exchange/bags/bag_motion.h"
#include "pipeline/exchange/bags/bag_plan.h"
#include "pipeline/exchange/bags/files/bag.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Writes the images into a capture's folder and collects odometry, the IMU and transforms.
class ImportVisitor : public BagVisitor {
 public:
  ImportVisitor(const BagPlan& plan, const BagOptions& options, const std::string& folder, Progress& progress)
      : plan_(plan), progress_(progress), images_(plan, options, folder), motion_(plan, options) {}

  bool Wants(const BagTopic& topic, int64_t /*record_time_ns*/) override {
    return topic.name == plan_.images.topic.name || motion_.Wants(topic);
  }

  Status Take(const BagMessage& message) override {
    if (message.topic.name != plan_.images.topic.name) {
      motion_.Take(message);
      return Ok();
    }
    if (progress_.Cancelled()) return MakeError(ErrorCode::kCancelled, "importing was stopped");
    progress_.Advance();
    return images_.Take(message);
  }

  Status Finish() {
    motion_.Finish();
    return images_.Finish();
  }

  const ImageImporter& images() const { return images_; }
  const MotionImporter& motion() const { return motion_; }
  std::vector<std::string> Warnings() const {
    std::vector<std::string> warnings = images_.Warnings();
    for (std::string& warning : motion_.Warnings()) warnings.push_back(std::move(warning));
    for (std::string& warning : warnings) warning = fmt::format("{}: {}", plan_.path, warning);
    return warnings;
  }

 private:
  const BagPlan& plan_;
  Progress& progress_;
  ImageImporter images_;
  MotionImporter motion_;
};

Status NoImages(const BagPlan& plan, const ImportVisitor& visitor) {
  const std::vector<std::string> warnings = visitor.Warnings();
  if (visitor.images().span().is_empty) {
    return MakeError(ErrorCode::kNoData, "{}: none of the {} images of {} can be read{}", plan.path,
                     plan.images.num_messages, plan.images.topic.name,
                     warnings.empty() ? "" : "; " + warnings.front());
  }
  return MakeError(ErrorCode::kNoData,
                   "{}: no keyframe among {} images of {}: they are blank, or the camera never moves; "
                   "--keyframes all takes every image",
                   plan.path, plan.images.num_messages, plan.images.topic.name);
}

}  // namespace

Result<BagReport> ImportBag(const std::string& path, const BagOptions& options, const std::string& output,
                            Progress& progress) {
  CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<Bag> bag, OpenBag(path));
  CAIRN_ASSIGN_OR_RETURN(const BagContents contents, LookThrough(*bag));
  BagReport report = {.warnings = contents.damage};
  CAIRN_ASSIGN_OR_RETURN(BagPlan plan, PlanImport(contents, path, options, &report.warnings));

  progress.Begin("import", plan.images.num_messages, "images");
  const Status status =
      ReplaceFolderAtomically(output, "a capture", [&](const std::string& folder) -> Status {
        std::error_code error;
        fs::create_directories(folder + "/images", error);
        if (error) return MakeError(ErrorCode::kIo, "{}/images: {}", folder, error.message());
        ImportVisitor visitor(plan, options, folder, progress);
        if (auto read = bag->Read(visitor); !read.ok()) return read.error();
        CAIRN_RETURN_IF_ERROR(visitor.Finish());
        if (visitor.images().written().empty()) return NoImages(plan, visitor);
        for (std::string& warning : visitor.Warnings()) report.warnings.push_back(std::move(warning));
        CAIRN_RETURN_IF_ERROR(CheckCameraSize(visitor.images().size(), &plan, &report.warnings));
        report.topic = plan.images.topic.name;
        report.num_messages = plan.images.num_messages;
        report.num_images = static_cast<int64_t>(visitor.images().written().size());
        report.num_cameras = plan.camera ? 1 : 0;
        if (plan.camera)
          CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", {{1, *plan.camera}}));
        const std::string imu =
            visitor.motion().ImuLines(visitor.images(), &report.num_imu_samples, &report.warnings);
        if (!imu.empty()) CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/" + kImuFile, imu));
        const std::string lines =
            visitor.motion().OdometryLines(visitor.images(), &report.num_with_odometry, &report.warnings);
        return lines.empty() ? Ok() : WriteFileAtomically(folder + "/" + kOdometryFile, lines);
      });
  progress.End();
  if (!status.ok()) return status.error();
  return report;
}

}  // namespace cairn::pipeline
