#include "core/base/content_hash.h"

#include <xxhash.h>

#include <new>

namespace cairn {

ContentHash HashContents(std::string_view bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return {hash.high64, hash.low64};
}

PartsHasher::PartsHasher() : state_(XXH3_createState(), [](XXH3_state_s* state) { XXH3_freeState(state); }) {
  if (!state_) throw std::bad_alloc();
  XXH3_128bits_reset(state_.get());
}

void PartsHasher::Add(std::string_view part) { XXH3_128bits_update(state_.get(), part.data(), part.size()); }

ContentHash PartsHasher::Finish() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
  return {hash.high64, hash.low64};
}

void WriteHash(const ContentHash& hash, BlobWriter* blob) {
  blob->UInt64(hash.high);
  blob->UInt64(hash.low);
}

ContentHash ReadHash(BlobReader* reader) {
  const uint64_t high = reader->UInt64();
  return {high, reader->UInt64()};
}

ContentHasher& ContentHasher::Text(std::string_view text) {
  bytes_.UInt64(text.size());
  bytes_.Bytes(text);
  return *this;
}

ContentHasher& ContentHasher::Hash(const ContentHash& hash) { return UInt(hash.high).UInt(hash.low); }

ContentHasher& ContentHasher::UInt(uint64_t value) {
  bytes_.UInt64(value);
  return *this;
}

ContentHasher& ContentHasher::Double(double value) {
  bytes_.Float64(value);
  return *this;
}

}  // namespace cairn
