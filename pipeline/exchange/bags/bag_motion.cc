#include "pipeline/exchange/bags/bag_motion.h"

#include <cmath>
#include <cstdlib>

#include "core/base/quantiles.h"

namespace cairn::pipeline {
namespace {

// Cameras that look steeper than this, on the mean, are as likely not stated in their optical frame.
constexpr double kSteepSine = 0.9;
// Odometry jumps where it goes farther than this, metres, and faster, metres a second, than robots in
// buildings do: it was reset, or corrected by a map.
constexpr double kJumpM = 0.5, kJumpMPerS = 10;
// Nothing that is mapped goes faster than this all the time, metres a second: such odometry is in another
// unit.
constexpr double kOtherUnitMPerS = 50;

// Why nothing of a source counts: it had nothing at the times of the images.
std::string MissesImages(const TimeSpan& images, const TimeSpan& source, const std::string& none,
                         const std::string& source_name) {
  if (source.is_empty) return none;
  return fmt::format(
      "{} is left out, as its stamps ({}) and those of the images ({}) are of two clocks; let "
      "both drivers stamp with the same one",
      source_name, source.Text(), images.Text());
}

SourceTimes TimesOf(const BagPlan& plan, const TopicClock& clock) {
  return {clock, ShiftToClock(plan.images.clock, clock)};
}

}  // namespace

MotionImporter::MotionImporter(const BagPlan& plan, const BagOptions& options)
    : plan_(plan),
      options_(options),
      motion_(plan.chain.value_or(FrameChain())),
      imu_motion_(plan.imu_chain.value_or(FrameChain())) {
  if (plan.odometry) odometry_times_ = TimesOf(plan, plan.odometry->clock);
  if (plan.imu) imu_times_ = TimesOf(plan, plan.imu->clock);
  for (const auto& [child, clock] : plan.frame_clocks) {
    if (motion_.Needs(child) || imu_motion_.Needs(child)) frame_times_[child] = TimesOf(plan, clock);
  }
}

bool MotionImporter::Wants(const BagTopic& topic) const {
  return (plan_.odometry && topic.name == plan_.odometry->topic.name) ||
         (plan_.imu && topic.name == plan_.imu->topic.name) ||
         ((plan_.odometry || plan_.imu_chain) && IsTransformTopic(topic));
}

void MotionImporter::Take(const BagMessage& message) {
  if (IsTransformTopic(message.topic)) {
    TakeTransforms(message);
  } else if (plan_.imu && message.topic.name == plan_.imu->topic.name) {
    TakeImu(message);
  } else {
    TakeOdometry(message);
  }
}

void MotionImporter::Finish() {
  odometry_.Sort();
  motion_.Sort();
  imu_motion_.Sort();
}

void MotionImporter::TakeOdometry(const BagMessage& message) {
  const Result<OdometryMessage> odometry = DecodeOdometry(message);
  if (!odometry.ok()) return damaged_odometry_.Add(odometry.error().message);
  const int64_t time_ns = odometry_times_.Take(odometry->header.stamp_ns, message.record_time_ns);
  LookForJump(time_ns, odometry->odom_from_child.translation);
  odometry_.Add(time_ns, odometry->odom_from_child);
  odometry_span_.Add(time_ns);
}

void MotionImporter::LookForJump(int64_t time_ns, const Eigen::Vector3d& place) {
  if (last_place_) {
    const double length_m = (place - last_place_->second).norm();
    const double seconds = 1e-9 * static_cast<double>(std::abs(time_ns - last_place_->first));
    if (length_m > 0 && seconds > 0) speeds_m_per_s_.push_back(length_m / seconds);
    if (length_m > kJumpM && length_m > kJumpMPerS * seconds)
      jumps_.Add(fmt::format("by {:.2f} m in {:.3f} s at {:.3f} s", length_m, seconds, 1e-9 * time_ns));
  }
  last_place_ = {time_ns, place};
}

void MotionImporter::TakeImu(const BagMessage& message) {
  const Result<ImuMessage> imu = DecodeImu(message);
  if (!imu.ok()) return damaged_imu_.Add(imu.error().message);
  const int64_t time_ns = imu_times_.Take(imu->header.stamp_ns, message.record_time_ns);
  if (!imu_span_.is_empty && time_ns <= imu_span_.last_ns) return late_imu_.Add(TimeName(time_ns, ""));
  imu_span_.Add(time_ns);
  const Eigen::Vector3d &turn = imu->turn_rad_s, &accel = imu->accel_m_s2;
  imu_lines_ += fmt::format("{},{},{},{},{},{},{}\n", time_ns, turn.x(), turn.y(), turn.z(), accel.x(),
                            accel.y(), accel.z());
  ++num_imu_samples_;
}

void MotionImporter::TakeTransforms(const BagMessage& message) {
  int64_t num_invalid = 0;
  const auto transforms = DecodeTransforms(message, &num_invalid);
  if (!transforms.ok()) return damaged_transforms_.Add(transforms.error().message);
  for (; num_invalid > 0; --num_invalid) damaged_transforms_.Add("a pose that is not valid");
  const bool is_static = IsStaticTransformTopic(message.topic);
  for (const TransformMessage& transform : *transforms) {
    const std::string& child = transform.child_frame_id;
    if (!motion_.Needs(child) && !imu_motion_.Needs(child)) continue;
    const int64_t time_ns = is_static ? 0 : TimeOf(transform, message);
    if (motion_.Needs(child)) motion_.Add(transform, time_ns, is_static);
    if (imu_motion_.Needs(child)) imu_motion_.Add(transform, time_ns, is_static);
  }
}

int64_t MotionImporter::TimeOf(const TransformMessage& transform, const BagMessage& message) {
  return frame_times_[transform.child_frame_id].Take(transform.header.stamp_ns, message.record_time_ns);
}

std::string MotionImporter::OdometryLines(const ImageImporter& images, int64_t* num_lines,
                                          std::vector<std::string>* warnings) const {
  if (!plan_.odometry) return {};
  if (!images.span().Meets(odometry_span_)) {
    warnings->push_back(plan_.path + ": " +
                        MissesImages(images.span(), odometry_span_,
                                     "no valid odometry on " + plan_.odometry->topic.name, "odometry"));
    return {};
  }
  if (const double m_per_s = speeds_m_per_s_.empty() ? 0 : Median(speeds_m_per_s_);
      m_per_s > kOtherUnitMPerS) {
    warnings->push_back(fmt::format(
        "{}: odometry is left out, as it goes at {:.0f} m/s where it moves, on the median: it is not in "
        "metres (of millimetres a thousandth is {:.2f} m/s), or its stamps are wrong; record it in metres, "
        "as "
        "nav_msgs/Odometry says, or give distances ([reconstruct] distances)",
        plan_.path, m_per_s, 1e-3 * m_per_s));
    return {};
  }
  std::string lines;
  PassedOver missing;
  double sum_sines = 0;
  for (const WrittenImage& image : images.written()) {
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
                                    missing.count, images.written().size(), missing.first));
  }
  if (*num_lines > 0 && std::abs(sum_sines) > kSteepSine * static_cast<double>(*num_lines)) {
    warnings->push_back(fmt::format(
        "{}: by /tf the camera looks {}, along z of the frame '{}': if it does not, the driver "
        "does not state the optical frame (x right, y down, z ahead); import with --odometry none",
        plan_.path, sum_sines > 0 ? "up" : "down", plan_.images.header->frame_id));
  }
  return lines;
}

