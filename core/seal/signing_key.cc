#include "core/seal/signing_key.h"

#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/files/replacement.h"
#include "core/seal/key_text.h"

namespace cairn {
namespace {

static_assert(crypto_sign_PUBLICKEYBYTES == 32 && crypto_sign_SECRETKEYBYTES == 64 &&
              crypto_sign_SEEDBYTES == 32 && crypto_sign_BYTES == 64);

constexpr size_t kNumSecretDigits = 2 * crypto_sign_SECRETKEYBYTES;
constexpr size_t kNumPublicDigits = 2 * crypto_sign_PUBLICKEYBYTES;

// Longer than any key: a file of more is not one.
constexpr size_t kMaxKeyBytes = 511;
constexpr const char* kKeyFile = "a key from `cairn keygen`";

// The line of a secret key's file, overwritten when it is destroyed.
struct SecretLine {
  ~SecretLine() { sodium_memzero(characters.data(), characters.size()); }
  std::array<char, kNumSecretDigits + 1> characters = {};
};

void InitializeSodium() {
  static const int initialized = sodium_init();
  (void)initialized;
}

Error NotAKey(const std::string& path, const char* what, size_t size, size_t num_digits) {
  return MakeError(ErrorCode::kCorrupt,
                   "{}: not a {}: {} characters, expected {} hexadecimal digits; restore it from a backup",
                   path, what, size, num_digits);
}

}  // namespace

SecretKey::~SecretKey() { sodium_memzero(data(), size()); }

KeyPair MakeKeyPair() {
  InitializeSodium();
  KeyPair keys;
  crypto_sign_keypair(keys.public_key.data(), keys.secret_key.data());
  return keys;
}

Status WriteKeyPair(const KeyPair& keys, const std::string& path) {
  const std::string public_path = path + ".pub";
  for (const std::string& file : {path, public_path}) {
    struct stat status = {};
    if (lstat(file.c_str(), &status) == 0)
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: already exists; keys are not overwritten: choose another name", file);
  }
  SecretLine line;
  sodium_bin2hex(line.characters.data(), line.characters.size(), keys.secret_key.data(),
                 keys.secret_key.size());
  line.characters.back() = '\n';
  CAIRN_ASSIGN_OR_RETURN(Replacement secret_file, Replacement::Begin(path, 0600));
  CAIRN_RETURN_IF_ERROR(secret_file.Write({line.characters.data(), line.characters.size()}));
  CAIRN_ASSIGN_OR_RETURN(Replacement public_file, Replacement::Begin(public_path));
  CAIRN_RETURN_IF_ERROR(public_file.Write(HexOf(keys.public_key) + "\n"));
  Status status = public_file.FinishNew();
  if (status.ok()) status = secret_file.FinishNew();
  // Half of a pair that nobody has used yet is useless, and would block the next one.
  if (public_file.is_in_place() && !secret_file.is_in_place()) unlink(public_path.c_str());
  return status;
}

Result<SecretKey> ReadSecretKey(const std::string& path) {
  KeyText text;
  CAIRN_RETURN_IF_ERROR(text.Read(
      path, kKeyFile, kMaxKeyBytes, 077,
      fmt::format(
          "a secret key of mode 0600; `chmod 600 {}`, and make a new key if somebody may have read it",
          path)));
  const std::string_view digits = text.trimmed();
  if (digits.size() == kNumPublicDigits && IsHex(digits)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a public key; sign with the secret one, which `cairn keygen KEY` wrote as KEY",
                     path);
  }
  if (digits.size() != kNumSecretDigits || !IsHex(digits))
    return NotAKey(path, "secret key", digits.size(), kNumSecretDigits);
  SecretKey key;
  DecodeHex(digits, key.data(), key.size());
  if (const Result<PublicKey> derived = PublicKeyOf(key); !derived.ok())
    return Corrupt(path, "{}", derived.error().message);
  return key;
}

Result<PublicKey> ReadPublicKey(const std::string& path) {
  KeyText text;  // it may hold a secret key
  CAIRN_RETURN_IF_ERROR(text.Read(path, kKeyFile, kMaxKeyBytes, 0, ""));
  return PublicKeyOfText(text.trimmed(), path);
}

Result<PublicKey> PublicKeyOfText(std::string_view text, const std::string& path) {
  if (text.size() == kNumSecretDigits && IsHex(text)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a secret key, expected a public one; give {}.pub, and keep this one off robots",
                     path, path);
  }
  if (text.size() != kNumPublicDigits || !IsHex(text))
    return NotAKey(path, "public key", text.size(), kNumPublicDigits);
  PublicKey key;
  DecodeHex(text, key.data(), key.size());
  return key;
}

Result<PublicKey> PublicKeyOf(const SecretKey& key) {
  InitializeSodium();
  PublicKey derived;
  SecretKey whole;
  crypto_sign_seed_keypair(derived.data(), whole.data(), key.data());
  if (sodium_memcmp(whole.data(), key.data(), key.size()) == 0) return derived;
  return MakeError(
      ErrorCode::kCorrupt,
      "the secret key is damaged: its public half does not follow from its seed; nothing is signed "
      "with it; restore it from a backup");
}

std::string HexOf(const PublicKey& key) { return HexOfBytes(key.data(), key.size()); }

}  // namespace cairn
