-- A map, version 1.0: what a robot opens.  The tables of vocabulary.sql stand beside these.  Contract: FORMAT.md.
PRAGMA application_id = 0x63726d70;  -- 'crmp'
PRAGMA user_version = 1000;          -- 1000 * major + minor

CREATE TABLE meta (
  key   TEXT PRIMARY KEY,
  value TEXT NOT NULL
) WITHOUT ROWID;

CREATE TABLE stage_options (
  stage   TEXT PRIMARY KEY,  -- "decompose_regions"
  options TEXT NOT NULL      -- TOML, every option of the stage
) WITHOUT ROWID;

CREATE TABLE inputs (
  name TEXT PRIMARY KEY,     -- "classes.db"
  hash TEXT NOT NULL         -- XXH3, 128 bits, hexadecimal
) WITHOUT ROWID;

-- Rigid transforms: unit quaternion and translation in metres.
CREATE TABLE frames (
  name TEXT PRIMARY KEY,     -- "floor_from_world", "camera_from_given"
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  tx REAL NOT NULL, ty REAL NOT NULL, tz REAL NOT NULL
) WITHOUT ROWID;

CREATE TABLE cameras (
  camera_id       INTEGER PRIMARY KEY,
  model           INTEGER NOT NULL,   -- COLMAP's number of the camera model
  width           INTEGER NOT NULL,   -- px
  height          INTEGER NOT NULL,   -- px
  has_focal_prior INTEGER NOT NULL,   -- 0: the focal length was a guess
  params          BLOB NOT NULL       -- float64 each
);

CREATE TABLE images (
  image_id      INTEGER PRIMARY KEY,
  name          TEXT NOT NULL,
  camera_id     INTEGER NOT NULL,
  station_idx   INTEGER,              -- where it was taken; NULL: at no station
  -- cam_from_world
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  tx REAL NOT NULL, ty REAL NOT NULL, tz REAL NOT NULL,
  num_landmarks INTEGER NOT NULL,
  landmarks     BLOB NOT NULL         -- landmark_idx seen in it: ascending varints
);

CREATE TABLE stations (
  station_idx INTEGER PRIMARY KEY,    -- 0, 1, ...
  x           REAL NOT NULL,          -- metres, floor frame
  y           REAL NOT NULL,
  heading_deg REAL,                   -- counter-clockwise from +x; NULL: sees all around
  is_covered  INTEGER NOT NULL,       -- 0: its neighbourhood lies in no region
  num_neighbours INTEGER NOT NULL,
  neighbours  BLOB NOT NULL           -- contiguous stations of larger index: ascending varints
);

CREATE TABLE regions (
  region_idx    INTEGER PRIMARY KEY,  -- 0, 1, ...
  num_stations  INTEGER NOT NULL,
  num_landmarks INTEGER NOT NULL,
  stations      BLOB NOT NULL,        -- station_idx: ascending varints
  landmarks     BLOB NOT NULL         -- landmark_idx: ascending varints
);

-- Ordered by the first region that has the landmark (those of no region last), so that a region is few runs of rows.
CREATE TABLE landmarks (
  landmark_idx     INTEGER PRIMARY KEY,  -- 0, 1, ...
  class_id         INTEGER NOT NULL,     -- feature class that it was made from
  x                INTEGER NOT NULL,     -- 0.1 mm, world frame
  y                INTEGER NOT NULL,
  z                INTEGER NOT NULL,
  scale            INTEGER NOT NULL,     -- size (sigma) of the feature in space, 0.1 mm
  num_observations INTEGER NOT NULL,     -- survey images that see it
  covariance       BLOB NOT NULL,        -- of the position, m^2: xx xy xz yy yz zz, float32 each
  descriptor       BLOB NOT NULL         -- 128 uint8
);

CREATE TABLE self_test (
  name  TEXT PRIMARY KEY,
  value REAL NOT NULL
) WITHOUT ROWID;
