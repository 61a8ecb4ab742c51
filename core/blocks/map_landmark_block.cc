// Landmark blocks as bytes: drawn in schemas/FORMAT.md.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"
#include "core/packing/map_codes.h"
#include "core/packing/packed_landmarks.h"

namespace cairn {
namespace {

constexpr double kMaxLandmarkCoordinate = 2e9;  // 200 km in units of 0.1 mm

// The values that occur in the descriptors, ascending: with up to 2^bits of them, a value takes `bits` bits.
struct DescriptorLevels {
  std::vector<uint8_t> values;
  int bits = 8;
};

DescriptorLevels LevelsOf(const DescriptorMatrix& descriptors) {
  std::array<bool, 256> occurs = {};
  for (Eigen::Index i = 0; i < descriptors.size(); ++i) occurs[descriptors.data()[i]] = true;
  DescriptorLevels levels;
  for (int value = 0; value < 256; ++value) {
    if (occurs[value]) levels.values.push_back(static_cast<uint8_t>(value));
  }
  const size_t num_values = std::max<size_t>(levels.values.size(), 2);
  levels.bits = std::bit_width(num_values - 1);
  return levels;
}

void WriteDescriptors(const DescriptorMatrix& descriptors, BlobWriter* writer) {
  const DescriptorLevels levels = LevelsOf(descriptors);
  std::array<uint8_t, 256> code = {};
  for (size_t i = 0; i < levels.values.size(); ++i) code[levels.values[i]] = static_cast<uint8_t>(i);
  writer->UInt8(static_cast<uint8_t>(levels.bits));
  writer->UInt8(static_cast<uint8_t>(levels.values.size() - 1));
  writer->Bytes(levels.values.data(), levels.values.size());
  uint32_t pending = 0;
  int num_pending = 0;
  for (Eigen::Index i = 0; i < descriptors.size(); ++i) {
    pending |= static_cast<uint32_t>(code[descriptors.data()[i]]) << num_pending;
    for (num_pending += levels.bits; num_pending >= 8; num_pending -= 8, pending >>= 8) {
      writer->UInt8(static_cast<uint8_t>(pending));
    }
  }
  if (num_pending > 0) writer->UInt8(static_cast<uint8_t>(pending));  // not of SIFT's 128 values
}

bool ReadDescriptors(BlobReader* reader, int64_t count, int num_values, DescriptorMatrix* descriptors) {
  const int bits = reader->UInt8();
  const size_t num_levels = size_t{reader->UInt8()} + 1;
  const std::string_view levels = reader->Bytes(num_levels);
  if (!reader->ok() || bits < 1 || bits > 8 || num_levels > size_t{1} << bits) return false;
  const std::string_view bytes = reader->Bytes((static_cast<size_t>(count) * num_values * bits + 7) / 8);
  if (!reader->ok()) return false;
  std::array<uint8_t, 256> value = {};  // of a code without a level: 0
  std::memcpy(value.data(), levels.data(), levels.size());
  descriptors->resize(count, num_values);
  const uint32_t mask = (1u << bits) - 1;
  uint32_t pending = 0;
  int num_pending = 0;
  size_t next = 0;
  for (Eigen::Index i = 0; i < descriptors->size(); ++i) {
    if (num_pending < bits) {
      pending |= static_cast<uint32_t>(static_cast<uint8_t>(bytes[next++])) << num_pending;
      num_pending += 8;
    }
    descriptors->data()[i] = value[pending & mask];
    pending >>= bits;
    num_pending -= bits;
  }
  return true;
}

// Offsets from the block's least coordinates, as few bytes each as the farthest one takes.
void WritePositions(const std::vector<MapLandmark>& landmarks, BlobWriter* writer) {
  std::vector<std::array<int64_t, 3>> positions;
  std::array<int64_t, 3> origin;
  origin.fill(std::numeric_limits<int64_t>::max());
  for (const MapLandmark& landmark : landmarks) {
    std::array<int64_t, 3>& position = positions.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = EncodeLength(landmark.position[axis]);
      origin[axis] = std::min(origin[axis], position[axis]);
    }
  }
  uint64_t farthest = 0;
  for (const auto& position : positions) {
    for (int axis = 0; axis < 3; ++axis) {
      farthest = std::max(farthest, static_cast<uint64_t>(position[axis] - origin[axis]));
    }
  }
  const int width = std::max(1, (static_cast<int>(std::bit_width(farthest)) + 7) / 8);
  writer->UInt8(static_cast<uint8_t>(width));
  for (const int64_t coordinate : origin) writer->UInt32(static_cast<uint32_t>(coordinate));
  for (const auto& position : positions) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto offset = static_cast<uint64_t>(position[axis] - origin[axis]);
      for (int byte = 0; byte < width; ++byte) writer->UInt8(static_cast<uint8_t>(offset >> (8 * byte)));
    }
  }
}

bool ReadPositions(BlobReader* reader, std::vector<MapLandmark>* landmarks) {
  const int width = reader->UInt8();
  std::array<int64_t, 3> origin;
  for (int64_t& coordinate : origin) coordinate = static_cast<int32_t>(reader->UInt32());
  if (width < 1 || width > 4) return false;
  for (MapLandmark& landmark : *landmarks) {
    for (int axis = 0; axis < 3; ++axis) {
      int64_t coordinate = origin[axis];
      for (int byte = 0; byte < width; ++byte) coordinate += int64_t{reader->UInt8()} << (8 * byte);
      if (std::abs(static_cast<double>(coordinate)) > kMaxLandmarkCoordinate) return false;
      landmark.position[axis] = DecodeLength(coordinate);
    }
  }
  return reader->ok();
}

