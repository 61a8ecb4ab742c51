#include "core/seal/accept_key_ring.h"

#include <limits>
#include <utility>

#include "core/files/file.h"
#include "core/files/file_lock.h"
#include "core/files/output_path.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

// Whether enough keys of this ring have signed `text`.
Status CheckSignedBy(const KeyRing& ring, const char* which, const std::string& text,
                     const SignatureList& signatures, const std::string& path) {
  const std::vector<std::string> signers = SignersOf(text, signatures, ring);
  if (signers.size() >= static_cast<size_t>(ring.threshold)) return Ok();
  return MakeError(
      signers.empty() ? ErrorCode::kWrongKey : ErrorCode::kNotSigned,
      "{}: {} of the {} signatures that {}, {}, requires{}{}; have others of its keys sign it with "
      "`cairn keys sign`, and keep {} beside it",
      path, signers.size(), ring.threshold, ring.Description(), which, signers.empty() ? "" : ": by ",
      fmt::join(signers, ", "), SignaturesPath(path));
}

}  // namespace

Status SignKeyRing(const std::string& path, const SecretKey& key) {
  CAIRN_ASSIGN_OR_RETURN(const KeyRingFile file, ReadKeyRing(path));
  return AddSignature(file.text, key, SignaturesPath(path));
}

Status CheckNextKeyRing(const KeyRing& current, const KeyRingFile& next, const SignatureList& signatures,
                        const std::string& path) {
  for (const KeyRing* ring : {&current, &next.ring}) {
    CAIRN_RETURN_IF_ERROR(CheckKeyRing(*ring));
    if (ring->is_single_key())
      return MakeError(ErrorCode::kInvalidArgument, "{}: a public key alone has no next ring", path);
  }
  // [TUF §5.3.5: exactly the version incremented by one]
  if (current.version == std::numeric_limits<uint64_t>::max() || next.ring.version != current.version + 1) {
    return MakeError(
        ErrorCode::kNotNewer,
        "{}: is ring {}, but only the one after ring {} follows it: each ring is signed by the one "
        "before; give all that come after {}, in turn",
        path, next.ring.version, current.version, current.version);
  }
  // [TUF §5.3.4: (1) a threshold of keys of version N, (2) a threshold of keys of version N+1]
  CAIRN_RETURN_IF_ERROR(CheckSignedBy(current, "which the robot has", next.text, signatures, path));
  return CheckSignedBy(next.ring, "itself", next.text, signatures, path);
}

Result<KeyRing> AcceptKeyRings(const std::string& given_path, const std::vector<std::string>& next_paths) {
  const std::string ring_path = FileOf(given_path);
  if (next_paths.empty())
    return MakeError(ErrorCode::kInvalidArgument, "{}: no ring is given that could follow it", ring_path);
  CAIRN_RETURN_IF_ERROR(CheckOutputIsNoInput(ring_path, next_paths));
  CAIRN_ASSIGN_OR_RETURN(const FileLock lock, LockFolderOf(ring_path));
  CAIRN_ASSIGN_OR_RETURN(KeyRingFile current, ReadKeyRing(ring_path));
  const uint64_t version = current.ring.version;
  bool is_known = false;  // the robot's own is among those that are given
  for (const std::string& path : next_paths) {
    CAIRN_ASSIGN_OR_RETURN(KeyRingFile next, ReadKeyRing(path));
    if (next.ring.version < version) continue;
    if (next.text == current.text) {
      is_known = true;
      continue;
    }
    if (next.ring.version == current.ring.version) {
      return MakeError(ErrorCode::kNotNewer,
                       "{}: is ring {}, as {} is, and is another: a version has one ring; make the next one",
                       path, next.ring.version,
                       current.ring.version == version ? ring_path : "the one before it");
    }
    CAIRN_ASSIGN_OR_RETURN(const SignatureList signatures, ReadSignaturesIfThere(SignaturesPath(path)));
    CAIRN_RETURN_IF_ERROR(CheckNextKeyRing(current.ring, next, signatures, path));
    current = std::move(next);  // [TUF §5.3.7: set the trusted root to the new one]
  }
  if (current.ring.version == version && !is_known) {
    return MakeError(ErrorCode::kNotNewer,
                     "{}: is earlier than {}, which is ring {}: a robot goes only forward", next_paths.back(),
                     ring_path, version);
  }
  // [TUF §5.3.8: persist it]; differs: once, when all are checked, as none between counts for anything else.
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(ring_path, current.text));
  return current.ring;
}

}  // namespace cairn
