/* Where is this camera?  The C API of cairn's runtime: open a map, make a localizer, or a tracker for frames
 * in order, and hand it grey pixels.  Where did it start?  Several starts, kept in mind on the way to a goal.
 * How does it get from survey image to survey image?  A servo.  In which of many maps is it?  An atlas.
 * Where is a robot with a laser on a floor plan?  A scan locator, or a plan tracker.
 *
 * Every function that can fail returns 0 (CAIRN_OK) or an error code, and leaves a sentence for its thread in
 * cairn_last_error().  Nothing is printed, no exception leaves the library, and no misuse that it can see
 * crashes it: null pointers, handles that were closed or never opened, sizes that do not fit, a localizer or
 * tracker used by two threads at once.
 *
 * ABI: a program built with this header runs with every later libcairn-runtime.so.0.  Functions are only
 * added.  Structs begin with their size and only grow at their end: set `size` to sizeof the struct before
 * every call (CAIRN_FIX_INIT and the like do), and the library touches no more than that.
 *
 * Threads: a map, an atlas, a plan and a log are shared by all; whatever else is created is for one thread at
 * a time.  Frames and units: metres, radians unless a name says otherwise; the camera looks along +z, x
 * right, y down; poses are cam_from_world (point_in_camera = rotation * point_in_world + translation) in the
 * frame of the surveyed capture.
 */
#ifndef CAIRN_RUNTIME_CAIRN_H_
#define CAIRN_RUNTIME_CAIRN_H_

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define CAIRN_API __attribute__((visibility("default")))
#else
#define CAIRN_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Error codes: the program's exit codes (core/base/error.h).  Append-only. */
enum {
  CAIRN_OK = 0,
  CAIRN_FAILED = 1,           /* anything that has no code of its own */
  CAIRN_INVALID_ARGUMENT = 2, /* a call with an invalid argument: null, a closed handle, a wrong size */
  CAIRN_NOT_FOUND = 3,        /* a file, a camera or a part of a map that does not exist */
  CAIRN_CORRUPT = 4,          /* a map that is damaged */
  CAIRN_UNSUPPORTED = 5,      /* a camera model or a version that this library does not know */
  CAIRN_NO_DATA = 6,
  CAIRN_IO = 7,
  CAIRN_GATE = 8,
  CAIRN_BUSY = 9, /* another thread is using this localizer or tracker */
  CAIRN_CANCELLED = 10,
  CAIRN_EMPTY_FILE = 11,
  CAIRN_TRUNCATED = 12,
  CAIRN_NOT_SQLITE = 13,
  CAIRN_FOREIGN_FILE = 14,
  CAIRN_TOO_NEW = 15,
  CAIRN_TOO_OLD = 16,
  CAIRN_NOT_SIGNED = 17,
  CAIRN_WRONG_KEY = 18,
  CAIRN_READ_ONLY = 19,
  CAIRN_DISK_FULL = 20,
  CAIRN_LOST = 21,
  CAIRN_NOT_NEWER = 22, /* a signed map of an epoch not later than this robot's, or below the requested one */
  CAIRN_OTHER_MAP = 23, /* a signed map of another name: the map of another site */
  CAIRN_NO_MEMORY = 24  /* none is left for what was asked */
};

/* Why an image has no fix: a result, not an error.  Append-only. */
enum {
  CAIRN_FIX = 0,              /* there is one */
  CAIRN_TOO_FEW_FEATURES = 1, /* blank, dark or blurred */
  CAIRN_NO_CANDIDATES = 2,    /* nothing in the map looks like it */
  CAIRN_TOO_FEW_MATCHES = 3,
  CAIRN_NO_POSE = 4,
  CAIRN_TOO_FEW_INLIERS = 5,
  CAIRN_POOR_SPREAD = 6,
  CAIRN_UNCERTAIN = 7,
  CAIRN_FAR_FROM_SURVEY = 8,
  CAIRN_AMBIGUOUS = 9,   /* another place explains the image nearly as well */
  CAIRN_IMPROBABLE = 10, /* most of what an image from there would show is missing */
  CAIRN_TILTED = 11,     /* up is not where it was sensed */
  CAIRN_OVER_BUDGET = 12 /* what budget_ms allows was done before a fix was sure */
};

/* Which landmarks an image was matched with.  Append-only. */
enum {
  CAIRN_SCOPE_PRIOR = 0,   /* of survey images near the prior */
  CAIRN_SCOPE_REGIONS = 1, /* of the regions of survey images that look alike */
  CAIRN_SCOPE_IMAGES = 2,  /* of these images themselves */
  CAIRN_SCOPE_ALL = 3,     /* of the whole map */
  CAIRN_SCOPE_TRACK = 4,   /* a tracker's: of where it expects the camera */
  CAIRN_SCOPE_VOTES = 5    /* a tracker's, lost: of the regions that landmarks in view vote for */
};

/* What a robot that does not know its start should do after an image.  Append-only. */
enum {
  CAIRN_VERDICT_FOLLOW = 0, /* go on */
  CAIRN_VERDICT_SWITCH = 1, /* another start is followed from now on */
  CAIRN_VERDICT_LOST = 2    /* no possible start explains the image: localize again */
};

/* What a servo does.  Append-only. */
enum {
  CAIRN_SERVO_TURNING = 0, /* on the spot */
  CAIRN_SERVO_APPROACHING = 1,
  CAIRN_SERVO_ARRIVED = 2,
  CAIRN_SERVO_LOST = 3 /* the target is not in sight: the robot stands */
};

/* Handles.  They are numbers, not addresses: a closed one is never mistaken for another. */
typedef struct cairn_map cairn_map;
typedef struct cairn_localizer cairn_localizer;
typedef struct cairn_tracker cairn_tracker;
typedef struct cairn_visual_tracker cairn_visual_tracker;
typedef struct cairn_log cairn_log;
typedef struct cairn_place_model cairn_place_model;
typedef struct cairn_start_hypotheses cairn_start_hypotheses;
typedef struct cairn_place_belief cairn_place_belief;
typedef struct cairn_servo cairn_servo;
typedef struct cairn_atlas cairn_atlas;
typedef struct cairn_atlas_localizer cairn_atlas_localizer;
typedef struct cairn_plan cairn_plan;
typedef struct cairn_scan_locator cairn_scan_locator;
typedef struct cairn_plan_tracker cairn_plan_tracker;

