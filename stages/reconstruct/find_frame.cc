#include "stages/reconstruct/find_frame.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/quantiles.h"
#include "stages/reconstruct/align.h"
#include "stages/reconstruct/scale_sources.h"

namespace cairn::reconstruct {
namespace {

// Two sources contradict each other from so many standard deviations of their difference on, and one gives
// way to another that knows the scale so many times as well.
constexpr double kContradictingSigmas = 3, kMuchBetter = 3;
// A source that knows the scale less well than this says nothing of it.
constexpr double kMaxSigmaRatio = 0.5;
// What people and robots look at is not nearer, nor farther, on the median, metres: lengths of another unit.
constexpr double kMinDepthM = 0.05, kMaxDepthM = 200;

struct Answered {
  const ScaleSource* source = nullptr;
  ScaleAnswer answer;
  double span_m = 0;
};

double SpanOf(const ModelPoses& model) {
  Eigen::AlignedBox3d box;
  for (const auto& [name, pose] : model) box.extend(pose.Center());
  return box.diagonal().norm();
}

// Median distance of the points from the images that see them; 0 without points.
double MedianDepth(const ColmapModel& reconstruction) {
  std::map<ImageId, Eigen::Vector3d> centres;
  for (const ModelImage& image : reconstruction.images) {
    centres.emplace(image.image_id, image.cam_from_world.Center());
  }
  std::vector<double> depths;
  for (const ModelPoint& point : reconstruction.points) {
    for (const auto& [image_id, keypoint] : point.track) {
      depths.push_back((point.position - centres.at(image_id)).norm());
    }
  }
  return depths.empty() ? 0 : Median(std::move(depths));
}

// Warns of lengths that are not in metres.
void CheckUnit(double depth_m, const Answered& taken, std::vector<std::string>* warnings) {
  if (depth_m == 0 || (depth_m >= kMinDepthM && depth_m <= kMaxDepthM)) return;
  if (taken.source->name == std::string("gps")) return;  // it has no unit to mistake
  warnings->push_back(fmt::format(
      "{}: by it what the images see is {:.4g} m away on the median, and their places span {:.4g} "
      "m; are its lengths in {}?  State them in metres",
      taken.answer.told_by, depth_m, taken.span_m,
      depth_m > kMaxDepthM ? "millimetres or centimetres" : "kilometres"));
}

Similarity WithoutScale(const ColmapModel& reconstruction, const ModelPoses& model, const Vertical& vertical,
                        const ReconstructOptions& options, ReconstructResult* result) {
  result->frame.unit = "arbitrary";
  result->frame.source = "none";
  const std::vector<Pose> poses = PosesOf(model);
  const double depth = MedianDepth(reconstruction);
  return LevelledFrame(poses, depth > 0 ? options.unscaled_depth / depth : 1, vertical.up);
}

Result<ScaleAnswer> Ask(const ScaleSource& source, const ScaleQuestion& question) {
  Result<ScaleAnswer> answer = source.ask(question);
  if (!answer.ok() || answer->sigma_ratio < kMaxSigmaRatio) return answer;
  return MakeError(ErrorCode::kNoData, "{}: it knows the scale to {:.0f} % only, which is no scale",
                   answer->told_by, 100 * answer->sigma_ratio);
}

// The one to take by scale_from = "auto".  REQUIRES: not empty
size_t MostTrusted(const Capture& capture, const std::vector<Answered>& answered,
                   std::vector<std::string>* warnings) {
  size_t taken = 0;
  if (answered[0].source->name == std::string("control_points")) return taken;
  for (size_t i = 1; i < answered.size(); ++i) {
    if (kMuchBetter * answered[i].answer.sigma_ratio < answered[taken].answer.sigma_ratio) taken = i;
  }
  if (taken > 0) {
    const ScaleAnswer &first = answered[0].answer, &better = answered[taken].answer;
    warnings->push_back(
        fmt::format("{}: {} knows the scale to {:.1f} % only, {} to {:.1f} %: this is taken; scale_from = "
                    "\"{}\" takes the "
                    "first, and its frame",
                    capture.root, first.told_by, 100 * first.sigma_ratio, better.told_by,
                    100 * better.sigma_ratio, answered[0].source->name));
  }
  return taken;
}

// Warns of each two that contradict each other.
void ComparePairs(const Capture& capture, const std::vector<Answered>& answered, size_t taken,
                  std::vector<std::string>* warnings) {
  for (size_t i = 0; i < answered.size(); ++i) {
    for (size_t j = i + 1; j < answered.size(); ++j) {
      const Answered &a = answered[i], &b = answered[j];
      const double sigmas =
          std::abs(std::log(b.answer.world_from_model.scale / a.answer.world_from_model.scale)) /
          std::hypot(a.answer.sigma_ratio, b.answer.sigma_ratio);
      if (sigmas <= kContradictingSigmas) continue;
      warnings->push_back(
          fmt::format("{}: two sources contradict each other on the scale by {:.0f} standard deviations: the "
                      "images' places "
                      "span {:.4g} m (+- {:.1f} %) by {}, {:.4g} m (+- {:.1f} %) by {}; the scale is that of "
                      "{}.  Check the "
                      "units and the files; scale_from = \"{}\" or \"{}\" chooses one",
                      capture.root, sigmas, a.span_m, 100 * a.answer.sigma_ratio, a.answer.told_by, b.span_m,
                      100 * b.answer.sigma_ratio, b.answer.told_by, answered[taken].answer.told_by,
                      a.source->name, b.source->name));
    }
  }
}

// Six digits, and millimetres, are more than is known.
CaptureFrame FrameOf(const Answered& taken) {
  CaptureFrame frame{.anchor = taken.answer.anchor, .source = taken.source->name};
  frame.scale_sigma_ratio = std::max(1e-6, std::round(1e6 * taken.answer.sigma_ratio) / 1e6);
  for (int i = 0; i < 3; ++i) frame.scale_centre[i] = std::round(1e3 * taken.answer.centre[i]) / 1e3;
  return frame;
}

}  // namespace

Result<Similarity> FindFrame(const ColmapModel& reconstruction, const Capture& capture,
                             const ReconstructOptions& options, ReconstructResult* result) {
  ModelPoses model;
  for (const ModelImage& image : reconstruction.images) model.emplace(image.name, image.cam_from_world);
  const std::string& from = options.scale_from;
  const std::optional<Result<InertialScale>> imu = AskImuOnce(capture, model, options);
  const ScaleQuestion question{reconstruction, model, capture, options, imu};
  const Vertical vertical = VerticalOf(question);
  if (from == "none") {
    if (imu && !imu->ok()) {
      if (imu->error().code != ErrorCode::kNoData) return imu->error();
      result->warnings.push_back(imu->error().message);
    }
    return WithoutScale(reconstruction, model, vertical, options, result);
  }
  std::vector<Answered> answered;
  std::optional<Error> refusal;  // of a source that the recipe names
  std::string nothing;
  for (const ScaleSource& source : ScaleSources()) {
    const bool is_asked_for = from == source.name;
    if (!is_asked_for && !source.is_there(question)) continue;
    Result<ScaleAnswer> answer = Ask(source, question);
    if (answer.ok()) {
      const double span_m = answer->world_from_model.scale * SpanOf(model);
      answered.push_back({&source, *std::move(answer), span_m});
      continue;
    }
    const Error& error = answer.error();
    if (is_asked_for) return MakeError(error.code, "scale_from = {}: {}", source.name, error.message);
    // What cannot be read is an error; what says nothing leaves the question to others.
    if (error.code != ErrorCode::kNoData) return error;
    if (source.is_named && !refusal) refusal = error;
    nothing += (nothing.empty() ? "" : "; ") + error.message;
    if (source.name != std::string("gps")) result->warnings.push_back(error.message);
  }
  if (answered.empty()) {
    if (refusal) return *refusal;
    result->warnings.push_back(
        fmt::format("nothing gives a scale ({}): the map's unit is arbitrary; give odometry.txt, imu.csv, "
                    "control_points, "
                    "camera_height_m or distances for metres",
                    nothing));
    return WithoutScale(reconstruction, model, vertical, options, result);
  }
  size_t taken = 0;
  if (from == "auto") {
    taken = MostTrusted(capture, answered, &result->warnings);
  } else {
    while (answered[taken].source->name != from) ++taken;
  }
  ComparePairs(capture, answered, taken, &result->warnings);
  CheckUnit(answered[taken].answer.world_from_model.scale * MedianDepth(reconstruction), answered[taken],
            &result->warnings);
  for (const Answered& one : answered) {
    result->warnings.insert(result->warnings.end(), one.answer.warnings.begin(), one.answer.warnings.end());
    result->scales.push_back({one.source->name, one.answer.told_by, one.span_m, one.answer.sigma_ratio});
  }
  const bool is_reconstructed = result->frame.is_reconstructed;
  result->frame = FrameOf(answered[taken]);
  result->frame.is_reconstructed = is_reconstructed;
  result->residuals = std::move(answered[taken].answer.residuals);
  return answered[taken].answer.world_from_model;
}

}  // namespace cairn::reconstruct
