#include "core/seal/signature.h"

#include <sodium.h>

#include <algorithm>

#include "core/files/output_path.h"

namespace cairn {
namespace {

// "alice, bob"; of a public key alone its digits.
std::string NamesText(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string KeyNameOf(const KeyRing::Key& key) { return key.name.empty() ? HexOf(key.public_key) : key.name; }

// Says which signatures of a ring are missing.  `signers`: those that are there, fewer than it wants.
Error TooFewSignatures(const std::string& path, const PublicKey& public_key, const KeyRing& ring,
                       const std::vector<std::string>& signers) {
  if (ring.is_single_key()) {
    return MakeError(ErrorCode::kWrongKey, "{}: is signed with key {}, but {} is required", path,
                     HexOf(public_key), HexOf(ring.keys.front().public_key));
  }
  if (signers.empty()) {
    return MakeError(
        ErrorCode::kWrongKey,
        "{}: is signed with key {}, but {} of the {} keys of {} are required and none has signed it", path,
        HexOf(public_key), ring.threshold, ring.keys.size(), ring.Description());
  }
  std::vector<std::string> missing;
  for (const KeyRing::Key& key : ring.keys) {
    if (std::find(signers.begin(), signers.end(), KeyNameOf(key)) == signers.end())
      missing.push_back(KeyNameOf(key));
  }
  return MakeError(ErrorCode::kNotSigned,
                   "{}: {} of the {} signatures that {} requires: by {}; not by {}, of whom {} more must "
                   "sign, with `cairn sign "
                   "--add`",
                   path, signers.size(), ring.threshold, ring.Description(), NamesText(signers),
                   NamesText(missing), static_cast<size_t>(ring.threshold) - signers.size());
}

}  // namespace

bool IsSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature) {
  return crypto_sign_verify_detached(signature.data(), reinterpret_cast<const uint8_t*>(bytes.data()),
                                     bytes.size(), public_key.data()) == 0;
}

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

std::vector<std::string> SignersOf(std::string_view bytes, const SignatureList& signatures,
                                   const KeyRing& ring) {
  std::vector<std::string> signers;
  for (const KeyRing::Key& key : ring.keys) {
    if (std::any_of(signatures.begin(), signatures.end(), [&](const KeySignature& of) {
          return of.public_key == key.public_key && IsSignatureOf(bytes, of.public_key, of.signature);
        }))
      signers.push_back(KeyNameOf(key));
  }
  return signers;
}

Status CheckSignatureOf(std::string_view bytes, const PublicKey& public_key, const Signature& signature,
                        const std::string& path, const std::optional<KeyRing>& required, const char* remedy,
                        const std::optional<SignatureList>& others) {
  if (required) {
    if (const Status status = CheckKeyRing(*required); !status.ok())
      return MakeError(status.error().code, "{}: whom to trust: {}", path, status.error().message);
  }
  if (public_key == PublicKey() && signature == Signature()) {
    if (!required) return Ok();
    return MakeError(ErrorCode::kNotSigned, "{}: is not signed, and a signature of {} is required; {}", path,
                     required->Description(), remedy);
  }
  const bool is_trusted_key = !required || required->Find(public_key) != nullptr;
  if (!IsSignatureOf(bytes, public_key, signature)) {
    return MakeError(ErrorCode::kWrongKey, "{}: its signature is not valid for key {}: it was changed since",
                     path, HexOf(public_key));
  }
  if (!required || (is_trusted_key && required->threshold == 1)) return Ok();
  SignatureList signatures = {{public_key, signature}};
  if (others) {
    signatures.insert(signatures.end(), others->begin(), others->end());
  } else {
    CAIRN_ASSIGN_OR_RETURN(const SignatureList beside, ReadSignaturesIfThere(SignaturesPath(FileOf(path))));
    signatures.insert(signatures.end(), beside.begin(), beside.end());
  }
  const std::vector<std::string> signers = SignersOf(bytes, signatures, *required);
  if (signers.size() >= static_cast<size_t>(required->threshold)) return Ok();
  return TooFewSignatures(path, public_key, *required, signers);
}

std::optional<KeyRing> AnyKeyOf(std::optional<KeyRing> ring) {
  if (ring) ring->threshold = std::min(ring->threshold, 1);  // one that is not allowed stays so
  return ring;
}

}  // namespace cairn
