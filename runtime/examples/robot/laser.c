/* Where is a robot with a laser?  It was switched on anywhere on the floor plan of PLAN (views.db, or a map
 * that has it), and drives: laser_c PLAN SCANS (scans.h)
 */
#include <stdio.h>
#include <stdlib.h>

#include "runtime/c_api/cairn.h"
#include "scans.h"

#define PI 3.14159265358979323846

/* Ends the program after an error. */
static void Check(int code) {
  if (code == CAIRN_OK) return;
  fprintf(stderr, "%s\n", cairn_last_error());
  exit(code);
}

int main(int argc, char** argv) {
  FILE* file = argc == 3 ? fopen(argv[2], "r") : NULL;
  if (file == NULL) return fprintf(stderr, "usage: laser_c PLAN SCANS\n"), 2;

  static double ranges[MOST_BEAMS];
  double motion[3];
  cairn_plan* plan = NULL;
  cairn_plan_tracker* tracker = NULL;
  cairn_scan scan = CAIRN_SCAN_INIT;
  scan.ranges_m = ranges;
  scan.max_range_m = 6;                             /* of this laser */
  Check(cairn_plan_open(argv[1], &plan));           /* shared by all threads */
  Check(cairn_plan_tracker_create(plan, &tracker)); /* one per robot */
  while ((scan.num_beams = ReadScan(file, motion, ranges)) > 0) {
    scan.first_angle_rad = -PI;
    scan.step_rad = 2 * PI / scan.num_beams;
    Check(cairn_plan_tracker_move(tracker, motion[0], motion[1], motion[2])); /* since the last scan */
    Check(cairn_plan_tracker_see_scan(tracker, &scan));
    int32_t num_places = 0;
    double elsewhere = 0;
    Check(cairn_plan_tracker_places(tracker, &num_places, &elsewhere));
    for (int32_t i = 0; i < num_places && i < 3; ++i) {
      cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
      Check(cairn_plan_tracker_place(tracker, i, &place)); /* the most probable first */
      printf("%.17g %.17g m, %.17g rad: %.17g; ", place.position_m[0], place.position_m[1], place.heading_rad,
             place.probability);
    }
    printf("elsewhere %.17g\n", elsewhere);
  }
  fclose(file);
  cairn_plan_tracker_destroy(tracker);
  cairn_plan_close(plan);
  return 0;
}
