#include "pipeline/exchange/bags/bag_images.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "core/files/file.h"

namespace cairn::pipeline {
namespace {

// Where an IMU is all that gives the scale, images are at most so far apart while the camera moves, seconds
// (bench/reconstruct/imu_keyframes.cc).
constexpr double kImuIntervalS = 0.4;

KeyframeOptions ChooserOptions(const BagPlan& plan) {
  KeyframeOptions options;
  if (plan.imu && !plan.odometry) options.max_interval_s = kImuIntervalS;
  return options;
}

}  // namespace

std::string TimeName(int64_t time_ns, const char* suffix) {
  return fmt::format("{:010}.{:09}{}", time_ns / 1'000'000'000, time_ns % 1'000'000'000, suffix);
}

ImageImporter::ImageImporter(const BagPlan& plan, const BagOptions& options, std::string folder)
    : plan_(plan),
      options_(options),
      folder_(std::move(folder)),
      times_(plan.images.clock, 0),
      chooser_(ChooserOptions(plan)),
      size_(static_cast<int>(plan.images.width), static_cast<int>(plan.images.height)) {}

Status ImageImporter::Take(const BagMessage& message) {
  Result<HeldImage> image = Decode(message);
  if (!image.ok()) {
    damaged_.Add(image.error().message);
    return Ok();
  }
  const cv::Size size = image->picture.grey.size();
  if (size_.empty()) size_ = size;
  if (size != size_) {
    resized_.Add(fmt::format("{} x {} pixels", size.width, size.height));
    return Ok();
  }
  if (!span_.is_empty && image->time_ns <= span_.last_ns) {
    late_.Add(TimeName(image->time_ns, ""));
    return Ok();
  }
  span_.Add(image->time_ns);
  if (options_.choice == FrameChoice::kAll) return WriteImage(*image);
  if (options_.choice == FrameChoice::kEvery) {
    const auto every_ns = static_cast<int64_t>(std::min(options_.every_s, 1e9) * 1e9);
    const bool is_due = written_.empty() || image->time_ns - written_.back().time_ns >= every_ns;
    return is_due ? WriteImage(*image) : Ok();
  }
  const int64_t index = num_taken_++;
  const cv::Mat grey = image->picture.grey;
  const int64_t time_ns = image->time_ns;
  held_.emplace(index, std::move(*image));
  CAIRN_RETURN_IF_ERROR(
      Write(chooser_.Add(index, grey, 1e-9 * static_cast<double>(time_ns - span_.first_ns))));
  const std::optional<int64_t> candidate = chooser_.Candidate();
  std::erase_if(held_, [&](const auto& held) { return held.first != candidate; });
  return Ok();
}

Status ImageImporter::Finish() {
  return options_.choice == FrameChoice::kKeyframes ? Write(chooser_.Finish()) : Ok();
}

Result<ImageImporter::HeldImage> ImageImporter::Decode(const BagMessage& message) {
  HeldImage image;
  if (message.topic.type == "sensor_msgs/Image") {
    CAIRN_ASSIGN_OR_RETURN(const ImageMessage raw, DecodeImage(message));
    CAIRN_ASSIGN_OR_RETURN(image.picture, PictureOf(raw));
    image.time_ns = raw.header.stamp_ns;
  } else {
    CAIRN_ASSIGN_OR_RETURN(const CompressedImageMessage compressed, DecodeCompressedImage(message));
    CAIRN_ASSIGN_OR_RETURN(image.picture, PictureOf(compressed));
    image.time_ns = compressed.header.stamp_ns;
  }
  image.time_ns = times_.Take(image.time_ns, message.record_time_ns);
  return image;
}

Status ImageImporter::Write(const std::vector<int64_t>& indices) {
  for (const int64_t index : indices) {
    const auto held = held_.find(index);
    if (held != held_.end()) CAIRN_RETURN_IF_ERROR(WriteImage(held->second));
  }
  return Ok();
}

Status ImageImporter::WriteImage(const HeldImage& image) {
  const std::string name = TimeName(image.time_ns, image.picture.suffix);
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, FileOf(image.picture));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder_ + "/images/" + name, bytes));
  written_.push_back({name, image.time_ns});
  return Ok();
}

std::vector<std::string> ImageImporter::Warnings() const {
  std::vector<std::string> warnings;
  const std::string& topic = plan_.images.topic.name;
  const auto say = [&](const PassedOver& passed_over, const std::string& text) {
    if (passed_over.count > 0) warnings.push_back(text);
  };
  say(damaged_, fmt::format("{} images of {} are left out, as they cannot be read; the first: {}",
                            damaged_.count, topic, damaged_.first));
  say(resized_, fmt::format("{} images of {} are left out: they are of another size ({}) than most ({} x {})",
                            resized_.count, topic, resized_.first, size_.width, size_.height));
  say(late_,
      fmt::format("{} images of {} are left out, whose stamps are not after those before them; the first: {}",
                  late_.count, topic, late_.first));
  for (std::string& warning : times_.Warnings("images of " + topic)) warnings.push_back(std::move(warning));
  return warnings;
}

}  // namespace cairn::pipeline
