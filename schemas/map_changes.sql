-- Where a place changed between the surveys of a map, beside the tables of map_findings.sql; a map without changes, as every map
-- of one survey is, lacks this table.  See FORMAT.md.

CREATE TABLE changes (
  change_idx   INTEGER PRIMARY KEY,  -- ascending session, of one session the largest first
  session_idx  INTEGER NOT NULL,     -- the first that shows it: its place among the sessions of meta, from 0; never 0
  -- Mean of the features, world frame, and root mean square of their distances from it: thousandths of the map's unit.
  x            INTEGER NOT NULL,
  y            INTEGER NOT NULL,
  z            INTEGER NOT NULL,
  radius       INTEGER NOT NULL,
  num_vanished INTEGER NOT NULL,     -- features that earlier sessions saw there and that are gone
  num_appeared INTEGER NOT NULL,     -- features that this session is the first to see there
  -- The images, by index, that show best what was there and what is there now; -1: none of the map.
  image_before INTEGER NOT NULL,
  image_after  INTEGER NOT NULL
);
