#include "pipeline/exchange/bags/import_bag.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "core/base/quantiles.h"
#include "core/capture/capture.h"
#include "core/capture/keyframes.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "pipeline/exchange/bags/bag.h"
#include "pipeline/exchange/bags/bag_bytes.h"
#include "pipeline/exchange/bags/camera_of_info.h"
#include "pipeline/exchange/bags/choose_topics.h"
#include "pipeline/exchange/bags/image_pixels.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Cameras that look steeper than this, on the mean, are as likely not stated in their optical frame.
constexpr double kSteepSine = 0.9;
// Odometry jumps where it goes farther than this, metres, and faster, metres a second, than robots in
// buildings do: it was reset, or corrected by a map.
constexpr double kJumpM = 0.5, kJumpMPerS = 10;
// Nothing that is mapped goes faster than this all the time, metres a second: such odometry is in another
// unit.
constexpr double kOtherUnitMPerS = 50;
// Stamps of two topics are of one clock where, seen from the times at which they were recorded, they differ
// by less than this: no driver and no network takes so long.
constexpr double kTwoClocksS = 5;
// Times of recording say when something happened where they follow stamps as closely as this, seconds.
constexpr double kSteadyS = 0.2;

struct TimeSpan {
  int64_t first_ns = 0, last_ns = 0;
  bool is_empty = true;
  void Add(int64_t time_ns) {
    first_ns = is_empty ? time_ns : std::min(first_ns, time_ns);
    last_ns = is_empty ? time_ns : std::max(last_ns, time_ns);
    is_empty = false;
  }
  bool Meets(const TimeSpan& other) const {
    return !is_empty && !other.is_empty && first_ns <= other.last_ns && other.first_ns <= last_ns;
  }
  std::string Text() const { return fmt::format("{:.3f} to {:.3f} s", 1e-9 * first_ns, 1e-9 * last_ns); }
};

struct WrittenImage {
  std::string name;
  int64_t time_ns = 0;
};

// What is imported, once the topics are chosen.
struct BagPlan {
  std::string path;
  TopicContents images;
  std::optional<TopicContents> odometry;  // only with `chain`
  std::optional<FrameChain> chain;        // between the odometry's child frame and the images' frame
  std::optional<TopicContents> imu;
  std::optional<FrameChain> imu_chain;  // between the images' frame and the IMU's
  std::optional<Camera> camera;
  bool camera_is_asked_for = false;
  // Added to the stamps of odometry, which are of another clock than those of the images; 0: of the same.
  int64_t odometry_shift_ns = 0;
};

// Names of one length: their order is that of time.
std::string TimeName(int64_t time_ns, const char* suffix) {
  return fmt::format("{:010}.{:09}{}", time_ns / 1'000'000'000, time_ns % 1'000'000'000, suffix);
}

// Writes the images into a capture's folder and collects odometry and transforms.
class ImportVisitor : public BagVisitor {
 public:
  ImportVisitor(const BagPlan& plan, const BagOptions& options, std::string folder, Progress& progress)
      : plan_(plan),
        options_(options),
        folder_(std::move(folder)),
        progress_(progress),
        size_(static_cast<int>(plan.images.width), static_cast<int>(plan.images.height)),
        motion_(plan.chain.value_or(FrameChain())),
        imu_motion_(plan.imu_chain.value_or(FrameChain())) {}

  bool Wants(const BagTopic& topic, int64_t /*record_time_ns*/) override {
    return topic.name == plan_.images.topic.name ||
           (plan_.odometry && topic.name == plan_.odometry->topic.name) ||
           (plan_.imu && topic.name == plan_.imu->topic.name) ||
           ((plan_.odometry || plan_.imu_chain) && IsTransformTopic(topic));
  }

  Status Take(const BagMessage& message) override {
    if (message.topic.name == plan_.images.topic.name) return TakeImage(message);
    if (IsTransformTopic(message.topic)) {
      TakeTransforms(message);
    } else if (plan_.imu && message.topic.name == plan_.imu->topic.name) {
      TakeImu(message);
    } else {
      TakeOdometry(message);
    }
    return Ok();
  }

  Status Finish() {
    odometry_.Sort();
    motion_.Sort();
    imu_motion_.Sort();
    return options_.choice == FrameChoice::kKeyframes ? Write(chooser_.Finish()) : Ok();
  }

