#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/seal/key_ring.h"
#include "runtime/map/map.h"

namespace cairn {

struct AtlasRows;  // core/atlas/atlas_file.h
struct Features;   // core/features/features.h
struct MapScore;   // runtime/atlas/code_index.h

struct AtlasOptions {
  // Size of the loaded parts of all maps that are kept open for later queries: those asked for last.  The one
  // in use may add as much (MapOptions::memory_budget_bytes).  REQUIRES: > 0
  int64_t memory_budget_bytes = int64_t{128} << 20;
  // Most maps that are kept open, each a file.  REQUIRES: >= 1
  int max_num_open_maps = 128;
  // An atlas without a signature of this key, or of enough keys of this ring, is refused (MapOptions).  Its
  // maps need none: the atlas states their hashes.
  std::optional<KeyRing> public_key;
  // Required name of the atlas (empty: any) and its smallest epoch (0: any).
  std::string name = {};
  uint64_t min_epoch = 0;
};

// Many maps of a site as one: `cairn atlas MAP... -o FILE` made it.  Immutable, shareable between threads;
// AtlasLocalizer (runtime/atlas/atlas_localizer.h) asks it.  Opening reads the atlas alone; a map's file is
// opened when it is needed, and must be the one that the atlas was made of.  No exception leaves it.
class Atlas {
 public:
  // Errors: as ReadAtlas (core/atlas/atlas_file.h); OtherMap, NotNewer (not the atlas that the options
  // require); InvalidArgument (an option).
  static Result<std::shared_ptr<const Atlas>> Open(const std::string& path, const AtlasOptions& options = {});
  ~Atlas();

  int num_maps() const;
  const std::string& map_name(int map) const;  // REQUIRES: 0 <= map < num_maps()
  // Errors: NotFound.
  Result<int> FindMap(const std::string& name) const;
  const AtlasRows& rows() const;

  // A map, opened where it is not.  Errors: as Map::Open; OtherMap (not the file that the atlas was made of).
  Result<std::shared_ptr<const Map>> OpenMap(int map) const;

  // The maps that have some of an image's features, most first.
  std::vector<MapScore> Rank(const Features& features) const;
  // Maps of which a place is known that looks like this image of that map, ascending.
  std::vector<int> MapsLike(int map, int32_t image) const;

 private:
  struct Store;
  explicit Atlas(std::unique_ptr<Store> store);

  std::unique_ptr<Store> store_;
};

}  // namespace cairn
