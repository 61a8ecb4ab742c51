// imu_keyframes [SEEDS]: walks with a camera in the hand through a hall, by the images that keyframe choice
// takes: how often an IMU gives the scale, and how right.  A row a length of the walk and choice of images:
// by what moves alone, and also no farther apart in time than the import of bags with an IMU wants.  Corners
// are points on walls, floor and ceiling; what is due is what KeyframeChooser says of them, without blur.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include <opencv2/core/types.hpp>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/capture/frame_motion.h"
#include "core/capture/keyframes.h"
#include "tests/reconstruct/inertial/simulated_imu.h"

namespace {

using namespace cairn;
using namespace cairn::reconstruct;

constexpr double kFramesPerSecond = 15, kLongestS = 120, kRefusedRatio = 0.2;
constexpr int kNumPoints = 3000;
constexpr double kNoisePx = 0.1, kMovedWay = 0.1;
const Eigen::Vector3d kHallM(14, 12, 3);
const cv::Size kFrame(640, 480);
constexpr double kFocalPx = 417;  // 75 degrees wide

std::vector<Eigen::Vector3d> PointsOfHall(Random& random) {
  std::vector<Eigen::Vector3d> points;
  const double areas_m2[] = {kHallM.y() * kHallM.z(), kHallM.x() * kHallM.z(), kHallM.x() * kHallM.y()};
  const double area_m2 = areas_m2[0] + areas_m2[1] + areas_m2[2];
  while (points.size() < kNumPoints) {
    double at = random.Uniform(0, area_m2);
    int axis = 0;
    while (axis < 2 && at > areas_m2[axis]) at -= areas_m2[axis++];
    Eigen::Vector3d point(random.Uniform(0, kHallM.x()), random.Uniform(0, kHallM.y()),
                          random.Uniform(0, kHallM.z()));
    point[axis] = random.Uniform(0, 1) < 0.5 ? 0 : kHallM[axis];
    points.push_back(point);
  }
  return points;
}

// Where a point is in the picture; outside of it where it is not.
cv::Point2f Project(const Pose& world_from_cam, const Eigen::Vector3d& point, Random& random) {
  const Eigen::Vector3d seen =
      world_from_cam.rotation.conjugate() * Eigen::Vector3d(point - world_from_cam.translation);
  const double x = random.Normal(0, kNoisePx), y = random.Normal(0, kNoisePx);
  if (seen.z() < 0.1) return {-1, -1};
  return {static_cast<float>(kFocalPx * seen.x() / seen.z() + 0.5 * kFrame.width + x),
          static_cast<float>(kFocalPx * seen.y() / seen.z() + 0.5 * kFrame.height + y)};
}
bool IsInFrame(const cv::Point2f& p) {
  return p.x >= 0 && p.y >= 0 && p.x < static_cast<float>(kFrame.width) &&
         p.y < static_cast<float>(kFrame.height);
}

struct Walk {
  Motion motion;
  std::vector<std::vector<double>> times_s;  // of the images, by choice
};

// Times of the images that are due, at most `longest_s` apart where it moves; 0: by what moves alone.
std::vector<double> ChooseTimes(const Motion& motion, double longest_s, uint64_t seed) {
  Random random(seed);
  const KeyframeOptions options;
  const std::vector<Eigen::Vector3d> points = PointsOfHall(random);
  std::vector<double> times_s;
  std::vector<size_t> corners;
  std::vector<cv::Point2f> corners_px;
  for (double time_s = 0.1; time_s < kLongestS - 0.1; time_s += 1 / kFramesPerSecond) {
    const Pose pose = motion(time_s);
    double way = times_s.empty() ? 1 : 0;
    if (!times_s.empty()) {
      std::vector<cv::Point2f> before, after;
      for (size_t i = 0; i < corners.size(); ++i) {
        const cv::Point2f place = Project(pose, points[corners[i]], random);
        if (!IsInFrame(place)) continue;
        before.push_back(corners_px[i]);
        after.push_back(place);
      }
      const FrameMotion moved = MeasureMotion(before, after, kFrame, 0);
      const double found_ratio = static_cast<double>(before.size()) / static_cast<double>(corners.size());
      way = std::max({moved.parallax / options.parallax_ratio, moved.shift / options.shift_ratio,
                      (1 - found_ratio) / (1 - options.min_overlap_ratio)});
      if (longest_s > 0 && way >= kMovedWay)
        way = std::max(way, 1.01 * (time_s - times_s.back()) / longest_s);
    }
    if (way < 1) continue;
    times_s.push_back(time_s);
    corners.clear();
    corners_px.clear();
    for (size_t i = 0; i < points.size() && std::ssize(corners) < options.num_corners; ++i) {
      const cv::Point2f place = Project(pose, points[i], random);
      if (!IsInFrame(place)) continue;
      corners.push_back(i);
      corners_px.push_back(place);
    }
  }
  return times_s;
}

// `speed`: 1 is that of a walk.
Walk MakeWalk(uint64_t seed, double speed, const std::vector<double>& choices) {
  const Motion walked = Handheld(seed);
  Walk walk;
  walk.motion = [=](double t) -> Pose {
    Pose pose = walked(speed * t);
    pose.translation += Eigen::Vector3d(kHallM.x() / 2, kHallM.y() / 2, 0);
    return pose;
  };
  for (const double longest_s : choices) walk.times_s.push_back(ChooseTimes(walk.motion, longest_s, seed));
  return walk;
}

void PrintRow(const std::vector<Walk>& walks, const char* motion, size_t choice, const char* choice_text,
              double duration_s, const SimulatedModel& model) {
  int num_refused = 0;
  double sum_squares = 0, largest = 0, sum_normalised = 0;
  std::vector<double> steps;
  for (size_t w = 0; w < walks.size(); ++w) {
    const uint64_t seed = w + 1;
    ModelMaker maker(walks[w].motion, model, 0, seed);
    double last_s = -1;
    for (const double time_s : walks[w].times_s[choice]) {
      if (time_s > duration_s - 0.1) break;
      maker.Add(time_s);
      if (last_s >= 0) steps.push_back(time_s - last_s);
      last_s = time_s;
    }
    const ImuRecording recording = RecordImu(walks[w].motion, ImuOfSeed(seed), duration_s, seed);
    const auto found = AlignToImu(maker.Finish(), recording, {});
    if (!found.ok() || !(found->sigma_ratio <= kRefusedRatio)) {
      ++num_refused;
      continue;
    }
    const double error = std::log(found->scale * model.model_per_metre);
    sum_squares += error * error;
    sum_normalised += error * error / (found->sigma_ratio * found->sigma_ratio);
    largest = std::max(largest, std::abs(error));
  }
  const auto num = static_cast<double>(walks.size()) - num_refused;
  std::printf("| %s, %g s, images %g mm off | %s | %.2f, %.2f | %d of %zu | %.1f %% | %.1f %% | %.1f |\n",
              motion, duration_s, 1e3 * model.place_sigma_m, choice_text, Median(steps), Quantile(steps, 0.9),
              num_refused, walks.size(), 100 * std::sqrt(sum_squares / num), 100 * largest,
              sum_normalised / num);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int num_seeds = argc > 1 ? std::atoi(argv[1]) : 12;
  const std::vector<double> choices = {0, 0.4};
  const char* texts[] = {"by what moves", "and at most 0.4 s apart"};
  std::printf(
      "| camera in the hand | images | s between them: median, 9th decile | refused | error: root mean "
      "square | "
      "largest | normalised error squared |\n|---|---|---|---|---|---|---|\n");
  const SimulatedModel worse = {.place_sigma_m = 0.01, .bend_sigma_m = 0.003, .bend_sigma_deg = 0.03};
  for (const auto& [motion, speed] : {std::pair("walking", 1.0), {"at half the speed", 0.5}}) {
    std::vector<Walk> walks(num_seeds);
    ParallelFor(num_seeds, 0, [&](int64_t i) { walks[i] = MakeWalk(i + 1, speed, choices); });
    for (const SimulatedModel& model : {SimulatedModel(), worse}) {
      for (const double duration_s : {30.0, 120.0}) {
        for (size_t c = 0; c < choices.size(); ++c) PrintRow(walks, motion, c, texts[c], duration_s, model);
      }
    }
  }
}
