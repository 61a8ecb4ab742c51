#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/blob.h"

struct XXH3_state_s;  // xxhash.h

namespace cairn {

// XXH3, 128 bits.  Not cryptographic.
struct ContentHash {
  uint64_t high = 0;
  uint64_t low = 0;
  friend auto operator<=>(const ContentHash&, const ContentHash&) = default;
};
ContentHash HashContents(std::string_view bytes);

// HashContents of contents that come in parts.
class PartsHasher {
 public:
  PartsHasher();
  void Add(std::string_view part);
  ContentHash Finish() const;

 private:
  std::unique_ptr<XXH3_state_s, void (*)(XXH3_state_s*)> state_;
};

// A hash as 16 bytes of a blob.
void WriteHash(const ContentHash& hash, BlobWriter* blob);
ContentHash ReadHash(BlobReader* reader);

// The hash of several things in turn.
class ContentHasher {
 public:
  ContentHasher& Text(std::string_view text);  // its length too
  ContentHasher& Hash(const ContentHash& hash);
  ContentHasher& UInt(uint64_t value);
  ContentHasher& Double(double value);  // its bits
  ContentHash Finish() { return HashContents(bytes_.Take()); }

 private:
  BlobWriter bytes_;
};

}  // namespace cairn
