#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/seal/key_ring.h"
#include "core/seal/signature_list.h"

namespace cairn {

// How a robot's ring is replaced by the next one: a key that was lost or stolen is one that the next ring
// lacks, a new one is one that it has.  As the root role of The Update Framework (specification 1.0, TUF
// §5.3): each ring is signed by the one before it and by itself.  Differs from it: a ring has no date on
// which it expires, since robots have no clock that can be trusted.

// Adds a signature of a ring by this key, of the ring or of the one before it, to SignaturesPath(path).
// Errors: as ReadKeyRing and AddSignature.
Status SignKeyRing(const std::string& path, const SecretKey& key);

// Whether `next` may follow `current`: its version is the next one, and enough keys of either ring have
// signed it, by `signatures`.  `path`, of `next`, is for messages.  Errors: NotNewer (an earlier version, or
// one that leaves out others); NotSigned, WrongKey (too few signatures: says whose); InvalidArgument
// (`current` is no ring).
Status CheckNextKeyRing(const KeyRing& current, const KeyRingFile& next, const SignatureList& signatures,
                        const std::string& path);

// Replaces the ring of a robot by the last of `next_paths`, each of which follows the one before it; their
// signatures are beside them.  All are checked before anything is written; at any instant the file is the
// whole old ring or the whole new one.  Those that the robot's ring is later than, or is, are passed over, so
// that all rings can be sent to all robots.  If the path is a link, the file that it leads to is replaced.
// Returns the ring that is then in place. Errors: those of ReadKeyRing, ReadSignatures and CheckNextKeyRing;
// NotNewer also where all are earlier, or where one has the version of the robot's and is another; Busy
// (another one is accepted in its folder); those of WriteFileAtomically.
Result<KeyRing> AcceptKeyRings(const std::string& ring_path, const std::vector<std::string>& next_paths);

}  // namespace cairn
