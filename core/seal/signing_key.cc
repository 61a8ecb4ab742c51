#include "core/seal/signing_key.h"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "core/files/file_descriptor.h"
#include "core/files/replacement.h"

namespace cairn {
namespace {

static_assert(crypto_sign_PUBLICKEYBYTES == 32 && crypto_sign_SECRETKEYBYTES == 64 &&
              crypto_sign_SEEDBYTES == 32 && crypto_sign_BYTES == 64);

constexpr size_t kNumSecretDigits = 2 * crypto_sign_SECRETKEYBYTES;
constexpr size_t kNumPublicDigits = 2 * crypto_sign_PUBLICKEYBYTES;

// A text that is overwritten when it is destroyed.  Longer than any key: a file that fills it is not a key.
struct SecretText {
  ~SecretText() { sodium_memzero(characters.data(), characters.size()); }
  std::array<char, 512> characters = {};
  size_t size = 0;
  std::string_view view() const { return {characters.data(), size}; }
};

void InitializeSodium() {
  static const int initialized = sodium_init();
  (void)initialized;
}

bool IsHex(std::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](unsigned char character) { return std::isxdigit(character) != 0; });
}

// The text of a key's file without white space at its end.  Never waits for a pipe.
Status ReadKeyText(const std::string& path, bool is_secret, SecretText* text) {
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat status = {};
  if (file.get() < 0 || fstat(file.get(), &status) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
    return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(errno));
  }
  if (!S_ISREG(status.st_mode)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: not a regular file, expected a key from `cairn keygen`", path);
  }
  if (is_secret && (status.st_mode & 077) != 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: users other than its owner may use it (mode {:04o}), expected a secret key of mode "
                     "0600; `chmod 600 {}`, and make a new key if somebody may have read it",
                     path, status.st_mode & 07777, path);
  }
  while (text->size < text->characters.size()) {
    const ssize_t num_read =
        read(file.get(), text->characters.data() + text->size, text->characters.size() - text->size);
    if (num_read < 0 && errno == EINTR) continue;
    if (num_read < 0) return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(errno));
    if (num_read == 0) break;
    text->size += static_cast<size_t>(num_read);
  }
  while (text->size > 0 && std::isspace(static_cast<unsigned char>(text->characters[text->size - 1])) != 0)
    --text->size;
  return Ok();
}

// REQUIRES: 2 * kNumBytes hexadecimal digits
template <size_t kNumBytes>
void Decode(std::string_view digits, std::array<uint8_t, kNumBytes>* bytes) {
  sodium_hex2bin(bytes->data(), kNumBytes, digits.data(), digits.size(), nullptr, nullptr, nullptr);
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
  SecretText text;
  sodium_bin2hex(text.characters.data(), text.characters.size(), keys.secret_key.data(),
                 keys.secret_key.size());
  text.characters[kNumSecretDigits] = '\n';
  text.size = kNumSecretDigits + 1;
  CAIRN_ASSIGN_OR_RETURN(Replacement secret_file, Replacement::Begin(path, 0600));
  CAIRN_RETURN_IF_ERROR(secret_file.Write(text.view()));
  CAIRN_ASSIGN_OR_RETURN(Replacement public_file, Replacement::Begin(public_path));
  CAIRN_RETURN_IF_ERROR(public_file.Write(HexOf(keys.public_key) + "\n"));
  Status status = public_file.FinishNew();
  if (status.ok()) status = secret_file.FinishNew();
  // Half of a pair that nobody has used yet is useless, and would block the next one.
  if (public_file.is_in_place() && !secret_file.is_in_place()) unlink(public_path.c_str());
  return status;
}

Result<SecretKey> ReadSecretKey(const std::string& path) {
  SecretText text;
  CAIRN_RETURN_IF_ERROR(ReadKeyText(path, /*is_secret=*/true, &text));
  if (text.size == kNumPublicDigits && IsHex(text.view())) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a public key; sign with the secret one, which `cairn keygen KEY` wrote as KEY",
                     path);
  }
  if (text.size != kNumSecretDigits || !IsHex(text.view()))
    return NotAKey(path, "secret key", text.size, kNumSecretDigits);
  SecretKey key;
  Decode<64>(text.view(), &key);
  if (const Result<PublicKey> derived = PublicKeyOf(key); !derived.ok())
    return Corrupt(path, "{}", derived.error().message);
  return key;
}

Result<PublicKey> ReadPublicKey(const std::string& path) {
  SecretText text;  // it may hold a secret key
  CAIRN_RETURN_IF_ERROR(ReadKeyText(path, /*is_secret=*/false, &text));
  if (text.size == kNumSecretDigits && IsHex(text.view())) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a secret key, expected a public one; give {}.pub, and keep this one off robots",
                     path, path);
  }
  if (text.size != kNumPublicDigits || !IsHex(text.view()))
    return NotAKey(path, "public key", text.size, kNumPublicDigits);
  PublicKey key;
  Decode(text.view(), &key);
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

std::string HexOf(const PublicKey& key) {
  std::string text;
  for (const uint8_t byte : key) text += fmt::format("{:02x}", byte);
  return text;
}

}  // namespace cairn
