-- A map, version 2.6: what a robot opens.  Contract: FORMAT.md.
PRAGMA application_id = 0x63726d70;  -- 'crmp'
PRAGMA user_version = 2008;          -- 1000 * major + minor

-- First, so that its only row stands in page 2: hashes and signature, 176 bytes.
CREATE TABLE seal (
  seal BLOB NOT NULL
);

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

CREATE TABLE self_test (
  name  TEXT PRIMARY KEY,
  value REAL NOT NULL
) WITHOUT ROWID;

-- Stations, regions, words, images and landmarks.
CREATE TABLE blocks (
  block_idx INTEGER PRIMARY KEY,  -- 0, 1, ...: the directory's entry
  bytes     BLOB NOT NULL
);

CREATE TABLE directory (
  entries BLOB NOT NULL           -- 69 bytes per block: what it holds, and its hash
);
