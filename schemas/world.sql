-- world.db: a world instance, input of decompose_regions.  Page: schemas/world.md.
-- Blobs are arrays of little-endian 32-bit integers.
PRAGMA application_id = 0x63727764;  -- 'crwd'
PRAGMA user_version = 1;

CREATE TABLE world (
  num_stations      INTEGER NOT NULL,
  num_edges         INTEGER NOT NULL,
  num_features      INTEGER NOT NULL,
  lattice_spacing_m REAL    NOT NULL,  -- 0: not a lattice survey
  -- floor_from_world: unit quaternion, translation in metres
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  tx REAL NOT NULL, ty REAL NOT NULL, tz REAL NOT NULL
);

CREATE TABLE stations (
  station_idx INTEGER PRIMARY KEY,  -- 0, 1, ...
  x           REAL NOT NULL,        -- metres, floor frame
  y           REAL NOT NULL,
  heading_deg REAL,                 -- counter-clockwise from +x; NULL: sees all around
  neighbours  BLOB NOT NULL,        -- stations of larger index that an edge joins to this one, ascending
  images      BLOB                  -- image_id of the images taken here, ascending; NULL: not known
);

CREATE TABLE features (
  feature_idx INTEGER PRIMARY KEY,  -- 0, 1, ...
  class_id    INTEGER,              -- feature class behind it; NULL: not known
  stations    BLOB NOT NULL         -- stations that see it, ascending
);

-- What was dropped, and why; see drops.md.
CREATE TABLE dropped_items (
  reason_id INTEGER NOT NULL,  -- core/drop_reason.h
  item_id   INTEGER NOT NULL,  -- class_id
  found     INTEGER,           -- what the filter found, where that is a number
  seen_at   BLOB               -- station_idx: i32 each
);
