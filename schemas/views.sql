-- views.db: view-invariant regions of a floor plan, output of decompose_views.  Page: schemas/views.md.
-- Blobs are arrays of little-endian 32-bit integers, except where varints are named.
PRAGMA application_id = 0x63727677;  -- 'crvw'
PRAGMA user_version = 1;

CREATE TABLE plan (
  grid_m        REAL    NOT NULL,  -- unit of grid coordinates, metres
  origin_x      REAL    NOT NULL,  -- floor frame, metres, of grid coordinates (0, 0)
  origin_y      REAL    NOT NULL,
  closed        INTEGER NOT NULL,  -- 1: polygons, the domain is left of every wall; 0: the domain is the box
  low_x         INTEGER NOT NULL,  -- box of the domain, grid
  low_y         INTEGER NOT NULL,
  high_x        INTEGER NOT NULL,
  high_y        INTEGER NOT NULL,
  num_regions   INTEGER NOT NULL,
  plan_vertices BLOB    NOT NULL,  -- x, y on the grid, each
  vertices      BLOB    NOT NULL   -- x, y on the grid, each: corners of regions
);

-- Labels are sides of walls: 2 * wall_idx is the one left of start -> end, 2 * wall_idx + 1 the other.
CREATE TABLE walls (
  wall_idx INTEGER PRIMARY KEY,  -- 0, 1, ...
  x0 REAL NOT NULL,              -- metres, floor frame
  y0 REAL NOT NULL,
  x1 REAL NOT NULL,
  y1 REAL NOT NULL,
  pieces BLOB NOT NULL           -- start and end of each of its pieces: plan vertices
);

-- In the order of a depth-first walk over the adjacency graph.
CREATE TABLE regions (
  region_idx       INTEGER PRIMARY KEY,  -- 0, 1, ...
  corners          BLOB    NOT NULL,     -- vertices, counter-clockwise
  parent           INTEGER,              -- region whose labels these are a change of; NULL: of none at all
  toggled          BLOB    NOT NULL,     -- labels that one of the two has, ascending, varints (core/blob.h)
  num_labels       INTEGER NOT NULL,
  wall_length_m    REAL    NOT NULL,     -- of the visible walls
  visible_length_m REAL    NOT NULL,     -- from the centroid, as the rest
  visible_area_m2  REAL    NOT NULL,
  longest_m        REAL    NOT NULL
);

-- Pairs of regions with a common border that is no wall: region a, region b, start and end of the border
-- (vertices; a to its left), four numbers each, ascending.  Up to 65536 pairs a row.
CREATE TABLE links (
  part_idx INTEGER PRIMARY KEY,
  links    BLOB NOT NULL
);

-- What cleaning changed in the plan's file.
CREATE TABLE plan_changes (
  kind    INTEGER NOT NULL,  -- stages/decompose_views/clean_plan.h
  what    TEXT    NOT NULL,
  line    INTEGER NOT NULL,  -- of the file, or number of the ring; 0: of none in particular
  x       REAL    NOT NULL,  -- metres
  y       REAL    NOT NULL,
  moved_m REAL    NOT NULL
);
