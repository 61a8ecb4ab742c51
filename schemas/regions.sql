-- regions.db: a decomposition, output of decompose_regions.  Page: schemas/regions.md.
-- Blobs are arrays of little-endian 32-bit integers, ascending.
PRAGMA application_id = 0x63727267;  -- 'crrg'
PRAGMA user_version = 1;

CREATE TABLE decomposition (
  algorithm       TEXT    NOT NULL,
  k               INTEGER NOT NULL,
  tau             INTEGER NOT NULL,
  rho             INTEGER NOT NULL,
  seed            INTEGER NOT NULL,  -- unsigned 64-bit number, stored as its two's complement
  lower_bound     INTEGER,           -- NULL: not computed
  uncovered_limit INTEGER NOT NULL,
  uncovered       BLOB    NOT NULL   -- stations
);

CREATE TABLE regions (
  region_idx INTEGER PRIMARY KEY,    -- 0, 1, ...
  features   BLOB NOT NULL,          -- feature indices of the world
  stations   BLOB NOT NULL           -- the tau-grown region
);

-- What was dropped, and why; see drops.md.
CREATE TABLE dropped_items (
  reason_id INTEGER NOT NULL,  -- core/drop_reason.h
  item_id   INTEGER NOT NULL,  -- feature_idx or station_idx
  found     INTEGER,           -- what the filter found, where that is a number
  seen_at   BLOB               -- NULL
);
