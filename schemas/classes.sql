-- classes.db: the feature classes of a capture with refined poses, output of group_classes.
-- Blobs are little-endian; class and image ids are the opaque ids of the capture's COLMAP database.
PRAGMA application_id = 0x6372636c;  -- 'crcl'
PRAGMA user_version = 3;

CREATE TABLE cameras (
  camera_id INTEGER PRIMARY KEY,
  model     INTEGER NOT NULL,  -- COLMAP's number
  width     INTEGER NOT NULL,  -- px
  height    INTEGER NOT NULL,  -- px
  params    BLOB    NOT NULL,  -- float64[]; as refined
  has_focal_prior INTEGER NOT NULL
);

-- As the capture states them, where refined ones are others.
CREATE TABLE stated_cameras (
  camera_id INTEGER PRIMARY KEY,
  model     INTEGER NOT NULL,
  width     INTEGER NOT NULL,
  height    INTEGER NOT NULL,
  params    BLOB    NOT NULL,
  has_focal_prior INTEGER NOT NULL
);

CREATE TABLE images (
  image_id  INTEGER PRIMARY KEY,
  name      TEXT    NOT NULL,
  camera_id INTEGER NOT NULL REFERENCES cameras,
  refined   BLOB    NOT NULL,  -- cam_from_world: float64[7] = qw qx qy qz tx ty tz, metres
  given     BLOB    NOT NULL   -- the same as the capture states it
);

CREATE TABLE classes (
  class_id     INTEGER PRIMARY KEY,
  position     BLOB NOT NULL,  -- float64[3], world frame, metres
  covariance   BLOB NOT NULL,  -- float64[6]: xx xy xz yy yz zz, m^2
  reprojection_error_px REAL NOT NULL,  -- root mean square
  descriptor   BLOB NOT NULL,  -- uint8[128]
  observations BLOB NOT NULL,  -- n x 24 bytes: image_id u32, keypoint_idx u32, x f32, y f32, scale f32, orientation f32
  presence     REAL NOT NULL,  -- probability that it is there now; 1 for a survey of one session
  sightings    BLOB NOT NULL   -- per session 12 bytes: expected f32, num_seen i32, there f32; empty: one session
);

-- Classes that are probably gone, in the same form: no id is in both tables.
CREATE TABLE vanished (
  class_id     INTEGER PRIMARY KEY,
  position     BLOB NOT NULL,
  covariance   BLOB NOT NULL,
  reprojection_error_px REAL NOT NULL,
  descriptor   BLOB NOT NULL,
  observations BLOB NOT NULL,
  presence     REAL NOT NULL,
  sightings    BLOB NOT NULL
);

-- The sessions of the survey, where there are several, in the order of time.
CREATE TABLE sessions (
  session_idx INTEGER PRIMARY KEY,
  name        TEXT NOT NULL
);

-- Where the place changed, by session, the largest first.
CREATE TABLE changes (
  session_idx  INTEGER NOT NULL,  -- the first that shows it
  position     BLOB NOT NULL,     -- float64[3], mean of the classes', world frame, metres
  radius_m     REAL NOT NULL,     -- root mean square of their distances from it
  num_vanished INTEGER NOT NULL,  -- classes
  num_appeared INTEGER NOT NULL,
  image_before INTEGER NOT NULL,  -- of an earlier session, shows what was there; 0: none
  image_after  INTEGER NOT NULL,  -- of this session, shows what is there now; 0: none
  moved_to     INTEGER NOT NULL,  -- by position, from 0: the change of this session where it is now; -1: nowhere
  num_moved    INTEGER NOT NULL   -- classes that show that
);

CREATE TABLE alignment (
  camera_from_given BLOB NOT NULL,  -- float64[7], as images.refined
  -- how far refined poses moved from the stated ones, root mean square per axis; 0: poses as stated
  stated_pose_sigma_m   REAL NOT NULL,
  stated_pose_sigma_deg REAL NOT NULL,
  -- which part of its variance a keypoint shares with the others of its image
  keypoint_correlation REAL NOT NULL
);

CREATE TABLE dropped (
  reason TEXT PRIMARY KEY,
  num_classes INTEGER NOT NULL
);

-- What was dropped, and why; see drops.md.
CREATE TABLE dropped_items (
  reason_id INTEGER NOT NULL,  -- core/drop_reason.h
  item_id   INTEGER NOT NULL,  -- image_id, pair_id, track_idx or class_id
  found     INTEGER,           -- what the filter found, where that is a number
  seen_at   BLOB               -- keypoints: image_id u32, keypoint_idx u32 each
);
