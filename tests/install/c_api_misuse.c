/* The C API as a C11 program uses it, and misuses it:  c_api_misuse MAP IMAGE.pgm MAP_WITH_PLAN */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "runtime/c_api/cairn.h"
#include "runtime/examples/robot/pgm.h"

static int num_failures = 0;

static void Check(int holds, const char* what, int line) {
  if (holds) return;
  ++num_failures;
  fprintf(stderr, "line %d: not so: %s (last error: %s)\n", line, what, cairn_last_error());
}
#define CHECK(condition) Check((condition) != 0, #condition, __LINE__)
/* The call fails with this code, and the sentence has these words in it. */
#define CHECK_ERROR(call, code, words)                  \
  do {                                                  \
    CHECK((call) == (code));                            \
    CHECK(strstr(cairn_last_error(), (words)) != NULL); \
  } while (0)

static void CheckMaps(const char* path) {
  cairn_map* map = (cairn_map*)&map;
  CHECK_ERROR(cairn_map_open(NULL, NULL, &map), CAIRN_INVALID_ARGUMENT, "path is NULL");
  CHECK(map == NULL);
  CHECK_ERROR(cairn_map_open(path, NULL, NULL), CAIRN_INVALID_ARGUMENT, "map is NULL");
  CHECK_ERROR(cairn_map_open("/nowhere/a.cairn", NULL, &map), CAIRN_NOT_FOUND, "/nowhere/a.cairn");
  const uint8_t key[32] = {1};
  cairn_map_options options = CAIRN_MAP_OPTIONS_INIT;
  options.public_key = key;
  CHECK_ERROR(cairn_map_open(path, &options, &map), CAIRN_NOT_SIGNED, path);
  options.key_ring = path;
  CHECK_ERROR(cairn_map_open(path, &options, &map), CAIRN_INVALID_ARGUMENT, "give one of them");
  options.public_key = NULL;
  CHECK_ERROR(cairn_map_open(path, &options, &map), CAIRN_CORRUPT, "not a public key");
  options.key_ring = NULL;
  options.memory_budget_bytes = -1;
  CHECK_ERROR(cairn_map_open(path, &options, &map), CAIRN_INVALID_ARGUMENT, "memory_budget_bytes is -1");
  options.size = 3;
  CHECK_ERROR(cairn_map_open(path, &options, &map), CAIRN_INVALID_ARGUMENT, "options->size is 3");

  CHECK(cairn_map_open(path, NULL, &map) == CAIRN_OK);
  cairn_map_description description = CAIRN_MAP_DESCRIPTION_INIT;
  CHECK(cairn_map_describe(map, &description) == CAIRN_OK);
  CHECK(strcmp(description.name, "poster") == 0 && description.num_images == 3 &&
        description.num_landmarks > 50);
  CHECK(description.is_metric == 1 && description.has_visual_map == 0);
  CHECK_ERROR(cairn_map_describe(map, NULL), CAIRN_INVALID_ARGUMENT, "description is NULL");
  cairn_camera camera = CAIRN_CAMERA_INIT;
  CHECK(cairn_map_camera_for_size(map, 320, 240, &camera) == CAIRN_OK);
  CHECK(camera.model == 0 && camera.num_params == 3 && camera.params[0] == 280);
  CHECK_ERROR(cairn_map_camera_for_size(map, 321, 240, &camera), CAIRN_NOT_FOUND, "320");
  /* Another kind of handle, a closed one, one that never was. */
  CHECK_ERROR(cairn_localizer_destroy((cairn_localizer*)map), CAIRN_INVALID_ARGUMENT, "not a localizer");
  CHECK(cairn_map_close(map) == CAIRN_OK);
  CHECK_ERROR(cairn_map_close(map), CAIRN_INVALID_ARGUMENT, "not an open map");
  CHECK_ERROR(cairn_map_describe(map, &description), CAIRN_INVALID_ARGUMENT, "not an open map");
  CHECK_ERROR(cairn_map_describe((cairn_map*)&description, &description), CAIRN_INVALID_ARGUMENT,
              "not an open map");
  CHECK(cairn_map_close(NULL) == CAIRN_OK);
  /* A map opened after another was closed is never taken for it. */
  cairn_map* next = NULL;
  CHECK(cairn_map_open(path, NULL, &next) == CAIRN_OK);
  CHECK(next != map && cairn_map_describe(map, &description) == CAIRN_INVALID_ARGUMENT);
  CHECK(cairn_map_close(next) == CAIRN_OK);
}

