#include "core/atlas/atlas_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <string_view>

#include "core/base/blob.h"
#include "core/files/file.h"
#include "core/packing/map_codes.h"
#include "core/packing/range_coder.h"
#include "core/seal/map_seal.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

constexpr std::string_view kMagic = "cairn atlas    ";
constexpr char kFormat = '1';
constexpr size_t kMaxTextBytes = 4096;

// What the signature is of.
std::string SignedHead(const PublicKey& public_key, const Hash& payload_hash) {
  BlobWriter writer;
  writer.Bytes(kMagic);
  writer.UInt8(static_cast<uint8_t>(kFormat));
  writer.Bytes(payload_hash.data(), payload_hash.size());
  writer.Bytes(public_key.data(), public_key.size());
  return writer.Take();
}

// Codes of places as the steps between them.  One function writes and reads; when it reads, `places` has as
// many empty places as there are, and the decoder's ok() says whether they make sense.
template <typename Coder>
void CodePlaces(Coder* coder, std::vector<std::vector<uint32_t>>* places) {
  AdaptiveNumber sizes, steps;
  int64_t num_codes = 0;
  for (std::vector<uint32_t>& place : *places) {
    const uint64_t size = sizes.Code(*coder, place.size());
    num_codes += static_cast<int64_t>(size);
    if (!coder->ok() || size > static_cast<uint64_t>(kMaxAtlasCodes) || num_codes > kMaxAtlasCodes) return;
    place.resize(size);
    uint64_t next = 0;  // the least that may follow
    for (uint32_t& code : place) {
      const uint64_t value = next + steps.Code(*coder, uint64_t{code} - next);
      code = static_cast<uint32_t>(value);
      next = value + 1;
      if (value > std::numeric_limits<uint32_t>::max()) return;
    }
  }
}

std::string EncodePlaces(std::vector<std::vector<uint32_t>> places) {
  RangeEncoder encoder;
  CodePlaces(&encoder, &places);
  return encoder.Take();
}

bool AreAscending(const std::vector<std::vector<uint32_t>>& places) {
  return std::all_of(places.begin(), places.end(), [](const std::vector<uint32_t>& place) {
    return std::adjacent_find(place.begin(), place.end(), std::greater_equal<>()) == place.end();
  });
}

void WriteText(const std::string& text, BlobWriter* writer) {
  writer->Varint(text.size());
  writer->Bytes(text);
}

std::string ReadText(BlobReader* reader) {
  const uint64_t size = reader->Varint();
  if (size > kMaxTextBytes) reader->Fail();
  return std::string(reader->Bytes(size));
}

void WriteImage(const AtlasImage& image, BlobWriter* writer) {
  writer->Varint(static_cast<uint64_t>(image.map));
  writer->Varint(static_cast<uint64_t>(image.image));
}

AtlasImage ReadImage(BlobReader* reader) {
  const auto index = [&] {
    return static_cast<int32_t>(std::min<uint64_t>(reader->Varint(), std::numeric_limits<int32_t>::max()));
  };
  const int32_t map = index();
  return {map, index()};
}

std::string EncodePayload(const AtlasRows& atlas) {
  BlobWriter writer;
  WriteText(atlas.name, &writer);
  writer.Varint(atlas.epoch);
  writer.Bytes(atlas.code_book.coefficients.data(), atlas.code_book.coefficients.size());
  for (const int16_t median : atlas.code_book.medians) writer.Varint(ZigZag(median));
  writer.Varint(atlas.maps.size());
  for (const AtlasMap& map : atlas.maps) {
    WriteText(map.name, &writer);
    WriteText(map.file, &writer);
    writer.Bytes(map.fingerprint.data(), map.fingerprint.size());
    writer.Varint(map.num_bytes);
    writer.Varint(static_cast<uint64_t>(map.num_images));
    writer.Varint(map.places.size());
    const std::string places = EncodePlaces(map.places);
    writer.Varint(places.size());
    writer.Bytes(places);
  }
  writer.Varint(atlas.look_alikes.size());
  for (const AtlasLookAlike& look_alike : atlas.look_alikes) {
    WriteImage(look_alike.image, &writer);
    WriteImage(look_alike.other, &writer);
  }
  writer.Varint(atlas.passages.size());
  for (const AtlasPassage& passage : atlas.passages) {
    WriteText(passage.name, &writer);
    WriteImage(passage.from, &writer);
    WriteImage(passage.to, &writer);
    writer.Float64(passage.cost);
  }
  return writer.Take();
}

// Reads `count` elements, each of one byte or more.
template <typename T, typename Read>
std::vector<T> ReadSome(BlobReader* reader, Read&& read) {
  const uint64_t count = reader->Varint();
  if (count > reader->num_left()) reader->Fail();
  std::vector<T> elements;
  for (uint64_t i = 0; i < count && reader->ok(); ++i) elements.push_back(read());
  return elements;
}

