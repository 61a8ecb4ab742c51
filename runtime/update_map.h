#pragma once

#include <optional>
#include <string>

#include "core/error.h"
#include "core/map_seal.h"

namespace cairn {

// Maps sent to robots as what changed (core/map_delta.h).  A robot that has a map open keeps what it opened:
// the file that it replaces stays until nobody has it open.  No exception leaves these functions.
struct UpdateOptions {
  // The delta, and the map that it leads to, must be signed with this key.
  std::optional<PublicKey> public_key;
};

// Writes the map that a delta leads to from `old_path`, which stays; whoever looks sees no `new_path`, or the
// whole.  Errors: those of ReadMapDelta and ApplyMapDelta; NotSigned and WrongKey also of the new map;
// DiskFull, ReadOnly, Io.
Status ApplyDelta(const std::string& old_path, const std::string& delta_path, const std::string& new_path,
                  const UpdateOptions& options = {});

// The same in place: at any instant `map_path` is the whole old or the whole new map, and the old one stays
// beside it as PreviousMapPath.  Of a link, the file that it leads to is updated, and the previous map lies
// there. Errors: also Busy (another update or rollback in the map's folder).  False, and nothing is done,
// where the map is the new one already.
Result<bool> UpdateMap(const std::string& map_path, const std::string& delta_path,
                       const UpdateOptions& options = {});

// Where UpdateMap keeps the map that it replaced: "kitchen.cairn.previous".
std::string PreviousMapPath(const std::string& map_path);

// Exchanges a map and the one that it replaced, in one step; a second time exchanges them back.
// Errors: NotFound (either); Busy; those of MapFile::Open for the previous map; Io.
Status RollBackMap(const std::string& map_path, const UpdateOptions& options = {});

}  // namespace cairn