static void CheckBadImages(cairn_localizer* localizer, const cairn_image* good) {
  cairn_fix fix = CAIRN_FIX_INIT;
  cairn_image image = *good;
  CHECK_ERROR(cairn_localize(NULL, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "localizer is NULL");
  CHECK_ERROR(cairn_localize(localizer, NULL, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "image is NULL");
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, NULL), CAIRN_INVALID_ARGUMENT, "fix is NULL");
  image.pixels = NULL;
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "pixels is NULL");
  image = *good;
  image.stride = 319;
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "319");
  image.stride = (size_t)1 << 62; /* times the rows, the sum overflows */
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "stride");
  fix.has_fix = 1; /* a fix before is not there after an error */
  fix.num_inliers = 77;
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "stride");
  CHECK(fix.has_fix == 0 && fix.num_inliers == 0);
  image = *good;
  image.height = -240;
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "-240");
  image = *good;
  image.height = 239;
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_NOT_FOUND, "239");
  fix.size = 8;
  CHECK_ERROR(cairn_localize(localizer, good, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "fix->size is 8");
  fix.size = sizeof fix;

  cairn_camera camera = CAIRN_CAMERA_INIT;
  camera.model = 77;
  CHECK_ERROR(cairn_localize(localizer, good, &camera, NULL, &fix), CAIRN_UNSUPPORTED, "77");
  camera.model = 1; /* PINHOLE takes four */
  camera.width = 320;
  camera.height = 240;
  camera.num_params = 3;
  CHECK_ERROR(cairn_localize(localizer, good, &camera, NULL, &fix), CAIRN_INVALID_ARGUMENT,
              "takes 4 parameters");
  camera.num_params = 1000;
  CHECK_ERROR(cairn_localize(localizer, good, &camera, NULL, &fix), CAIRN_INVALID_ARGUMENT, "1000");
  cairn_prior prior = CAIRN_PRIOR_INIT;
  prior.rotation_wxyz[0] = 0;
  CHECK_ERROR(cairn_localize(localizer, good, NULL, &prior, &fix), CAIRN_INVALID_ARGUMENT, "unit quaternion");
  prior.rotation_wxyz[0] = 1;
  prior.sigma_m = NAN;
  CHECK_ERROR(cairn_localize(localizer, good, NULL, &prior, &fix), CAIRN_INVALID_ARGUMENT, "sigma_m is nan");
  cairn_floor_fix floor_fix = CAIRN_FLOOR_FIX_INIT;
  CHECK_ERROR(cairn_localize_on_floor(localizer, good, NULL, &floor_fix), CAIRN_NOT_FOUND, "visual map");
}

static void CheckFixes(cairn_localizer* localizer, const cairn_image* image) {
  cairn_fix fix = CAIRN_FIX_INIT;
  CHECK(cairn_localize(localizer, image, NULL, NULL, &fix) == CAIRN_OK);
  CHECK(fix.has_fix == 1 && fix.reason == CAIRN_FIX && fix.num_inliers > 20 && fix.message[0] == 0);
  CHECK(fabs(fix.center_m[0] - 0.4) < 0.05 && fabs(fix.center_m[1] - 0.1) < 0.05 &&
        fabs(fix.center_m[2] - 1.6) < 0.05);
  CHECK(fix.covariance[0] > 0 && fix.covariance[35] > 0 && fix.covariance[1] == fix.covariance[6]);

  /* The same pixels with gaps between the rows, and a struct of a later release: the same fix, the rest
   * untouched. */
  const size_t stride = 512;
  uint8_t* wide = malloc(stride * (size_t)image->height);
  memset(wide, 255, stride * (size_t)image->height);
  for (int y = 0; y < image->height; ++y)
    memcpy(wide + (size_t)y * stride, image->pixels + (size_t)y * (size_t)image->width, (size_t)image->width);
  cairn_image with_gaps = *image;
  with_gaps.pixels = wide;
  with_gaps.stride = stride;
  struct {
    cairn_fix fix;
    int64_t later;
  } larger = {CAIRN_FIX_INIT, 7};
  larger.fix.size = sizeof larger;
  CHECK(cairn_localize(localizer, &with_gaps, NULL, NULL, &larger.fix) == CAIRN_OK);
  CHECK(memcmp(larger.fix.rotation_wxyz, fix.rotation_wxyz, sizeof fix.rotation_wxyz) == 0);
  CHECK(memcmp(larger.fix.covariance, fix.covariance, sizeof fix.covariance) == 0);
  CHECK(larger.later == 7 && larger.fix.size == sizeof larger);

  cairn_prior prior = CAIRN_PRIOR_INIT;
  memcpy(prior.rotation_wxyz, fix.rotation_wxyz, sizeof prior.rotation_wxyz);
  memcpy(prior.translation_m, fix.translation_m, sizeof prior.translation_m);
  cairn_fix with_prior = CAIRN_FIX_INIT;
  CHECK(cairn_localize(localizer, image, NULL, &prior, &with_prior) == CAIRN_OK && with_prior.has_fix == 1);

  memset(wide, 90, stride * (size_t)image->height);
  CHECK(cairn_localize(localizer, &with_gaps, NULL, NULL, &fix) == CAIRN_OK);
  CHECK(fix.has_fix == 0 && fix.reason == CAIRN_TOO_FEW_FEATURES && strlen(fix.message) > 10);
  CHECK(strcmp(cairn_reason_name(fix.reason), "too_few_features") == 0);
  free(wide);
}