  const std::vector<WrittenImage>& written() const { return written_; }
  cv::Size size() const { return size_; }
  bool has_read_an_image() const { return !image_times_.is_empty; }
  std::vector<std::string> Warnings() const;
  // odometry.txt's lines.  What stands in the way is said in `warnings`.
  std::string OdometryLines(int64_t* num_lines, std::vector<std::string>* warnings) const;
  // imu.csv, likewise.
  std::string ImuLines(int64_t* num_lines, std::vector<std::string>* warnings) const;

 private:
  struct HeldImage {
    BagPicture picture;
    int64_t time_ns = 0;
  };

  static int64_t TimeOf(const MessageHeader& header, const BagMessage& message) {
    return header.stamp_ns != 0 ? header.stamp_ns : std::max<int64_t>(message.record_time_ns, 0);
  }

  Status TakeImage(const BagMessage& message);
  Result<HeldImage> DecodeMessage(const BagMessage& message);
  void TakeOdometry(const BagMessage& message);
  void LookForJump(int64_t time_ns, const Eigen::Vector3d& place);
  void TakeImu(const BagMessage& message);
  void TakeTransforms(const BagMessage& message);
  Status Write(const std::vector<int64_t>& indices);
  Status WriteImage(const HeldImage& image);

  const BagPlan& plan_;
  const BagOptions& options_;
  std::string folder_;
  Progress& progress_;

  KeyframeChooser chooser_;
  int64_t num_taken_ = 0;
  std::map<int64_t, HeldImage> held_;  // those that may become keyframes
  std::vector<WrittenImage> written_;
  TimeSpan image_times_;
  cv::Size size_;

  FrameMotion motion_;
  Trajectory odometry_;
  TimeSpan odometry_times_;
  std::optional<std::pair<int64_t, Eigen::Vector3d>> last_place_;  // of odometry, with its time
  std::vector<double> speeds_m_per_s_;                             // of odometry, between two messages
  FrameMotion imu_motion_;
  std::string imu_lines_;
  int64_t num_imu_samples_ = 0;
  TimeSpan imu_times_;
  PassedOver damaged_imu_, late_imu_;
  PassedOver damaged_images_, resized_images_, late_images_, unstamped_images_, wild_images_, wild_odometry_,
      damaged_odometry_, damaged_transforms_, jumps_;
};

Result<ImportVisitor::HeldImage> ImportVisitor::DecodeMessage(const BagMessage& message) {
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
  const TopicClock& clock = plan_.images.clock;
  if (image.time_ns == 0) unstamped_images_.Add("");
  if (clock.IsWild(image.time_ns, message.record_time_ns))
    wild_images_.Add(fmt::format("{:.3f} s", 1e-9 * static_cast<double>(image.time_ns)));
  image.time_ns = clock.TimeOf(image.time_ns, message.record_time_ns);
  return image;
}

Status ImportVisitor::TakeImage(const BagMessage& message) {
  if (progress_.Cancelled()) return MakeError(ErrorCode::kCancelled, "importing was stopped");
  progress_.Advance();
  Result<HeldImage> image = DecodeMessage(message);
  if (!image.ok()) {
    damaged_images_.Add(image.error().message);
    return Ok();
  }
  const cv::Size size = image->picture.grey.size();
  if (size_.empty()) size_ = size;
  if (size != size_) {
    resized_images_.Add(fmt::format("{} x {} pixels", size.width, size.height));
    return Ok();
  }
  if (!image_times_.is_empty && image->time_ns <= image_times_.last_ns) {
    late_images_.Add(TimeName(image->time_ns, ""));
    return Ok();
  }
  image_times_.Add(image->time_ns);
  if (options_.choice == FrameChoice::kAll) return WriteImage(*image);
  if (options_.choice == FrameChoice::kEvery) {
    const auto every_ns = static_cast<int64_t>(std::min(options_.every_s, 1e9) * 1e9);
    const bool is_due = written_.empty() || image->time_ns - written_.back().time_ns >= every_ns;
    return is_due ? WriteImage(*image) : Ok();
  }
  const int64_t index = num_taken_++;
  const cv::Mat grey = image->picture.grey;
  held_.emplace(index, std::move(*image));
  CAIRN_RETURN_IF_ERROR(Write(chooser_.Add(index, grey)));
  const std::optional<int64_t> candidate = chooser_.Candidate();
  std::erase_if(held_, [&](const auto& held) { return held.first != candidate; });
  return Ok();
}

