#include "stages/reconstruct/inertial/inertial_scale.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "core/capture/sessions.h"
#include "stages/reconstruct/inertial/image_times.h"
#include "stages/reconstruct/inertial/imu_file.h"

namespace cairn::reconstruct {
namespace {

namespace fs = std::filesystem;

constexpr double kWorthSayingS = 0.03;        // of the clocks' difference
constexpr double kWorthSayingNoiseRatio = 3;  // of the noise over what the options say

// An IMU's file, and how the names of its images begin.
struct ImuPlace {
  std::string path, prefix;
};

std::vector<ImuPlace> PlacesOfImus(const Capture& capture) {
  const std::string single = capture.root + "/" + kImuFile;
  if (fs::exists(single)) return {{single, ""}};
  std::vector<ImuPlace> places;
  const auto sessions = ReadSessionsText(capture.root + "/" + kSessionsFile);
  if (!sessions.ok()) return places;
  for (const std::string& session : *sessions) {
    const std::string path = SessionImuPath(capture.root, session);
    if (fs::exists(path)) places.push_back({path, session + "/"});
  }
  return places;
}

// The images of an IMU, in the order of time.  Errors: NoData, with what their names are.
Result<std::vector<TimedImage>> ImagesOf(const ImuPlace& place, const std::map<std::string, Pose>& model) {
  std::map<std::string, std::vector<TimedImage>> folders;
  std::string other;
  for (const auto& [name, pose] : model) {
    if (!name.starts_with(place.prefix)) continue;
    const std::optional<int64_t> time_ns = TimeOfImageNs(name);
    if (time_ns) {
      folders[name.substr(0, name.rfind('/') + 1)].push_back({name, *time_ns, pose});
    } else {
      other = name;
    }
  }
  if (folders.empty()) {
    return MakeError(
        ErrorCode::kNoData,
        "{}: no image is named by its time{}: seconds with a point (1700000000.250000000.jpg) or "
        "nanoseconds (1700000000250000000.jpg), by the IMU's clock; rename them",
        place.path, other.empty() ? "" : ", such as " + other);
  }
  auto most = folders.begin();
  for (auto folder = folders.begin(); folder != folders.end(); ++folder) {
    if (folder->second.size() > most->second.size()) most = folder;
  }
  std::vector<TimedImage>& images = most->second;
  std::sort(images.begin(), images.end(),
            [](const TimedImage& a, const TimedImage& b) { return a.time_ns < b.time_ns; });
  return std::move(images);
}

// Errors: those of ReadImu, ImagesOf and AlignToImu, with the file.
Result<InertialAlignment> AlignToPlace(const ImuPlace& place, const std::map<std::string, Pose>& model,
                                       const InertialOptions& options, std::vector<TimedImage>* images) {
  CAIRN_ASSIGN_OR_RETURN(const ImuRecording imu, ReadImu(place.path));
  CAIRN_ASSIGN_OR_RETURN(*images, ImagesOf(place, model));
  Result<InertialAlignment> alignment = AlignToImu(*images, imu, options);
  if (alignment.ok()) return alignment;
  return MakeError(alignment.error().code, "{}: {}", place.path, alignment.error().message);
}

void Warn(const ImuPlace& place, const InertialAlignment& alignment, std::vector<std::string>* warnings) {
  if (std::abs(alignment.time_offset_s) > kWorthSayingS) {
    warnings->push_back(fmt::format(
        "{}: the images were taken {:.0f} ms {} than their names say, by the IMU's clock; that is "
        "taken into account",
        place.path, 1e3 * std::abs(alignment.time_offset_s),
        alignment.time_offset_s > 0 ? "later" : "earlier"));
  }
  if (alignment.imu_noise_ratio > kWorthSayingNoiseRatio) {
    warnings->push_back(
        fmt::format("{}: IMU and images disagree by {:.1f} times the noise of imu_accel_noise and "
                    "imu_gyro_noise: vibration, another part, or images in the wrong places; the scale is as "
                    "doubtful",
                    place.path, alignment.imu_noise_ratio));
  }
}

}  // namespace

bool HasImu(const Capture& capture) { return !PlacesOfImus(capture).empty(); }

Result<InertialScale> ScaleByImu(const Capture& capture, const std::map<std::string, Pose>& model,
                                 const InertialOptions& options) {
  InertialScale found;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  double sum = 0, weights = 0;
  std::string nothing;
  for (const ImuPlace& place : PlacesOfImus(capture)) {
    std::vector<TimedImage> images;
    const Result<InertialAlignment> alignment = AlignToPlace(place, model, options, &images);
    if (!alignment.ok()) {
      // What cannot be read is an error; what says nothing leaves the question to others.
      if (alignment.error().code != ErrorCode::kNoData) return alignment.error();
      nothing += (nothing.empty() ? "" : "; ") + alignment.error().message;
      continue;
    }
    found.told_by += (found.told_by.empty() ? "" : ", ") + place.path;
    Warn(place, *alignment, &found.warnings);
    up += alignment->up / (alignment->up_sigma_rad * alignment->up_sigma_rad);
    found.up_sigma_deg = std::max(found.up_sigma_deg, DegFromRad(alignment->up_sigma_rad));
    if (!std::isfinite(alignment->sigma_ratio)) continue;
    const double weight = 1 / (alignment->sigma_ratio * alignment->sigma_ratio);
    sum += weight * std::log(alignment->scale);
    weights += weight;
    for (size_t i = 0; i < alignment->image_idx.size(); ++i) {
      found.residuals.push_back(
          {images[alignment->image_idx[i]].name, alignment->residuals_m[i], alignment->is_off[i]});
    }
  }
  if (found.told_by.empty())
    return MakeError(ErrorCode::kNoData, "{}", nothing.empty() ? capture.root + ": no " + kImuFile : nothing);
  if (!nothing.empty()) found.warnings.push_back(nothing);
  found.up = up.normalized();
  found.sigma_ratio = weights > 0 ? 1 / std::sqrt(weights) : std::numeric_limits<double>::infinity();
  found.scale = weights > 0 ? std::exp(sum / weights) : 0;
  return found;
}

}  // namespace cairn::reconstruct
