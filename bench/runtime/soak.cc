// A day of frames: the features of a drive are shown to a tracker back and forth, and every so often from
// another place, as often as asked.  Fixes, wrong ones, the memory that the process holds in the course of
// it, and how often a frame asks for some.
#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <opencv2/core/utility.hpp>

#include "bench/runtime/fix_figures.h"
#include "bench/runtime/process_figures.h"
#include "core/capture/capture.h"
#include "core/images/image_file.h"
#include "runtime/track/region_tracker.h"
#include "tests/runtime/track/count_requests.h"

namespace cairn {
namespace {

struct Frame {
  Features features;
  const Camera* camera;
  Pose truth;
};

Result<std::vector<Frame>> ReadFrames(const Capture& capture, const std::string& folder) {
  std::vector<CaptureImage> images = capture.images;
  std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  std::vector<Frame> frames;
  for (const CaptureImage& image : images) {
    if (!image.cam_from_world) return MakeError(ErrorCode::kNoData, "{}: {} has no pose", folder, image.name);
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(folder + "/images/" + image.name));
    CAIRN_ASSIGN_OR_RETURN(Features features, ExtractSift(grey, {}));
    frames.push_back({std::move(features), &capture.cameras.at(image.camera_id), *image.cam_from_world});
  }
  return frames;
}

Status Run(const std::string& map_path, const std::string& capture_path, int64_t num_frames, int leg,
           double budget_ms) {
  cv::setNumThreads(1);
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(map_path));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(capture_path));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<Frame> frames, ReadFrames(capture, capture_path));
  LocalizerOptions options;
  options.budget_ms = budget_ms;
  RegionTracker tracker(map, options);
  fmt::print(
      "| frames | fixes | wrong, with P > 0.99 | MiB held | requests for memory since the row before | work, "
      "most, ms |\n"
      "|--:|--:|--:|--:|--:|--:|\n");
  FixFigures figures;
  int num_sure_wrong = 0;
  int64_t num_requests_in_frames = 0;
  double most_work_ms = 0;
  int64_t at = 0;
  int step = 1;
  const int64_t num_rows = 10;
  for (int64_t i = 0; i < num_frames; ++i) {
    // Back and forth; after each leg it is carried to another frame.
    if (leg > 0 && i % leg == 0) at = (i / leg * 7919) % std::ssize(frames);
    if (at + step < 0 || at + step >= std::ssize(frames)) step = -step;
    at = std::clamp<int64_t>(at + step, 0, std::ssize(frames) - 1);
    const Frame& frame = frames[at];
    Features features = frame.features;
    const long before = num_requests;
    CAIRN_ASSIGN_OR_RETURN(const Localization found,
                           tracker.TrackFeatures(std::move(features), *frame.camera));
    num_requests_in_frames += num_requests - before;
    const int num_wrong = figures.num_wrong;
    figures.Add(found, frame.truth);
    constexpr double kSure = 0.99;
    num_sure_wrong += figures.num_wrong > num_wrong && found.probability > kSure ? 1 : 0;
    most_work_ms = std::max(most_work_ms, found.work_ms);
    figures.errors_m.clear();  // they would grow
    figures.errors_deg.clear();
    figures.errors_squared.clear();
    if ((i + 1) % std::max<int64_t>(1, num_frames / num_rows) == 0) {
      fmt::print("| {} | {} | {}, {} | {:.1f} | {} | {:.1f} |\n", i + 1, figures.num_fixes, figures.num_wrong,
                 num_sure_wrong, ResidentMib(), num_requests_in_frames, most_work_ms);
      num_requests_in_frames = 0;
      std::fflush(stdout);
    }
  }
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::string map, capture;
  int64_t num_frames = 1'000'000;
  int leg = 0;
  double budget_ms = 0;
  CLI::App app("A day of frames");
  app.add_option("map", map, "map")->required();
  app.add_option("capture", capture, "capture of a drive, with poses")->required();
  app.add_option("--frames", num_frames, "frames to show")->check(CLI::PositiveNumber);
  app.add_option("--leg", leg, "frames until it is carried elsewhere; 0: never");
  app.add_option("--budget-ms", budget_ms, "of each frame; 0: any");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(map, capture, num_frames, leg, budget_ms); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
