#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/seal/map_seal.h"

namespace cairn {

// A valid signature says who made a map, not when, nor for which place: an older map signed with the same key
// is as valid as today's, and so is another site's.  So a map has a name and an epoch, both under its
// signature, and a robot takes only a later epoch of the same name (docs/updates.md).

// Whether `next` may take the place of `old`; the paths are for messages.
// Errors: OtherMap (another name); NotNewer (an epoch that is not later, unless `allow_older`).
Status CheckFollows(const MapHead& next, const std::string& next_path, const MapHead& old,
                    const std::string& old_path, bool allow_older);

// Whether a map is the one that was asked for.  Errors: OtherMap (a name was asked for, and the map has
// another), NotNewer (an epoch before `min_epoch`).
Status CheckAskedFor(const MapHead& head, const std::string& path, const std::string& name,
                     uint64_t min_epoch);

// The epoch that a map needs to follow the one at `previous_path`, which these keys have signed.  Errors: as
// MapFile::Open with the keys; OtherMap (not of this name); InvalidArgument (no epoch comes after it).
Result<uint64_t> EpochAfter(const std::string& previous_path, const std::string& name,
                            const KeyRing& trusted);

}  // namespace cairn
