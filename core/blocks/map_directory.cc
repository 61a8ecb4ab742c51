#include <algorithm>
#include <limits>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"

namespace cairn {
namespace {

// Fewest bytes that an element of a block takes: bounds what a false count allocates.
int64_t FewestBytes(BlockKind kind) {
  switch (kind) {
    case BlockKind::kLandmarks:
      return 16;
    case BlockKind::kImages:
      return 29;
    case BlockKind::kStations:
      return 5;
    case BlockKind::kDocumentNorms:
    case BlockKind::kAppearance:
      return 4;
    case BlockKind::kAmbiguity:
      return 2;
    case BlockKind::kViewRegions:
      return 26;
    case BlockKind::kFloorPlan:
      return 33;
    case BlockKind::kRegions:
    case BlockKind::kWords:
    case BlockKind::kVocabularyTree:
    case BlockKind::kLandmarkModels:
      return 1;
  }
  return 1;
}

// Kinds of the packed forms of blocks, and of a floor plan without regions, in files alone.
constexpr uint8_t kPackedLandmarks = 13;
constexpr uint8_t kPackedImages = 14;
constexpr uint8_t kBarePlan = 15;

// `has_regions`: of the floor plan.
uint8_t StoredKind(const BlockEntry& entry, bool has_regions) {
  if (entry.kind == static_cast<uint8_t>(BlockKind::kFloorPlan)) return has_regions ? entry.kind : kBarePlan;
  if (!entry.is_packed) return entry.kind;
  return entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks) ? kPackedLandmarks : kPackedImages;
}

void SetStoredKind(uint8_t stored, BlockEntry* entry) {
  entry->is_packed = stored == kPackedLandmarks || stored == kPackedImages;
  entry->kind = stored == kPackedLandmarks ? static_cast<uint8_t>(BlockKind::kLandmarks)
                : stored == kPackedImages  ? static_cast<uint8_t>(BlockKind::kImages)
                : stored == kBarePlan      ? static_cast<uint8_t>(BlockKind::kFloorPlan)
                                           : stored;
}

// Packed landmarks can take almost no bytes, so there is a limit to how many a block has.
constexpr uint32_t kMaxPackedLandmarks = 1024;

constexpr const char* kOtherKind = "other";

// As MapDirectory::Encode writes an entry: kind; first, count, number of bytes; hash; two corners.
constexpr size_t kEntryBytes = sizeof(uint8_t) + 3 * sizeof(uint32_t) + sizeof(Hash) + 6 * sizeof(float);

}  // namespace

const char* BlockKindName(BlockKind kind) {
  switch (kind) {
    case BlockKind::kStations:
      return "stations";
    case BlockKind::kRegions:
      return "regions";
    case BlockKind::kVocabularyTree:
      return "vocabulary_tree";
    case BlockKind::kDocumentNorms:
      return "document_norms";
    case BlockKind::kWords:
      return "words";
    case BlockKind::kImages:
      return "images";
    case BlockKind::kLandmarks:
      return "landmarks";
    case BlockKind::kAppearance:
      return "appearance";
    case BlockKind::kAmbiguity:
      return "ambiguity";
    case BlockKind::kFloorPlan:
      return "floor_plan";
    case BlockKind::kViewRegions:
      return "view_regions";
    case BlockKind::kLandmarkModels:
      return "landmark_models";
  }
  return kOtherKind;
}

namespace {

bool IsKnown(uint8_t kind) { return BlockKindName(static_cast<BlockKind>(kind)) != kOtherKind; }

}  // namespace

void MapDirectory::Add(const BlockEntry& entry) {
  if (IsKnown(entry.kind)) {
    of_kind_[entry.kind].push_back(static_cast<int64_t>(blocks_.size()));
    count_[entry.kind] += entry.count;
  }
  blocks_.push_back(entry);
}

int64_t MapDirectory::OrdinalOf(BlockKind kind, int64_t element) const {
  const std::vector<int64_t>& of_kind = of_kind_[static_cast<int>(kind)];
  const auto after =
      std::upper_bound(of_kind.begin(), of_kind.end(), element,
                       [&](int64_t value, int64_t block) { return value < blocks_[block].first; });
  return after - of_kind.begin() - 1;
}

