// two_senses MAP CAPTURE: a robot with a laser and a camera drives through the capture's images, in their
// order, and is lost at each of them in turn.  How often its first place is right, by its laser alone, by its
// camera alone and by both: at once, and after each metre of the way.  The laser is simulated in the map's
// floor plan.
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include "bench/views/scan_places.h"
#include "bench/views/simulated_laser.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/blocks/map_head.h"
#include "core/capture/capture.h"
#include "core/geometry/floor_pose.h"
#include "core/images/image_file.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/belief/image_places.h"
#include "runtime/belief/plan_tracker.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"

namespace {

using namespace cairn;

constexpr SimulatedLaser kLaser{.range_m = 8, .sigma_m = 0.01, .hidden_ratio = 0.1};
constexpr double kWheelsErr = 0.03;  // of each way and turn
constexpr int kNumMetres = 6;
constexpr std::array<const char*, 3> kSenses = {"laser", "camera", "both"};

struct Look {
  PlanarPose pose;
  ScanView scan;
  std::vector<PossiblePlace> places;  // by its image
};

struct Count {
  int right = 0, wrong = 0, sure_right = 0, sure_wrong = 0, num = 0;
  void Add(const PoseBelief& belief, const PlanarPose& pose) {
    ++num;
    if (belief.places().empty()) return;
    const PossiblePlace& first = belief.places()[0];
    const bool is_right = IsRight(first.pose, pose);
    (is_right ? right : wrong) += first.probability > 0.5 ? 1 : 0;
    (is_right ? sure_right : sure_wrong) += first.probability >= 0.99 ? 1 : 0;
  }
};

FloorMotion MotionOf(const PlanarPose& from, const PlanarPose& to, Random* random) {
  const double way = 1 + random->Normal(0, kWheelsErr), turn = 1 + random->Normal(0, kWheelsErr);
  const PlanarPose moved = MotionBetween(from, to);
  return {way * moved.position, turn * moved.heading_rad};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: two_senses MAP CAPTURE\n");
    return 2;
  }
  const auto fail = [](const Error& error) {
    std::fprintf(stderr, "%s\n", error.message.c_str());
    return 1;
  };
  const auto map = Map::Open(argv[1]);
  if (!map.ok()) return fail(map.error());
  const auto plan = (*map)->Plan();
  if (!plan.ok()) return fail(plan.error());
  const auto capture = ReadCapture(argv[2]);
  if (!capture.ok()) return fail(capture.error());
  const auto tracker = PlanTracker::Make(**plan);
  if (!tracker.ok()) return fail(tracker.error());
  const PlanRays rays((*plan)->plan.walls);
  std::vector<Look> looks(capture->images.size());
  std::vector<int> has_fix(looks.size(), 0);
  ParallelFor(static_cast<int64_t>(looks.size()), 0, [&](int64_t i) {
    const CaptureImage& image = capture->images[i];
    Look& look = looks[i];
    const FloorPose camera = FloorPoseOf(*image.cam_from_world, (*map)->head().floor_from_world);
    look.pose = {camera.position, WrapAngle(RadFromDeg(camera.heading_deg))};
    Random random(static_cast<uint64_t>(i) + 1);
    look.scan = SimulatedScan(kLaser, rays, look.pose, &random);
    const auto grey = ReadGreyImage(std::string(argv[2]) + "/images/" + image.name);
    if (!grey.ok()) return;
    Localizer localizer(*map);
    const auto found = localizer.Localize(*grey, capture->cameras.at(image.camera_id));
    if (!found.ok()) return;
    has_fix[i] = found->has_fix() ? 1 : 0;
    look.places = PlacesOf(*found, (*map)->head(), {});
  });
  int num_fixes = 0;
  for (const int fix : has_fix) num_fixes += fix;
  std::printf(
      "%zu images, %d with a fix\n\n| senses | metres driven | first place of more than 0.5: right, wrong | "
      "of 0.99 or more: right, wrong | of |\n|---|---|---|---|---|\n",
      looks.size(), num_fixes);
  for (int sense = 0; sense < 3; ++sense) {
    std::vector<std::array<Count, kNumMetres + 1>> counts(looks.size());
    ParallelFor(static_cast<int64_t>(looks.size()), 0, [&](int64_t start) {
      PlanTracker robot = *tracker;
      Random random(static_cast<uint64_t>(start) + 1);
      double way = 0;
      int metre = 0;
      for (size_t i = start; i < looks.size() && metre <= kNumMetres; ++i) {
        if (i > static_cast<size_t>(start)) {
          (void)robot.Move(MotionOf(looks[i - 1].pose, looks[i].pose, &random));
          way += (looks[i].pose.position - looks[i - 1].pose.position).norm();
        }
        if (sense != 1) (void)robot.SeeScan(looks[i].scan);
        if (sense != 0) robot.SeeImage(looks[i].places);
        for (; metre <= kNumMetres && way >= metre; ++metre)
          counts[start][metre].Add(robot.belief(), looks[i].pose);
      }
    });
    for (const int metre : {0, 1, 2, 4, 6}) {
      Count sum;
      for (const auto& of_start : counts) {
        sum.right += of_start[metre].right;
        sum.wrong += of_start[metre].wrong;
        sum.sure_right += of_start[metre].sure_right;
        sum.sure_wrong += of_start[metre].sure_wrong;
        sum.num += of_start[metre].num;
      }
      std::printf("| %s | %d | %d, %d | %d, %d | %d |\n", kSenses[sense], metre, sum.right, sum.wrong,
                  sum.sure_right, sum.sure_wrong, sum.num);
    }
  }
  return 0;
}
