/* Where is this picture?  where_c MAP IMAGE.pgm */
#include <stdio.h>
#include <stdlib.h>

#include "pgm.h"
#include "runtime/c_api/cairn.h"

int main(int argc, char** argv) {
  int width = 0, height = 0;
  uint8_t* pixels = argc == 3 ? ReadPgm(argv[2], &width, &height) : NULL;
  if (pixels == NULL) return fprintf(stderr, "usage: where_c MAP IMAGE.pgm (8-bit grey)\n"), 2;

  cairn_map* map = NULL;
  cairn_localizer* localizer = NULL;
  cairn_image image = CAIRN_IMAGE_INIT;
  cairn_fix fix = CAIRN_FIX_INIT;
  image.pixels = pixels;
  image.width = width;
  image.height = height;
  int code = cairn_map_open(argv[1], NULL, &map);                       /* shared by all threads */
  if (code == CAIRN_OK) code = cairn_localizer_create(map, &localizer); /* one per thread */
  if (code == CAIRN_OK) code = cairn_localize(localizer, &image, NULL, NULL, &fix);
  if (code != CAIRN_OK) {
    fprintf(stderr, "%s\n", cairn_last_error());
  } else if (fix.has_fix) {
    printf("%.3f %.3f %.3f m, %d inliers, region %d\n", fix.center_m[0], fix.center_m[1], fix.center_m[2],
           fix.num_inliers, fix.region);
  } else {
    printf("no fix: %s\n", fix.message);
  }

  cairn_localizer_destroy(localizer);
  cairn_map_close(map);
  free(pixels);
  return code;
}
