#include "runtime/map/map.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include <fmt/ranges.h>

#include "core/base/no_throw.h"
#include "core/base/pooled.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_layout.h"
#include "core/blocks/map_rows.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/plan/views.h"
#include "core/view_regions/derive_views.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/block_cache.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// In the cache, beside the numbers of blocks.
constexpr int64_t kAllLandmarks = -1;
constexpr int64_t kWholeAppearance = -2;
constexpr int64_t kStoredPlan = -3;  // with the regions that the map has
constexpr int64_t kDerivedViews = -4;

// Image sizes that a message names.
constexpr size_t kMaxNumSizesNamed = 10;

int64_t NumBytes(const LandmarkSet& set) {
  return static_cast<int64_t>(PooledSize(set.idx.capacity() * sizeof(LandmarkIdx)) +
                              PooledSize(set.landmarks.capacity() * sizeof(MapLandmark))) +
         set.descriptors.num_bytes() + set.packed.num_bytes();
}

int64_t NumBytes(const Views& views) {
  return static_cast<int64_t>(sizeof(Views) + views.vertices.size() * sizeof(GridPoint) +
                              (views.face_offsets.size() + views.toggle_offsets.size()) * sizeof(int64_t) +
                              views.face_vertices.size() * sizeof(int32_t) +
                              (views.parents.size() + views.toggled_labels.size()) * sizeof(int32_t) +
                              views.index.size() * sizeof(ViewIndex) +
                              views.links.size() * sizeof(ViewLink)) +
         NumBytes(views.plan);
}

int64_t NumBytes(const AppearanceMap& appearance) {
  return appearance.graph.num_links() * int64_t{2 * sizeof(AppearanceGraph::Neighbour)} +
         static_cast<int64_t>(
             appearance.is_kept.size() * (1 + sizeof(std::vector<int32_t>) + sizeof(int64_t)) +
             appearance.node_of_image.size() * 2 * sizeof(int32_t) +
             appearance.entropy.size() * sizeof(double) +
             appearance.look_alikes.size() * sizeof(std::vector<MapAppearanceNode::LookAlike>));
}

}  // namespace

// Where an open map's blocks come from, and those that are kept.
struct Map::Store {
  MapHead head;
  MapDirectory directory;
  // One of the two.
  std::optional<MapFile> file;
  std::unique_ptr<const MapRows> rows;
  std::unique_ptr<const MapLayout> layout;
  BlockCache cache;

  Store(MapFile opened, int64_t memory_budget_bytes)
      : head(opened.head()),
        directory(opened.directory()),
        file(std::move(opened)),
        cache(memory_budget_bytes) {}
  explicit Store(MapRows given)
      : head(given),
        rows(std::make_unique<const MapRows>(std::move(given))),
        layout(std::make_unique<const MapLayout>(*rows)),
        cache(std::numeric_limits<int64_t>::max()) {
    directory.set_descriptor_kind(head.descriptor_kind);
    for (const BlockEntry& entry : layout->entries()) directory.Add(entry);
  }

  template <typename Block>
  using Decoder = Result<Block>(std::string_view bytes, const BlockEntry& entry,
                                const MapDirectory& directory, const std::string& what);
  // From the cache; else decoded from the file, or made of the rows.
  template <typename Block, typename Make>
  Result<std::shared_ptr<const Block>> Load(BlockKind kind, int64_t ordinal, Decoder<Block>* decode,
                                            const Make& make);

  Status AddAmbiguity(AppearanceMap* appearance);
};

Result<std::shared_ptr<const Map>> Map::Open(const std::string& path, const MapOptions& options) {
  return WithoutExceptions(path.c_str(), [&]() -> Result<std::shared_ptr<const Map>> {
    CAIRN_ASSIGN_OR_RETURN(MapFile file, MapFile::Open(path, {.public_key = options.public_key}));
    CAIRN_RETURN_IF_ERROR(CheckAskedFor(file.head(), path, options.name, options.min_epoch));
    return std::shared_ptr<const Map>(
        new Map(std::make_unique<Store>(std::move(file), options.memory_budget_bytes)));
  });
}

Result<std::shared_ptr<const Map>> Map::FromRows(MapRows rows) {
  return WithoutExceptions("map", [&]() -> Result<std::shared_ptr<const Map>> {
    CAIRN_RETURN_IF_ERROR(CheckMapRows(rows));
    return std::shared_ptr<const Map>(new Map(std::make_unique<Store>(std::move(rows))));
  });
}

