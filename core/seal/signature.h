#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/seal/signing_key.h"

namespace cairn {

// The Ed25519 signature of `bytes`: everything that cairn signs is signed here.  Checked with the public key
// before it is returned.  Errors: Corrupt (PublicKeyOf); Failed (the public key does not accept it: the
// machine miscalculates).
Result<Signature> SignBytes(std::string_view bytes, const SecretKey& key);

// Whether `signature` of `bytes` is by `required` or, without it, by `public_key`; both zero: not signed.
// `remedy` ends the message where a signature is missing.  Errors: NotSigned (required only), WrongKey.
Status CheckSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature,
                        const std::string& path, const std::optional<PublicKey>& required,
                        const char* remedy);

}  // namespace cairn
