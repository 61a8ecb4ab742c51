#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_layout.h"
#include "core/blocks/map_rows.h"
#include "core/map/map_file.h"
#include "core/plan/views.h"
#include "core/world/appearance_graph.h"
#include "runtime/map/block_cache.h"
#include "runtime/map/landmark_set.h"

namespace cairn {

// The appearance graph of a map's images, for finding ways from one to another (runtime/drive/route.h).
struct AppearanceMap {
  AppearanceGraph graph;                          // links with a kept node at one end
  std::vector<std::vector<int32_t>> node_images;  // per node, indices of images, ascending
  std::vector<char> is_kept;                      // per node
  std::vector<NodeIdx> node_of_image;             // per image of the map; -1: in no node
  int num_kept_images = 0;
  // How well each node's place can be told from others; empty where the map does not say.
  std::vector<double> entropy;                                         // nats
  std::vector<std::vector<MapAppearanceNode::LookAlike>> look_alikes;  // both ways, ascending by node
};

struct MapOptions {
  // Largest size of the loaded parts of a map that are kept for later queries.  The parts that a query is
  // using come on top.
  int64_t memory_budget_bytes = int64_t{256} << 20;
  // Maps without a signature of this key are refused.
  std::optional<PublicKey> public_key;
  // Required name of the map (empty: any) and its smallest epoch (0: any): a map of this site, not older than
  // the robot's last one.  They can be trusted only with a key: without one, anybody can write a map that
  // says so.
  std::string name = {};
  uint64_t min_epoch = 0;
};

// An open map: immutable, shareable between threads, one Localizer per thread.  The first header to read;
// then runtime/localize/localizer.h.  Opening reads the head and the directory; blocks are read, checked
// against their hashes and kept within the budget when a query asks for them.  No exception leaves it.
class Map {
 public:
  // Opens a map file read-only; it must not change while the map is open.  Errors: as MapFile::Open
  // (core/map/map_file.h); OtherMap, NotNewer (not the map that the options require).
  static Result<std::shared_ptr<const Map>> Open(const std::string& path, const MapOptions& options = {});
  // A map that was never a file: its numbers are not rounded.  Errors: InvalidArgument (CheckMapRows).
  static Result<std::shared_ptr<const Map>> FromRows(MapRows rows);

  const MapHead& head() const { return head_; }
  // Blocks and numbers of landmarks, images, ...
  const MapDirectory& directory() const { return directory_; }
  int64_t num_landmarks() const { return directory_.Count(BlockKind::kLandmarks); }
  int64_t num_images() const { return directory_.Count(BlockKind::kImages); }
  // Without words, every landmark is its own: they are few enough to be searched one by one.
  bool has_words() const { return directory_.Count(BlockKind::kVocabularyTree) > 0; }

  // The camera of the survey with this image size.  Errors: NotFound when no camera or more than one has it;
  // lists the available sizes.
  Result<Camera> CameraForSize(int width, int height) const;

  // Blocks by their ordinals, from the cache or the file.  REQUIRES: ordinal < directory().NumBlocks(kind)
  // Errors: Corrupt (a block without the hash that the directory states), Io.
  Result<std::shared_ptr<const LandmarkBlock>> Landmarks(int64_t ordinal) const;
  Result<std::shared_ptr<const ImageBlock>> Images(int64_t ordinal) const;
  Result<std::shared_ptr<const StationBlock>> Stations(int64_t ordinal) const;
  Result<std::shared_ptr<const RegionBlock>> Regions(int64_t ordinal) const;
  Result<std::shared_ptr<const WordBlock>> Words(int64_t ordinal) const;
  // REQUIRES: has_words()
  Result<std::shared_ptr<const Vocabulary>> VocabularyTree() const;  // its inverted files: Words
  Result<std::shared_ptr<const std::vector<float>>> DocumentNorms() const;

  // The whole appearance graph; empty where the map has none.  Kept like a block.  Errors: Corrupt, also
  // where an image is of two nodes.
  Result<std::shared_ptr<const AppearanceMap>> Appearance() const;

  // Whether there is a floor plan.
  bool has_views() const { return directory_.Count(BlockKind::kViewRegions) > 0; }
  // The whole floor plan and its view-invariant regions, floor frame.  Kept like a block.  Errors: NotFound
  // where the map has none; Corrupt.
  Result<std::shared_ptr<const Views>> FloorViews() const;

  // Whether there is a visual map (runtime/visual_map/visual_map.h).
  bool has_visual_map() const { return directory_.NumBlocks(BlockKind::kLandmarkModels) > 0; }
  // The models of all landmarks; their images are in range.  Not kept in the cache: the caller turns them
  // into a VisualMap.  Errors: NotFound where the map has none; Corrupt.
  Result<VisualMapData> LandmarkModels() const;

  // An image by its index.
  Result<std::shared_ptr<const MapImage>> Image(int64_t image) const;
  // These landmarks (ascending), packed for matching if asked.
  Result<std::shared_ptr<const LandmarkSet>> Gather(std::vector<LandmarkIdx> landmarks, bool packed) const;
  // All landmarks, packed.  Kept like a block.
  Result<std::shared_ptr<const LandmarkSet>> AllLandmarks() const;

  // The blocks that are kept at the moment.
  const BlockCache& cache() const { return cache_; }

 private:
  explicit Map(MapFile file, int64_t memory_budget_bytes);
  explicit Map(MapRows rows);
  template <typename Block>
  using Decoder = Result<Block>(std::string_view bytes, const BlockEntry& entry,
                                const MapDirectory& directory, const std::string& what);
  // From the cache; else decoded from the file, or made of the rows.
  template <typename Block, typename Make>
  Result<std::shared_ptr<const Block>> Load(BlockKind kind, int64_t ordinal, Decoder<Block>* decode,
                                            const Make& make) const;

  Status AddAmbiguity(AppearanceMap* appearance) const;

  MapHead head_;
  MapDirectory directory_;
  // One of the two.
  std::optional<MapFile> file_;
  std::unique_ptr<const MapRows> rows_;
  std::unique_ptr<const MapLayout> layout_;
  mutable BlockCache cache_;
};

}  // namespace cairn
