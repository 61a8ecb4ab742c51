#include "core/seal/signature_list.h"

#include <algorithm>
#include <iterator>

#include "core/files/file.h"
#include "core/seal/key_text.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

constexpr std::string_view kPreviousSuffix = ".previous";  // PreviousMapPath (runtime/map/update_map.h)

SignatureList InOrder(SignatureList signatures) {
  std::sort(signatures.begin(), signatures.end());
  signatures.erase(std::unique(signatures.begin(), signatures.end()), signatures.end());
  return signatures;
}

}  // namespace

std::string SignaturesPath(const std::string& path) {
  std::string_view map = path;
  if (map.ends_with(kPreviousSuffix)) map.remove_suffix(kPreviousSuffix.size());
  return std::string(map) + ".signatures";
}

Result<SignatureList> DecodeSignatures(std::string_view text, const std::string& path) {
  if (text.size() > kMaxSignatureBytes) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is larger than {} bytes; leave only the signatures of the keys that are trusted",
                     path, kMaxSignatureBytes);
  }
  SignatureList signatures;
  int num_lines = 0;
  while (!text.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const std::string_view line, NextLine(&text, &num_lines, path));
    if (line.empty() || line.starts_with('#')) continue;
    KeySignature signature;
    const size_t num_key_digits = 2 * signature.public_key.size();
    const size_t num_digits = 2 * signature.signature.size();
    if (line.size() == num_digits && IsHex(line)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: line {}: may be a secret key, and is no signature; take it out, and if it is one, make "
          "a new key: whoever has seen this file can sign with it",
          path, num_lines);
    }
    if (line.size() != num_key_digits + 1 + num_digits || line[num_key_digits] != ' ' ||
        !IsHex(line.substr(0, num_key_digits)) || !IsHex(line.substr(num_key_digits + 1))) {
      return MakeError(
          ErrorCode::kCorrupt,
          "{}: line {}: {} characters, expected a public key and a signature, {} and {} hexadecimal "
          "digits, as `cairn sign --add` writes them; copy it again",
          path, num_lines, line.size(), num_key_digits, num_digits);
    }
    if (signatures.size() == kMaxSignatures) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: has more than {} signatures; leave only those of the keys that are trusted", path,
                       kMaxSignatures);
    }
    DecodeHex(line.substr(0, num_key_digits), signature.public_key.data(), signature.public_key.size());
    DecodeHex(line.substr(num_key_digits + 1), signature.signature.data(), signature.signature.size());
    signatures.push_back(signature);
  }
  return InOrder(std::move(signatures));
}

std::string EncodeSignatures(SignatureList signatures) {
  std::string text;
  for (const KeySignature& signature : InOrder(std::move(signatures))) {
    text += HexOf(signature.public_key) + " " +
            HexOfBytes(signature.signature.data(), signature.signature.size()) + "\n";
  }
  return text;
}

Result<SignatureList> ReadSignatures(const std::string& path) {
  KeyText text;
  CAIRN_RETURN_IF_ERROR(text.Read(path, "signatures from `cairn sign --add`", kMaxSignatureBytes, 0, ""));
  return DecodeSignatures(text.view(), path);
}

Result<SignatureList> ReadSignaturesIfThere(const std::string& path) {
  Result<SignatureList> signatures = ReadSignatures(path);
  if (!signatures.ok() && signatures.error().code == ErrorCode::kNotFound) return SignatureList();
  return signatures;
}

Status AddSignature(std::string_view bytes, const SecretKey& key, const std::string& signatures_path) {
  CAIRN_ASSIGN_OR_RETURN(SignatureList signatures, ReadSignaturesIfThere(signatures_path));
  KeySignature added;
  CAIRN_ASSIGN_OR_RETURN(added.public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(added.signature, SignBytes(bytes, key));
  signatures.push_back(added);
  signatures = InOrder(std::move(signatures));
  if (signatures.size() > kMaxSignatures) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has {} signatures already, which is the most; take some out", signatures_path,
                     kMaxSignatures);
  }
  return WriteFileAtomically(signatures_path, EncodeSignatures(std::move(signatures)));
}

SignatureList ValidSignatures(std::string_view bytes, const SignatureList& signatures) {
  SignatureList valid;
  std::copy_if(signatures.begin(), signatures.end(), std::back_inserter(valid),
               [&](const KeySignature& of) { return IsSignatureOf(bytes, of.public_key, of.signature); });
  return valid;
}

}  // namespace cairn