Map::Map(std::unique_ptr<Store> store) : store_(std::move(store)) {}
Map::~Map() = default;

const MapHead& Map::head() const { return store_->head; }
std::array<uint8_t, 32> Map::root_hash() const { return store_->file ? store_->file->seal().root : Hash{}; }
const MapDirectory& Map::directory() const { return store_->directory; }
const BlockCache& Map::cache() const { return store_->cache; }
int64_t Map::num_landmarks() const { return directory().Count(BlockKind::kLandmarks); }
int64_t Map::num_images() const { return directory().Count(BlockKind::kImages); }
int64_t Map::num_regions() const { return directory().Count(BlockKind::kRegions); }
int64_t Map::num_kept_bytes() const { return cache().num_bytes(); }
bool Map::has_words() const { return directory().Count(BlockKind::kVocabularyTree) > 0; }
bool Map::has_floor_plan() const { return directory().Count(BlockKind::kFloorPlan) > 0; }
bool Map::has_visual_map() const { return directory().NumBlocks(BlockKind::kLandmarkModels) > 0; }

template <typename Block, typename Make>
Result<std::shared_ptr<const Block>> Map::Store::Load(BlockKind kind, int64_t ordinal, Decoder<Block>* decode,
                                                      const Make& make) {
  const int64_t block = directory.Block(kind, ordinal);
  if (auto found = cache.Find(block)) return std::static_pointer_cast<const Block>(found);
  const BlockEntry& entry = directory.blocks()[block];
  std::shared_ptr<const Block> loaded;
  if (file) {
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, file->ReadBlock(block));
    CAIRN_ASSIGN_OR_RETURN(Block decoded, decode(bytes, entry, directory, file->NameOf(block)));
    loaded = std::make_shared<const Block>(std::move(decoded));
  } else {
    loaded = std::make_shared<const Block>(std::invoke(make, *layout, entry));
  }
  const int64_t num_bytes = NumBytes(*loaded);
  return std::static_pointer_cast<const Block>(cache.Insert(block, std::move(loaded), num_bytes));
}

Result<std::shared_ptr<const LandmarkBlock>> Map::Landmarks(int64_t ordinal) const {
  return store_->Load(BlockKind::kLandmarks, ordinal, DecodeLandmarkBlock, &MapLayout::MakeLandmarkBlock);
}

Result<std::shared_ptr<const ImageBlock>> Map::Images(int64_t ordinal) const {
  return store_->Load(BlockKind::kImages, ordinal, DecodeImageBlock, &MapLayout::MakeImageBlock);
}

Result<std::shared_ptr<const StationBlock>> Map::Stations(int64_t ordinal) const {
  return store_->Load(BlockKind::kStations, ordinal, DecodeStationBlock, &MapLayout::MakeStationBlock);
}

Result<std::shared_ptr<const RegionBlock>> Map::Regions(int64_t ordinal) const {
  return store_->Load(BlockKind::kRegions, ordinal, DecodeRegionBlock, &MapLayout::MakeRegionBlock);
}

Result<std::shared_ptr<const WordBlock>> Map::Words(int64_t ordinal) const {
  return store_->Load(BlockKind::kWords, ordinal, DecodeWordBlock, &MapLayout::MakeWordBlock);
}

Result<std::shared_ptr<const Vocabulary>> Map::VocabularyTree() const {
  return store_->Load(BlockKind::kVocabularyTree, 0, DecodeVocabularyTree,
                      [&](const auto&, const auto&) { return store_->rows->vocabulary; });
}

Result<std::shared_ptr<const std::vector<float>>> Map::DocumentNorms() const {
  return store_->Load<std::vector<float>>(
      BlockKind::kDocumentNorms, 0,
      [](std::string_view bytes, const BlockEntry& entry, const MapDirectory&, const std::string& what) {
        return DecodeDocumentNorms(bytes, entry, what);
      },
      [](const MapLayout& layout, const auto&) { return layout.MakeDocumentNorms(); });
}

