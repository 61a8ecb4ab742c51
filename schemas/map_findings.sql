-- What the compilation found out about a map, for people and programs that judge it; a robot does not need it to localize.
-- Part of a map beside the tables of the map itself.  See FORMAT.md.

-- Held-out images by the region at whose stations they were taken.  An image counts in every region that has its station.
CREATE TABLE self_test_regions (
  region_idx       INTEGER PRIMARY KEY,  -- -1: outside, at no station of any region
  num_held_out     INTEGER NOT NULL,
  num_localized    INTEGER NOT NULL,
  num_gross_errors INTEGER NOT NULL,     -- of those localized
  -- Of those localized; NULL where there is none.
  median_error_m   REAL,
  median_error_deg REAL,
  p90_error_m      REAL,
  p90_error_deg    REAL
);

-- How well the places of a region are told from others by looking; regions without images of the appearance graph have no
-- row.
CREATE TABLE region_entropies (
  region_idx INTEGER PRIMARY KEY,
  entropy    REAL NOT NULL           -- mean of the images' at its stations, nats
);

-- What the stages dropped, by reason; only reasons that occurred.
CREATE TABLE drop_reasons (
  reason_id   INTEGER PRIMARY KEY,
  stage       TEXT NOT NULL,         -- "group_classes"
  kind        TEXT NOT NULL,         -- what is counted: image, pair, feature, keypoint, view or station
  name        TEXT NOT NULL,         -- "few_observations"
  text        TEXT NOT NULL,         -- why, for people
  num_dropped INTEGER NOT NULL,
  at_stations BLOB NOT NULL          -- how many at each station, in order: a varint each; empty: none at any
);

-- What a map whose landmarks were chosen by trial promises; one row, or none.
CREATE TABLE promises (
  promise_id      INTEGER PRIMARY KEY,   -- 0
  min_matches     INTEGER NOT NULL,      -- with this probability, at least so many landmarks are matched
  max_error_m     REAL NOT NULL,         -- and the pose is within these limits
  max_error_deg   REAL NOT NULL,
  probability     REAL NOT NULL,
  match_ratio     REAL NOT NULL,         -- from what is expected to what happens (core/promise/promise_model.h)
  shape           REAL NOT NULL,
  error_ratio     REAL NOT NULL,
  radius_m        REAL NOT NULL,         -- of a view
  radius_deg      REAL NOT NULL,
  landmarks_bound INTEGER NOT NULL,      -- no map with fewer keeps the promise where it can be kept
  nodes           BLOB NOT NULL,         -- see FORMAT.md
  left_out        BLOB NOT NULL,         -- calibration curves: survey images left out of the maps that were tried,
  held_out        BLOB NOT NULL          -- and images of the self-test
);