Status ImportVisitor::Write(const std::vector<int64_t>& indices) {
  for (const int64_t index : indices) {
    const auto held = held_.find(index);
    if (held != held_.end()) CAIRN_RETURN_IF_ERROR(WriteImage(held->second));
  }
  return Ok();
}

Status ImportVisitor::WriteImage(const HeldImage& image) {
  const std::string name = TimeName(image.time_ns, image.picture.suffix);
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, FileOf(image.picture));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder_ + "/images/" + name, bytes));
  written_.push_back({name, image.time_ns});
  return Ok();
}

void ImportVisitor::TakeOdometry(const BagMessage& message) {
  const Result<OdometryMessage> odometry = DecodeOdometry(message);
  if (!odometry.ok()) return damaged_odometry_.Add(odometry.error().message);
  const int64_t stamp_ns = odometry->header.stamp_ns;
  const TopicClock& clock = plan_.odometry->clock;
  if (clock.IsWild(stamp_ns, message.record_time_ns))
    wild_odometry_.Add(fmt::format("{:.3f} s", 1e-9 * static_cast<double>(stamp_ns)));
  const int64_t time_ns = clock.TimeOf(stamp_ns, message.record_time_ns) + plan_.odometry_shift_ns;
  LookForJump(time_ns, odometry->odom_from_child.translation);
  odometry_.Add(time_ns, odometry->odom_from_child);
  odometry_times_.Add(time_ns);
}

void ImportVisitor::LookForJump(int64_t time_ns, const Eigen::Vector3d& place) {
  if (last_place_) {
    const double length_m = (place - last_place_->second).norm();
    const double seconds = 1e-9 * static_cast<double>(std::abs(time_ns - last_place_->first));
    if (length_m > 0 && seconds > 0) speeds_m_per_s_.push_back(length_m / seconds);
    if (length_m > kJumpM && length_m > kJumpMPerS * seconds)
      jumps_.Add(fmt::format("by {:.2f} m in {:.3f} s at {:.3f} s", length_m, seconds, 1e-9 * time_ns));
  }
  last_place_ = {time_ns, place};
}

void ImportVisitor::TakeImu(const BagMessage& message) {
  const Result<ImuMessage> imu = DecodeImu(message);
  if (!imu.ok()) return damaged_imu_.Add(imu.error().message);
  const int64_t time_ns = TimeOf(imu->header, message);
  if (!imu_times_.is_empty && time_ns <= imu_times_.last_ns) return late_imu_.Add(TimeName(time_ns, ""));
  imu_times_.Add(time_ns);
  const Eigen::Vector3d &turn = imu->turn_rad_s, &accel = imu->accel_m_s2;
  imu_lines_ += fmt::format("{},{},{},{},{},{},{}\n", time_ns, turn.x(), turn.y(), turn.z(), accel.x(),
                            accel.y(), accel.z());
  ++num_imu_samples_;
}

void ImportVisitor::TakeTransforms(const BagMessage& message) {
  int64_t num_invalid = 0;
  const auto transforms = DecodeTransforms(message, &num_invalid);
  if (!transforms.ok()) return damaged_transforms_.Add(transforms.error().message);
  for (; num_invalid > 0; --num_invalid) damaged_transforms_.Add("a pose that is not valid");
  const bool is_static = message.topic.name.ends_with("tf_static");
  for (const TransformMessage& transform : *transforms) {
    if (motion_.Needs(transform.child_frame_id))
      motion_.Add(transform, TimeOf(transform.header, message), is_static);
    if (imu_motion_.Needs(transform.child_frame_id))
      imu_motion_.Add(transform, TimeOf(transform.header, message), is_static);
  }
}

