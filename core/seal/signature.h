#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/seal/key_ring.h"
#include "core/seal/signature_list.h"
#include "core/seal/signing_key.h"

namespace cairn {

// The Ed25519 signature of `bytes`: everything that cairn signs is signed here.  Checked with the public key
// before it is returned.  Errors: Corrupt (PublicKeyOf); Failed (the public key does not accept it: the
// machine miscalculates).
Result<Signature> SignBytes(std::string_view bytes, const SecretKey& key);

bool IsSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature);

// The names of the ring's keys that have signed `bytes`, in the ring's order, each once.  Signatures by other
// keys, of other bytes and false ones do not count.  [TUF21 §5.3: "verify that it has been signed by a
// threshold"]
std::vector<std::string> SignersOf(std::string_view bytes, const SignatureList& signatures,
                                   const KeyRing& ring);

// Whether a file's own `signature`, by `public_key`, is valid and, together with `others`, as many different
// keys of `required` have signed `bytes` as it wants; both zero: not signed.  Without `required` any key will
// do. `others`: none: those in its file of signatures, which are read only where the file's own does not
// suffice. `remedy` ends the message where there is no signature at all.  Errors: NotSigned (none, or too few
// keys of `required`; it says how many, and whose), WrongKey (false, or no key of `required`),
// InvalidArgument (CheckKeyRing), those of ReadSignatures.
Status CheckSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature,
                        const std::string& path, const std::optional<KeyRing>& required, const char* remedy,
                        const std::optional<SignatureList>& others = std::nullopt);

// What a single signature has to be by: any key of the ring.
std::optional<KeyRing> AnyKeyOf(std::optional<KeyRing> ring);

}  // namespace cairn