#define CAIRN_MESSAGE_BYTES 256
#define CAIRN_MAX_CAMERA_PARAMS 12

typedef struct cairn_map_options {
  size_t size;
  int64_t memory_budget_bytes; /* limit for loaded parts of the map that are kept; 0: the default, 256 MiB */
  const uint8_t* public_key;   /* 32 bytes: maps that this key has not signed are refused; NULL: any map */
  /* Only to be trusted with a key: without one, anybody can write a map that says so. */
  const char* name;    /* maps of another name are refused (CAIRN_OTHER_MAP); NULL or "": any name */
  uint64_t min_epoch;  /* maps of an earlier epoch are refused (CAIRN_NOT_NEWER); 0: any */
  int32_t allow_older; /* 1: cairn_map_update takes an earlier or the same epoch, too; never another map */
  int32_t reserved;    /* 0 */
  /* In place of public_key: file of a ring of keys (`cairn keys make`) or of a public key.  Maps that fewer
   * keys of the ring have signed than it wants are refused (CAIRN_NOT_SIGNED, CAIRN_WRONG_KEY). */
  const char* key_ring;
  /* cairn_map_update: file with more signatures of the new map; NULL or "": DELTA.signatures, if there. */
  const char* signatures;
} cairn_map_options;
#define CAIRN_MAP_OPTIONS_INIT \
  { sizeof(cairn_map_options), 0, NULL, NULL, 0, 0, 0, NULL, NULL }

/* What a map says about itself. */
typedef struct cairn_map_description {
  size_t size;
  int64_t num_landmarks;
  int64_t num_images; /* of the survey */
  int64_t num_regions;
  int32_t has_visual_map; /* 1: cairn_localize_on_floor works */
  int32_t is_metric;      /* 0: nothing gave the survey its scale, and "metres" have an arbitrary length */
  char name[128];         /* as the recipe calls it, cut to fit, always with a NUL */
  uint64_t epoch;         /* counts the signed releases of a map of this name; 0: never counted */
  /* How well the map's metres are known: standard deviation of its scale, as a part of it (0: poses were
   * stated), and the place of the world frame that stays where it is when the scale errs.  The covariance of
   * a fix at C contains that of scale_sigma_ratio (C - scale_centre_m), the same multiple of it in every fix.
   */
  double scale_sigma_ratio;
  double scale_centre_m[3];
} cairn_map_description;
#define CAIRN_MAP_DESCRIPTION_INIT                                 \
  {                                                                \
    sizeof(cairn_map_description), 0, 0, 0, 0, 0, {0}, 0, 0, { 0 } \
  }

/* Intrinsics: COLMAP's models by their numbers, with its parameters in its order (0 SIMPLE_PINHOLE: f, cx,
 * cy; 1 PINHOLE: fx, fy, cx, cy; 2 SIMPLE_RADIAL: f, cx, cy, k; 4 OPENCV: fx, fy, cx, cy, k1, k2, p1, p2;
 * ...), px.  The centre of the first pixel is at (0.5, 0.5). */
typedef struct cairn_camera {
  size_t size;
  int32_t model;
  int32_t width, height; /* px */
  int32_t num_params;
  double params[CAIRN_MAX_CAMERA_PARAMS];
} cairn_camera;
#define CAIRN_CAMERA_INIT                   \
  {                                         \
    sizeof(cairn_camera), 0, 0, 0, 0, { 0 } \
  }

/* 8-bit grey pixels: `height` rows of `width` bytes, `stride` bytes from the start of one row to the next.
 * Only read, and only during the call. */
typedef struct cairn_image {
  size_t size;
  const uint8_t* pixels;
  int32_t width, height; /* px */
  size_t stride;         /* bytes, >= width; 0: rows without gaps */
} cairn_image;
#define CAIRN_IMAGE_INIT \
  { sizeof(cairn_image), NULL, 0, 0, 0 }

/* Where the camera is believed to be. */
typedef struct cairn_prior {
  size_t size;
  double rotation_wxyz[4]; /* cam_from_world, a unit quaternion */
  double translation_m[3];
  double sigma_m;   /* of the camera's place, per axis, > 0 */
  double sigma_deg; /* of its rotation, > 0 */
} cairn_prior;
#define CAIRN_PRIOR_INIT \
  { sizeof(cairn_prior), {1, 0, 0, 0}, {0, 0, 0}, 1, 10 }

/* What a camera of a rig sees, at the same time as the others. */
typedef struct cairn_rig_image {
  size_t size;
  const cairn_image* image;
  const cairn_camera* camera; /* NULL: the survey's camera of the image's size */
  double rotation_wxyz[4];    /* cam_from_rig, a unit quaternion */
  double translation_m[3];
} cairn_rig_image;
#define CAIRN_RIG_IMAGE_INIT                                       \
  {                                                                \
    sizeof(cairn_rig_image), NULL, NULL, {1, 0, 0, 0}, { 0, 0, 0 } \
  }

/* A pose and how well it is known: a camera's cam_from_world, or how it moved from a frame to the next. */
typedef struct cairn_uncertain_pose {
  size_t size;
  double rotation_wxyz[4]; /* a unit quaternion */
  double translation_m[3];
  /* 6 x 6: rotation (rad), translation (m), of the left perturbation. */
  double covariance[36];
} cairn_uncertain_pose;
#define CAIRN_UNCERTAIN_POSE_INIT                                \
  {                                                              \
    sizeof(cairn_uncertain_pose), {1, 0, 0, 0}, {0, 0, 0}, { 0 } \
  }