Result<std::shared_ptr<const AppearanceMap>> Map::Appearance() const {
  if (auto found = store_->cache.Find(kWholeAppearance))
    return std::static_pointer_cast<const AppearanceMap>(found);
  auto appearance = std::make_shared<AppearanceMap>();
  appearance->node_of_image.assign(num_images(), -1);
  std::vector<AppearanceLink> links;
  for (int64_t ordinal = 0; ordinal < store_->directory.NumBlocks(BlockKind::kAppearance); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block,
                           store_->Load(BlockKind::kAppearance, ordinal, DecodeAppearanceBlock,
                                        &MapLayout::MakeAppearanceBlock));
    for (const MapAppearanceNode& node : block->nodes) {
      const auto node_idx = static_cast<NodeIdx>(appearance->is_kept.size());
      for (const int32_t image : node.images) {
        if (appearance->node_of_image[image] >= 0) {
          return MakeError(ErrorCode::kCorrupt, "map '{}': image {} is of two appearance nodes",
                           store_->head.name, image);
        }
        appearance->node_of_image[image] = node_idx;
      }
      for (const MapAppearanceNode::Link& link : node.links)
        links.push_back({node_idx, link.node, link.num_inliers});
      if (node.is_kept) appearance->num_kept_images += static_cast<int>(node.images.size());
      appearance->is_kept.push_back(node.is_kept ? 1 : 0);
      appearance->node_images.push_back(node.images);
    }
  }
  appearance->graph = AppearanceGraph(static_cast<int>(appearance->is_kept.size()), std::move(links));
  CAIRN_RETURN_IF_ERROR(store_->AddAmbiguity(appearance.get()));
  const int64_t num_bytes = NumBytes(*appearance);
  return std::static_pointer_cast<const AppearanceMap>(
      store_->cache.Insert(kWholeAppearance, std::move(appearance), num_bytes));
}

Status Map::Store::AddAmbiguity(AppearanceMap* appearance) {
  const int64_t num_blocks = directory.NumBlocks(BlockKind::kAmbiguity);
  for (int64_t ordinal = 0; ordinal < num_blocks; ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, Load(BlockKind::kAmbiguity, ordinal, DecodeAmbiguityBlock,
                                                  &MapLayout::MakeAmbiguityBlock));
    for (const AmbiguityBlock::Node& node : block->nodes) {
      appearance->entropy.push_back(node.entropy);
      appearance->look_alikes.push_back(node.look_alikes);
    }
  }
  if (num_blocks > 0 && appearance->entropy.size() != appearance->is_kept.size()) {
    return MakeError(ErrorCode::kCorrupt, "map '{}': entropies of {} appearance nodes of {}", head.name,
                     appearance->entropy.size(), appearance->is_kept.size());
  }
  CompleteLookAlikes(&appearance->look_alikes);
  return Ok();
}

Result<std::shared_ptr<const Views>> Map::Plan() const {
  if (auto found = store_->cache.Find(kStoredPlan)) return std::static_pointer_cast<const Views>(found);
  if (!has_floor_plan()) {
    return MakeError(
        ErrorCode::kNotFound,
        "map '{}' has no floor plan; name one in its recipe ([[capture]] floor_plan) and compile "
        "it again",
        store_->head.name);
  }
  auto views = std::make_shared<Views>();
  CAIRN_ASSIGN_OR_RETURN(const auto plan,
                         store_->Load(BlockKind::kFloorPlan, 0, DecodeFloorPlan,
                                      [&](const auto&, const auto&) { return store_->rows->views.plan; }));
  views->plan = *plan;
  int64_t num_bytes = NumBytes(*plan);
  for (int64_t ordinal = 0; ordinal < store_->directory.NumBlocks(BlockKind::kViewRegions); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, store_->Load(BlockKind::kViewRegions, ordinal, DecodeViewBlock,
                                                          &MapLayout::MakeViewBlock));
    CAIRN_RETURN_IF_ERROR(AppendRegions(*block, "map '" + store_->head.name + "'", views.get()));
    num_bytes += NumBytes(*block);
  }
  CAIRN_RETURN_IF_ERROR(CheckViews(*views, "map '" + store_->head.name + "'"));
  return std::static_pointer_cast<const Views>(
      store_->cache.Insert(kStoredPlan, std::move(views), num_bytes));
}

Result<std::shared_ptr<const Views>> Map::FloorViews(int num_threads, int64_t memory_mib,
                                                     Progress& progress) const {
  CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Views> stored, Plan());
  if (stored->num_faces() > 0) return stored;
  if (auto found = store_->cache.Find(kDerivedViews)) return std::static_pointer_cast<const Views>(found);
  Result<DerivedViews> derived = DeriveViews(stored->plan, num_threads, memory_mib, progress);
  if (!derived.ok())
    return MakeError(derived.error().code, "map '{}': {}", store_->head.name, derived.error().message);
  auto views = std::make_shared<Views>(std::move(derived->views));
  const int64_t num_bytes = NumBytes(*views);
  return std::static_pointer_cast<const Views>(
      store_->cache.Insert(kDerivedViews, std::move(views), num_bytes));
}

