#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/atlas/descriptor_code.h"
#include "core/base/error.h"
#include "core/seal/key_ring.h"
#include "core/seal/signing_key.h"

namespace cairn {

// The first half of Seal::root, as hard to forge.
using MapFingerprint = std::array<uint8_t, 16>;
MapFingerprint FingerprintOf(const std::array<uint8_t, 32>& root);

// One of an atlas's maps, and how it is told from the others.
struct AtlasMap {
  std::string name;  // MapHead::name; no two are alike
  std::string file;  // from the atlas's folder; or an absolute path
  MapFingerprint fingerprint = {};
  uint64_t num_bytes = 0;
  int64_t num_images = 0;
  // Codes of landmarks (core/atlas/descriptor_code.h), ascending, of each place: landmarks that are seen from
  // about the same images.  Neighbouring places lie side by side in the survey.
  std::vector<std::vector<uint32_t>> places;
};

// An image of one of the maps, by their indices.
struct AtlasImage {
  int32_t map = 0;
  int32_t image = 0;
  friend bool operator==(const AtlasImage&, const AtlasImage&) = default;
};

// Two images of different maps that could be taken for each other: what the first one shows has a fix in the
// second one's map, near that image.
struct AtlasLookAlike {
  AtlasImage image, other;
};

// A way from one map to another: a lift, a flight of stairs, a door.
struct AtlasPassage {
  std::string name;
  AtlasImage from, to;  // where it begins and ends; it can be gone both ways
  double cost = 1;      // as so much of what a way minimises (RouteOptions): by default so many links
};

// The contents of an atlas: many maps of a site in one file, which says in which of them an image was taken.
struct AtlasRows {
  std::string name;
  uint64_t epoch = 0;  // as MapHead::epoch
  PublicKey public_key = {};
  Signature signature = {};
  std::array<uint8_t, 32> payload_hash = {};  // of its file, once it was encoded or read
  CodeBook code_book;
  std::vector<AtlasMap> maps;
  std::vector<AtlasLookAlike> look_alikes;
  std::vector<AtlasPassage> passages;

  bool is_signed() const { return public_key != PublicKey() || signature != Signature(); }
};

// Bounds of what a reader allocates.
inline constexpr int kMaxAtlasMaps = 1 << 16;
inline constexpr int kMaxAtlasCodes = 1 << 22;

// The bytes of an atlas, schemas/atlas.md; with a key, signed, and `atlas` has key and signature afterwards.
// Errors: InvalidArgument (an index that refers to nothing, codes that do not ascend, too many of them, two
// maps of one name, a cost that is negative or not finite); Corrupt (the key: PublicKeyOf).
Result<std::string> EncodeAtlas(const std::optional<SecretKey>& key, AtlasRows* atlas);

// Reads an atlas and checks every byte of it, and its signature: those of `required`, or, without it, of the
// key that it names (CheckSignatureOf).  Errors: NotFound, Io, EmptyFile, Truncated, Corrupt, Unsupported
// (not an atlas, or of a later format), NotSigned (required only), WrongKey.
Result<AtlasRows> ReadAtlas(const std::string& path, const std::optional<KeyRing>& required);
// The bytes that the signatures of an atlas cover.  REQUIRES: it was encoded or read.
std::string SignedBytesOf(const AtlasRows& atlas);
// Adds this key's signature of an atlas that is signed to a file of signatures; the atlas stays as it is.
// Errors: as ReadAtlas and AddSignature; NotSigned; InvalidArgument (it has this key's already).
Status AddAtlasSignature(const std::string& path, const SecretKey& key, const std::string& signatures_path);

// Whether a file begins as an atlas does; false also where it cannot be read.
bool IsAtlasFile(const std::string& path);

// The bytes that these places' codes take in an atlas.
size_t NumBytesOfPlaces(const std::vector<std::vector<uint32_t>>& places);

}  // namespace cairn
