-- Things that moved, as of the changes of map_changes.sql; a map in which nothing did lacks this table.  See FORMAT.md.

CREATE TABLE moves (
  -- What vanished at this change is now at the other one, of the same session (or at the same).
  change_idx   INTEGER PRIMARY KEY,
  moved_to     INTEGER NOT NULL,
  -- Features that show it; positive.
  num_features INTEGER NOT NULL
);
