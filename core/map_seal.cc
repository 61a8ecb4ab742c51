#include "core/map_seal.h"

#include <sodium.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>

#include "core/blob.h"
#include "core/database.h"
#include "core/file.h"
#include "core/input_file.h"
#include "core/map_file.h"
#include "core/signature.h"
#include "core/write_error.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

static_assert(sizeof(crypto_generichash_state) <= 384);
static_assert(crypto_sign_PUBLICKEYBYTES == 32 && crypto_sign_SECRETKEYBYTES == 64 &&
              crypto_sign_BYTES == 64);

constexpr std::string_view kMagic("cairn map seal 2", 16);
constexpr size_t kRootOffset = 16;
constexpr size_t kFileOffset = 48;   // from here to the end: zero while the file is hashed
constexpr size_t kSignedBytes = 80;  // magic, root, file

crypto_generichash_state* StateOf(std::array<uint8_t, 384>* bytes) {
  return reinterpret_cast<crypto_generichash_state*>(bytes->data());
}

// A map file open for its seal.
class SealedFile {
 public:
  static Result<SealedFile> Open(const std::string& path, const char* mode) {
    SealedFile file;
    CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
    file.path_ = path;
    file.file_.reset(std::fopen(path.c_str(), mode));
    if (!file.file_) return MakeError(ErrorCode::kIo, "{}: cannot be opened: {}", path, std::strerror(errno));
    std::string head(131072, '\0');
    head.resize(std::fread(head.data(), 1, head.size(), file.file_.get()));
    const size_t page_size = ParseSqliteHeader(head).page_size;
    const std::string_view page =
        std::string_view(head).substr(std::min(page_size, head.size())).substr(0, page_size);
    const size_t found = page.find(kMagic);
    if (found == std::string_view::npos || page.find(kMagic, found + 1) != std::string_view::npos ||
        found + Seal::kNumBytes > page.size()) {
      return MakeError(ErrorCode::kCorrupt, "{}: page 2 has no seal; is it a whole map of format 2?", path);
    }
    file.offset_ = page_size + found;
    file.bytes_ = page.substr(found, Seal::kNumBytes);
    return file;
  }

  const std::string& bytes() const { return bytes_; }

  Status Write(const Seal& seal) {
    const std::string bytes = EncodeSeal(seal);
    if (std::fseek(file_.get(), static_cast<long>(offset_), SEEK_SET) != 0 ||
        std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size() ||
        std::fflush(file_.get()) != 0) {
      return WriteError(path_, "its seal cannot be written", errno);
    }
    return Ok();
  }

