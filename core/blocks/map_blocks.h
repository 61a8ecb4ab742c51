#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/features/transform_code.h"
#include "core/plan/views.h"

namespace cairn {

// The bulk of a map is cut into blocks, each read and checked by itself: schemas/FORMAT.md draws their bytes.

// BLAKE2b, 256 bits.
using Hash = std::array<uint8_t, 32>;

// The values are stored in files: append only.
enum class BlockKind : uint8_t {
  kStations = 1,
  kRegions = 2,
  kVocabularyTree = 3,
  kDocumentNorms = 4,
  kWords = 5,
  kImages = 6,
  kLandmarks = 7,
  kAppearance = 8,
  kAmbiguity = 9,
  kFloorPlan = 10,
  kViewRegions = 11,
  kLandmarkModels = 12,
};
inline constexpr int kNumBlockKinds = 13;   // 0 is none
const char* BlockKindName(BlockKind kind);  // "stations"

// Regions of one place are of different headings, and few places have so many.
inline constexpr int64_t kMaxRegionsPerStation = 1024;

// What the directory says of a block.
struct BlockEntry {
  uint8_t kind = 0;  // a BlockKind, or one of a later minor version
  // Of landmarks and images: stored in few bits (core/packing/packed_landmarks.h); a kind of its own in
  // files.
  bool is_packed = false;
  uint32_t first = 0;
  uint32_t count = 0;  // elements first .. first + count - 1
  uint32_t num_bytes = 0;
  Hash hash = {};
  // Of image blocks: contains the cameras' centres, world frame.
  Eigen::AlignedBox3f centers;
};

// All blocks of a map, in file order.  Blocks of a kind hold its elements 0, 1, ... one after the other.
class MapDirectory {
 public:
  void Add(const BlockEntry& entry);
  const std::vector<BlockEntry>& blocks() const { return blocks_; }
  const BlockEntry& Entry(BlockKind kind, int64_t ordinal) const { return blocks_[Block(kind, ordinal)]; }
  // Index in blocks() of a kind's block.
  int64_t Block(BlockKind kind, int64_t ordinal) const { return of_kind_[static_cast<int>(kind)][ordinal]; }
  int64_t NumBlocks(BlockKind kind) const {
    return static_cast<int64_t>(of_kind_[static_cast<int>(kind)].size());
  }
  // Number of elements of a kind.
  int64_t Count(BlockKind kind) const { return count_[static_cast<int>(kind)]; }
  // Ordinal, among those of its kind, of the block with an element.  REQUIRES: element in [0, Count(kind))
  int64_t OrdinalOf(BlockKind kind, int64_t element) const;
  // Of the map, which its head says and its blocks do not.
  const DescriptorKind& descriptor_kind() const { return descriptor_kind_; }
  void set_descriptor_kind(DescriptorKind kind) { descriptor_kind_ = std::move(kind); }

  std::string Encode() const;
  // `max_num_bytes`: what the blocks can take together.  Errors: Corrupt (lengths, order, counts that the
  // bytes of a block cannot hold).
  static Result<MapDirectory> Decode(std::string_view bytes, int64_t max_num_bytes);

