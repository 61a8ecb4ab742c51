/* Where did I start?  A robot that was switched on anywhere is on its way to where the survey image GOAL was
 * taken; these pictures it took on its way, one at each place.  start_c MAP GOAL PICTURE.pgm... */
#include <stdio.h>
#include <stdlib.h>

#include "pgm.h"
#include "runtime/c_api/cairn.h"

#define MOST_PLACES 1000

/* Ends the program after an error. */
static void Check(int code) {
  if (code == CAIRN_OK) return;
  fprintf(stderr, "%s\n", cairn_last_error());
  exit(code);
}

/* What a picture says about where it was taken. */
static void Look(cairn_place_model* model, const char* path, cairn_place_scores* places) {
  cairn_image image = CAIRN_IMAGE_INIT;
  uint8_t* pixels = ReadPgm(path, &image.width, &image.height);
  image.pixels = pixels;
  Check(cairn_place_model_look(model, &image, places));
  free(pixels);
}

static void PrintName(const cairn_map* map, const cairn_place_model* model, int32_t place) {
  cairn_survey_image image = CAIRN_SURVEY_IMAGE_INIT;
  int32_t number = 0;
  Check(cairn_place_model_image_of_place(model, place, &number));
  Check(cairn_map_describe_image(map, number, &image));
  printf(" %s", image.name);
}

int main(int argc, char** argv) {
  if (argc < 4) return fprintf(stderr, "usage: start_c MAP GOAL PICTURE.pgm... (8-bit grey)\n"), 2;

  cairn_map* map = NULL;
  cairn_place_model* model = NULL;
  cairn_start_hypotheses* starts = NULL;
  cairn_place_scores places = CAIRN_PLACE_SCORES_INIT;
  int32_t goal = 0, num_starts = 0, followed = 0;
  Check(cairn_map_open(argv[1], NULL, &map));
  Check(cairn_place_model_create(map, &model));
  Check(cairn_place_model_num_places(model, &places.num_places));
  places.scores = (double*)malloc((size_t)places.num_places * sizeof(double));
  places.probabilities = (double*)malloc((size_t)places.num_places * sizeof(double));
  Check(cairn_map_find_image(map, argv[2], &goal));
  Check(cairn_place_model_place_of_image(model, goal, &goal));
  Look(model, argv[3], &places);
  Check(cairn_start_hypotheses_create(model, &places, goal, &starts));
  Check(cairn_start_hypotheses_count(starts, &num_starts));
  for (int i = 3; i < argc; ++i) {
    int32_t verdict =
        CAIRN_VERDICT_FOLLOW; /* go on; _SWITCH: back, restart, the other way; _LOST: begin anew */
    if (i > 3) {
      Look(model, argv[i], &places);
      Check(cairn_start_hypotheses_observe(starts, &places, &verdict));
    }
    printf("%s", cairn_verdict_name(verdict));
    for (int32_t k = 0; k < num_starts; ++k) {
      cairn_start_hypothesis start = CAIRN_START_HYPOTHESIS_INIT;
      Check(cairn_start_hypotheses_get(starts, k, &start));
      if (start.is_followed) followed = k;
      PrintName(map, model, start.start);
      printf(" %.17g", start.posterior);
    }
    printf("\n");
    if (verdict == CAIRN_VERDICT_LOST) return 0;
  }
  int32_t way[MOST_PLACES], num_places = 0;
  Check(cairn_start_hypotheses_way(starts, followed, 0, way, MOST_PLACES, &num_places));
  printf("way");
  for (int32_t k = 0; k < num_places && k < MOST_PLACES; ++k) PrintName(map, model, way[k]);
  printf("\n");

  free(places.scores);
  free(places.probabilities);
  cairn_start_hypotheses_destroy(starts);
  cairn_place_model_destroy(model);
  cairn_map_close(map);
  return 0;
}