/* A fix, or the reason for none. */
typedef struct cairn_fix {
  size_t size;
  int32_t has_fix; /* 1 or 0 */
  int32_t reason;  /* CAIRN_FIX, or why there is none */
  /* With a fix, else zero. */
  double rotation_wxyz[4]; /* cam_from_world */
  double translation_m[3];
  double center_m[3]; /* where the camera stands, world frame */
  /* 6 x 6: rotation (rad), translation (m), of the left perturbation of cam_from_world. */
  double covariance[36];
  int32_t region; /* the one with most inliers; -1: none */
  int32_t num_features, num_matches, num_inliers;
  char
      message[CAIRN_MESSAGE_BYTES]; /* why there is no fix: found and needed; cut to fit, always with a NUL */
  int32_t scope;                    /* CAIRN_SCOPE_ALL, ...: which landmarks it was matched with */
  int32_t reserved;                 /* 0 */
  /* P(the fix is right), by how much of what an image from there should show is found, and by what other
   * places explain.  Without a fix 0, but for CAIRN_IMPROBABLE, and for CAIRN_AMBIGUOUS: that one of several
   * poses is right. */
  double probability;
  /* What the answer took: milliseconds of the core on which work was measured, counted and not timed; no more
   * than the options budget_ms times core_speed. */
  double work_ms;
} cairn_fix;
#define CAIRN_FIX_INIT \
  { sizeof(cairn_fix), 0, 0, {0}, {0}, {0}, {0}, 0, 0, 0, 0, {0}, 0, 0, 0, 0 }

/* A place on the floor, from how landmarks look from different places (maps with a visual map). */
typedef struct cairn_floor_fix {
  size_t size;
  int32_t has_fix;
  int32_t num_matches, num_agreeing;
  int32_t scope;        /* CAIRN_SCOPE_ALL; a tracker's: _TRACK or _VOTES too */
  double position_m[2]; /* floor frame */
  double heading_deg;   /* counter-clockwise from +x, [0, 360) */
  /* 3 x 3: x m, y m, heading rad; without a fix that of the whole survey (a tracker: x, y of its belief). */
  double covariance[9];
  char message[CAIRN_MESSAGE_BYTES];
  /* With a fix or without: where the camera is on average over all that is possible, floor frame, and how
   * much that leaves open.  Of this image, or of a tracker's belief after it. */
  double mean_m[2];
  double entropy; /* nats, over places */
} cairn_floor_fix;
#define CAIRN_FLOOR_FIX_INIT \
  { sizeof(cairn_floor_fix), 0, 0, 0, 0, {0}, 0, {0}, {0}, {0}, 0 }

/* How much a log keeps. */
typedef struct cairn_log_options {
  size_t size;
  double max_mb_per_day; /* its largest growth in any 24 hours, 10^6 bytes, > 0 */
} cairn_log_options;
#define CAIRN_LOG_OPTIONS_INIT \
  { sizeof(cairn_log_options), 50 }

/* An image of the survey. */
typedef struct cairn_survey_image {
  size_t size;
  char name[256];          /* cut to fit, always with a NUL */
  double rotation_wxyz[4]; /* cam_from_world, as a fix of its pixels states it */
  double translation_m[3];
  double center_m[3]; /* where the camera stood, world frame */
} cairn_survey_image;
#define CAIRN_SURVEY_IMAGE_INIT                               \
  {                                                           \
    sizeof(cairn_survey_image), {0}, {1, 0, 0, 0}, {0}, { 0 } \
  }

/* What an image says about where it was taken: for each place of the map (cairn_place_model_num_places), in
 * arrays of the caller's.  A function that fills it in leaves out an array that is NULL. */
typedef struct cairn_place_scores {
  size_t size;
  int32_t num_places; /* how many there is room for, or are given; another number than the map's is refused */
  int32_t reserved;   /* 0 */
  double* scores;     /* in [0, 1]; all 0: the image shares nothing with the map */
  double* probabilities; /* sum to 1; all equal where all scores are 0 */
} cairn_place_scores;
#define CAIRN_PLACE_SCORES_INIT \
  { sizeof(cairn_place_scores), 0, 0, NULL, NULL }

/* Where the robot may have started. */
typedef struct cairn_start_hypothesis {
  size_t size;
  int32_t start;          /* a place */
  int32_t whereabouts;    /* the place where the robot most likely is by now if it started there */
  int32_t num_way_places; /* on the way from the start to the goal, both among them */
  int32_t is_followed;    /* 1: its way is the one to follow */
  double score;           /* of the first image */
  double posterior;       /* p(start | all images); those of all starts sum to 1 */
  double way_cost;        /* of the way's links */
} cairn_start_hypothesis;
#define CAIRN_START_HYPOTHESIS_INIT \
  { sizeof(cairn_start_hypothesis), 0, 0, 0, 0, 0, 0, 0 }

/* How a robot is to drive until the next image. */
typedef struct cairn_servo_command {
  size_t size;
  double speed_m_s;    /* ahead; negative: backwards */
  double turn_rad_s;   /* to the left */
  double step_s;       /* for so long (option step_s): a robot without another command by then stops */
  int32_t state;       /* CAIRN_SERVO_APPROACHING, ... */
  int32_t num_matches; /* with what the target shows */
  int32_t num_inliers; /* of these, that agree on one motion */
  int32_t reserved;    /* 0 */
  char why[CAIRN_MESSAGE_BYTES]; /* a sentence; cut to fit, always with a NUL */
} cairn_servo_command;
#define CAIRN_SERVO_COMMAND_INIT                                           \
  {                                                                        \
    sizeof(cairn_servo_command), 0, 0, 0, CAIRN_SERVO_LOST, 0, 0, 0, { 0 } \
  }

/* One turn of a laser scanner that stands level.  Only read, and only during the call.  Beams are at
 * first_angle_rad + i * step_rad, or where angles_rad says, counter-clockwise from the laser's x.  A range
 * that is not more than 0, or NaN, is left out; one of max_range_m or more, or infinite, met nothing. */
typedef struct cairn_scan {
  size_t size;
  int32_t num_beams;        /* 1 to 100,000 */
  int32_t reserved;         /* 0 */
  const double* ranges_m;   /* num_beams */
  const double* angles_rad; /* num_beams; NULL: in equal steps */
  double first_angle_rad, step_rad;
  double max_range_m; /* the laser's own; 0: not known.  The option of this name bounds it, too */
} cairn_scan;
#define CAIRN_SCAN_INIT \
  { sizeof(cairn_scan), 0, 0, NULL, NULL, 0, 0, 0 }

