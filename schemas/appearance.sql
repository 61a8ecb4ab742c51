-- appearance.db: the appearance graph and the images kept of it, output of link_appearance.  Page:
-- schemas/appearance.md.  Blobs are arrays of little-endian 32-bit integers.
PRAGMA application_id = 0x63726167;  -- 'crag'
PRAGMA user_version = 2;

CREATE TABLE appearance (
  num_nodes          INTEGER NOT NULL,
  num_links          INTEGER NOT NULL,
  num_components     INTEGER NOT NULL,
  num_dominators     INTEGER NOT NULL,
  strong_num_inliers INTEGER NOT NULL,
  max_detour_links   INTEGER NOT NULL   -- 0: no cycles were restored
);

CREATE TABLE components (
  component_idx INTEGER PRIMARY KEY,    -- 0, 1, ... by their smallest nodes
  num_nodes     INTEGER NOT NULL,
  num_kept      INTEGER NOT NULL,
  lower_bound   INTEGER                 -- NULL: not computed
);

CREATE TABLE nodes (
  node_idx      INTEGER PRIMARY KEY,    -- 0, 1, ...
  component_idx INTEGER NOT NULL,
  role          INTEGER NOT NULL,       -- 0 dropped, 1 kept: dominating, 2 kept: restores a cycle
  images        BLOB NOT NULL,          -- image_id, ascending
  neighbours    BLOB NOT NULL,          -- nodes of larger index that are linked to this one, ascending
  num_inliers   BLOB NOT NULL,          -- verified inliers of these links
  entropy       INTEGER                 -- of its look-alikes' distribution, thousandths of a nat; NULL: not computed
);

CREATE TABLE confusable (               -- nodes that look alike and lie apart
  node1 INTEGER NOT NULL,
  node2 INTEGER NOT NULL,               -- > node1
  score INTEGER NOT NULL,               -- thousandths, 1 to 1000
  PRIMARY KEY (node1, node2)
) WITHOUT ROWID;