std::string MapDirectory::Encode() const {
  BlobWriter writer;
  const bool has_regions = Count(BlockKind::kViewRegions) > 0;
  for (const BlockEntry& entry : blocks_) {
    writer.UInt8(StoredKind(entry, has_regions));
    writer.UInt32(entry.first);
    writer.UInt32(entry.count);
    writer.UInt32(entry.num_bytes);
    writer.Bytes(entry.hash.data(), entry.hash.size());
    for (const Eigen::Vector3f& corner : {entry.centers.min(), entry.centers.max()}) {
      for (int axis = 0; axis < 3; ++axis) {
        writer.Float32(entry.kind == static_cast<uint8_t>(BlockKind::kImages) ? corner[axis] : 0);
      }
    }
  }
  return writer.Take();
}

Result<MapDirectory> MapDirectory::Decode(std::string_view bytes, int64_t max_num_bytes) {
  BlobReader reader(bytes);
  MapDirectory directory;
  directory.blocks_.reserve(bytes.size() / kEntryBytes);
  int64_t num_bytes = 0;
  bool has_bare_plan = false;
  while (reader.num_left() > 0 && reader.ok()) {
    BlockEntry entry;
    const uint8_t stored_kind = reader.UInt8();
    SetStoredKind(stored_kind, &entry);
    has_bare_plan = has_bare_plan || stored_kind == kBarePlan;
    entry.first = reader.UInt32();
    entry.count = reader.UInt32();
    entry.num_bytes = reader.UInt32();
    const std::string_view hash = reader.Bytes(entry.hash.size());
    std::copy(hash.begin(), hash.end(), entry.hash.begin());  // none where it is cut off
    for (Eigen::Vector3f* corner : {&entry.centers.min(), &entry.centers.max()}) {
      for (int axis = 0; axis < 3; ++axis) (*corner)[axis] = reader.Float32();
    }
    const size_t block = directory.blocks_.size();
    const auto corrupt = [&](const char* what) {
      return MakeError(ErrorCode::kCorrupt, "directory: block {} (kind {}): {}", block, entry.kind, what);
    };
    if (!reader.ok()) return corrupt("its entry is cut off");
    num_bytes += entry.num_bytes;
    if (num_bytes > max_num_bytes) return corrupt("more bytes than the file has");
    if (IsKnown(entry.kind)) {
      const auto kind = static_cast<BlockKind>(entry.kind);
      if (entry.first != directory.Count(kind) ||
          int64_t{entry.first} + entry.count > std::numeric_limits<int32_t>::max()) {
        return corrupt("its elements do not follow those of the block before");
      }
      const bool is_packed_landmarks = entry.is_packed && kind == BlockKind::kLandmarks;
      if (entry.count == 0 ||
          (is_packed_landmarks ? entry.count > kMaxPackedLandmarks
                               : int64_t{entry.count} * FewestBytes(kind) > entry.num_bytes)) {
        return corrupt("more elements than its bytes can hold, or none");
      }
      const bool is_single = kind == BlockKind::kVocabularyTree || kind == BlockKind::kDocumentNorms ||
                             kind == BlockKind::kFloorPlan;
      if (is_single && directory.NumBlocks(kind) > 0) return corrupt("only one block of its kind is allowed");
      if (kind == BlockKind::kImages &&
          !(entry.centers.min().allFinite() && entry.centers.max().allFinite())) {
        return corrupt("its box of camera centres is not finite");
      }
    }
    directory.Add(entry);
  }
  if ((directory.Count(BlockKind::kVocabularyTree) > 0) !=
      (directory.Count(BlockKind::kDocumentNorms) == directory.Count(BlockKind::kImages) &&
       directory.Count(BlockKind::kWords) > 0)) {
    return MakeError(ErrorCode::kCorrupt,
                     "directory: a vocabulary tree, words and a norm per image belong together");
  }
  if (directory.Count(BlockKind::kRegions) > kMaxRegionsPerStation * directory.Count(BlockKind::kStations)) {
    return MakeError(ErrorCode::kCorrupt, "directory: {} regions of {} stations",
                     directory.Count(BlockKind::kRegions), directory.Count(BlockKind::kStations));
  }
  const bool needs_regions = directory.Count(BlockKind::kFloorPlan) > 0 && !has_bare_plan;
  if (needs_regions != (directory.Count(BlockKind::kViewRegions) > 0))
    return MakeError(ErrorCode::kCorrupt, "directory: a floor plan and its regions belong together");
  if (directory.Count(BlockKind::kLandmarkModels) > 0 &&
      directory.Count(BlockKind::kLandmarkModels) != directory.Count(BlockKind::kLandmarks)) {
    return MakeError(ErrorCode::kCorrupt, "directory: models of {} landmarks of {}",
                     directory.Count(BlockKind::kLandmarkModels), directory.Count(BlockKind::kLandmarks));
  }
  return directory;
}

}  // namespace cairn
