// A drive localized frame by frame from scratch, and tracked: processor time of a frame beyond its features,
// fixes and errors of both.  Every `--kidnap-every` frames the camera is carried elsewhere: the drive is
// shown in pieces, in another order.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <limits>
#include <map>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <opencv2/core/utility.hpp>

#include "core/capture/capture.h"
#include "core/capture/image_file.h"
#include "runtime/track/region_tracker.h"

namespace cairn {
namespace {

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Figures {
  double seconds = 0;
  int num_fixes = 0, num_wrong = 0;
  std::vector<double> errors_m, errors_deg;
  std::map<std::string, int> scopes;

  void Add(const Localization& found, const Pose& truth, double frame_seconds) {
    seconds += frame_seconds;
    if (!found.has_fix()) return;
    ++num_fixes;
    errors_m.push_back(CenterErrorM(found.cam_from_world, truth));
    errors_deg.push_back(RotationErrorDeg(found.cam_from_world, truth));
    num_wrong += errors_m.back() > 0.5 || errors_deg.back() > 10;
    ++scopes[ScopeName(found.scope)];
  }

  void Print(const std::string& name, int num_frames) {
    const auto quantile_of = [](std::vector<double> values, double part) {
      if (values.empty()) return 0.0;
      std::sort(values.begin(), values.end());
      return values[static_cast<size_t>(part * static_cast<double>(values.size() - 1))];
    };
    fmt::print(
        "{:<14}{:>8.2f} ms{:>7} fixes{:>4} wrong; median {:.2f} cm {:.3f} deg, 90 % {:.2f} cm {:.3f} deg;",
        name, 1000 * seconds / num_frames, num_fixes, num_wrong, 100 * quantile_of(errors_m, 0.5),
        quantile_of(errors_deg, 0.5), 100 * quantile_of(errors_m, 0.9), quantile_of(errors_deg, 0.9));
    for (const auto& [scope, count] : scopes) fmt::print(" {} {}", scope, count);
    fmt::print("\n");
  }
};

Status Run(const std::string& map_path, const std::string& capture_path, int kidnap_every,
           int max_num_frames) {
  cv::setNumThreads(1);
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(map_path));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(capture_path));
  std::vector<CaptureImage> frames = capture.images;
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
  RegionTracker tracker(map);
  Figures scratch, tracked;
  double features_seconds = 0;
  for (const CaptureImage& frame : frames) {
    if (!frame.cam_from_world)
      return MakeError(ErrorCode::kNoData, "{}: {} has no pose", capture_path, frame.name);
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(capture_path + "/images/" + frame.name));
    const Camera& camera = capture.cameras.at(frame.camera_id);
    const double start = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, localizer.options().sift));
    const double extracted = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Localization alone, localizer.LocalizeFeatures(features, camera));
    const double middle = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Localization followed, tracker.TrackFeatures(features, camera));
    const double end = CpuSeconds();
    features_seconds += extracted - start;
    scratch.Add(alone, *frame.cam_from_world, middle - extracted);
    tracked.Add(followed, *frame.cam_from_world, end - middle);
  }
  const int num_frames = static_cast<int>(frames.size());
  fmt::print("{} frames, features {:.2f} ms a frame\n", num_frames, 1000 * features_seconds / num_frames);
  scratch.Print("from scratch", num_frames);
  tracked.Print("tracked", num_frames);
  fmt::print("tracked / from scratch: {:.3f}; with features {:.3f}\n", tracked.seconds / scratch.seconds,
             (tracked.seconds + features_seconds) / (scratch.seconds + features_seconds));
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::string map, capture;
  int kidnap_every = 0, max_num_frames = std::numeric_limits<int>::max();
  CLI::App app("A drive localized frame by frame, and tracked");
  app.add_option("map", map, "map")->required();
  app.add_option("capture", capture, "capture of the drive, with poses")->required();
  app.add_option("--kidnap-every", kidnap_every, "frames between kidnappings; 0: none");
  app.add_option("--frames", max_num_frames, "most frames");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(map, capture, kidnap_every, max_num_frames); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
