#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/blocks/map_head.h"
#include "core/camera/camera.h"
#include "core/seal/key_ring.h"

namespace cairn {

// Contents of a map, which a robot that only asks where it is need not know.  core/blocks/map_blocks.h:
class MapDirectory;
struct LandmarkBlock;
struct ImageBlock;
struct StationBlock;
struct RegionBlock;
struct WordBlock;
struct VisualBlock;
// core/blocks/map_rows.h:
struct MapRows;
struct MapImage;
// core/base/progress.h, core/plan/views.h, core/vocabulary/vocabulary_tree.h, core/world/visual_map.h:
class Progress;
struct Views;
struct Vocabulary;
struct VisualMapData;
// Beside this header:
class BlockCache;
struct AppearanceMap;
struct LandmarkSet;

struct MapOptions {
  // Largest size of the loaded parts of a map that are kept for later queries.  The parts that a query is
  // using come on top.
  int64_t memory_budget_bytes = int64_t{256} << 20;
  // Maps that this key has not signed are refused; or those that fewer keys of this ring have signed than it
  // wants (core/seal/key_ring.h; ReadTrustedKeys reads either).  Signatures besides the map's own are in the
  // file MAP.signatures.
  std::optional<KeyRing> public_key;
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

  ~Map();

  const MapHead& head() const;
  // What seals the file (core/seal/map_seal.h): no two maps have it; zero for a map that was never a file.
  std::array<uint8_t, 32> root_hash() const;
  // Blocks and numbers of landmarks, images, ...
  const MapDirectory& directory() const;
  int64_t num_landmarks() const;
  int64_t num_images() const;
  int64_t num_regions() const;
  // Without words, every landmark is its own: they are few enough to be searched one by one.
  bool has_words() const;

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
  bool has_floor_plan() const;
  // The floor plan and, where the map has them, its view-invariant regions, floor frame.  Kept like a block.
  // Errors: NotFound where the map has no plan; Corrupt.
  Result<std::shared_ptr<const Views>> Plan() const;
  // The same with the regions in any case: where the map has none they are derived from the walls
  // (core/view_regions/derive_views.h), in seconds to minutes, and kept as blocks are: where that has no room
  // for them the next call derives them again.  Errors: those of Plan and of DeriveViews.
  Result<std::shared_ptr<const Views>> FloorViews(int num_threads, int64_t memory_mib,
                                                  Progress& progress) const;

  // Whether there is a visual map (runtime/visual_map/visual_map.h).
  bool has_visual_map() const;
  // The models of all landmarks; their images are in range.  The caller turns them into a VisualMap.  Errors:
  // NotFound where the map has none; Corrupt.
  Result<VisualMapData> LandmarkModels() const;
  // Some of them, a block like those above.  REQUIRES: has_visual_map()
  Result<std::shared_ptr<const VisualBlock>> LandmarkModels(int64_t ordinal) const;

  // The name of an image by its index; the image itself.  Errors: as Images.
  Result<std::string> ImageName(int64_t image) const;
  Result<std::shared_ptr<const MapImage>> Image(int64_t image) const;
  // These landmarks (ascending), packed for matching if asked.
  Result<std::shared_ptr<const LandmarkSet>> Gather(std::span<const LandmarkIdx> landmarks,
                                                    bool packed) const;
  // All landmarks, packed.  Kept like a block.
  Result<std::shared_ptr<const LandmarkSet>> AllLandmarks() const;

  // The blocks that are kept at the moment, and their size.
  const BlockCache& cache() const;
  int64_t num_kept_bytes() const;

 private:
  struct Store;
  explicit Map(std::unique_ptr<Store> store);

  std::unique_ptr<Store> store_;
};

}  // namespace cairn
