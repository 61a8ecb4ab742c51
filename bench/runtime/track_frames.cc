// A drive localized frame by frame from scratch, and tracked, by all features of each image and by those that
// the map expects: processor time of a frame, beside that of OpenCV's SIFT on the same image, fixes, errors,
// and errors squared over their covariance.  Every `--kidnap-every` frames the camera is carried elsewhere:
// the drive is shown in pieces, in another order.
#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "bench/runtime/fix_figures.h"
#include "bench/runtime/opencv_sift.h"
#include "core/capture/capture.h"
#include "core/images/image_file.h"
#include "runtime/track/region_tracker.h"

namespace cairn {
namespace {

struct Figures : FixFigures {
  std::vector<double> ms, ms_of_opencv;  // of each frame; and its ratio to OpenCV's SIFT
  std::map<std::string, int> scopes;

  void Add(const Localization& found, const Pose& truth, double frame_seconds, double opencv_seconds) {
    FixFigures::Add(found, truth);
    ms.push_back(1000 * frame_seconds);
    ms_of_opencv.push_back(frame_seconds / opencv_seconds);
    if (found.has_fix()) ++scopes[ScopeName(found.scope)];
  }

  void Print(const std::string& name) const {
    const auto num_frames = static_cast<double>(ms.size());
    fmt::print(
        "| {} | {:.1f} | {:.3f} | {} of {} | {} | {:.3f} cm, {:.3f}° | {:.3f} cm, {:.3f}° | {:.1f} | {:.0f}, "
        "{:.0f} |",
        name, QuantileOf(ms, 0.5), QuantileOf(ms_of_opencv, 0.5), num_fixes, ms.size(), num_wrong,
        100 * QuantileOf(errors_m, 0.5), QuantileOf(errors_deg, 0.5), 100 * QuantileOf(errors_m, 0.9),
        QuantileOf(errors_deg, 0.9), QuantileOf(errors_squared, 0.5), num_features / num_frames,
        num_inliers / std::max(1, num_fixes));
    for (const auto& [scope, count] : scopes) fmt::print(" {} {}", scope, count);
    fmt::print(" |\n");
  }
};

Status Run(const std::string& map_path, const std::string& capture_path, bool queries, int kidnap_every,
           int max_num_frames, int max_num_fine) {
  const cv::Ptr<cv::SIFT> opencv = OpenCvSift();
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(map_path));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(capture_path));
  std::vector<CaptureImage> frames = queries ? capture.queries : capture.images;
  std::sort(frames.begin(), frames.end(),
            [](const CaptureImage& a, const CaptureImage& b) { return a.name < b.name; });
  if (kidnap_every > 0) {  // pieces in turn from the first and the second half
    std::vector<CaptureImage> shown;
    const int half = static_cast<int>(frames.size()) / 2;
    for (int first = 0; first < half; first += kidnap_every) {
      for (const int start : {first, half + first}) {
        shown.insert(shown.end(), frames.begin() + start,
                     frames.begin() + start + std::min(kidnap_every, half - first));
      }
    }
    frames = shown;
  }
  if (static_cast<int>(frames.size()) > max_num_frames) frames.resize(max_num_frames);
  Localizer localizer(map);
  RegionTrackerOptions whole_images, map_guided;
  map_guided.features.max_num_fine_features = max_num_fine;
  whole_images.features.map_guided = false;
  RegionTracker tracker(map, {}, whole_images), guided_tracker(map, {}, map_guided);
  Figures scratch, tracked, guided;
  std::vector<double> opencv_ms, sift_ms;
  for (const CaptureImage& frame : frames) {
    if (!frame.cam_from_world)
      return MakeError(ErrorCode::kNoData, "{}: {} has no pose", capture_path, frame.name);
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(capture_path + "/images/" + frame.name));
    const Camera& camera = capture.cameras.at(frame.camera_id);
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    const double before = CpuSeconds();
    opencv->detectAndCompute(grey, {}, keypoints, descriptors);
    const double start = CpuSeconds(), of_opencv = start - before;
    CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, localizer.options().sift));
    const double sift = CpuSeconds() - start;
    CAIRN_ASSIGN_OR_RETURN(const Localization alone, localizer.LocalizeFeatures(features, camera));
    const double middle = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Localization followed, tracker.TrackFeatures(features, camera));
    const double before_guided = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Localization found, guided_tracker.Track(grey, camera));
    const double end = CpuSeconds();
    opencv_ms.push_back(1000 * of_opencv);
    sift_ms.push_back(1000 * sift);
    scratch.Add(alone, *frame.cam_from_world, middle - start, of_opencv);
    tracked.Add(followed, *frame.cam_from_world, sift + before_guided - middle, of_opencv);
    guided.Add(found, *frame.cam_from_world, end - before_guided, of_opencv);
  }
  fmt::print("{} frames; SIFT of the whole image: OpenCV {:.1f} ms, ours {:.1f} ms\n\n", frames.size(),
             QuantileOf(opencv_ms, 0.5), QuantileOf(sift_ms, 0.5));
  fmt::print(
      "| | ms a frame | of OpenCV's SIFT | fixes | wrong | median | 90 % | error squared, median | features, "
      "inliers | found by |\n"
      "|---|--:|--:|--:|--:|--:|--:|--:|--:|---|\n");
  scratch.Print("each frame from scratch");
  tracked.Print("tracked, all features");
  guided.Print("tracked, map-guided");
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::string map, capture;
  bool queries = false;
  int max_num_fine = cairn::RegionTrackerOptions().features.max_num_fine_features;
  int kidnap_every = 0, max_num_frames = std::numeric_limits<int>::max();
  CLI::App app("A drive localized frame by frame, and tracked");
  app.add_option("map", map, "map")->required();
  app.add_option("capture", capture, "capture of the drive, with poses")->required();
  app.add_flag("--queries", queries, "show the capture's queries, not its images");
  app.add_option("--kidnap-every", kidnap_every, "frames between kidnappings; 0: none");
  app.add_option("--max-num-fine-features", max_num_fine, "of map-guided tracking");
  app.add_option("--frames", max_num_frames, "most frames");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status =
          cairn::Run(map, capture, queries, kidnap_every, max_num_frames, max_num_fine);
      !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
