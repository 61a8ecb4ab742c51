#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/seal/map_seal.h"

namespace cairn {

// Maps sent to robots as what changed (core/map/map_delta.h).  A robot that has a map open keeps what it
// opened: the file that it replaces stays until nobody has it open.  No exception leaves these functions.
struct UpdateOptions {
  // The delta, and the map that it leads to, must be signed with this key.
  std::optional<PublicKey> public_key;
  // Lets a map of an earlier or the same epoch take a signed map's place; another map never does.
  bool allow_older = false;
  // What the map must be called; empty: whatever the map in place is called, or, where that does not count,
  // anything.
  std::string name = {};
  // The least epoch that it may have, also going back: a robot's own memory, which holds even where somebody
  // has put an older map in place.  0: any.
  uint64_t min_epoch = 0;
};

// What takes a map's place has its name and a later epoch (core/map/map_epoch.h), where a key is required or
// the map in place is signed.  Where a key is required, a map in place that it has not signed does not count:
// then `name` and `min_epoch` alone say what may follow.

// Writes the map that a delta leads to from `old_path`, which stays and is what the new one has to follow;
// whoever looks sees no `new_path`, or the whole.  Errors: those of ReadMapDelta and ApplyMapDelta; NotSigned
// and WrongKey also of the new map; NotNewer, OtherMap; DiskFull, ReadOnly, Io.
Status ApplyDelta(const std::string& old_path, const std::string& delta_path, const std::string& new_path,
                  const UpdateOptions& options = {});

// The same in place: at any instant `map_path` is the whole old or the whole new map, and the old one stays
// beside it as PreviousMapPath.  What lay there before goes only when the new map is in place.  Of a link,
// the file that it leads to is updated, and the previous map lies there.  Errors: also Busy (another update
// or rollback in the map's folder).  False, and nothing is done, where the map is the new one already. Where
// only the folder cannot be synced at the end, the error says that the new map is in place.
Result<bool> UpdateMap(const std::string& map_path, const std::string& delta_path,
                       const UpdateOptions& options = {});

// Where UpdateMap keeps the map that it replaced: "kitchen.cairn.previous".
std::string PreviousMapPath(const std::string& map_path);

// Exchanges a map and the one that it replaced, in one step; a second time exchanges them back.  Going back
// is what it is for: epochs do not matter but for `min_epoch`; names do, as above.
// Errors: NotFound (either); Busy; those of MapFile::Open for the previous map; OtherMap, NotNewer; Io, also
// where the previous map is no regular file.
Status RollBackMap(const std::string& map_path, const UpdateOptions& options = {});

}  // namespace cairn
