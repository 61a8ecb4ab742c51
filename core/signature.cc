#include "core/signature.h"

#include <sodium.h>

namespace cairn {

Status CheckSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature,
                        const std::string& path, const std::optional<PublicKey>& required,
                        const char* remedy) {
  if (public_key == PublicKey() && signature == Signature()) {
    if (!required) return Ok();
    return MakeError(ErrorCode::kNotSigned, "{}: is not signed, and a signature of key {} is required; {}",
                     path, HexOf(*required), remedy);
  }
  if (required && public_key != *required) {
    return MakeError(ErrorCode::kWrongKey, "{}: is signed with key {}, but {} is required", path,
                     HexOf(public_key), HexOf(*required));
  }
  if (crypto_sign_verify_detached(signature.data(), reinterpret_cast<const uint8_t*>(bytes.data()),
                                  bytes.size(), public_key.data()) == 0) {
    return Ok();
  }
  return MakeError(ErrorCode::kWrongKey, "{}: its signature is not that of key {}: it was changed since",
                   path, HexOf(public_key));
}

}  // namespace cairn
