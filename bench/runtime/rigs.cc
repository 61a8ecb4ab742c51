// Fixes of one camera of a rig, of the first and the opposite one, and of all: processor time beside that of
// their features, recall, errors, and errors squared over their covariance.  Each without and with gravity:
// the true up, turned by a normal error.
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <opencv2/core/utility.hpp>

#include "bench/runtime/fix_figures.h"
#include "core/base/random.h"
#include "core/capture/capture.h"
#include "core/colmap/rig_config.h"
#include "core/images/image_file.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"

namespace cairn {
namespace {

struct Figures : FixFigures {
  std::vector<double> feature_ms, all_ms;

  void Print(const std::string& name) const {
    double sum_squared = 0;
    for (const double error : errors_squared) sum_squared += error;
    fmt::print(
        "| {} | {} of {} | {} | {:.3f} cm, {:.4f}° | {:.3f} cm, {:.4f}° | {:.1f}, {:.1f} | {:.0f} | {:.1f} | "
        "{:.1f} | {:.2f} |\n",
        name, num_fixes, num_images, num_wrong, 100 * QuantileOf(errors_m, 0.5), QuantileOf(errors_deg, 0.5),
        100 * QuantileOf(errors_m, 0.9), QuantileOf(errors_deg, 0.9), QuantileOf(errors_squared, 0.5),
        sum_squared / std::max(1, num_fixes), num_inliers / std::max(1, num_fixes),
        QuantileOf(feature_ms, 0.5), QuantileOf(all_ms, 0.5),
        QuantileOf(all_ms, 0.5) / QuantileOf(feature_ms, 0.5));
  }
};

SensedUp SenseUp(const Pose& rig_from_world, const Pose& floor_from_world, double sigma_deg, Random& random) {
  Vector6d error = Vector6d::Zero();
  for (int axis = 0; axis < 3; ++axis) error[axis] = random.Normal(0, RadFromDeg(sigma_deg));
  const Eigen::Vector3d up = floor_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  return {Perturb(Pose(), error).rotation * (rig_from_world.rotation * up), std::max(sigma_deg, 0.01)};
}

Status Run(const std::string& map_path, const std::string& capture_path, double gravity_sigma_deg,
           const LocalizerOptions& options) {
  cv::setNumThreads(1);
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(map_path));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(capture_path));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<RigCamera> rig,
                         ReadRigConfig(capture_path + "/" + kRigConfigFile));
  std::map<std::string, const CaptureImage*> images;
  for (const CaptureImage& image : capture.images) images.emplace(image.name, &image);
  Localizer localizer(map, options);
  std::vector<std::vector<size_t>> sets = {{0}};
  if (rig.size() > 2) sets.push_back({0, rig.size() / 2});
  if (rig.size() > 1) sets.emplace_back();
  for (size_t i = 0; rig.size() > 1 && i < rig.size(); ++i) sets.back().push_back(i);
  std::vector<Figures> without(sets.size()), with(sets.size());
  Random random(1);
  int number = 0;
  for (const auto& [name, first] : images) {
    if (!NameInRig(rig, 0, name).ok()) continue;
    fmt::print(stderr, "\r{} of {}", ++number, images.size() / rig.size());
    if (!first->cam_from_world)
      return MakeError(ErrorCode::kNoData, "{}: {} has no pose", capture_path, name);
    const Pose truth = rig[0].cam_from_rig.Inverse() * *first->cam_from_world;
    const SensedUp up = SenseUp(truth, map->head().floor_from_world, gravity_sigma_deg, random);
    std::vector<RigFeatures> all;
    std::vector<double> feature_seconds;
    for (size_t i = 0; i < rig.size(); ++i) {
      CAIRN_ASSIGN_OR_RETURN(const std::string of_camera, NameInRig(rig, i, name));
      CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(capture_path + "/images/" + of_camera));
      const double start = CpuSeconds();
      CAIRN_ASSIGN_OR_RETURN(Features features, ExtractSift(grey, options.sift));
      feature_seconds.push_back(CpuSeconds() - start);
      all.push_back(
          {std::move(features), capture.cameras.at(images.at(of_camera)->camera_id), rig[i].cam_from_rig});
    }
    for (size_t set = 0; set < sets.size(); ++set) {
      std::vector<RigFeatures> taken;
      double seconds = 0;
      for (const size_t i : sets[set]) {
        taken.push_back(all[i]);
        seconds += feature_seconds[i];
      }
      for (Figures* figures : {&without[set], &with[set]}) {
        const double start = CpuSeconds();
        CAIRN_ASSIGN_OR_RETURN(
            const Localization found,
            localizer.LocalizeRigFeatures(taken, std::nullopt,
                                          figures == &with[set] ? std::optional(up) : std::nullopt));
        figures->feature_ms.push_back(1000 * seconds);
        figures->all_ms.push_back(1000 * (seconds + CpuSeconds() - start));
        const int num_wrong = figures->num_wrong;
        figures->Add(found, truth);
        if (figures->num_wrong > num_wrong) {
          fmt::print(stderr, "\nwrong: {} of {} cameras{}: {:.2f} m, {:.1f}°, P {:.4f}, {} inliers\n", name,
                     taken.size(), figures == &with[set] ? ", gravity" : "", figures->errors_m.back(),
                     figures->errors_deg.back(), found.probability, found.num_inliers);
        }
      }
    }
  }
  fmt::print(stderr, "\n");
  fmt::print(
      "| cameras | fixes | wrong | median | 90 % | error squared, median and mean | inliers | ms of features "
      "| "
      "ms of all | ratio |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (size_t set = 0; set < sets.size(); ++set) {
    without[set].Print(fmt::format("{}", sets[set].size()));
    with[set].Print(fmt::format("{}, gravity", sets[set].size()));
  }
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::string map, capture;
  double gravity_sigma_deg = 1;
  cairn::LocalizerOptions options;
  CLI::App app("Fixes of the cameras of a rig, without and with gravity");
  app.add_option("map", map, "map")->required();
  app.add_option("capture", capture, "capture of the rig, with poses and rig_config.json")->required();
  app.add_option("--gravity-sigma-deg", gravity_sigma_deg, "error of gravity per axis, degrees");
  app.add_option("--floor-up-sigma-deg", options.floor_up_sigma_deg, "error of the map's up, degrees");
  app.add_option("--num-features", options.sift.max_num_features, "most features of an image");
  app.add_option("--min-probability", options.accept.min_probability, "of a fix");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(map, capture, gravity_sigma_deg, options); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