/* Where a robot or its laser may be on a plan. */
typedef struct cairn_plan_place {
  size_t size;
  double position_m[2]; /* floor frame */
  double heading_rad;   /* counter-clockwise from +x, [-pi, pi] */
  double covariance[9]; /* 3 x 3: x m, y m, heading rad */
  double probability;
  /* 1: no standard deviation is more than 0.25 m, or 10 degrees; 0: along some direction the place is not
   * known, as in a corridor. */
  int32_t determined;
  int32_t reserved; /* 0 */
  /* A scan locator's: of the beams that met something, those that ended at walls of the plan.  Else 0. */
  double explained_ratio;
} cairn_plan_place;
#define CAIRN_PLAN_PLACE_INIT \
  { sizeof(cairn_plan_place), {0, 0}, 0, {0}, 0, 0, 0, 0 }

/* "0.1.0". */
CAIRN_API const char* cairn_version(void);
/* "corrupt" for CAIRN_CORRUPT, "too_few_matches" for CAIRN_TOO_FEW_MATCHES, "track" for CAIRN_SCOPE_TRACK;
 * "unknown" for any other number. */
CAIRN_API const char* cairn_error_name(int32_t code);
CAIRN_API const char* cairn_reason_name(int32_t reason);
CAIRN_API const char* cairn_scope_name(int32_t scope);
/* "follow", "switch", "lost". */
CAIRN_API const char* cairn_verdict_name(int32_t verdict);
/* "turning", "approaching", "arrived", "lost". */
CAIRN_API const char* cairn_servo_state_name(int32_t state);
/* The message of this thread's last failed call: says what was found and what to do.  Never NULL; valid until
 * this thread's next call of the library. */
CAIRN_API const char* cairn_last_error(void);

/* Opens a map file, which must not change while it is open.  `options` may be NULL.  On an error *map is
 * NULL. */
CAIRN_API int32_t cairn_map_open(const char* path, const cairn_map_options* options, cairn_map** map);
CAIRN_API int32_t cairn_map_describe(const cairn_map* map, cairn_map_description* description);
/* The survey's camera of this image size.  CAIRN_NOT_FOUND when none or more than one has it. */
CAIRN_API int32_t cairn_map_camera_for_size(const cairn_map* map, int32_t width, int32_t height,
                                            cairn_camera* camera);
/* Localizers and trackers of the map stay usable.  NULL is allowed; a handle that is already closed gives
 * CAIRN_INVALID_ARGUMENT. */
CAIRN_API int32_t cairn_map_close(cairn_map* map);

CAIRN_API int32_t cairn_localizer_create(const cairn_map* map, cairn_localizer** localizer);
/* Any option that `cairn localize --help` lists under "Stage options", as text: ("min_num_inliers", "9"). */
CAIRN_API int32_t cairn_localizer_set_option(cairn_localizer* localizer, const char* name, const char* value);
CAIRN_API int32_t cairn_localizer_destroy(cairn_localizer* localizer);

/* `camera` NULL: the survey's camera of the image's size; `prior` may be NULL.  An image without a fix is no
 * error: see fix->has_fix.  After an error *fix has no fix. */
CAIRN_API int32_t cairn_localize(cairn_localizer* localizer, const cairn_image* image,
                                 const cairn_camera* camera, const cairn_prior* prior, cairn_fix* fix);
/* From features that the caller found, as those of the map's survey (cairn_map_descriptors).  `keypoints`: x,
 * y, scale and orientation of each, 4 * num_features numbers; the first pixel's centre is (0.5, 0.5); a scale
 * of 0: not measured. `descriptors`: num_features rows of `num_columns`, floats (is_float 1) of a float or
 * dense kind, of any length; bytes (is_float 0) of SIFT, 128, or of a binary kind, whose bits they are.
 * CAIRN_INVALID_ARGUMENT: others.  They are not logged. */
CAIRN_API int32_t cairn_localize_features(cairn_localizer* localizer, const float* keypoints,
                                          const void* descriptors, int32_t is_float, int32_t num_columns,
                                          int32_t num_features, const cairn_camera* camera,
                                          const cairn_prior* prior, cairn_fix* fix);
/* What the landmarks' descriptors are, with a NUL, cut to `capacity` bytes: "sift", "binary 256 orb". */
CAIRN_API int32_t cairn_map_descriptors(const cairn_map* map, char* text, int32_t capacity);
/* Which way is up at the next image, or the next of a rig: a direction in the camera's frame (a rig's), of
 * any length, and its standard deviation per axis.  An accelerometer says so while the robot does not speed
 * up or brake, an IMU always.  No pose tilts the camera then
 * (CAIRN_TILTED), and where up is known well, two landmarks make one, not three; the map's floor says what is
 * up in the world. */
CAIRN_API int32_t cairn_localizer_sense_up(cairn_localizer* localizer, double right, double down,
                                           double ahead, double sigma_deg);
/* One fix of what the cameras of a rig see at the same time: fix and prior are poses of the rig
 * (rig_from_world).  Nothing of it is logged. */
CAIRN_API int32_t cairn_localize_rig(cairn_localizer* localizer, const cairn_rig_image* const* images,
                                     int32_t num_images, const cairn_prior* prior, cairn_fix* fix);
/* The same by the visual map, on the floor.  CAIRN_NOT_FOUND where the map has none; the first call loads it.
 */
CAIRN_API int32_t cairn_localize_on_floor(cairn_localizer* localizer, const cairn_image* image,
                                          const cairn_camera* camera, cairn_floor_fix* fix);

/* Frame after frame: a tracker looks only for the landmarks near where it expects the camera, and finds it
 * again, as if the frame were the first, when it is not there: fix->scope says which.  One for each camera;
 * the same frames, the same fixes.
 *
 * There are two, as there are two ways to localize an image, and not one with a choice: only the one in space
 * predicts a pose, and their answers are different structs.
 *
 * cairn_tracker follows a camera in space, by its odometry or a constant velocity. */
CAIRN_API int32_t cairn_tracker_create(const cairn_map* map, cairn_tracker** tracker);
/* Any option that `cairn localize --sequence` takes, as text: ("step_sigma_m", "0.3"), ("min_num_inliers",
 * "9").  The tracker forgets the frames before. */