std::string MotionImporter::ImuLines(const ImageImporter& images, int64_t* num_lines,
                                     std::vector<std::string>* warnings) const {
  if (!plan_.imu) return {};
  if (!images.span().Meets(imu_span_)) {
    warnings->push_back(
        plan_.path + ": " +
        MissesImages(images.span(), imu_span_, "nothing valid on " + plan_.imu->topic.name, "the IMU"));
    return {};
  }
  std::optional<Pose> place = options_.camera_from_imu;
  if (!place && plan_.imu_chain) {
    const Result<Pose> stated =
        imu_motion_.BaseFromCamera(images.written().front().time_ns, options_.max_time_gap_s);
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
                    "found from turns about two axes at least; --imu-on-camera states it",
                    plan_.path, plan_.imu->header->frame_id, plan_.images.header->frame_id));
  }
  *num_lines = num_imu_samples_;
  return head + imu_lines_;
}

std::vector<std::string> MotionImporter::Warnings() const {
  std::vector<std::string> warnings = WarningsOfClocks();
  const auto say = [&](const PassedOver& passed_over, const std::string& text) {
    if (passed_over.count > 0) warnings.push_back(text);
  };
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

// What each source's clock did not give, and which are of another clock than the images.
std::vector<std::string> MotionImporter::WarningsOfClocks() const {
  std::vector<std::string> warnings;
  const auto say = [&](const SourceTimes& times, const std::string& things, const std::string& source) {
    for (std::string& warning : times.Warnings(things)) warnings.push_back(std::move(warning));
    if (times.shift_ns() == 0 || !times.has_taken()) return;
    warnings.push_back(
        fmt::format("the stamps of {} and of {} are of two clocks, {:.3f} s apart; {} are taken by when both "
                    "were recorded, which is right to some hundredths of a second; let both drivers stamp "
                    "with the same clock",
                    plan_.images.topic.name, source, 1e-9 * static_cast<double>(times.shift_ns()), things));
  };
  if (plan_.odometry) say(odometry_times_, "messages of odometry", plan_.odometry->topic.name);
  if (plan_.imu) say(imu_times_, "messages of the IMU", plan_.imu->topic.name);
  for (const auto& [child, times] : frame_times_) {
    if (motion_.Moves(child) || imu_motion_.Moves(child))
      say(times, fmt::format("transforms of '{}'", child), fmt::format("the frame '{}' on /tf", child));
  }
  return warnings;
}

}  // namespace cairn::pipeline