 private:
  std::vector<BlockEntry> blocks_;
  std::array<std::vector<int64_t>, kNumBlockKinds> of_kind_;
  std::array<int64_t, kNumBlockKinds> count_ = {};
  DescriptorKind descriptor_kind_;
};

// Landmarks first, first + 1, ... with which regions have them, and where to look for images that see them.
struct LandmarkBlock {
  LandmarkIdx first = 0;
  std::vector<MapLandmark> landmarks;
  DescriptorMatrix descriptors;
  // Regions that have landmarks here, ascending, with those.
  std::vector<std::pair<RegionIdx, std::vector<LandmarkIdx>>> regions;
  std::vector<int32_t> image_blocks;             // ordinals of image blocks, ascending
  std::optional<TransformCode> descriptor_code;  // where the block is packed
};

struct ImageBlock {
  int32_t first = 0;  // index of the first image
  std::vector<MapImage> images;
  bool is_packed = false;
};

struct StationBlock {
  StationIdx first = 0;
  std::vector<MapStation> stations;
  std::vector<std::vector<StationIdx>> neighbours;  // of larger index, ascending
  std::vector<std::vector<RegionIdx>> regions;      // that contain the station, ascending
};

struct RegionBlock {
  RegionIdx first = 0;
  std::vector<std::vector<int32_t>> landmark_blocks;  // per region, ordinals, ascending
};

// The postings of words as they are stored, documents are images: a query reads those of few words of a
// block.
struct WordBlock {
  WordIdx first = 0;
  // Per word the number of postings, and of each the step from the image before and the count; all varints,
  // and known to be right: of PackWords or DecodeWordBlock.
  std::string bytes;
  std::vector<uint32_t> begins;  // per word: where it begins in `bytes`

  size_t num_words() const { return begins.size(); }
  size_t NumPostings(size_t i) const {
    const char* at = bytes.data() + begins[i];
    return NextVarint(&at);
  }
  // Calls visit(posting) for those of the i-th word, ascending.
  template <typename Visit>
  void ForPostings(size_t i, const Visit& visit) const {
    const char* at = bytes.data() + begins[i];
    int64_t document = -1;
    for (uint64_t num_left = NextVarint(&at); num_left > 0; --num_left) {
      const uint64_t head = NextVarint(&at);
      document += static_cast<int64_t>(head / 2) + 1;
      const int32_t count = head % 2 == 1 ? static_cast<int32_t>(NextVarint(&at)) + 2 : 1;
      visit(Posting{static_cast<int32_t>(document), count});
    }
  }
  std::vector<Posting> Postings(size_t i) const;

