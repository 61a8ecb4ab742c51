#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/seal/key_ring.h"

namespace cairn {

// Updates a robot's map by the differences to the new one (core/delta/map_delta.h).  A robot that has a map
// open keeps the old contents: the replaced file exists until nobody has it open.  No exception leaves
// these functions.
struct UpdateOptions {
  // The delta and the map that it leads to must be signed with this key; or the map by as many keys of this
  // ring as it wants, and the delta by one of them.
  std::optional<KeyRing> public_key;
  // Lets a map of an earlier or the same epoch replace a signed map; a map of another name never does.
  bool allow_older = false;
  // Required name of the map; empty: the name of the map in place or, where that does not count, any.
  std::string name = {};
  // Smallest epoch that it may have, also when rolling back: a robot's own memory, which holds even where
  // somebody has put an older map in place.  0: any.
  uint64_t min_epoch = 0;
  // File with signatures of the map that a delta leads to, besides the one in its seal
  // (core/seal/signature_list.h); empty: DELTA.signatures, where it is there.
  std::string signatures = {};
};

// Where a key is required or the map in place is signed, a map can only be replaced by one with its name and
// a later epoch (core/map/map_epoch.h).  Where a key is required, a map in place that it has not signed does
// not count: then only `name` and `min_epoch` decide.

// Signatures besides those in the seals of a map and of the one before it lie in one file,
// SignaturesPath(map).  It gets those of the new map before that is put in place, and keeps those of the maps
// that are there.  So at every moment each of these maps has all of its signatures, and one rename, or one
// exchange, changes the map.

// Writes the map that a delta leads to from `old_path`, which stays and which the new one has to follow;
// readers see no `new_path` or a complete one.  Errors: those of ReadMapDelta, ReadSignatures and
// ApplyMapDelta; NotSigned and WrongKey also of the new map; NotNewer, OtherMap; DiskFull, ReadOnly, Io.
Status ApplyDelta(const std::string& old_path, const std::string& delta_path, const std::string& new_path,
                  const UpdateOptions& options = {});

// The same in place: at any instant `map_path` is the whole old or the whole new map, and the old one stays
// beside it as PreviousMapPath.  An older previous map is removed only when the new map is in place.  If the
// path is a link, the file that it leads to is updated, and the previous map is kept beside that file.
// Errors: also Busy (another update or rollback in the map's folder).  Returns false where the map already
// is the new one; then only signatures of it that are new are kept.  Where only the folder cannot be synced
// at the end, the error says that the new map is in place.
Result<bool> UpdateMap(const std::string& map_path, const std::string& delta_path,
                       const UpdateOptions& options = {});

// Where UpdateMap keeps the map that it replaced: "kitchen.cairn.previous".
std::string PreviousMapPath(const std::string& map_path);

// Exchanges a map and the one that it replaced, in one step; a second call exchanges them back.  As it goes
// back, only `min_epoch` limits the epoch; names count as above.  Errors: NotFound (either); Busy; those of
// MapFile::Open for the previous map; OtherMap, NotNewer; Io, also where the previous map is not a
// regular file.
Status RollBackMap(const std::string& map_path, const UpdateOptions& options = {});

}  // namespace cairn
