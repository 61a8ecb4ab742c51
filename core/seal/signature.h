#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/seal/signing_key.h"

namespace cairn {

// The Ed25519 signature of `bytes`: whatever cairn signs, it signs here.  Checked with the public key before
// anybody sees it.  Errors: Corrupt (PublicKeyOf); Failed (it is not what the public key accepts: the machine
// miscalculates).
Result<Signature> SignBytes(std::string_view bytes, const SecretKey& key);

// Whether `signature` is that of `bytes` with `required`, or, without it, with `public_key`; both zero: not
// signed.  `remedy` ends the message where a signature is missing.  Errors: NotSigned (required only),
// WrongKey.
Status CheckSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature,
                        const std::string& path, const std::optional<PublicKey>& required,
                        const char* remedy);

}  // namespace cairn