 private:
  static uint64_t NextVarint(const char** at) {
    uint64_t value = 0;
    for (int shift = 0;; shift += 7) {
      const auto byte = static_cast<uint8_t>(*(*at)++);
      value |= static_cast<uint64_t>(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
  }
};
// `postings`: per word, ascending images, counts of at least 1.
WordBlock PackWords(WordIdx first, const std::vector<std::vector<Posting>>& postings);

struct AppearanceBlock {
  int32_t first = 0;  // index of the first node
  std::vector<MapAppearanceNode> nodes;
};

// How well the places of nodes can be told from others: their entropies and look-alikes.
struct AmbiguityBlock {
  struct Node {
    double entropy = 0;
    std::vector<MapAppearanceNode::LookAlike> look_alikes;
  };
  int32_t first = 0;  // index of the first node
  std::vector<Node> nodes;
};

// Maps store every pair of look-alikes once, at the smaller node; this adds it at the larger one too.
// Ascending at each node.  REQUIRES: nodes in range
void CompleteLookAlikes(std::vector<std::vector<MapAppearanceNode::LookAlike>>* look_alikes);

// View-invariant regions first, first + 1, ...
struct ViewBlock {
  struct Region {
    std::vector<int32_t> corners;   // vertices, counter-clockwise
    int32_t num_more_vertices = 0;  // ends of links that no region up to here has as a corner
    FaceIdx parent = -1;
    std::vector<LabelIdx> toggled;  // ascending
    ViewIndex index;
    std::vector<ViewLink> links;  // of which this is `a`, ascending
  };
  FaceIdx first = 0;
  int32_t first_vertex = 0;         // number of vertices that the blocks before name
  std::vector<GridPoint> vertices;  // named here for the first time, in that order
  std::vector<Region> regions;
};

// Models of the landmarks first, first + 1, ..., with what all blocks of the visual map repeat.
struct VisualBlock {
  LandmarkIdx first = 0;
  VisualMapData part;
};

// Blocks as bytes.  Same block, same bytes.
std::string EncodeBlock(const LandmarkBlock& block);
std::string EncodeBlock(const ImageBlock& block);
std::string EncodeBlock(const StationBlock& block);
std::string EncodeBlock(const RegionBlock& block);
std::string EncodeBlock(const WordBlock& block);
std::string EncodeBlock(const AppearanceBlock& block);
std::string EncodeBlock(const AmbiguityBlock& block);
std::string EncodeBlock(const ViewBlock& block);
std::string EncodeBlock(const VisualBlock& block);
std::string EncodeFloorPlan(const FloorPlan& plan);
std::string EncodeVocabularyTree(const Vocabulary& vocabulary);
std::string EncodeDocumentNorms(const std::vector<float>& norms);

// The inverse.  `entry` is one of the directory's, `what` names the block in messages.  Every length, index
// and number is checked against the directory.  Errors: Corrupt.
Result<LandmarkBlock> DecodeLandmarkBlock(std::string_view bytes, const BlockEntry& entry,
                                          const MapDirectory& directory, const std::string& what);
Result<ImageBlock> DecodeImageBlock(std::string_view bytes, const BlockEntry& entry,
                                    const MapDirectory& directory, const std::string& what);
Result<StationBlock> DecodeStationBlock(std::string_view bytes, const BlockEntry& entry,
                                        const MapDirectory& directory, const std::string& what);
Result<RegionBlock> DecodeRegionBlock(std::string_view bytes, const BlockEntry& entry,
                                      const MapDirectory& directory, const std::string& what);
Result<WordBlock> DecodeWordBlock(std::string_view bytes, const BlockEntry& entry,
                                  const MapDirectory& directory, const std::string& what);
Result<AppearanceBlock> DecodeAppearanceBlock(std::string_view bytes, const BlockEntry& entry,
                                              const MapDirectory& directory, const std::string& what);
Result<AmbiguityBlock> DecodeAmbiguityBlock(std::string_view bytes, const BlockEntry& entry,
                                            const MapDirectory& directory, const std::string& what);
Result<ViewBlock> DecodeViewBlock(std::string_view bytes, const BlockEntry& entry,
                                  const MapDirectory& directory, const std::string& what);
Result<VisualBlock> DecodeVisualBlock(std::string_view bytes, const BlockEntry& entry,
                                      const MapDirectory& directory, const std::string& what);
// Checks what CheckFloorPlan checks.
Result<FloorPlan> DecodeFloorPlan(std::string_view bytes, const BlockEntry& entry,
                                  const MapDirectory& directory, const std::string& what);
// A tree with empty inverted files.
Result<Vocabulary> DecodeVocabularyTree(std::string_view bytes, const BlockEntry& entry,
                                        const MapDirectory& directory, const std::string& what);
Result<std::vector<float>> DecodeDocumentNorms(std::string_view bytes, const BlockEntry& entry,
                                               const std::string& what);

// Puts the regions of a block after those that `views` has.  Call CheckViews on the whole afterwards.
// Errors: Corrupt where they do not follow one another.
Status AppendRegions(const ViewBlock& block, const std::string& what, Views* views);

// Errors: Corrupt where a block's camera, headings and errors are not those of another one's models.
Status CheckSameSurvey(const VisualBlock& block, const VisualMapData& other, const std::string& what);

// Puts the models of a block after those that `visual_map` has.  Errors: as CheckSameSurvey.
Status AppendModels(const VisualBlock& block, const std::string& what, VisualMapData* visual_map);

// Approximate memory that a decoded block takes, bytes.
int64_t NumBytes(const LandmarkBlock& block);
int64_t NumBytes(const ImageBlock& block);
int64_t NumBytes(const StationBlock& block);
int64_t NumBytes(const RegionBlock& block);
int64_t NumBytes(const WordBlock& block);
int64_t NumBytes(const AppearanceBlock& block);
int64_t NumBytes(const AmbiguityBlock& block);
int64_t NumBytes(const ViewBlock& block);
int64_t NumBytes(const VisualBlock& block);
int64_t NumBytes(const FloorPlan& plan);
int64_t NumBytes(const Vocabulary& vocabulary);
int64_t NumBytes(const std::vector<float>& values);

}  // namespace cairn
