// Where is a robot with a laser?  It was switched on anywhere on the floor plan of PLAN (views.db, or a map
// that has it), and drives: laser_cc PLAN SCANS (scans.h)
#include <cstdio>
#include <numbers>
#include <vector>

#include "runtime/belief/robot_on_plan.h"
#include "runtime/map/open_views.h"
#include "scans.h"
#include "value_or_exit.h"

int main(int argc, char** argv) {
  std::FILE* file = argc == 3 ? std::fopen(argv[2], "r") : nullptr;
  if (file == nullptr) return std::fprintf(stderr, "usage: laser_cc PLAN SCANS\n"), 2;

  auto robot = ValueOrExit(cairn::RobotOnPlan::Make(ValueOrExit(cairn::OpenPlan(argv[1]))));
  std::vector<double> ranges(MOST_BEAMS);
  double motion[3];
  while (const int num_beams = ReadScan(file, motion, ranges.data())) {
    cairn::RangeScan scan;
    scan.ranges_m.assign(ranges.begin(), ranges.begin() + num_beams);
    scan.first_angle_rad = -std::numbers::pi;
    scan.step_rad = 2 * std::numbers::pi / num_beams;
    scan.max_range_m = 6;                                                  // of this laser
    cairn::Status told = robot.Move({{motion[0], motion[1]}, motion[2]});  // since the last scan
    if (told.ok()) told = robot.SeeScan(scan);
    if (!told.ok()) return std::fprintf(stderr, "%s\n", told.error().message.c_str()), 1;
    int num_told = 0;
    for (const cairn::PossiblePlace& place : robot.Places()) {  // the most probable first
      if (num_told++ == 3) break;
      std::printf("%.17g %.17g m, %.17g rad: %.17g; ", place.pose.position.x(), place.pose.position.y(),
                  place.pose.heading_rad, place.probability);
    }
    std::printf("elsewhere %.17g\n", robot.elsewhere());
  }
  std::fclose(file);
}