std::vector<std::string> ImportVisitor::Warnings() const {
  std::vector<std::string> warnings;
  const std::string& topic = plan_.images.topic.name;
  const auto say = [&](const PassedOver& skipped, const std::string& text) {
    if (skipped.count > 0) warnings.push_back(fmt::format("{}: {}", plan_.path, text));
  };
  say(damaged_images_, fmt::format("{} images of {} are left out, as they cannot be read; the first: {}",
                                   damaged_images_.count, topic, damaged_images_.first));
  say(resized_images_,
      fmt::format("{} images of {} are left out: they are of another size ({}) than most ({} x {})",
                  resized_images_.count, topic, resized_images_.first, size_.width, size_.height));
  say(late_images_,
      fmt::format("{} images of {} are left out, whose stamps are not after those before them; the first: {}",
                  late_images_.count, topic, late_images_.first));
  say(unstamped_images_,
      fmt::format("{} images of {} have no stamp; they have the times at which they were recorded",
                  unstamped_images_.count, topic));
  say(wild_images_,
      fmt::format(
          "{} images of {} have stamps far from when they were recorded, unlike the others (the first: "
          "{}); they have the times at which they were recorded",
          wild_images_.count, topic, wild_images_.first));
  say(wild_odometry_,
      fmt::format(
          "{} messages of odometry have stamps far from when they were recorded, unlike the others (the "
          "first: {}); they have the times at which they were recorded",
          wild_odometry_.count, wild_odometry_.first));
  say(damaged_odometry_, fmt::format("{} messages of odometry are left out; the first: {}",
                                     damaged_odometry_.count, damaged_odometry_.first));
  say(jumps_,
      fmt::format("odometry jumps {} times, the first {}: was it reset, or corrected by a map? Lengths "
                  "across a jump are wrong; --odometry takes another topic, or none",
                  jumps_.count, jumps_.first));
  say(damaged_imu_, fmt::format("{} messages of the IMU are left out; the first: {}", damaged_imu_.count,
                                damaged_imu_.first));
  say(late_imu_,
      fmt::format("{} messages of the IMU are left out, whose stamps are not after those before them; "
                  "the first: {}",
                  late_imu_.count, late_imu_.first));
  say(damaged_transforms_, fmt::format("{} transforms are left out; the first: {}", damaged_transforms_.count,
                                       damaged_transforms_.first));
  return warnings;
}