Result<std::shared_ptr<const VisualBlock>> Map::LandmarkModels(int64_t ordinal) const {
  return store_->Load(BlockKind::kLandmarkModels, ordinal, DecodeVisualBlock, &MapLayout::MakeVisualBlock);
}

Result<VisualMapData> Map::LandmarkModels() const {
  if (!has_visual_map()) {
    return MakeError(ErrorCode::kNotFound,
                     "map '{}' has no visual map; set [emit_map] visual_map = true in its recipe and compile "
                     "it again",
                     store_->head.name);
  }
  VisualMapData models;
  for (int64_t ordinal = 0; ordinal < store_->directory.NumBlocks(BlockKind::kLandmarkModels); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, LandmarkModels(ordinal));
    CAIRN_RETURN_IF_ERROR(AppendModels(*block, "map '" + store_->head.name + "'", &models));
  }
  return models;
}

Result<std::string> Map::ImageName(int64_t image) const {
  CAIRN_ASSIGN_OR_RETURN(const auto found, Image(image));
  return found->name;
}

Result<std::shared_ptr<const MapImage>> Map::Image(int64_t image) const {
  CAIRN_ASSIGN_OR_RETURN(const auto block, Images(store_->directory.OrdinalOf(BlockKind::kImages, image)));
  return std::shared_ptr<const MapImage>(block, &block->images[image - block->first]);
}

Result<std::shared_ptr<const LandmarkSet>> Map::Gather(std::span<const LandmarkIdx> landmarks,
                                                       bool packed) const {
  auto set = MakePooled<LandmarkSet>();
  set->idx.assign(landmarks.begin(), landmarks.end());
  set->landmarks.reserve(set->idx.size());
  const DescriptorKind& kind = directory().descriptor_kind();
  set->descriptors.resize(static_cast<Eigen::Index>(set->idx.size()), kind.num_values);
  std::shared_ptr<const LandmarkBlock> block;
  for (size_t i = 0; i < set->idx.size(); ++i) {
    const LandmarkIdx landmark = set->idx[i];
    if (!block || landmark >= block->first + static_cast<int64_t>(block->landmarks.size())) {
      CAIRN_ASSIGN_OR_RETURN(block, Landmarks(store_->directory.OrdinalOf(BlockKind::kLandmarks, landmark)));
    }
    set->landmarks.push_back(block->landmarks[landmark - block->first]);
    set->descriptors.row(static_cast<Eigen::Index>(i)) = block->descriptors.row(landmark - block->first);
  }
  if (packed) set->packed = PackedDescriptors(set->descriptors, kind.space());
  return std::shared_ptr<const LandmarkSet>(std::move(set));
}

Result<std::shared_ptr<const LandmarkSet>> Map::AllLandmarks() const {
  if (auto found = store_->cache.Find(kAllLandmarks))
    return std::static_pointer_cast<const LandmarkSet>(found);
  PooledVector<LandmarkIdx> landmarks(num_landmarks());
  std::iota(landmarks.begin(), landmarks.end(), 0);
  CAIRN_ASSIGN_OR_RETURN(auto set, Gather(landmarks, true));
  const int64_t num_bytes = NumBytes(*set);
  return std::static_pointer_cast<const LandmarkSet>(
      store_->cache.Insert(kAllLandmarks, std::move(set), num_bytes));
}

Result<Camera> Map::CameraForSize(int width, int height) const {
  const Camera* found = nullptr;
  int num_found = 0;
  std::set<std::string> sizes;
  for (const Camera& camera : store_->head.cameras) {
    if (sizes.size() < kMaxNumSizesNamed) sizes.insert(fmt::format("{} x {}", camera.width, camera.height));
    if (camera.width != width || camera.height != height) continue;
    found = &camera;
    ++num_found;
  }
  if (num_found == 1) return *found;
  return MakeError(ErrorCode::kNotFound,
                   "{} of map '{}' take images of {} x {} px (its cameras: {}); give the camera, or the "
                   "whole picture in one of these sizes",
                   num_found == 0 ? "no cameras" : fmt::format("{} cameras", num_found), store_->head.name,
                   width, height, fmt::join(sizes, ", "));
}

}  // namespace cairn