  // Of all bytes, those from the file hash to the end of the seal taken as zero; the seal's head as `head`.
  Result<Hash> HashFile(const Seal& seal) {
    const std::string head =
        EncodeSeal(seal).substr(0, kFileOffset) + std::string(Seal::kNumBytes - kFileOffset, '\0');
    Hasher hasher;
    std::string chunk(1 << 20, '\0');
    std::rewind(file_.get());
    size_t position = 0;
    for (size_t num_read; (num_read = std::fread(chunk.data(), 1, chunk.size(), file_.get())) > 0;) {
      const size_t begin = std::max(position, offset_);
      const size_t end = std::min(position + num_read, offset_ + head.size());
      if (begin < end) chunk.replace(begin - position, end - begin, head, begin - offset_, end - begin);
      hasher.Add(std::string_view(chunk).substr(0, num_read));
      position += num_read;
    }
    if (std::ferror(file_.get()) != 0) return MakeError(ErrorCode::kIo, "{}: reading failed", path_);
    return hasher.Finish();
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
  size_t offset_ = 0;
  std::string bytes_;
};

template <size_t kSize>
std::string Hex(const std::array<uint8_t, kSize>& bytes) {
  std::string text;
  for (const uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

template <size_t kSize>
Result<std::array<uint8_t, kSize>> ReadHex(const std::string& path, const char* what) {
  CAIRN_ASSIGN_OR_RETURN(std::string text, ReadFile(path));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  std::array<uint8_t, kSize> bytes;
  size_t num_bytes = 0;
  const char* end = nullptr;
  if (text.size() != 2 * kSize ||
      sodium_hex2bin(bytes.data(), kSize, text.data(), text.size(), nullptr, &num_bytes, &end) != 0 ||
      num_bytes != kSize) {
    return MakeError(ErrorCode::kCorrupt, "{}: not a {}: {} characters, expected {} hexadecimal digits", path,
                     what, text.size(), 2 * kSize);
  }
  return bytes;
}

}  // namespace

Hasher::Hasher() {
  static const int initialized = sodium_init();  // chooses the fastest code of the processor
  (void)initialized;
  crypto_generichash_init(StateOf(&state_), nullptr, 0, Hash().size());
}

void Hasher::Add(std::string_view bytes) {
  crypto_generichash_update(StateOf(&state_), reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
}

void Hasher::Add(uint64_t number) {
  BlobWriter writer;
  writer.UInt64(number);
  Add(writer.Take());
}

Hash Hasher::Finish() {
  Hash hash;
  crypto_generichash_final(StateOf(&state_), hash.data(), hash.size());
  return hash;
}

Hash HashOf(std::string_view bytes) {
  Hasher hasher;
  hasher.Add(bytes);
  return hasher.Finish();
}

std::string EncodeSeal(const Seal& seal) {
  BlobWriter writer;
  writer.Bytes(kMagic);
  writer.Bytes(seal.root.data(), seal.root.size());
  writer.Bytes(seal.file.data(), seal.file.size());
  writer.Bytes(seal.public_key.data(), seal.public_key.size());
  writer.Bytes(seal.signature.data(), seal.signature.size());
  return writer.Take();
}

Result<Seal> DecodeSeal(std::string_view bytes) {
  BlobReader reader(bytes);
  if (bytes.size() != Seal::kNumBytes || reader.Bytes(kMagic.size()) != kMagic) {
    return MakeError(ErrorCode::kCorrupt, "a seal of {} bytes without its magic", bytes.size());
  }
  Seal seal;
  const auto read = [&](auto* field) {
    std::memcpy(field->data(), reader.Bytes(field->size()).data(), field->size());
  };
  read(&seal.root);
  read(&seal.file);
  read(&seal.public_key);
  read(&seal.signature);
  return seal;
}

Status SealFile(const std::string& path, const Hash& root) {
  CAIRN_ASSIGN_OR_RETURN(SealedFile file, SealedFile::Open(path, "r+b"));
  Seal seal{.root = root};
  CAIRN_ASSIGN_OR_RETURN(seal.file, file.HashFile(seal));
  return file.Write(seal);
}

Result<Seal> ReadSeal(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const SealedFile file, SealedFile::Open(path, "rb"));
  return DecodeSeal(file.bytes());
}

Status CheckFileHash(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SealedFile file, SealedFile::Open(path, "rb"));
  CAIRN_ASSIGN_OR_RETURN(const Seal seal, DecodeSeal(file.bytes()));
  CAIRN_ASSIGN_OR_RETURN(const Hash found, file.HashFile(seal));
  if (found == seal.file) return Ok();
  return MakeError(
      ErrorCode::kCorrupt,
      "{}: its bytes have the hash {}, but {} is sealed: it was damaged or changed; copy it again", path,
      Hex(found), Hex(seal.file));
}

Status CheckSignature(const Seal& seal, const std::string& path, const std::optional<PublicKey>& required) {
  return CheckSignatureOf(EncodeSeal(seal).substr(0, kSignedBytes), seal.public_key, seal.signature, path,
                          required, "sign it with `cairn sign`");
}

KeyPair MakeKeyPair() {
  const Hasher initializes_sodium;
  KeyPair keys;
  crypto_sign_keypair(keys.public_key.data(), keys.secret_key.data());
  return keys;
}

Status WriteKeyPair(const KeyPair& keys, const std::string& path) {
  for (const std::string& file : {path, path + ".pub"}) {
    std::error_code error;
    if (!fs::exists(file, error)) continue;
    return MakeError(ErrorCode::kInvalidArgument, "{}: exists already; keys are not overwritten", file);
  }
  CAIRN_RETURN_IF_ERROR(ReplaceFileAtomically(path, [&](const std::string& temporary) -> Status {
    const mode_t mask = umask(0077);
    const Status status = WriteFileAtomically(temporary, Hex(keys.secret_key) + "\n");
    umask(mask);
    return status;
  }));
  return WriteFileAtomically(path + ".pub", HexOf(keys.public_key) + "\n");
}

Result<SecretKey> ReadSecretKey(const std::string& path) { return ReadHex<64>(path, "secret key"); }

Result<PublicKey> ReadPublicKey(const std::string& path) { return ReadHex<32>(path, "public key"); }

std::string HexOf(const PublicKey& key) { return Hex(key); }

Status SignMap(const std::string& path, const SecretKey& key, const std::string& signed_path) {
  CAIRN_RETURN_IF_ERROR(MapFile::Open(path, {}));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(path));
  CAIRN_ASSIGN_OR_RETURN(Seal seal, ReadSeal(path));
  std::copy(key.end() - 32, key.end(), seal.public_key.begin());
  const std::string bytes = EncodeSeal(seal);
  crypto_sign_detached(seal.signature.data(), nullptr, reinterpret_cast<const uint8_t*>(bytes.data()),
                       kSignedBytes, key.data());
  return ReplaceFileAtomically(signed_path, [&](const std::string& temporary) -> Status {
    std::error_code error;
    if (!fs::copy_file(path, temporary, error)) {
      return WriteError(signed_path, "cannot be written", error.value());
    }
    fs::permissions(temporary, fs::perms::owner_write, fs::perm_options::add, error);
    CAIRN_ASSIGN_OR_RETURN(SealedFile file, SealedFile::Open(temporary, "r+b"));
    return file.Write(seal);
  });
}

}  // namespace cairn