std::string ImportVisitor::OdometryLines(int64_t* num_lines, std::vector<std::string>* warnings) const {
  if (!plan_.odometry) return {};
  if (!image_times_.Meets(odometry_times_)) {
    warnings->push_back(
        odometry_times_.is_empty
            ? fmt::format("{}: no valid odometry on {}", plan_.path, plan_.odometry->topic.name)
            : fmt::format("{}: odometry is left out, as its stamps ({}) and those of the images ({}) are of "
                          "two clocks; let both drivers stamp with the same one",
                          plan_.path, odometry_times_.Text(), image_times_.Text()));
    return {};
  }
  if (const double m_per_s = speeds_m_per_s_.empty() ? 0 : Median(speeds_m_per_s_);
      m_per_s > kOtherUnitMPerS) {
    warnings->push_back(fmt::format(
        "{}: odometry is left out, as it goes at {:.0f} m/s where it moves, on the median: it is not in "
        "metres "
        "(of millimetres a thousandth is {:.2f} m/s), or its stamps are wrong; record it in metres, as "
        "nav_msgs/Odometry says, or give distances ([reconstruct] distances)",
        plan_.path, m_per_s, 1e-3 * m_per_s));
    return {};
  }
  std::string lines;
  PassedOver missing;
  double sum_sines = 0;
  for (const WrittenImage& image : written_) {
    const Result<Pose> world_from_base = odometry_.At(image.time_ns, options_.max_time_gap_s);
    const Result<Pose> base_from_camera =
        options_.base_from_camera ? *options_.base_from_camera
                                  : motion_.BaseFromCamera(image.time_ns, options_.max_time_gap_s);
    if (!world_from_base.ok() || !base_from_camera.ok()) {
      missing.Add((world_from_base.ok() ? base_from_camera : world_from_base).error().message);
      continue;
    }
    const Pose world_from_camera = *world_from_base * *base_from_camera;
    const Eigen::Vector3d& t = world_from_camera.translation;
    const Eigen::Quaterniond& q = world_from_camera.rotation;
    lines +=
        fmt::format("{} {} {} {} {} {} {} {}\n", image.name, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    sum_sines += (q * Eigen::Vector3d::UnitZ()).z();
    ++*num_lines;
  }
  if (missing.count > 0) {
    warnings->push_back(fmt::format("{}: {} of {} images have no odometry; the first: {}", plan_.path,
                                    missing.count, written_.size(), missing.first));
  }
  if (*num_lines > 0 && std::abs(sum_sines) > kSteepSine * static_cast<double>(*num_lines)) {
    warnings->push_back(fmt::format(
        "{}: by /tf the camera looks {}, along z of the frame '{}': if it does not, the driver "
        "does not state the optical frame (x right, y down, z ahead); import with --odometry none",
        plan_.path, sum_sines > 0 ? "up" : "down", plan_.images.header->frame_id));
  }
  return lines;
}

std::string ImportVisitor::ImuLines(int64_t* num_lines, std::vector<std::string>* warnings) const {
  if (!plan_.imu) return {};
  if (!image_times_.Meets(imu_times_)) {
    warnings->push_back(
        imu_times_.is_empty
            ? fmt::format("{}: nothing valid on {}", plan_.path, plan_.imu->topic.name)
            : fmt::format(
                  "{}: the IMU is left out, as its stamps ({}) and those of the images ({}) are of two "
                  "clocks; let both drivers stamp with the same one",
                  plan_.path, imu_times_.Text(), image_times_.Text()));
    return {};
  }
  std::optional<Pose> place = options_.camera_from_imu;
  if (!place && plan_.imu_chain) {
    const Result<Pose> stated = imu_motion_.BaseFromCamera(written_.front().time_ns, options_.max_time_gap_s);
    if (stated.ok()) place = *stated;
  }
  std::string head = "#timestamp [ns],w_x [rad/s],w_y,w_z,a_x [m/s^2],a_y,a_z\n";
  if (place) {
    const Eigen::Vector3d& t = place->translation;
    const Eigen::Quaterniond& q = place->rotation;
    head +=
        fmt::format("#imu_on_camera,{},{},{},{},{},{},{}\n", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  } else {
    warnings->push_back(
        fmt::format("{}: /tf does not say where the IMU ('{}') is on the camera ('{}'): how it is turned is "
                    "found from turns "
                    "about two axes at least; --imu-on-camera states it",
                    plan_.path, plan_.imu->header->frame_id, plan_.images.header->frame_id));
  }
  *num_lines = num_imu_samples_;
  return head + imu_lines_;
}

// Finds the camera, if one is stated; what is assumed or missing is said in `warnings`.
Status ChooseCamera(const BagContents& contents, const BagOptions& options, BagPlan* plan,
                    std::vector<std::string>* warnings) {
  if (!options.camera.empty()) {
    CAIRN_ASSIGN_OR_RETURN(plan->camera, ParseCamera(options.camera));
    plan->camera->camera_id = 1;
    plan->camera_is_asked_for = true;
    return Ok();
  }
  constexpr char kRemedy[] = "the focal length is found when the map is made; --camera states it";
  const std::optional<TopicContents> topic = CameraInfoOf(contents, plan->images);
  if (!topic || !topic->camera_info) {
    warnings->push_back(fmt::format("{}: no camera_info that belongs to {}{}; {}", plan->path,
                                    plan->images.topic.name, topic ? " can be read: " + topic->problem : "",
                                    kRemedy));
    return Ok();
  }
  const std::string& name = topic->topic.name;
  const Result<Camera> camera = CameraOfInfo(*topic->camera_info, AreRectified(plan->images));
  if (!camera.ok()) {
    warnings->push_back(
        fmt::format("{}: {} is not used: {}; {}", plan->path, name, camera.error().message, kRemedy));
    return Ok();
  }
  if (topic->camera_info_changes)
    warnings->push_back(fmt::format("{}: {} changes; its first message is used", plan->path, name));
  plan->camera = *camera;
  return Ok();
}

// Odometry without the camera's place on the robot says nothing about images.
void ChooseChain(const BagContents& contents, const BagOptions& options, BagPlan* plan,
                 std::vector<std::string>* warnings) {
  if (!plan->odometry) return;
  const Result<FrameChain> chain =
      !plan->odometry->header
          ? Error{ErrorCode::kNoData, "no message of " + plan->odometry->topic.name +
                                          " can be read; the first: " + plan->odometry->problem}
      : options.base_from_camera
          ? FrameChain()
          : contents.frames.Chain(plan->odometry->child_frame_id, plan->images.header->frame_id);
  if (chain.ok()) {
    plan->chain = *chain;
    return;
  }
  warnings->push_back(fmt::format("{}: odometry is left out: {}{}", plan->path, chain.error().message,
                                  plan->odometry->header ? "; --camera-on-robot states it" : ""));
  plan->odometry.reset();
}

// Where images and odometry are stamped by two clocks, they are brought together by when they were recorded.
void CompareClocks(BagPlan* plan, std::vector<std::string>* warnings) {
  if (!plan->odometry) return;
  const TopicClock &images = plan->images.clock, &odometry = plan->odometry->clock;
  const double apart_s =
      1e-9 * (static_cast<double>(images.ahead_ns()) - static_cast<double>(odometry.ahead_ns()));
  const double spread_s = 1e-9 * static_cast<double>(std::max(images.spread_ns(), odometry.spread_ns()));
  const bool were_at_once = plan->images.first_time_ns <= plan->odometry->last_time_ns &&
                            plan->odometry->first_time_ns <= plan->images.last_time_ns;
  if (std::abs(apart_s) < kTwoClocksS || spread_s > kSteadyS || !were_at_once) return;
  plan->odometry_shift_ns = images.ahead_ns() - odometry.ahead_ns();
  warnings->push_back(fmt::format(
      "{}: the stamps of {} and of {} are of two clocks, {:.3f} s apart; odometry is taken by when "
      "both were recorded, which is right to some hundredths of a second; let both drivers stamp "
      "with the same clock",
      plan->path, plan->images.topic.name, plan->odometry->topic.name, apart_s));
}

// An IMU without a stated place is of use, too.
void ChooseImuChain(const BagContents& contents, const BagOptions& options, BagPlan* plan) {
  if (!plan->imu || options.camera_from_imu) return;
  const Result<FrameChain> chain =
      contents.frames.Chain(plan->images.header->frame_id, plan->imu->header->frame_id);
  if (chain.ok()) plan->imu_chain = *chain;
}

// The camera is only of use where it is that of the images.
Status CheckCameraSize(const cv::Size& size, BagPlan* plan, std::vector<std::string>* warnings) {
  if (!plan->camera || (plan->camera->width == size.width && plan->camera->height == size.height))
    return Ok();
  const std::string sizes = fmt::format("{} x {} px, but the images have {} x {}", plan->camera->width,
                                        plan->camera->height, size.width, size.height);
  if (plan->camera_is_asked_for)
    return MakeError(ErrorCode::kInvalidArgument, "--camera has {}; give that of the images", sizes);
  warnings->push_back(fmt::format("{}: camera_info is not used: it is of {}; --camera states the right one",
                                  plan->path, sizes));
  plan->camera.reset();
  return Ok();
}

Status NoImages(const BagPlan& plan, const ImportVisitor& visitor) {
  const std::vector<std::string> warnings = visitor.Warnings();
  if (!visitor.has_read_an_image()) {
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
  BagPlan plan = {.path = path};
  CAIRN_ASSIGN_OR_RETURN(plan.images, ChooseImages(contents, path, options.topic, &report.warnings));
  CAIRN_ASSIGN_OR_RETURN(plan.odometry, ChooseOdometry(contents, path, options.odometry));
  CAIRN_RETURN_IF_ERROR(ChooseCamera(contents, options, &plan, &report.warnings));
  ChooseChain(contents, options, &plan, &report.warnings);
  CAIRN_ASSIGN_OR_RETURN(plan.imu, ChooseImu(contents, path, options.imu, &report.warnings));
  ChooseImuChain(contents, options, &plan);
  CompareClocks(&plan, &report.warnings);

  progress.Begin("import", plan.images.num_messages, "images");
  const Status status =
      ReplaceFolderAtomically(output, "a capture", [&](const std::string& folder) -> Status {
        std::error_code error;
        fs::create_directories(folder + "/images", error);
        if (error) return MakeError(ErrorCode::kIo, "{}/images: {}", folder, error.message());
        ImportVisitor visitor(plan, options, folder, progress);
        if (auto read = bag->Read(visitor); !read.ok()) return read.error();
        CAIRN_RETURN_IF_ERROR(visitor.Finish());
        if (visitor.written().empty()) return NoImages(plan, visitor);
        for (std::string& warning : visitor.Warnings()) report.warnings.push_back(std::move(warning));
        CAIRN_RETURN_IF_ERROR(CheckCameraSize(visitor.size(), &plan, &report.warnings));
        report.topic = plan.images.topic.name;
        report.num_messages = plan.images.num_messages;
        report.num_images = static_cast<int64_t>(visitor.written().size());
        report.num_cameras = plan.camera ? 1 : 0;
        if (plan.camera)
          CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", {{1, *plan.camera}}));
        const std::string imu = visitor.ImuLines(&report.num_imu_samples, &report.warnings);
        if (!imu.empty()) CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/" + kImuFile, imu));
        const std::string lines = visitor.OdometryLines(&report.num_with_odometry, &report.warnings);
        return lines.empty() ? Ok() : WriteFileAtomically(folder + "/" + kOdometryFile, lines);
      });
  progress.End();
  if (!status.ok()) return status.error();
  return report;
}

}  // namespace cairn::pipeline
