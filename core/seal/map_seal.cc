#include "core/seal/map_seal.h"

#include <fcntl.h>
#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "core/base/blob.h"
#include "core/files/database.h"
#include "core/files/file_descriptor.h"
#include "core/files/input_file.h"
#include "core/files/write_error.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

static_assert(sizeof(crypto_generichash_state) <= 384);

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
  // `flags`: O_RDONLY or O_RDWR.
  static Result<SealedFile> Open(const std::string& path, int flags) {
    CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
    SealedFile file(path, open(path.c_str(), flags | O_NONBLOCK | O_CLOEXEC));
    if (file.descriptor_->get() < 0) return file.ReadError();
    std::string head(131072, '\0');
    CAIRN_ASSIGN_OR_RETURN(const size_t num_read, file.ReadAt(0, &head));
    head.resize(num_read);
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
    size_t num_written = 0;
    while (num_written < bytes.size()) {
      const ssize_t more = pwrite(descriptor_->get(), bytes.data() + num_written, bytes.size() - num_written,
                                  static_cast<off_t>(offset_ + num_written));
      if (more < 0 && errno == EINTR) continue;
      if (more < 0) return WriteError(path_, "its seal cannot be written", errno);
      num_written += static_cast<size_t>(more);
    }
    return Ok();
  }

  // Hash of all bytes, with those from the file hash to the end of the seal taken as zero, and `seal`'s bytes
  // before them.
  Result<Hash> HashFile(const Seal& seal) const {
    const std::string head =
        EncodeSeal(seal).substr(0, kFileOffset) + std::string(Seal::kNumBytes - kFileOffset, '\0');
    Hasher hasher;
    std::string chunk(1 << 20, '\0');
    size_t position = 0;
    while (true) {
      CAIRN_ASSIGN_OR_RETURN(const size_t num_read, ReadAt(position, &chunk));
      if (num_read == 0) return hasher.Finish();
      const size_t begin = std::max(position, offset_);
      const size_t end = std::min(position + num_read, offset_ + head.size());
      if (begin < end) chunk.replace(begin - position, end - begin, head, begin - offset_, end - begin);
      hasher.Add(std::string_view(chunk).substr(0, num_read));
      position += num_read;
    }
  }

 private:
  SealedFile(std::string path, int descriptor)
      : path_(std::move(path)), descriptor_(std::make_unique<FileDescriptor>(descriptor)) {}

  Error ReadError() const {
    return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path_, std::strerror(errno));
  }

  // Fills `chunk` from there on, as far as the file goes; returns how far.
  Result<size_t> ReadAt(size_t position, std::string* chunk) const {
    size_t num_read = 0;
    while (num_read < chunk->size()) {
      const ssize_t more = pread(descriptor_->get(), chunk->data() + num_read, chunk->size() - num_read,
                                 static_cast<off_t>(position + num_read));
      if (more < 0 && errno == EINTR) continue;
      if (more < 0) return ReadError();
      if (more == 0) break;
      num_read += static_cast<size_t>(more);
    }
    return num_read;
  }

  std::string path_;
  std::unique_ptr<FileDescriptor> descriptor_;
  size_t offset_ = 0;
  std::string bytes_;
};

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
  CAIRN_ASSIGN_OR_RETURN(SealedFile file, SealedFile::Open(path, O_RDWR));
  Seal seal{.root = root};
  CAIRN_ASSIGN_OR_RETURN(seal.file, file.HashFile(seal));
  return file.Write(seal);
}

Status SignFile(const std::string& path, const Hash& root, const SecretKey& key) {
  CAIRN_ASSIGN_OR_RETURN(SealedFile file, SealedFile::Open(path, O_RDWR));
  Seal seal{.root = root};
  CAIRN_ASSIGN_OR_RETURN(seal.public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(seal.file, file.HashFile(seal));
  CAIRN_ASSIGN_OR_RETURN(seal.signature, SignBytes(SignedBytesOf(seal), key));
  return file.Write(seal);
}

Result<Seal> ReadSeal(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const SealedFile file, SealedFile::Open(path, O_RDONLY));
  return DecodeSeal(file.bytes());
}

Status CheckFileHash(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SealedFile file, SealedFile::Open(path, O_RDONLY));
  CAIRN_ASSIGN_OR_RETURN(const Seal seal, DecodeSeal(file.bytes()));
  CAIRN_ASSIGN_OR_RETURN(const Hash found, file.HashFile(seal));
  if (found == seal.file) return Ok();
  return MakeError(
      ErrorCode::kCorrupt,
      "{}: its bytes have the hash {}, but {} is sealed: it was damaged or changed; copy it again", path,
      HexOf(found), HexOf(seal.file));
}

std::string SignedBytesOf(const Seal& seal) { return EncodeSeal(seal).substr(0, kSignedBytes); }

Status CheckSignature(const Seal& seal, const std::string& path, const std::optional<KeyRing>& required,
                      const std::optional<SignatureList>& others) {
  return CheckSignatureOf(SignedBytesOf(seal), seal.public_key, seal.signature, path, required,
                          "sign it with `cairn sign`", others);
}

}  // namespace cairn