static void CheckTrackers(const char* path, const cairn_image* image) {
  cairn_map* map = NULL;
  cairn_localizer* localizer = NULL;
  cairn_tracker* tracker = (cairn_tracker*)&map;
  cairn_visual_tracker* visual = (cairn_visual_tracker*)&map;
  cairn_fix fix = CAIRN_FIX_INIT;
  cairn_floor_fix floor_fix = CAIRN_FLOOR_FIX_INIT;
  cairn_prior prior = CAIRN_PRIOR_INIT;
  int32_t is_expected = -1;
  CHECK_ERROR(cairn_tracker_create(NULL, &tracker), CAIRN_INVALID_ARGUMENT, "map is NULL");
  CHECK(tracker == NULL);
  CHECK(cairn_map_open(path, NULL, &map) == CAIRN_OK && cairn_localizer_create(map, &localizer) == CAIRN_OK);
  CHECK_ERROR(cairn_tracker_create(map, NULL), CAIRN_INVALID_ARGUMENT, "tracker is NULL");
  CHECK_ERROR(cairn_visual_tracker_create(map, NULL), CAIRN_INVALID_ARGUMENT, "tracker is NULL");
  CHECK_ERROR(cairn_visual_tracker_create(map, &visual), CAIRN_NOT_FOUND, "visual map");
  CHECK(visual == NULL);
  CHECK(cairn_tracker_create(map, &tracker) == CAIRN_OK);
  CHECK(cairn_map_close(map) == CAIRN_OK); /* the tracker keeps what it needs */

  CHECK_ERROR(cairn_tracker_track(NULL, image, NULL, &fix), CAIRN_INVALID_ARGUMENT, "tracker is NULL");
  CHECK_ERROR(cairn_tracker_track(tracker, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "image is NULL");
  CHECK_ERROR(cairn_tracker_track(tracker, image, NULL, NULL), CAIRN_INVALID_ARGUMENT, "fix is NULL");
  CHECK_ERROR(cairn_tracker_predict(tracker, NULL, &prior), CAIRN_INVALID_ARGUMENT, "is_expected is NULL");
  CHECK_ERROR(cairn_tracker_predict(tracker, &is_expected, NULL), CAIRN_INVALID_ARGUMENT, "prior is NULL");
  CHECK_ERROR(cairn_tracker_set_option(tracker, NULL, "1"), CAIRN_INVALID_ARGUMENT, "name is NULL");
  CHECK_ERROR(cairn_tracker_set_option(tracker, "step_sigma_m", NULL), CAIRN_INVALID_ARGUMENT,
              "value is NULL");
  CHECK_ERROR(cairn_visual_tracker_track(NULL, image, NULL, &floor_fix), CAIRN_INVALID_ARGUMENT,
              "visual tracker is NULL");
  CHECK_ERROR(cairn_visual_tracker_track(NULL, image, NULL, NULL), CAIRN_INVALID_ARGUMENT, "fix is NULL");
  CHECK_ERROR(cairn_visual_tracker_move(NULL, 0, 0, 0), CAIRN_INVALID_ARGUMENT, "visual tracker is NULL");
  CHECK_ERROR(cairn_visual_tracker_set_option(NULL, "tracked_ratio", "1"), CAIRN_INVALID_ARGUMENT,
              "visual tracker is NULL");
  CHECK(cairn_tracker_destroy(NULL) == CAIRN_OK && cairn_visual_tracker_destroy(NULL) == CAIRN_OK);

  /* Other kinds of handle. */
  CHECK_ERROR(cairn_tracker_track((cairn_tracker*)localizer, image, NULL, &fix), CAIRN_INVALID_ARGUMENT,
              "not a tracker");
  CHECK_ERROR(cairn_localize((cairn_localizer*)tracker, image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT,
              "not a localizer");
  CHECK_ERROR(cairn_visual_tracker_track((cairn_visual_tracker*)tracker, image, NULL, &floor_fix),
              CAIRN_INVALID_ARGUMENT, "not a visual tracker");
  CHECK(cairn_localizer_destroy(localizer) == CAIRN_OK);

  CHECK(cairn_tracker_track(tracker, image, NULL, &fix) == CAIRN_OK && fix.has_fix == 1);
  CHECK(cairn_tracker_track(tracker, image, NULL, &fix) == CAIRN_OK && fix.scope == CAIRN_SCOPE_TRACK);
  CHECK(cairn_tracker_predict(tracker, &is_expected, &prior) == CAIRN_OK && is_expected == 1);
  CHECK(cairn_tracker_destroy(tracker) == CAIRN_OK);
  CHECK_ERROR(cairn_tracker_track(tracker, image, NULL, &fix), CAIRN_INVALID_ARGUMENT, "destroyed");
  CHECK(fix.has_fix == 0);
  CHECK_ERROR(cairn_tracker_predict(tracker, &is_expected, &prior), CAIRN_INVALID_ARGUMENT, "destroyed");
  CHECK(is_expected == 0 && prior.sigma_m == 1);
  CHECK_ERROR(cairn_tracker_destroy(tracker), CAIRN_INVALID_ARGUMENT, "destroyed");
}

/* The poster's map has words, but no appearance graph. */
static void CheckPlaces(const char* path, const cairn_image* image) {
  cairn_map* map = NULL;
  cairn_place_model* model = (cairn_place_model*)&map;
  cairn_start_hypotheses* starts = (cairn_start_hypotheses*)&map;
  cairn_survey_image survey = CAIRN_SURVEY_IMAGE_INIT;
  cairn_place_scores places = CAIRN_PLACE_SCORES_INIT;
  cairn_start_hypothesis start = CAIRN_START_HYPOTHESIS_INIT;
  int32_t number = -1, way[3] = {-1, -1, -1};
  CHECK(cairn_map_open(path, NULL, &map) == CAIRN_OK);
  CHECK(cairn_map_find_image(map, "view1", &number) == CAIRN_OK && number == 1);
  CHECK_ERROR(cairn_map_find_image(map, "view3", &number), CAIRN_NOT_FOUND, "view3");
  CHECK_ERROR(cairn_map_find_image(map, "view1", NULL), CAIRN_INVALID_ARGUMENT, "image is NULL");
  CHECK(cairn_map_describe_image(map, 1, &survey) == CAIRN_OK && strcmp(survey.name, "view1") == 0);
  CHECK(fabs(survey.center_m[1]) < 1e-6 && fabs(survey.center_m[2] - 1.5) < 1e-6);
  survey.size = 3;
  CHECK_ERROR(cairn_map_describe_image(map, 1, &survey), CAIRN_INVALID_ARGUMENT, "description->size is 3");
  CHECK_ERROR(cairn_map_describe_image(map, 3, &survey), CAIRN_INVALID_ARGUMENT, "description->size");
  CHECK_ERROR(cairn_route(map, 0, 2, NULL, way, 3, &number, NULL), CAIRN_NOT_FOUND, "no appearance graph");
  CHECK(number == 0 && way[0] == -1);
  CHECK_ERROR(cairn_place_model_create(map, NULL), CAIRN_INVALID_ARGUMENT, "model is NULL");
  CHECK_ERROR(cairn_place_model_create(NULL, &model), CAIRN_INVALID_ARGUMENT, "map is NULL");
  CHECK(model == NULL);
  CHECK_ERROR(cairn_place_model_create(map, &model), CAIRN_NOT_FOUND, "no appearance graph");
  CHECK_ERROR(cairn_place_model_look((cairn_place_model*)map, image, &places), CAIRN_INVALID_ARGUMENT,
              "not a place model");
  CHECK_ERROR(cairn_place_model_look(NULL, image, &places), CAIRN_INVALID_ARGUMENT, "place model is NULL");
  CHECK_ERROR(cairn_start_hypotheses_create(NULL, &places, 0, &starts), CAIRN_INVALID_ARGUMENT,
              "place model is NULL");
  CHECK(starts == NULL);
  CHECK_ERROR(cairn_start_hypotheses_get((cairn_start_hypotheses*)map, 0, &start), CAIRN_INVALID_ARGUMENT,
              "not a set of starts");
  CHECK(cairn_place_model_destroy(NULL) == CAIRN_OK && cairn_start_hypotheses_destroy(NULL) == CAIRN_OK);
  CHECK(strcmp(cairn_verdict_name(CAIRN_VERDICT_SWITCH), "switch") == 0);
  CHECK(strcmp(cairn_verdict_name(-1), "unknown") == 0);
  CHECK(cairn_map_close(map) == CAIRN_OK);
}

/* The poster's map has no floor plan, the other has. */
static void CheckPlans(const char* path, const char* path_with_plan) {
  enum { kNumBeams = 90 };
  double ranges[kNumBeams];
  cairn_plan* plan = (cairn_plan*)&plan;
  cairn_scan_locator* locator = (cairn_scan_locator*)&plan;
  cairn_plan_tracker* tracker = (cairn_plan_tracker*)&plan;
  cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
  cairn_scan scan = CAIRN_SCAN_INIT;
  int32_t num = -1, is_complete = -1;
  double elsewhere = -1;
  CHECK_ERROR(cairn_plan_open(path, &plan), CAIRN_NOT_FOUND, path);
  CHECK(plan == NULL);
  CHECK_ERROR(cairn_plan_open(NULL, &plan), CAIRN_INVALID_ARGUMENT, "path is NULL");
  CHECK(cairn_plan_open(path_with_plan, &plan) == CAIRN_OK);
  CHECK(cairn_plan_walls(plan, NULL, 0, &num) == CAIRN_OK && num > 10);
  CHECK(cairn_scan_locator_create(plan, &locator) == CAIRN_OK);
  CHECK(cairn_plan_tracker_create(plan, &tracker) == CAIRN_OK);
  CHECK_ERROR(cairn_map_close((cairn_map*)plan), CAIRN_INVALID_ARGUMENT, "not an open map");
  CHECK_ERROR(cairn_plan_close((cairn_plan*)locator), CAIRN_INVALID_ARGUMENT, "not a plan");
  CHECK_ERROR(cairn_tracker_destroy((cairn_tracker*)tracker), CAIRN_INVALID_ARGUMENT, "not a tracker");
  CHECK(cairn_plan_close(plan) == CAIRN_OK); /* both keep what they need */
  CHECK_ERROR(cairn_plan_close(plan), CAIRN_INVALID_ARGUMENT, "not a plan");

  CHECK_ERROR(cairn_scan_locator_locate(locator, &scan, &num, NULL), CAIRN_INVALID_ARGUMENT,
              "num_beams is 0");
  scan.num_beams = kNumBeams;
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, &scan), CAIRN_INVALID_ARGUMENT, "ranges_m is NULL");
  scan.ranges_m = ranges;
  scan.step_rad = 0.01;
  for (int i = 0; i < kNumBeams; ++i) ranges[i] = -1;
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, &scan), CAIRN_NO_DATA, "at least three");
  for (int i = 0; i < kNumBeams; ++i) ranges[i] = 2.5;
  scan.step_rad = NAN;
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, &scan), CAIRN_INVALID_ARGUMENT, "angle of beam 0");
  scan.step_rad = 1;
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, &scan), CAIRN_INVALID_ARGUMENT, "degrees");
  scan.step_rad = 0.01;
  scan.size = 4;
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, &scan), CAIRN_INVALID_ARGUMENT, "scan->size is 4");
  scan.size = sizeof scan;
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, NULL), CAIRN_INVALID_ARGUMENT, "scan is NULL");
  CHECK_ERROR(cairn_plan_tracker_see_scan(NULL, &scan), CAIRN_INVALID_ARGUMENT, "plan tracker is NULL");
  CHECK_ERROR(cairn_plan_tracker_move(tracker, NAN, 0, 0), CAIRN_INVALID_ARGUMENT, "not finite");
  CHECK_ERROR(cairn_plan_tracker_set_option(tracker, "laser_ahead", "1"), CAIRN_INVALID_ARGUMENT,
              "'laser_ahead_m'");
  CHECK(cairn_plan_tracker_places(tracker, &num, &elsewhere) == CAIRN_OK && num == 0 && elsewhere == 1);
  CHECK_ERROR(cairn_plan_tracker_place(tracker, 0, &place), CAIRN_INVALID_ARGUMENT, "place 0 of 0");
  CHECK(cairn_scan_locator_locate(locator, &scan, &num, &is_complete) == CAIRN_OK);
  CHECK(num >= 0 && (is_complete == 0 || is_complete == 1));

  CHECK(cairn_scan_locator_destroy(locator) == CAIRN_OK && cairn_plan_tracker_destroy(tracker) == CAIRN_OK);
  CHECK_ERROR(cairn_scan_locator_locate(locator, &scan, &num, NULL), CAIRN_INVALID_ARGUMENT, "destroyed");
  CHECK(num == 0);
  CHECK_ERROR(cairn_plan_tracker_see_scan(tracker, &scan), CAIRN_INVALID_ARGUMENT, "destroyed");
  CHECK(cairn_scan_locator_destroy(NULL) == CAIRN_OK && cairn_plan_tracker_destroy(NULL) == CAIRN_OK &&
        cairn_plan_close(NULL) == CAIRN_OK);
}

