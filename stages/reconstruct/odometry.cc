#include "stages/reconstruct/odometry.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include "core/base/quantiles.h"
#include "stages/reconstruct/align.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumWindows = 40, kMinNumWindows = 3;
constexpr double kMinStepsOfWindow = 5;
// A window that ends nearer to its beginning than this part of its way says little of the scale.
constexpr double kMinChordRatio = 0.3;
constexpr double kSigmasOff = 3, kMinSpreadRatio = 0.005;

// An image that is in the odometry and in the model.
struct Place {
  const OdometryPose* odometry = nullptr;
  const Pose* cam_from_model = nullptr;

  Eigen::Vector3d InOdometry() const { return odometry->world_from_cam.translation; }
  Eigen::Vector3d InModel() const { return cam_from_model->Center(); }
};

// Images of different folders are of different drives.
std::string FolderOfImage(const std::string& name) { return name.substr(0, name.rfind('/') + 1); }

double StepM(const Place& a, const Place& b) {
  if (FolderOfImage(a.odometry->name) != FolderOfImage(b.odometry->name)) return 0;
  return (a.InOdometry() - b.InOdometry()).norm();
}

std::vector<OdometryWindow> CutIntoWindows(const std::vector<Place>& places) {
  std::vector<double> steps;
  double way_m = 0;
  for (size_t i = 1; i < places.size(); ++i) {
    const double step_m = StepM(places[i - 1], places[i]);
    way_m += step_m;
    if (step_m > 0) steps.push_back(step_m);
  }
  std::vector<OdometryWindow> windows;
  if (steps.empty()) return windows;
  // A jump makes the way long, not the windows.
  const double typical_way_m = std::min(way_m, 3 * Median(steps) * static_cast<double>(steps.size()));
  const double length_m = std::max(typical_way_m / kNumWindows, kMinStepsOfWindow * Median(steps));
  for (size_t first = 0; first + 1 < places.size();) {
    double of_window_m = 0;
    size_t last = first;
    while (last + 1 < places.size() && of_window_m < length_m &&
           FolderOfImage(places[last + 1].odometry->name) == FolderOfImage(places[first].odometry->name)) {
      ++last;
      of_window_m += StepM(places[last - 1], places[last]);
    }
    const double odometry_m = (places[last].InOdometry() - places[first].InOdometry()).norm();
    const double model = (places[last].InModel() - places[first].InModel()).norm();
    if (of_window_m >= length_m && odometry_m >= kMinChordRatio * of_window_m && model > 0)
      windows.push_back({places[first].odometry->name, places[last].odometry->name, odometry_m, model});
    first = std::max(last, first + 1);
  }
  return windows;
}

// Marks the windows that are off, and fills scale and its standard deviation.
double FitScale(OdometryAlignment* alignment) {
  std::vector<double> ratios, deviations;
  for (const OdometryWindow& window : alignment->windows) ratios.push_back(window.odometry_m / window.model);
  const double middle = Median(ratios);
  for (const double ratio : ratios) deviations.push_back(std::abs(ratio / middle - 1));
  alignment->spread_ratio = std::max(kMinSpreadRatio, kSigmaOfMad * Median(deviations));
  double sum = 0, sum_squares = 0, num = 0;
  for (size_t i = 0; i < ratios.size(); ++i) {
    OdometryWindow& window = alignment->windows[i];
    window.is_off = deviations[i] > kSigmasOff * alignment->spread_ratio;
    if (window.is_off) continue;
    sum += window.odometry_m * window.model;
    sum_squares += window.model * window.model;
    ++num;
  }
  alignment->scale_sigma_ratio = alignment->spread_ratio / std::sqrt(num);
  return sum / sum_squares;
}

// The model's up is the odometry's in the mean; the heading is the first image's.
Eigen::Quaterniond FitRotation(const std::vector<Place>& places) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Place& place : places) {
    const Eigen::Quaterniond odometry_from_model =
        place.odometry->world_from_cam.rotation * place.cam_from_model->rotation;
    up += odometry_from_model.conjugate() * Eigen::Vector3d::UnitZ();
  }
  const Eigen::Quaterniond level = Eigen::Quaterniond::FromTwoVectors(
      up.norm() > 1e-6 ? up : Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ());
  const Place& first = places.front();
  const Eigen::Matrix3d turn =
      (first.odometry->world_from_cam.rotation * first.cam_from_model->rotation * level.conjugate())
          .toRotationMatrix();
  // The turn about the vertical that is nearest to it.
  const double yaw = std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())) * level;
}

}  // namespace

Result<OdometryAlignment> AlignToOdometry(const std::vector<OdometryPose>& odometry,
                                          const std::map<std::string, Pose>& model) {
  std::vector<Place> places;
  for (const OdometryPose& pose : odometry) {
    const auto found = model.find(pose.name);
    if (found != model.end()) places.push_back({&pose, &found->second});
  }
  OdometryAlignment alignment;
  alignment.windows = CutIntoWindows(places);
  if (std::ssize(alignment.windows) < kMinNumWindows) {
    return MakeError(
        ErrorCode::kNoData,
        "the odometry of {} registered images moves over {} pieces of way; three at least give a "
        "scale",
        places.size(), alignment.windows.size());
  }
  Similarity& similarity = alignment.world_from_model;
  similarity.scale = FitScale(&alignment);
  similarity.rotation = FitRotation(places);
  alignment.first = places.front().InOdometry();
  similarity.translation =
      alignment.first - similarity.scale * (similarity.rotation * places.front().InModel());
  return alignment;
}

std::vector<ImageMotion> MotionsOf(const std::vector<OdometryPose>& odometry, const MapperInput& input) {
  std::map<std::string, int> index;
  for (const DatabaseImage& image : input.images) index.emplace(image.name, static_cast<int>(index.size()));
  std::vector<ImageMotion> motions;
  std::map<std::string, const OdometryPose*> last;  // of each folder
  for (const OdometryPose& pose : odometry) {
    if (index.count(pose.name) == 0) continue;
    const OdometryPose* before = std::exchange(last[FolderOfImage(pose.name)], &pose);
    if (before == nullptr) continue;
    motions.push_back({index.at(before->name), index.at(pose.name),
                       pose.world_from_cam.Inverse() * before->world_from_cam});
  }
  return motions;
}

Result<std::vector<ImageMotion>> OdometryMotions(const MapperInput& input, const Capture& capture) {
  const std::string path = capture.root + "/" + kOdometryFile;
  if (!std::filesystem::exists(path)) return std::vector<ImageMotion>();
  const Result<std::vector<OdometryPose>> odometry = ReadOdometry(path, capture);
  if (odometry.ok()) return MotionsOf(*odometry, input);
  if (odometry.error().code == ErrorCode::kNoData) return std::vector<ImageMotion>();
  return odometry.error();
}

}  // namespace cairn::reconstruct
