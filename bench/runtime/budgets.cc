// Images localized from scratch, and followed in the order of their names, with less and less work for each
// (LocalizerOptions::budget_ms): fixes, wrong ones, errors squared over their covariance, the most work, and
// processor time.
#include <malloc.h>

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <opencv2/core/utility.hpp>

#include "bench/runtime/fix_figures.h"
#include "core/capture/capture.h"
#include "core/images/image_file.h"
#include "runtime/track/region_tracker.h"

namespace cairn {
namespace {

struct Figures : FixFigures {
  std::vector<double> ms;
  double most_work_ms = 0;
  int num_over_budget = 0, num_sure_wrong = 0;

  void Add(const Localization& found, const Pose& truth, double seconds) {
    const int num_wrong_before = num_wrong;
    FixFigures::Add(found, truth);
    constexpr double kSure = 0.99;
    num_sure_wrong += num_wrong > num_wrong_before && found.probability > kSure ? 1 : 0;
    num_over_budget += found.reason == NoFix::kOverBudget ? 1 : 0;
    most_work_ms = std::max(most_work_ms, found.work_ms);
    ms.push_back(1000 * seconds);
  }

  void Print(double budget_ms, const char* how) const {
    fmt::print(
        "| {} | {} | {} of {} | {} | {}, {} | {:.3f} cm | {:.1f} | {:.2f} | {:.1f}, {:.1f}, {:.1f} |\n",
        budget_ms == 0 ? "any" : fmt::format("{:g}", budget_ms), how, num_fixes, ms.size(), num_over_budget,
        num_wrong, num_sure_wrong, 100 * QuantileOf(errors_m, 0.5), QuantileOf(errors_squared, 0.5),
        most_work_ms, QuantileOf(ms, 0.5), QuantileOf(ms, 0.99), QuantileOf(ms, 1));
  }
};

Status Run(const std::string& map_path, const std::string& capture_path, int every, double core_speed,
           const std::vector<double>& budgets_ms) {
  cv::setNumThreads(1);
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(map_path));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(capture_path));
  std::vector<CaptureImage> images = capture.queries.empty() ? capture.images : capture.queries;
  std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  std::vector<cv::Mat> greys;
  for (const CaptureImage& image : images) {
    CAIRN_ASSIGN_OR_RETURN(greys.emplace_back(), ReadGreyImage(capture_path + "/images/" + image.name));
  }
  fmt::print(
      "| budget, ms | | fixes | over budget | wrong, with P > 0.99 | error, median | error squared, median | "
      "most work, ms | ms: median, 99 %, most |\n|--:|---|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const double budget_ms : budgets_ms) {
    LocalizerOptions options;
    options.budget_ms = budget_ms;
    options.core_speed = core_speed;
    Localizer localizer(map, options);
    RegionTracker tracker(map, options);
    Figures scratch, tracked;
    for (size_t i = 0; i < images.size(); ++i) {
      const Camera& camera = capture.cameras.at(images[i].camera_id);
      if (!images[i].cam_from_world)
        return MakeError(ErrorCode::kNoData, "{}: {} has no pose", capture_path, images[i].name);
      double start = CpuSeconds();
      if (i % every == 0) {
        CAIRN_ASSIGN_OR_RETURN(const Localization found, localizer.Localize(greys[i], camera));
        scratch.Add(found, *images[i].cam_from_world, CpuSeconds() - start);
      }
      start = CpuSeconds();
      CAIRN_ASSIGN_OR_RETURN(const Localization followed, tracker.Track(greys[i], camera));
      tracked.Add(followed, *images[i].cam_from_world, CpuSeconds() - start);
    }
    scratch.Print(budget_ms, "scratch");
    tracked.Print(budget_ms, "followed");
  }
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::string map, capture;
  int every = 1;
  double core_speed = 1;
  std::vector<double> budgets_ms{0, 50, 30, 20, 15, 10, 7, 5};
  CLI::App app("Images localized with less and less work");
  app.add_option("map", map, "map")->required();
  app.add_option("capture", capture, "capture of images with poses; its queries, if it has any")->required();
  app.add_option("--every", every, "one image in so many is localized from scratch, too")
      ->check(CLI::PositiveNumber);
  app.add_option("--core-speed", core_speed, "of this core")->check(CLI::PositiveNumber);
  app.add_option("--budgets-ms", budgets_ms, "0: any")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(map, capture, every, core_speed, budgets_ms); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
