-- A vocabulary tree with its inverted files: vocabulary.db, and the same tables inside a map.  See FORMAT.md.

CREATE TABLE vocabulary (
  branching INTEGER NOT NULL,      -- most children of a node
  depth INTEGER NOT NULL,          -- levels below the root
  num_nodes INTEGER NOT NULL,      -- root included
  num_words INTEGER NOT NULL,      -- leaves
  num_documents INTEGER NOT NULL
);

-- Inner nodes only.  Nodes are numbered breadth first from the root, 0, so that the children of an inner node follow
-- those of the inner node before it; a node without a row is a leaf.  Words number the leaves in the same order.
CREATE TABLE vocabulary_nodes (
  node_id INTEGER PRIMARY KEY,
  num_children INTEGER NOT NULL,
  centres BLOB NOT NULL            -- num_children x 128 uint8, the children's centres
);

-- Inverted files that are not empty.
CREATE TABLE vocabulary_words (
  word_id INTEGER PRIMARY KEY,
  num_postings INTEGER NOT NULL,
  postings BLOB NOT NULL           -- per posting: varint of the document's step from the one before, varint of the count
);

CREATE TABLE vocabulary_documents (
  document_idx INTEGER PRIMARY KEY,  -- 0 .. num_documents - 1
  image_id INTEGER NOT NULL          -- ascending
);
