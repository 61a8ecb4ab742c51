#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/map_seal.h"

namespace cairn {

// Whether `signature` is that of `bytes` with `required`, or, without it, with `public_key`; both zero: not
// signed.  `remedy` ends the message where a signature is missing.  Errors: NotSigned (required only),
// WrongKey.
Status CheckSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature,
                        const std::string& path, const std::optional<PublicKey>& required,
                        const char* remedy);

}  // namespace cairn