CAIRN_API int32_t cairn_tracker_set_option(cairn_tracker* tracker, const char* name, const char* value);
/* The next frame.  `camera` NULL: the survey's camera of the image's size.  A frame without a fix is no
 * error; after an error *fix has no fix, and the tracker is as before. */
CAIRN_API int32_t cairn_tracker_track(cairn_tracker* tracker, const cairn_image* image,
                                      const cairn_camera* camera, cairn_fix* fix);
/* How the camera moved since the last frame, several calls add up: over the floor, in the frame that it had
 * on it (CAIRN_UNSUPPORTED: a map whose unit is not the metre); or in space, from its frame then to that now,
 * as visual or inertial odometry has it.  Without either it follows a constant velocity. */
CAIRN_API int32_t cairn_tracker_move(cairn_tracker* tracker, double ahead_m, double left_m,
                                     double turn_left_rad);
CAIRN_API int32_t cairn_tracker_move_camera(cairn_tracker* tracker,
                                            const cairn_uncertain_pose* next_from_last);
/* Which way is up at the next frame, as cairn_localizer_sense_up has it. */
CAIRN_API int32_t cairn_tracker_sense_up(cairn_tracker* tracker, double right, double down, double ahead,
                                         double sigma_deg);
/* Seconds from the last frame to the next [1], for a tracker with the option ("min_place_probability",
 * "0.9"): it publishes a fix only where its place has this probability by all frames so far, as
 * cairn_place_belief has it.  CAIRN_INVALID_ARGUMENT: the option is 0, the default. */
CAIRN_API int32_t cairn_tracker_elapse(cairn_tracker* tracker, double seconds);
/* Where the next frame is expected.  *is_expected 0: the tracker is lost, and *prior is CAIRN_PRIOR_INIT. */
CAIRN_API int32_t cairn_tracker_predict(cairn_tracker* tracker, int32_t* is_expected, cairn_prior* prior);
/* Where the camera was at the last frame: its fix, or where it moved since the last one; and after a move,
 * where it is now.  *is_known 0: it had none yet, and *pose is CAIRN_UNCERTAIN_POSE_INIT. */
CAIRN_API int32_t cairn_tracker_believe(cairn_tracker* tracker, int32_t* is_known,
                                        cairn_uncertain_pose* pose);
CAIRN_API int32_t cairn_tracker_destroy(cairn_tracker* tracker);

/* cairn_visual_tracker follows a robot on the floor, by the visual map.  CAIRN_NOT_FOUND where the map has
 * none. */
CAIRN_API int32_t cairn_visual_tracker_create(const cairn_map* map, cairn_visual_tracker** tracker);
/* Any option that `cairn localize --sequence --estimator visual-map` reads: ("unknown_way_sigma_m", "0.5"),
 * ("max_image_side_px", "512").  The tracker forgets the frames before; after an error it is as before. */
CAIRN_API int32_t cairn_visual_tracker_set_option(cairn_visual_tracker* tracker, const char* name,
                                                  const char* value);
/* Odometry: since the last frame the robot drove this far ahead and to the left, in its frame at the start,
 * and then turned to the left.  Several calls before a frame add up.  Without any, it may have gone anywhere
 * within unknown_way_sigma_m. */
CAIRN_API int32_t cairn_visual_tracker_move(cairn_visual_tracker* tracker, double ahead_m, double left_m,
                                            double turn_left_rad);
/* The next frame; as cairn_tracker_track.  Without a fix the belief is what there is: mean_m, covariance. */
CAIRN_API int32_t cairn_visual_tracker_track(cairn_visual_tracker* tracker, const cairn_image* image,
                                             const cairn_camera* camera, cairn_floor_fix* fix);
CAIRN_API int32_t cairn_visual_tracker_destroy(cairn_visual_tracker* tracker);

/* What a robot brings home for a later compile (docs/robots.md): the folder that `cairn localize --log`
 * writes, with features and fix of frames that differ in place.  It is made, or gone on with; after every
 * frame it is whole.  A log may be that of several localizers and trackers, in any threads.
 *
 * `options` may be NULL.  CAIRN_BUSY: another log writes there, in this process or another;
 * CAIRN_INVALID_ARGUMENT: the folder has something else in it, or the log of a map of another name or frame.
 */
CAIRN_API int32_t cairn_log_open(const cairn_map* map, const char* folder, const cairn_log_options* options,
                                 cairn_log** log);
/* From now on each frame with a fix is offered to the log, which must be of the same map; NULL: to none.
 * Their options may be set before and after. */
CAIRN_API int32_t cairn_localizer_set_log(cairn_localizer* localizer, const cairn_log* log);
CAIRN_API int32_t cairn_tracker_set_log(cairn_tracker* tracker, const cairn_log* log);
/* How many frames were kept since it was opened.  A log that can no longer be written (CAIRN_DISK_FULL, ...)
 * keeps nothing more, and fixes are as ever: this call returns the error, and *num_kept too. */
CAIRN_API int32_t cairn_log_num_kept(const cairn_log* log, int64_t* num_kept);
/* Its localizers and trackers go on without it.  NULL is allowed. */
CAIRN_API int32_t cairn_log_close(cairn_log* log);

/* Images of the survey are numbered from 0 (cairn_map_description.num_images); cairn_map_find_image finds the
 * number of a name, O(images).  CAIRN_NOT_FOUND: the survey has no such image. */
CAIRN_API int32_t cairn_map_find_image(const cairn_map* map, const char* name, int32_t* image);
CAIRN_API int32_t cairn_map_describe_image(const cairn_map* map, int32_t image,
                                           cairn_survey_image* description);

/* A way from survey image to survey image along which each shows what the next one shows, for a robot that
 * steers by its camera.  `weight`: what the way minimises: "links" (NULL: the same), "matches" (the sum of
 * 1 / matches of the links), "entropy" (it leads through places that are like no other) or "risk" (the metres
 * expected, with what getting lost on the way costs).  Writes the numbers of at most `capacity` images, the
 * first of them `from`, the last `to`; *num_images says how many there are, also where that is more. `images`
 * may be NULL with a capacity of 0, `cost` (the sum of the links' weights) may be NULL.  CAIRN_NOT_FOUND: no
 * way, an image that is not in the map's appearance graph, or a map that has none. */
