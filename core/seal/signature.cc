#include "core/seal/signature.h"

#include <sodium.h>

namespace cairn {
namespace {

bool IsSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature) {
  return crypto_sign_verify_detached(signature.data(), reinterpret_cast<const uint8_t*>(bytes.data()),
                                     bytes.size(), public_key.data()) == 0;
}

}  // namespace

// A signature uses both halves of the key.  Two signatures of the same bytes, one made with a public half
// that does not belong to the seed, reveal the secret key: so neither half is trusted, and the result
// is checked.
Result<Signature> SignBytes(std::string_view bytes, const SecretKey& key) {
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  Signature signature;
  crypto_sign_detached(signature.data(), nullptr, reinterpret_cast<const uint8_t*>(bytes.data()),
                       bytes.size(), key.data());
  if (IsSignatureOf(bytes, public_key, signature)) return signature;
  return MakeError(
      ErrorCode::kFailed,
      "a signature that was just made is not valid for key {}: this machine miscalculates; nothing is signed",
      HexOf(public_key));
}

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
  if (IsSignatureOf(bytes, public_key, signature)) return Ok();
  return MakeError(ErrorCode::kWrongKey, "{}: its signature is not valid for key {}: it was changed since",
                   path, HexOf(public_key));
}

}  // namespace cairn