AtlasMap ReadAtlasMap(BlobReader* reader) {
  AtlasMap map;
  map.name = ReadText(reader);
  map.file = ReadText(reader);
  const std::string_view fingerprint = reader->Bytes(map.fingerprint.size());
  std::copy(fingerprint.begin(), fingerprint.end(), map.fingerprint.begin());
  map.num_bytes = reader->Varint();
  map.num_images =
      static_cast<int64_t>(std::min<uint64_t>(reader->Varint(), std::numeric_limits<int32_t>::max()));
  const uint64_t num_places = reader->Varint();
  const std::string_view bytes = reader->Bytes(reader->Varint());
  if (!reader->ok() || num_places > static_cast<uint64_t>(kMaxAtlasCodes)) {
    reader->Fail();
    return map;
  }
  map.places.resize(num_places);
  RangeDecoder decoder(bytes);
  CodePlaces(&decoder, &map.places);
  // Also where codes ran over their end.
  if (!decoder.Finished() || !AreAscending(map.places)) reader->Fail();
  return map;
}

// False where the bytes make no sense.
bool ReadPayload(std::string_view payload, AtlasRows* atlas) {
  BlobReader reader(payload);
  atlas->name = ReadText(&reader);
  atlas->epoch = reader.Varint();
  for (uint8_t& coefficient : atlas->code_book.coefficients) {
    coefficient = reader.UInt8();
    if (coefficient >= kSiftDescriptorDim) reader.Fail();
  }
  for (int16_t& median : atlas->code_book.medians) {
    const int64_t value = UnZigZag(reader.Varint());
    median = static_cast<int16_t>(value);
    if (median != value) reader.Fail();
  }
  atlas->maps = ReadSome<AtlasMap>(&reader, [&] { return ReadAtlasMap(&reader); });
  atlas->look_alikes = ReadSome<AtlasLookAlike>(&reader, [&] {
    const AtlasImage image = ReadImage(&reader);
    return AtlasLookAlike{image, ReadImage(&reader)};
  });
  atlas->passages = ReadSome<AtlasPassage>(&reader, [&] {
    AtlasPassage passage{.name = ReadText(&reader)};
    passage.from = ReadImage(&reader);
    passage.to = ReadImage(&reader);
    passage.cost = reader.Float64();
    return passage;
  });
  return reader.Finished();
}

Status CheckImage(const AtlasRows& atlas, const AtlasImage& image, const char* what) {
  const auto num_maps = static_cast<int32_t>(atlas.maps.size());
  if (image.map < 0 || image.map >= num_maps)
    return MakeError(ErrorCode::kInvalidArgument, "{} names map {} of {}", what, image.map, num_maps);
  const int64_t num_images = atlas.maps[image.map].num_images;
  if (image.image < 0 || image.image >= num_images) {
    return MakeError(ErrorCode::kInvalidArgument, "{} names image {} of {} of map '{}'", what, image.image,
                     num_images, atlas.maps[image.map].name);
  }
  return Ok();
}

Status CheckAtlas(const AtlasRows& atlas) {
  if (atlas.maps.empty()) return MakeError(ErrorCode::kInvalidArgument, "an atlas without maps");
  if (atlas.maps.size() > static_cast<size_t>(kMaxAtlasMaps)) {
    return MakeError(ErrorCode::kInvalidArgument, "{} maps, an atlas has at most {}", atlas.maps.size(),
                     kMaxAtlasMaps);
  }
  std::set<std::string> names;
  int64_t num_codes = 0;
  for (const AtlasMap& map : atlas.maps) {
    if (!names.insert(map.name).second) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "two maps are called '{}'; a place is named by its map, so give them other names",
                       map.name);
    }
    if (map.name.size() > kMaxTextBytes || map.file.size() > kMaxTextBytes)
      return MakeError(ErrorCode::kInvalidArgument, "map '{:.40}...': a name of more than {} bytes", map.name,
                       kMaxTextBytes);
    if (!AreAscending(map.places))
      return MakeError(ErrorCode::kInvalidArgument, "map '{}': codes that do not ascend", map.name);
    for (const std::vector<uint32_t>& place : map.places) num_codes += static_cast<int64_t>(place.size());
  }
  if (num_codes > kMaxAtlasCodes) {
    return MakeError(ErrorCode::kInvalidArgument, "{} codes of landmarks, an atlas has at most {}", num_codes,
                     kMaxAtlasCodes);
  }
  for (const AtlasLookAlike& look_alike : atlas.look_alikes) {
    CAIRN_RETURN_IF_ERROR(CheckImage(atlas, look_alike.image, "a look-alike"));
    CAIRN_RETURN_IF_ERROR(CheckImage(atlas, look_alike.other, "a look-alike"));
  }
  for (const AtlasPassage& passage : atlas.passages) {
    CAIRN_RETURN_IF_ERROR(CheckImage(atlas, passage.from, "a passage"));
    CAIRN_RETURN_IF_ERROR(CheckImage(atlas, passage.to, "a passage"));
    if (!std::isfinite(passage.cost) || passage.cost < 0)
      return MakeError(ErrorCode::kInvalidArgument, "passage '{}': a cost of {}", passage.name, passage.cost);
  }
  return Ok();
}

}  // namespace