CAIRN_API int32_t cairn_route(const cairn_map* map, int32_t from, int32_t to, const char* weight,
                              int32_t* images, int32_t capacity, int32_t* num_images, double* cost);

/* Which places an image may show, by the map's visual words (docs/active.md).  Places are the nodes of the
 * map's appearance graph, numbered from 0.  CAIRN_NOT_FOUND: the map has no words, or no appearance graph. */
CAIRN_API int32_t cairn_place_model_create(const cairn_map* map, cairn_place_model** model);
/* How places are scored ("score_exponent"), what is looked for in images ("max_image_side_px",
 * "max_num_features", ...) and how a closer look verifies ("num_candidates", "max_ratio", ...).  After an
 * error the model is as before. */
CAIRN_API int32_t cairn_place_model_set_option(cairn_place_model* model, const char* name, const char* value);
CAIRN_API int32_t cairn_place_model_num_places(const cairn_place_model* model, int32_t* num_places);
/* The place of a survey image (*place -1: of none), and the first survey image of a place. */
CAIRN_API int32_t cairn_place_model_place_of_image(const cairn_place_model* model, int32_t image,
                                                   int32_t* place);
CAIRN_API int32_t cairn_place_model_image_of_place(const cairn_place_model* model, int32_t place,
                                                   int32_t* image);
/* What an image says, by its words. */
CAIRN_API int32_t cairn_place_model_look(cairn_place_model* model, const cairn_image* image,
                                         cairn_place_scores* places);
/* The same of features that the caller has: `num_features` rows of 128 bytes, RootSIFT as the survey's. */
CAIRN_API int32_t cairn_place_model_look_at_features(cairn_place_model* model, const uint8_t* descriptors,
                                                     int32_t num_features, cairn_place_scores* places);
/* A closer look, for a robot that stands still because it is lost: the best places are verified by geometry,
 * in some tenths of a second.  `camera` NULL: the survey's camera of the image's size. */
CAIRN_API int32_t cairn_place_model_look_closer(cairn_place_model* model, const cairn_image* image,
                                                const cairn_camera* camera, cairn_place_scores* places);
/* What an image taken at a place should say: its probabilities. */
CAIRN_API int32_t cairn_place_model_expected(cairn_place_model* model, int32_t place, double* probabilities,
                                             int32_t num_places);
CAIRN_API int32_t cairn_place_model_destroy(cairn_place_model* model);

/* Which of several places a robot started at, found out while it is under way to a goal (docs/active.md).  Of
 * the first image, of which scores are read.  CAIRN_NO_DATA: it shares nothing with the map; CAIRN_NOT_FOUND:
 * no way leads from any possible start to the goal.  The model may be destroyed meanwhile. */
CAIRN_API int32_t cairn_start_hypotheses_create(const cairn_place_model* model,
                                                const cairn_place_scores* first, int32_t goal_place,
                                                cairn_start_hypotheses** starts);
/* Any option of the starts that `cairn drive --help` lists: ("min_score_ratio", "0.8"), ("weight",
 * "entropy").  They begin anew with the first image; after an error they are as before. */
CAIRN_API int32_t cairn_start_hypotheses_set_option(cairn_start_hypotheses* starts, const char* name,
                                                    const char* value);
/* An image at the next place of the followed way, of which probabilities are read. */
CAIRN_API int32_t cairn_start_hypotheses_observe(cairn_start_hypotheses* starts,
                                                 const cairn_place_scores* places, int32_t* verdict);
/* The robot does not see what the next image of the followed way shows, so it did not start there.  *is_other
 * 1: the likeliest other start is followed now; 0: there is none. */
CAIRN_API int32_t cairn_start_hypotheses_refute(cairn_start_hypotheses* starts, int32_t* is_other);
/* The robot is back at its start: what it has learnt about starts is kept. */
CAIRN_API int32_t cairn_start_hypotheses_restart(cairn_start_hypotheses* starts);
CAIRN_API int32_t cairn_start_hypotheses_count(const cairn_start_hypotheses* starts, int32_t* num_starts);
/* The start of this number, from 0 on, best score of the first image first. */
CAIRN_API int32_t cairn_start_hypotheses_get(const cairn_start_hypotheses* starts, int32_t number,
                                             cairn_start_hypothesis* start);
/* Its way to the goal, or (`from_whereabouts` 1) the way from where the robot would be by now: places, as
 * cairn_route writes images.  CAIRN_NOT_FOUND: no way leads from there. */
CAIRN_API int32_t cairn_start_hypotheses_way(const cairn_start_hypotheses* starts, int32_t number,
                                             int32_t from_whereabouts, int32_t* places, int32_t capacity,
                                             int32_t* num_places);
CAIRN_API int32_t cairn_start_hypotheses_destroy(cairn_start_hypotheses* starts);

/* Where a robot that woke up may be, image after image (docs/active.md): a probability of each place of the
 * map, by the survey image that shows it, and of none.  One per robot; any map will do.  CAIRN_NO_DATA: the
 * map has no images. */
CAIRN_API int32_t cairn_place_belief_create(const cairn_map* map, cairn_place_belief** belief);
/* Any option that `cairn where --help` lists: ("elsewhere_ratio", "0.1").  The belief begins anew; after an
 * error it is as before. */
CAIRN_API int32_t cairn_place_belief_set_option(cairn_place_belief* belief, const char* name,
                                                const char* value);
/* Odometry since the last image, as cairn_visual_tracker_move.  CAIRN_UNSUPPORTED: the map's unit is not the
 * metre. Without any it may have gone to what shows the same landmarks. */
CAIRN_API int32_t cairn_place_belief_move(cairn_place_belief* belief, double ahead_m, double left_m,
                                          double turn_left_rad);
/* Seconds since the last image [1], so that images may come at any rate; several calls add up. */
CAIRN_API int32_t cairn_place_belief_elapse(cairn_place_belief* belief, double seconds);
/* Gravity, at the next image: which way is up in the camera's frame (of any length), and its standard
 * deviation, degrees.  A pose that says otherwise is refuted. */
CAIRN_API int32_t cairn_place_belief_sense_up(cairn_place_belief* belief, double right, double down,
                                              double ahead, double sigma_deg);
