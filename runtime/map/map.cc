#include "runtime/map/map.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include <fmt/ranges.h>

#include "core/base/no_throw.h"
#include "core/map/map_epoch.h"

namespace cairn {
namespace {

// In the cache, beside the numbers of blocks.
constexpr int64_t kAllLandmarks = -1;
constexpr int64_t kWholeAppearance = -2;
constexpr int64_t kWholeViews = -3;

// Image sizes that a message names.
constexpr size_t kMaxNumSizesNamed = 10;

int64_t NumBytes(const LandmarkSet& set) {
  return static_cast<int64_t>(set.idx.size() * (sizeof(LandmarkIdx) + sizeof(MapLandmark))) +
         set.descriptors.size() + set.packed.num_bytes();
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

Result<std::shared_ptr<const Map>> Map::Open(const std::string& path, const MapOptions& options) {
  return WithoutExceptions(path.c_str(), [&]() -> Result<std::shared_ptr<const Map>> {
    CAIRN_ASSIGN_OR_RETURN(MapFile file, MapFile::Open(path, {.public_key = options.public_key}));
    CAIRN_RETURN_IF_ERROR(CheckAskedFor(file.head(), path, options.name, options.min_epoch));
    return std::shared_ptr<const Map>(new Map(std::move(file), options.memory_budget_bytes));
  });
}

Result<std::shared_ptr<const Map>> Map::FromRows(MapRows rows) {
  return WithoutExceptions("map", [&]() -> Result<std::shared_ptr<const Map>> {
    CAIRN_RETURN_IF_ERROR(CheckMapRows(rows));
    return std::shared_ptr<const Map>(new Map(std::move(rows)));
  });
}

Map::Map(MapFile file, int64_t memory_budget_bytes)
    : head_(file.head()), directory_(file.directory()), file_(std::move(file)), cache_(memory_budget_bytes) {}

Map::Map(MapRows rows) : head_(rows), cache_(std::numeric_limits<int64_t>::max()) {
  rows_ = std::make_unique<const MapRows>(std::move(rows));
  layout_ = std::make_unique<const MapLayout>(*rows_);
  for (const BlockEntry& entry : layout_->entries()) directory_.Add(entry);
}

template <typename Block, typename Make>
Result<std::shared_ptr<const Block>> Map::Load(BlockKind kind, int64_t ordinal, Decoder<Block>* decode,
                                               const Make& make) const {
  const int64_t block = directory_.Block(kind, ordinal);
  if (auto found = cache_.Find(block)) return std::static_pointer_cast<const Block>(found);
  const BlockEntry& entry = directory_.blocks()[block];
  std::shared_ptr<const Block> loaded;
  if (file_) {
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, file_->ReadBlock(block));
    CAIRN_ASSIGN_OR_RETURN(Block decoded, decode(bytes, entry, directory_, file_->NameOf(block)));
    loaded = std::make_shared<const Block>(std::move(decoded));
  } else {
    loaded = std::make_shared<const Block>(std::invoke(make, *layout_, entry));
  }
  const int64_t num_bytes = NumBytes(*loaded);
  return std::static_pointer_cast<const Block>(cache_.Insert(block, std::move(loaded), num_bytes));
}

Result<std::shared_ptr<const LandmarkBlock>> Map::Landmarks(int64_t ordinal) const {
  return Load(BlockKind::kLandmarks, ordinal, DecodeLandmarkBlock, &MapLayout::MakeLandmarkBlock);
}

Result<std::shared_ptr<const ImageBlock>> Map::Images(int64_t ordinal) const {
  return Load(BlockKind::kImages, ordinal, DecodeImageBlock, &MapLayout::MakeImageBlock);
}

Result<std::shared_ptr<const StationBlock>> Map::Stations(int64_t ordinal) const {
  return Load(BlockKind::kStations, ordinal, DecodeStationBlock, &MapLayout::MakeStationBlock);
}

Result<std::shared_ptr<const RegionBlock>> Map::Regions(int64_t ordinal) const {
  return Load(BlockKind::kRegions, ordinal, DecodeRegionBlock, &MapLayout::MakeRegionBlock);
}

Result<std::shared_ptr<const WordBlock>> Map::Words(int64_t ordinal) const {
  return Load(BlockKind::kWords, ordinal, DecodeWordBlock, &MapLayout::MakeWordBlock);
}

Result<std::shared_ptr<const Vocabulary>> Map::VocabularyTree() const {
  return Load(BlockKind::kVocabularyTree, 0, DecodeVocabularyTree,
              [&](const auto&, const auto&) { return rows_->vocabulary; });
}

Result<std::shared_ptr<const std::vector<float>>> Map::DocumentNorms() const {
  return Load<std::vector<float>>(
      BlockKind::kDocumentNorms, 0,
      [](std::string_view bytes, const BlockEntry& entry, const MapDirectory&, const std::string& what) {
        return DecodeDocumentNorms(bytes, entry, what);
      },
      [](const MapLayout& layout, const auto&) { return layout.MakeDocumentNorms(); });
}

Result<std::shared_ptr<const AppearanceMap>> Map::Appearance() const {
  if (auto found = cache_.Find(kWholeAppearance)) return std::static_pointer_cast<const AppearanceMap>(found);
  auto appearance = std::make_shared<AppearanceMap>();
  appearance->node_of_image.assign(num_images(), -1);
  std::vector<AppearanceLink> links;
  for (int64_t ordinal = 0; ordinal < directory_.NumBlocks(BlockKind::kAppearance); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, Load(BlockKind::kAppearance, ordinal, DecodeAppearanceBlock,
                                                  &MapLayout::MakeAppearanceBlock));
    for (const MapAppearanceNode& node : block->nodes) {
      const auto node_idx = static_cast<NodeIdx>(appearance->is_kept.size());
      for (const int32_t image : node.images) {
        if (appearance->node_of_image[image] >= 0) {
          return MakeError(ErrorCode::kCorrupt, "map '{}': image {} is of two appearance nodes", head_.name,
                           image);
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
  CAIRN_RETURN_IF_ERROR(AddAmbiguity(appearance.get()));
  const int64_t num_bytes = NumBytes(*appearance);
  return std::static_pointer_cast<const AppearanceMap>(
      cache_.Insert(kWholeAppearance, std::move(appearance), num_bytes));
}

Status Map::AddAmbiguity(AppearanceMap* appearance) const {
  const int64_t num_blocks = directory_.NumBlocks(BlockKind::kAmbiguity);
  for (int64_t ordinal = 0; ordinal < num_blocks; ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, Load(BlockKind::kAmbiguity, ordinal, DecodeAmbiguityBlock,
                                                  &MapLayout::MakeAmbiguityBlock));
    for (const AmbiguityBlock::Node& node : block->nodes) {
      appearance->entropy.push_back(node.entropy);
      appearance->look_alikes.push_back(node.look_alikes);
    }
  }
  if (num_blocks > 0 && appearance->entropy.size() != appearance->is_kept.size()) {
    return MakeError(ErrorCode::kCorrupt, "map '{}': entropies of {} appearance nodes of {}", head_.name,
                     appearance->entropy.size(), appearance->is_kept.size());
  }
  CompleteLookAlikes(&appearance->look_alikes);
  return Ok();
}

Result<std::shared_ptr<const Views>> Map::FloorViews() const {
  if (auto found = cache_.Find(kWholeViews)) return std::static_pointer_cast<const Views>(found);
  if (!has_views()) {
    return MakeError(
        ErrorCode::kNotFound,
        "map '{}' has no floor plan; name one in its recipe ([[capture]] floor_plan) and compile "
        "it again",
        head_.name);
  }
  auto views = std::make_shared<Views>();
  CAIRN_ASSIGN_OR_RETURN(const auto plan, Load(BlockKind::kFloorPlan, 0, DecodeFloorPlan,
                                               [&](const auto&, const auto&) { return rows_->views.plan; }));
  views->plan = *plan;
  int64_t num_bytes = NumBytes(*plan);
  for (int64_t ordinal = 0; ordinal < directory_.NumBlocks(BlockKind::kViewRegions); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(
        const auto block, Load(BlockKind::kViewRegions, ordinal, DecodeViewBlock, &MapLayout::MakeViewBlock));
    CAIRN_RETURN_IF_ERROR(AppendRegions(*block, "map '" + head_.name + "'", views.get()));
    num_bytes += NumBytes(*block);
  }
  CAIRN_RETURN_IF_ERROR(CheckViews(*views, "map '" + head_.name + "'"));
  return std::static_pointer_cast<const Views>(cache_.Insert(kWholeViews, std::move(views), num_bytes));
}

Result<VisualMapData> Map::LandmarkModels() const {
  if (!has_visual_map()) {
    return MakeError(ErrorCode::kNotFound,
                     "map '{}' has no visual map; set [emit_map] visual_map = true in its recipe and compile "
                     "it again",
                     head_.name);
  }
  VisualMapData models;
  for (int64_t ordinal = 0; ordinal < directory_.NumBlocks(BlockKind::kLandmarkModels); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, Load(BlockKind::kLandmarkModels, ordinal, DecodeVisualBlock,
                                                  &MapLayout::MakeVisualBlock));
    CAIRN_RETURN_IF_ERROR(AppendModels(*block, "map '" + head_.name + "'", &models));
  }
  return models;
}

Result<std::shared_ptr<const MapImage>> Map::Image(int64_t image) const {
  CAIRN_ASSIGN_OR_RETURN(const auto block, Images(directory_.OrdinalOf(BlockKind::kImages, image)));
  return std::shared_ptr<const MapImage>(block, &block->images[image - block->first]);
}

Result<std::shared_ptr<const LandmarkSet>> Map::Gather(std::vector<LandmarkIdx> landmarks,
                                                       bool packed) const {
  auto set = std::make_shared<LandmarkSet>();
  set->idx = std::move(landmarks);
  set->landmarks.reserve(set->idx.size());
  set->descriptors.resize(static_cast<Eigen::Index>(set->idx.size()), kDescriptorDim);
  std::shared_ptr<const LandmarkBlock> block;
  for (size_t i = 0; i < set->idx.size(); ++i) {
    const LandmarkIdx landmark = set->idx[i];
    if (!block || landmark >= block->first + static_cast<int64_t>(block->landmarks.size())) {
      CAIRN_ASSIGN_OR_RETURN(block, Landmarks(directory_.OrdinalOf(BlockKind::kLandmarks, landmark)));
    }
    set->landmarks.push_back(block->landmarks[landmark - block->first]);
    set->descriptors.row(static_cast<Eigen::Index>(i)) = block->descriptors.row(landmark - block->first);
  }
  if (packed) set->packed = PackedDescriptors(set->descriptors);
  return std::shared_ptr<const LandmarkSet>(std::move(set));
}

Result<std::shared_ptr<const LandmarkSet>> Map::AllLandmarks() const {
  if (auto found = cache_.Find(kAllLandmarks)) return std::static_pointer_cast<const LandmarkSet>(found);
  std::vector<LandmarkIdx> landmarks(num_landmarks());
  std::iota(landmarks.begin(), landmarks.end(), 0);
  CAIRN_ASSIGN_OR_RETURN(auto set, Gather(std::move(landmarks), true));
  const int64_t num_bytes = NumBytes(*set);
  return std::static_pointer_cast<const LandmarkSet>(cache_.Insert(kAllLandmarks, std::move(set), num_bytes));
}

Result<Camera> Map::CameraForSize(int width, int height) const {
  const Camera* found = nullptr;
  int num_found = 0;
  std::set<std::string> sizes;
  for (const Camera& camera : head_.cameras) {
    if (sizes.size() < kMaxNumSizesNamed) sizes.insert(fmt::format("{} x {}", camera.width, camera.height));
    if (camera.width != width || camera.height != height) continue;
    found = &camera;
    ++num_found;
  }
  if (num_found == 1) return *found;
  return MakeError(ErrorCode::kNotFound,
                   "{} cameras of map '{}' take images of {} x {} px (its cameras: {}); give the camera",
                   num_found, head_.name, width, height, fmt::join(sizes, ", "));
}

}  // namespace cairn