int main(int argc, char** argv) {
  int width = 0, height = 0;
  uint8_t* pixels = argc == 4 ? ReadPgm(argv[2], &width, &height) : NULL;
  if (pixels == NULL) return fprintf(stderr, "usage: c_api_misuse MAP IMAGE.pgm MAP_WITH_PLAN\n"), 2;
  CHECK(strcmp(cairn_error_name(CAIRN_CORRUPT), "corrupt") == 0);
  CHECK(strcmp(cairn_error_name(4711), "unknown") == 0 && strcmp(cairn_reason_name(-1), "unknown") == 0);
  CHECK(strcmp(cairn_scope_name(CAIRN_SCOPE_VOTES), "votes") == 0 &&
        strcmp(cairn_scope_name(6), "unknown") == 0);
  CHECK(strlen(cairn_version()) >= 5);
  CheckMaps(argv[1]);

  cairn_map* map = NULL;
  cairn_localizer* localizer = NULL;
  CHECK_ERROR(cairn_localizer_create(NULL, &localizer), CAIRN_INVALID_ARGUMENT, "map is NULL");
  CHECK(cairn_map_open(argv[1], NULL, &map) == CAIRN_OK);
  CHECK(cairn_localizer_create(map, &localizer) == CAIRN_OK);
  CHECK(cairn_map_close(map) == CAIRN_OK); /* the localizer keeps what it needs */
  cairn_image image = CAIRN_IMAGE_INIT;
  image.pixels = pixels;
  image.width = width;
  image.height = height;
  CheckBadImages(localizer, &image);
  CheckFixes(localizer, &image);
  CheckTrackers(argv[1], &image);
  CheckPlaces(argv[1], &image);
  CheckPlans(argv[1], argv[3]);

  CHECK_ERROR(cairn_localizer_set_option(localizer, "min_num_inlier", "9"), CAIRN_INVALID_ARGUMENT,
              "'min_num_inliers'");
  CHECK_ERROR(cairn_localizer_set_option(localizer, "min_num_inliers", "many"), CAIRN_INVALID_ARGUMENT,
              "many");
  CHECK(cairn_localizer_set_option(localizer, "min_num_inliers", "100000") == CAIRN_OK);
  cairn_fix fix = CAIRN_FIX_INIT;
  CHECK(cairn_localize(localizer, &image, NULL, NULL, &fix) == CAIRN_OK && fix.has_fix == 0);
  CHECK(cairn_localizer_destroy(localizer) == CAIRN_OK);
  CHECK_ERROR(cairn_localize(localizer, &image, NULL, NULL, &fix), CAIRN_INVALID_ARGUMENT, "destroyed");
  free(pixels);
  return num_failures == 0 ? 0 : 1;
}