MapFingerprint FingerprintOf(const std::array<uint8_t, 32>& root) {
  MapFingerprint fingerprint;
  std::copy_n(root.begin(), fingerprint.size(), fingerprint.begin());
  return fingerprint;
}

size_t NumBytesOfPlaces(const std::vector<std::vector<uint32_t>>& places) {
  return EncodePlaces(places).size();
}

Result<std::string> EncodeAtlas(const std::optional<SecretKey>& key, AtlasRows* atlas) {
  CAIRN_RETURN_IF_ERROR(CheckAtlas(*atlas));
  const std::string payload = EncodePayload(*atlas);
  const Hash hash = HashOf(payload);
  atlas->public_key = {};
  atlas->signature = {};
  if (key) {
    CAIRN_ASSIGN_OR_RETURN(atlas->public_key, PublicKeyOf(*key));
    CAIRN_ASSIGN_OR_RETURN(atlas->signature, SignBytes(SignedHead(atlas->public_key, hash), *key));
  }
  BlobWriter writer;
  atlas->payload_hash = hash;
  writer.Bytes(SignedBytesOf(*atlas));
  writer.Bytes(atlas->signature.data(), atlas->signature.size());
  writer.Bytes(payload);
  return writer.Take();
}

Result<AtlasRows> ReadAtlas(const std::string& path, const std::optional<KeyRing>& required) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  if (bytes.empty()) return MakeError(ErrorCode::kEmptyFile, "{}: is empty, expected an atlas", path);
  const std::string_view magic = std::string_view(bytes).substr(0, kMagic.size());
  if (magic != kMagic.substr(0, magic.size())) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: not an atlas of maps; make one with `cairn atlas MAP... -o FILE`", path);
  }
  if (bytes.size() > kMagic.size() && bytes[kMagic.size()] != kFormat)
    return MakeError(ErrorCode::kUnsupported, "{}: an atlas of a later format than this program reads", path);
  BlobReader reader(bytes);
  reader.Bytes(kMagic.size() + 1);
  AtlasRows atlas;
  Hash& hash = atlas.payload_hash;
  const auto read = [&](auto* field) {
    const std::string_view found = reader.Bytes(field->size());
    std::copy(found.begin(), found.end(), field->begin());
  };
  read(&hash);
  read(&atlas.public_key);
  read(&atlas.signature);
  if (!reader.ok()) {
    return MakeError(ErrorCode::kTruncated, "{}: {} bytes, fewer than its head alone has; copy it again",
                     path, bytes.size());
  }
  const std::string_view payload = reader.Bytes(reader.num_left());
#ifndef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  if (HashOf(payload) != hash) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: does not have the hash that its head states: it was cut off, damaged or changed; "
                     "copy it again",
                     path);
  }
#endif
  CAIRN_RETURN_IF_ERROR(CheckSignatureOf(SignedHead(atlas.public_key, hash), atlas.public_key,
                                         atlas.signature, path, required,
                                         "make it with `cairn atlas --key`"));
  if (!ReadPayload(payload, &atlas)) return Corrupt(path, "its contents make no sense; make it anew");
  if (const Status checked = CheckAtlas(atlas); !checked.ok())
    return Corrupt(path, "{}; make it anew", checked.error().message);
  return atlas;
}

Status AddAtlasSignature(const std::string& path, const SecretKey& key, const std::string& signatures_path) {
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(const AtlasRows atlas, ReadAtlas(path, std::nullopt));
  if (!atlas.is_signed()) {
    return MakeError(
        ErrorCode::kNotSigned,
        "{}: is not signed, and signatures are added to one in the file; make it with `cairn atlas "
        "--key`",
        path);
  }
  if (atlas.public_key == public_key) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: has the signature of key {} already", path,
                     HexOf(public_key));
  }
  return AddSignature(SignedBytesOf(atlas), key, signatures_path);
}

std::string SignedBytesOf(const AtlasRows& atlas) { return SignedHead(atlas.public_key, atlas.payload_hash); }

bool IsAtlasFile(const std::string& path) { return ReadHead(path, kMagic.size()) == kMagic; }

}  // namespace cairn
