#pragma once

#include <compare>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/seal/signing_key.h"

namespace cairn {

// Signatures of one thing by several keys.  They lie in a file beside it, so that it stays as it is and
// several people sign on several machines: a line for each, public key and signature in hexadecimal, one
// space between them; lines that begin with '#' and empty ones are comments.  Files are joined one behind the
// other, in any order.  What is signed begins with words of its kind, so that a signature of one kind of file
// is none of another.
struct KeySignature {
  PublicKey public_key = {};
  Signature signature = {};
  auto operator<=>(const KeySignature&) const = default;
};
using SignatureList = std::vector<KeySignature>;

// Bounds of a file, checked before it is taken apart.
inline constexpr size_t kMaxSignatures = 256;
inline constexpr size_t kMaxSignatureBytes = 65536;

// Where the signatures of a map, a key ring or an atlas are: "kitchen.cairn.signatures".  A map and the one
// that it replaced have one file: "kitchen.cairn.previous" has "kitchen.cairn.signatures" too, and so no
// moment of an exchange parts a map from its signatures.  Where the path is a link, beside the file that it
// leads to.
std::string SignaturesPath(const std::string& path);

// In ascending order, each once.  `path` is for messages.  Errors: Corrupt (a line that is no signature, cut
// off), InvalidArgument (more than the bounds; a secret key in it).
Result<SignatureList> DecodeSignatures(std::string_view text, const std::string& path);
std::string EncodeSignatures(SignatureList signatures);
// Errors: also NotFound, Io; InvalidArgument (not a regular file).
Result<SignatureList> ReadSignatures(const std::string& path);
// The same; empty where there is no file.
Result<SignatureList> ReadSignaturesIfThere(const std::string& path);

// Adds the signature of `bytes` by this key to those that a file has, or makes the file.  The order in which
// keys sign does not change the file.  Errors: as ReadSignatures, SignBytes and WriteFileAtomically.
Status AddSignature(std::string_view bytes, const SecretKey& key, const std::string& signatures_path);

// Those that are valid signatures of `bytes`, whosever.
SignatureList ValidSignatures(std::string_view bytes, const SignatureList& signatures);

}  // namespace cairn
