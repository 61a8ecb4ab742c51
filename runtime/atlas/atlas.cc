#include "runtime/atlas/atlas.h"

#include <algorithm>
#include <filesystem>
#include <list>
#include <mutex>
#include <set>
#include <utility>

#include "core/atlas/atlas_file.h"
#include "core/base/no_throw.h"
#include "runtime/atlas/code_index.h"

namespace cairn {

struct Atlas::Store {
  Store(AtlasRows read, std::string path_of_atlas, AtlasOptions given)
      : rows(std::move(read)), path(std::move(path_of_atlas)), options(std::move(given)), index(rows) {
    for (const AtlasLookAlike& pair : rows.look_alikes) {
      look_alikes.insert({pair.image.map, pair.image.image, pair.other.map});
      look_alikes.insert({pair.other.map, pair.other.image, pair.image.map});
    }
  }

  // Those that were asked for longest ago.
  void CloseForOneMore() {
    int64_t num_bytes = 0;
    for (const auto& [map, opened] : open) num_bytes += opened->num_kept_bytes();
    while (!open.empty() && (open.size() >= static_cast<size_t>(options.max_num_open_maps) ||
                             num_bytes > options.memory_budget_bytes)) {
      num_bytes -= open.back().second->num_kept_bytes();
      open.pop_back();
    }
  }

  AtlasRows rows;
  std::string path;
  AtlasOptions options;
  CodeIndex index;
  struct LookAlike {
    int32_t map, image, other_map;
    auto operator<=>(const LookAlike&) const = default;
  };
  std::set<LookAlike> look_alikes;
  std::mutex mutex;
  std::list<std::pair<int, std::shared_ptr<const Map>>> open;  // the last used first
};

Atlas::Atlas(std::unique_ptr<Store> store) : store_(std::move(store)) {}
Atlas::~Atlas() = default;

Result<std::shared_ptr<const Atlas>> Atlas::Open(const std::string& path, const AtlasOptions& options) {
  return WithoutExceptions(path.c_str(), [&]() -> Result<std::shared_ptr<const Atlas>> {
    if (options.max_num_open_maps < 1) {
      return MakeError(ErrorCode::kInvalidArgument, "max_num_open_maps: {}, must be 1 or more",
                       options.max_num_open_maps);
    }
    if (options.memory_budget_bytes <= 0) {
      return MakeError(ErrorCode::kInvalidArgument, "memory_budget_bytes: {}, must be positive",
                       options.memory_budget_bytes);
    }
    CAIRN_ASSIGN_OR_RETURN(AtlasRows rows, ReadAtlas(path, options.public_key));
    if (!options.name.empty() && rows.name != options.name) {
      return MakeError(ErrorCode::kOtherMap, "{}: is atlas '{}', expected '{}'", path, rows.name,
                       options.name);
    }
    if (rows.epoch < options.min_epoch) {
      return MakeError(ErrorCode::kNotNewer, "{}: has epoch {}, expected {} or later", path, rows.epoch,
                       options.min_epoch);
    }
    return std::shared_ptr<const Atlas>(new Atlas(std::make_unique<Store>(std::move(rows), path, options)));
  });
}

int Atlas::num_maps() const { return static_cast<int>(store_->rows.maps.size()); }
const std::string& Atlas::map_name(int map) const { return store_->rows.maps[map].name; }
const AtlasRows& Atlas::rows() const { return store_->rows; }

Result<int> Atlas::FindMap(const std::string& name) const {
  for (int map = 0; map < num_maps(); ++map) {
    if (map_name(map) == name) return map;
  }
  return MakeError(ErrorCode::kNotFound, "{}: no map is called '{}'; `cairn inspect` lists them",
                   store_->path, name);
}

Result<std::shared_ptr<const Map>> Atlas::OpenMap(int map) const {
  return WithoutExceptions(store_->path.c_str(), [&]() -> Result<std::shared_ptr<const Map>> {
    const std::lock_guard lock(store_->mutex);
    auto& open = store_->open;
    const auto found =
        std::find_if(open.begin(), open.end(), [&](const auto& kept) { return kept.first == map; });
    if (found != open.end()) {
      open.splice(open.begin(), open, found);
      return open.front().second;
    }
    const AtlasMap& row = store_->rows.maps[map];
    const std::string path = (std::filesystem::path(store_->path).parent_path() / row.file).string();
    CAIRN_ASSIGN_OR_RETURN(auto opened,
                           Map::Open(path, {.memory_budget_bytes = store_->options.memory_budget_bytes}));
    if (FingerprintOf(opened->root_hash()) != row.fingerprint) {
      return MakeError(
          ErrorCode::kOtherMap,
          "{}: is not the file that {} was made of (map '{}'): it was updated or exchanged; make "
          "the atlas anew",
          path, store_->path, row.name);
    }
    store_->CloseForOneMore();
    open.emplace_front(map, std::move(opened));
    return open.front().second;
  });
}

std::vector<MapScore> Atlas::Rank(const Features& features) const { return store_->index.Rank(features); }

std::vector<int> Atlas::MapsLike(int map, int32_t image) const {
  std::vector<int> maps;
  const auto& look_alikes = store_->look_alikes;
  for (auto next = look_alikes.lower_bound({map, image, 0});
       next != look_alikes.end() && next->map == map && next->image == image; ++next)
    maps.push_back(next->other_map);
  return maps;
}

}  // namespace cairn