/* The next image; `camera` as in cairn_localize.  `fix`: what the image says by itself; may be NULL. */
CAIRN_API int32_t cairn_place_belief_see(cairn_place_belief* belief, const cairn_image* image,
                                         const cairn_camera* camera, cairn_fix* fix);
/* The likeliest places, at most `capacity`, the likeliest first: the number of a survey image of each, and
 * the probability of being about there; *num_places says how many there are of these.  *elsewhere: P(at no
 * place of the map). */
CAIRN_API int32_t cairn_place_belief_places(const cairn_place_belief* belief, int32_t* images,
                                            double* probabilities, int32_t capacity, int32_t* num_places,
                                            double* elsewhere);
CAIRN_API int32_t cairn_place_belief_destroy(cairn_place_belief* belief);

/* Steers a robot with wheels to where a survey image was taken, by its camera alone (docs/active.md): the
 * camera looks ahead, at the height of the survey's.  No odometry, and a focal length that may be wrong by a
 * fifth.  One for each image of a way.  CAIRN_INVALID_ARGUMENT: no such
 * image; CAIRN_NO_DATA: it shows no landmarks. */
CAIRN_API int32_t cairn_servo_create(const cairn_map* map, int32_t image, cairn_servo** servo);
/* Where the camera is on the robot ("camera_ahead_m" and "camera_left_m" of the middle of its axle,
 * "camera_turn_deg"; without: above it, and it looks ahead), how it drives ("max_speed_m_s", "step_s", ...),
 * when it has arrived ("arrive_distance_ratio", "arrive_heading_deg"; for an image on the way 0.04 and 4 will
 * do), what it takes for a motion ("min_num_inliers", ...) and what is looked for in images
 * ("max_num_features", ...).  The servo begins anew; after an error it is as before. */
CAIRN_API int32_t cairn_servo_set_option(cairn_servo* servo, const char* name, const char* value);
/* The command after an image, which should come every step_s; `camera` NULL: the survey's camera of the
 * image's size, and the same for all images of a servo.  A target that is not in sight is no error, but
 * CAIRN_SERVO_LOST: the next image may show it again.  After an error *command stops the robot, and the servo
 * is as before. */
CAIRN_API int32_t cairn_servo_step(cairn_servo* servo, const cairn_image* image, const cairn_camera* camera,
                                   cairn_servo_command* command);
/* The last command did not move the robot, since something stands in the way: it goes the other way. */
CAIRN_API int32_t cairn_servo_blocked(cairn_servo* servo);
CAIRN_API int32_t cairn_servo_destroy(cairn_servo* servo);

/* A floor plan, for robots with a laser (docs/floor_plans.md): of views.db or of a map, whose contents say
 * which the file is.  CAIRN_NOT_FOUND: no such file, or a map without a plan. */
CAIRN_API int32_t cairn_plan_open(const char* path, cairn_plan** plan);
/* That of an open map, of one that had to be signed too. */
CAIRN_API int32_t cairn_map_plan(const cairn_map* map, cairn_plan** plan);
/* Its walls: x and y of start and end of each in `ends_m`, 4 * capacity numbers, floor frame, metres;
 * *num_walls says how many there are.  `ends_m` may be NULL with a capacity of 0. */
CAIRN_API int32_t cairn_plan_walls(const cairn_plan* plan, double* ends_m, int32_t capacity,
                                   int32_t* num_walls);
/* Scan locators and trackers of it stay usable. */
CAIRN_API int32_t cairn_plan_close(cairn_plan* plan);

/* Where one scan was taken, without knowing anything before.  CAIRN_NO_DATA: a plan without walls;
 * CAIRN_UNSUPPORTED: one of more than 0.5 square kilometres. */
CAIRN_API int32_t cairn_scan_locator_create(const cairn_plan* plan, cairn_scan_locator** locator);
/* Any option that `cairn plan locate --help-all` lists under "Stage options": ("max_range_m", "30"; default
 * 20), ("sigma_wall_m", "0.1").  After an error the locator is as before. */
CAIRN_API int32_t cairn_scan_locator_set_option(cairn_scan_locator* locator, const char* name,
                                                const char* value);
/* *num_places: how many poses explain the scan; *is_complete (may be NULL) 0: there may be more.
 * CAIRN_NO_DATA: fewer than three beams met something.  After an error there are none. */
CAIRN_API int32_t cairn_scan_locator_locate(cairn_scan_locator* locator, const cairn_scan* scan,
                                            int32_t* num_places, int32_t* is_complete);
/* One of the poses of the laser that explain the last scan, from 0 on, the most probable first.  What the
 * probabilities lack of 1 is for a place that the plan does not show. */
CAIRN_API int32_t cairn_scan_locator_place(const cairn_scan_locator* locator, int32_t number,
                                           cairn_plan_place* place);
CAIRN_API int32_t cairn_scan_locator_destroy(cairn_scan_locator* locator);

/* Where a robot is on a plan, by its scans, its wheels and what its camera's images say, any of them: several
 * places are believed with their probabilities.  In the beginning it may be anywhere.  One per robot.  Errors
 * of create: as cairn_scan_locator_create. */
CAIRN_API int32_t cairn_plan_tracker_create(const cairn_plan* plan, cairn_plan_tracker** tracker);
/* Any option that `cairn plan follow --help-all` lists under "Stage options" ("max_range_m", "30"), and where
 * laser and camera stand on the robot: "laser_ahead_m" and "laser_left_m" of the middle of its axle,
 * "laser_turn_deg" to the left; "camera_ahead_m", "camera_left_m", "camera_turn_deg".  The tracker begins
 * anew; after an error it is as before. */
CAIRN_API int32_t cairn_plan_tracker_set_option(cairn_plan_tracker* tracker, const char* name,
                                                const char* value);
/* Odometry since the last call: this far ahead and to the left, in the robot's frame before, and then turned.
 */
CAIRN_API int32_t cairn_plan_tracker_move(cairn_plan_tracker* tracker, double ahead_m, double left_m,
                                          double turn_left_rad);
/* The same, by where the wheels have the robot in a frame of theirs: it moved as from the pose of the call
 * before.  The first call moves nothing. */