bool ReadRegions(BlobReader* reader, int64_t num_regions, LandmarkBlock* block) {
  const uint64_t num_lists = reader->Varint();
  if (num_lists > reader->num_left()) return false;
  int64_t region = -1;
  int64_t max_num_values = kMaxListElements;
  for (uint64_t i = 0; i < num_lists; ++i) {
    const uint64_t step = reader->Varint();
    if (step == 0 || step > static_cast<uint64_t>(num_regions)) return false;
    region += static_cast<int64_t>(step);
    std::vector<int32_t> local;
    if (region >= num_regions ||
        !ReadRuns(reader, static_cast<int64_t>(block->landmarks.size()), &max_num_values, &local)) {
      return false;
    }
    for (int32_t& landmark : local) landmark += block->first;
    block->regions.emplace_back(static_cast<RegionIdx>(region), std::move(local));
  }
  return reader->ok();
}

}  // namespace

std::string EncodeBlock(const LandmarkBlock& block) {
  BlobWriter writer;
  writer.Varint(block.regions.size());
  RegionIdx previous = -1;
  for (const auto& [region, landmarks] : block.regions) {
    writer.Varint(static_cast<uint64_t>(region - previous));
    previous = region;
    std::vector<int32_t> local = landmarks;
    for (int32_t& landmark : local) landmark -= block.first;
    WriteRuns(local, &writer);
  }
  WriteRuns(block.image_blocks, &writer);
  if (block.descriptor_code) {
    writer.Bytes(PackLandmarks({block.landmarks, block.descriptors, *block.descriptor_code}));
    return writer.Take();
  }
  int64_t class_id = 0;
  for (const MapLandmark& landmark : block.landmarks) {
    writer.Varint(ZigZag(static_cast<int64_t>(landmark.class_id) - class_id));
    class_id = landmark.class_id;
  }
  for (const MapLandmark& landmark : block.landmarks) writer.Varint(landmark.num_observations);
  for (const MapLandmark& landmark : block.landmarks) writer.UInt8(EncodeSize(landmark.scale_m));
  for (const MapLandmark& landmark : block.landmarks) writer.UInt64(EncodeCovariance(landmark.covariance));
  WritePositions(block.landmarks, &writer);
  WriteDescriptors(block.descriptors, &writer);
  return writer.Take();
}

Result<LandmarkBlock> DecodeLandmarkBlock(std::string_view bytes, const BlockEntry& entry,
                                          const MapDirectory& directory, const std::string& what) {
  LandmarkBlock block;
  block.first = static_cast<LandmarkIdx>(entry.first);
  block.landmarks.resize(entry.count);
  BlobReader reader(bytes);
  const auto corrupt = [&](const char* part) {
    return Corrupt(what, "{} of {} landmarks make no sense", part, entry.count);
  };
  if (!ReadRegions(&reader, directory.Count(BlockKind::kRegions), &block)) return corrupt("the regions");
  int64_t max_num_values = kMaxListElements;
  if (!ReadRuns(&reader, directory.NumBlocks(BlockKind::kImages), &max_num_values, &block.image_blocks)) {
    return corrupt("the image blocks");
  }
  if (entry.is_packed) {
    PackedLandmarks packed;
    if (!directory.descriptor_kind().is_sift()) return corrupt("the packed descriptors");
    if (!reader.ok() || !UnpackLandmarks(reader.Bytes(reader.num_left()), entry.count, &packed))
      return corrupt("the packed numbers");
    block.landmarks = std::move(packed.landmarks);
    block.descriptors = std::move(packed.descriptors);
    block.descriptor_code = packed.code;
    return block;
  }
  int64_t class_id = 0;
  for (MapLandmark& landmark : block.landmarks) {
    class_id += UnZigZag(reader.Varint());  // a varint has 63 bits at most
    if (class_id < 0 || class_id > kInvalidClassId) return corrupt("the class ids");
    landmark.class_id = static_cast<ClassId>(class_id);
  }
  for (MapLandmark& landmark : block.landmarks) {
    const uint64_t num_observations = reader.Varint();
    if (num_observations > static_cast<uint64_t>(std::numeric_limits<int>::max())) {
      return corrupt("the observations");
    }
    landmark.num_observations = static_cast<int>(num_observations);
  }
  for (MapLandmark& landmark : block.landmarks) landmark.scale_m = DecodeSize(reader.UInt8());
  for (MapLandmark& landmark : block.landmarks) landmark.covariance = DecodeCovariance(reader.UInt64());
  if (!ReadPositions(&reader, &block.landmarks)) return corrupt("the positions");
  if (!ReadDescriptors(&reader, entry.count, directory.descriptor_kind().num_values, &block.descriptors))
    return corrupt("the descriptors");
  if (!reader.Finished()) return corrupt("the bytes");
  return block;
}

int64_t NumBytes(const LandmarkBlock& block) {
  int64_t num_bytes = static_cast<int64_t>(sizeof(block)) + block.descriptors.num_bytes();
  num_bytes += static_cast<int64_t>(block.landmarks.size() * sizeof(MapLandmark));
  num_bytes += static_cast<int64_t>(block.image_blocks.size() * sizeof(int32_t));
  for (const auto& [region, landmarks] : block.regions) {
    num_bytes += static_cast<int64_t>(sizeof(block.regions[0]) + landmarks.size() * sizeof(LandmarkIdx));
  }
  return num_bytes;
}

}  // namespace cairn
