/* Where is a robot that drives straight ahead and takes a picture every METRES?  The map needs a visual map.
 * follow_c MAP METRES IMAGE.pgm... */
#include <stdio.h>
#include <stdlib.h>

#include "pgm.h"
#include "runtime/c_api/cairn.h"

int main(int argc, char** argv) {
  if (argc < 4) return fprintf(stderr, "usage: follow_c MAP METRES IMAGE.pgm... (8-bit grey)\n"), 2;
  const double ahead_m = atof(argv[2]); /* a robot takes what its wheels count instead */

  cairn_map* map = NULL;
  cairn_visual_tracker* tracker = NULL;
  int code = cairn_map_open(argv[1], NULL, &map);                          /* shared by all threads */
  if (code == CAIRN_OK) code = cairn_visual_tracker_create(map, &tracker); /* one per robot */
  for (int i = 3; i < argc && code == CAIRN_OK; ++i) {
    cairn_image image = CAIRN_IMAGE_INIT;
    cairn_floor_fix fix = CAIRN_FLOOR_FIX_INIT;
    uint8_t* pixels = ReadPgm(argv[i], &image.width, &image.height);
    image.pixels = pixels;
    if (i > 3) code = cairn_visual_tracker_move(tracker, ahead_m, 0, 0); /* since the last picture */
    if (code == CAIRN_OK) code = cairn_visual_tracker_track(tracker, &image, NULL, &fix);
    free(pixels);
    if (code == CAIRN_OK && fix.has_fix) {
      printf("%.3f %.3f m, %.1f deg, %s\n", fix.position_m[0], fix.position_m[1], fix.heading_deg,
             cairn_scope_name(fix.scope));
    } else if (code == CAIRN_OK) {
      printf("no fix: %s\n", fix.message);
    }
  }
  if (code != CAIRN_OK) fprintf(stderr, "%s\n", cairn_last_error());

  cairn_visual_tracker_destroy(tracker);
  cairn_map_close(map);
  return code;
}