CAIRN_API int32_t cairn_plan_tracker_move_to(cairn_plan_tracker* tracker, double x_m, double y_m,
                                             double heading_rad);
/* A scan, in the laser's frame.  CAIRN_NO_DATA: fewer than three beams met something.  After an error the
 * tracker is as before. */
CAIRN_API int32_t cairn_plan_tracker_see_scan(cairn_plan_tracker* tracker, const cairn_scan* scan);
/* An image, localized by itself with a localizer of the map that the plan is of, as cairn_localize does
 * without a prior; of several places that look alike, all count.  `fix` (may be NULL): what it says.
 * CAIRN_UNSUPPORTED: the map's unit is not the metre. */
CAIRN_API int32_t cairn_plan_tracker_see_image(cairn_plan_tracker* tracker, cairn_localizer* localizer,
                                               const cairn_image* image, const cairn_camera* camera,
                                               cairn_fix* fix);
/* The same of a fix that was found elsewhere, as of a rig whose frame is the camera's.  Not a tracker's, nor
 * one with a prior: what it was told before would count twice.  Without a fix nothing changes. */
CAIRN_API int32_t cairn_plan_tracker_see_fix(cairn_plan_tracker* tracker, const cairn_map* map,
                                             const cairn_fix* fix);
/* What another sense says by itself: places of the robot, with position_m, heading_rad, covariance and
 * probability; what these lack of 1 is for a place that it does not know. */
CAIRN_API int32_t cairn_plan_tracker_see_places(cairn_plan_tracker* tracker,
                                                const cairn_plan_place* const* places, int32_t num_places);
/* How many places are believed, and P(anywhere else), which may be NULL. */
CAIRN_API int32_t cairn_plan_tracker_places(const cairn_plan_tracker* tracker, int32_t* num_places,
                                            double* elsewhere);
/* One of them, from 0 on, the most probable first: the robot's frame. */
CAIRN_API int32_t cairn_plan_tracker_place(const cairn_plan_tracker* tracker, int32_t number,
                                           cairn_plan_place* place);
CAIRN_API int32_t cairn_plan_tracker_destroy(cairn_plan_tracker* tracker);

/* Many maps of a site as one (`cairn atlas`): in which of them was an image taken?  Reads the atlas alone; a
 * map's file is opened when it is needed, and must be the one that the atlas was made of (CAIRN_OTHER_MAP).
 * `options`, which may be NULL: the atlas must be signed with the public key, and have this name and epoch;
 * the memory budget is each map's [64 MiB].  Shared by all threads. */
CAIRN_API int32_t cairn_atlas_open(const char* path, const cairn_map_options* options, cairn_atlas** atlas);
CAIRN_API int32_t cairn_atlas_num_maps(const cairn_atlas* atlas, int32_t* num_maps);
/* One of its maps, from 0 on: for a localizer or tracker of the map in which the robot turned out to be.
 * Close it with cairn_map_close. */
CAIRN_API int32_t cairn_atlas_open_map(const cairn_atlas* atlas, int32_t map, cairn_map** opened);
/* Localizers that were made of it go on. */
CAIRN_API int32_t cairn_atlas_close(cairn_atlas* atlas);
/* For one thread at a time. */
CAIRN_API int32_t cairn_atlas_localizer_create(const cairn_atlas* atlas, cairn_atlas_localizer** localizer);
/* Any option that `cairn localize --help` lists: ("max_num_maps", "3"). */
CAIRN_API int32_t cairn_atlas_localizer_set_option(cairn_atlas_localizer* localizer, const char* name,
                                                   const char* value);
/* The maps in which the image may have been taken, at most `capacity`, the most probable first, and P(there),
 * all maps considered; *num_places says how many there are of these.  *elsewhere (may be NULL): P(in none).
 * `fix` (may be NULL): where in the first of them, with that probability, or why there is no fix.  `camera`
 * NULL: each map's camera of the image's size. */
CAIRN_API int32_t cairn_atlas_localize(cairn_atlas_localizer* localizer, const cairn_image* image,
                                       const cairn_camera* camera, int32_t* maps, double* probabilities,
                                       int32_t capacity, int32_t* num_places, double* elsewhere,
                                       cairn_fix* fix);
CAIRN_API int32_t cairn_atlas_localizer_destroy(cairn_atlas_localizer* localizer);

/* Updates a map by its differences to a new one (`cairn update delta`).  Replaces the file at `map_path` by
 * the map that the delta leads to: at any instant it is the whole old or the whole new one, and the old one
 * stays beside it, for cairn_map_roll_back.  A map that is open stays the old one; open it again.  `options`,
 * which may be NULL: delta and new map must be signed with the public key; name, min_epoch, allow_older.
 * *was_updated (may be NULL): 0 where the map already is the new one.  CAIRN_INVALID_ARGUMENT: the delta
 * leads from another map; CAIRN_NOT_NEWER, CAIRN_OTHER_MAP: a key is required, or the map in place is signed,
 * and the new map does not follow it; CAIRN_BUSY: another update is running in the folder. */
CAIRN_API int32_t cairn_map_update(const char* map_path, const char* delta_path,
                                   const cairn_map_options* options, int32_t* was_updated);
/* Exchanges the map and the one before the last update; a second call exchanges them back.  min_epoch holds
 * here too; allow_older is ignored. */
CAIRN_API int32_t cairn_map_roll_back(const char* map_path, const cairn_map_options* options);
/* Replaces a robot's ring of keys by the one after it (`cairn keys make --after`), whose signatures are
 * beside it in NEXT.signatures: enough keys of either ring must have signed it.  At any instant the file at
 * `ring_path` is the whole old or the whole new ring.  *version (may be NULL): of the ring that is then in
 * place; a ring that is there already is no error.  CAIRN_NOT_NEWER: an earlier version, or one that leaves
 * out others; CAIRN_NOT_SIGNED, CAIRN_WRONG_KEY: too few signatures, or none; CAIRN_BUSY. */
CAIRN_API int32_t cairn_key_ring_accept(const char* ring_path, const char* next_path, uint64_t* version);

#ifdef __cplusplus
} /* extern "C" */
#endif

#endif /* CAIRN_RUNTIME_CAIRN_H_ */
