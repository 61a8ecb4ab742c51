#include "core/blocks/map_layout.h"

#include <algorithm>
#include <limits>

namespace cairn {
namespace {

constexpr size_t kLandmarksPerBlock = 1024;
constexpr size_t kImagesPerBlock = 32;
// Sights are packed by those of the images before in the block.
constexpr size_t kPackedImagesPerBlock = 64;
constexpr size_t kStationsPerBlock = 1024;
constexpr size_t kRegionsPerBlock = 1024;
constexpr size_t kWordsPerBlock = 1024;
constexpr size_t kPostingsPerBlock = 4096;
// A query reads most words of a small map, and few of those of one that has more postings than this.
constexpr size_t kManyPostings = size_t{1} << 22;
constexpr size_t kPostingsPerBlockOfMany = 1024;
constexpr size_t kAppearanceNodesPerBlock = 1024;
constexpr FaceIdx kViewRegionsPerBlock = 4096;
constexpr size_t kLandmarkModelsPerBlock = 256;

}  // namespace

MapLayout::MapLayout(const MapRows& rows)
    : rows_(rows), images_per_block_(rows.descriptor_code ? kPackedImagesPerBlock : kImagesPerBlock) {
  regions_of_station_.resize(rows.stations.size());
  for (size_t region = 0; region < rows.regions.size(); ++region) {
    for (const StationIdx station : rows.regions[region].stations) {
      regions_of_station_[station].push_back(static_cast<RegionIdx>(region));
    }
  }
  int32_t image = 0;
  for (const ImageId image_id : rows.vocabulary.document_ids) {  // both ascending; every document is an image
    while (rows.images[image].image_id < image_id) ++image;
    image_of_document_.push_back(image);
  }
  CutEvenly(BlockKind::kStations, rows.stations.size(), kStationsPerBlock);
  CutEvenly(BlockKind::kRegions, rows.regions.size(), kRegionsPerBlock);
  if (!rows.vocabulary.nodes.empty()) {
    AddEntry(BlockKind::kVocabularyTree, 0, rows.vocabulary.nodes.size());
    CutEvenly(BlockKind::kDocumentNorms, rows.images.size(), std::numeric_limits<int32_t>::max());
    CutWords();
  }
  CutEvenly(BlockKind::kAppearance, rows.appearance.size(), kAppearanceNodesPerBlock);
  if (!rows.appearance.empty() && rows.appearance[0].entropy)
    CutEvenly(BlockKind::kAmbiguity, rows.appearance.size(), kAppearanceNodesPerBlock);
  const size_t first_image_block = entries_.size();
  CutEvenly(BlockKind::kImages, rows.images.size(), images_per_block_);
  for (size_t i = first_image_block; i < entries_.size(); ++i) {
    BlockEntry& entry = entries_[i];
    for (uint32_t k = entry.first; k < entry.first + entry.count; ++k) {
      // As the file has the pose; rounding it to float moves it by less than the margin.
      const Eigen::Vector3d center = rows.images[k].cam_from_world.Center();
      const double margin = 2e-4 + 2e-7 * center.norm();
      entry.centers.extend((center.array() - margin).matrix().cast<float>());
      entry.centers.extend((center.array() + margin).matrix().cast<float>());
    }
  }
  CutLandmarks();
  CutViews();
  CutEvenly(BlockKind::kLandmarkModels, rows.visual_map.landmarks.size(), kLandmarkModelsPerBlock);
  LinkRegions();
  LinkImages();
}

void MapLayout::AddEntry(BlockKind kind, size_t first, size_t count) {
  const bool can_be_packed = kind == BlockKind::kLandmarks || kind == BlockKind::kImages;
  entries_.push_back({.kind = static_cast<uint8_t>(kind),
                      .is_packed = can_be_packed && rows_.descriptor_code,
                      .first = static_cast<uint32_t>(first),
                      .count = static_cast<uint32_t>(count)});
}

void MapLayout::CutEvenly(BlockKind kind, size_t count, size_t size) {
  for (size_t first = 0; first < count; first += size) AddEntry(kind, first, std::min(size, count - first));
}

void MapLayout::CutWords() {
  const auto& files = rows_.vocabulary.inverted_files;
  size_t total = 0;
  for (const std::vector<Posting>& postings : files) total += postings.size();
  const size_t per_block = total > kManyPostings ? kPostingsPerBlockOfMany : kPostingsPerBlock;
  size_t first = 0, num_postings = 0;
  for (size_t word = 0; word < files.size(); ++word) {
    num_postings += files[word].size();
    if (num_postings < per_block && word + 1 - first < kWordsPerBlock && word + 1 < files.size()) continue;
    AddEntry(BlockKind::kWords, first, word + 1 - first);
    first = word + 1;
    num_postings = 0;
  }
}

void MapLayout::CutLandmarks() {
  const size_t num_landmarks = rows_.landmarks.size();
  std::vector<RegionIdx> home(num_landmarks, std::numeric_limits<RegionIdx>::max());
  for (size_t region = rows_.regions.size(); region-- > 0;) {
    for (const LandmarkIdx landmark : rows_.regions[region].landmarks)
      home[landmark] = static_cast<RegionIdx>(region);
  }
  size_t block_first = 0;
  const auto cut = [&](size_t end) {
    if (end == block_first) return;
    AddEntry(BlockKind::kLandmarks, block_first, end - block_first);
    first_landmarks_.push_back(static_cast<int32_t>(block_first));
    landmark_block_.resize(end, static_cast<int32_t>(first_landmarks_.size()) - 1);
    block_first = end;
  };
  for (size_t begin = 0, end = 0; begin < num_landmarks; begin = end) {
    while (end < num_landmarks && home[end] == home[begin]) ++end;
    if (end - block_first > kLandmarksPerBlock) cut(begin);
    while (end - block_first > kLandmarksPerBlock) cut(block_first + kLandmarksPerBlock);
  }
  cut(num_landmarks);
}

void MapLayout::LinkRegions() {
  regions_of_block_.resize(first_landmarks_.size());
  blocks_of_region_.resize(rows_.regions.size());
  for (size_t region = 0; region < rows_.regions.size(); ++region) {
    for (const LandmarkIdx landmark : rows_.regions[region].landmarks) {
      const int32_t block = landmark_block_[landmark];
      std::vector<int32_t>& blocks = blocks_of_region_[region];
      if (blocks.empty() || blocks.back() != block) {
        blocks.push_back(block);
        regions_of_block_[block].emplace_back(static_cast<RegionIdx>(region), std::vector<LandmarkIdx>());
      }
      regions_of_block_[block].back().second.push_back(landmark);
    }
  }
}

void MapLayout::LinkImages() {
  image_blocks_of_block_.resize(first_landmarks_.size());
  for (size_t image = 0; image < rows_.images.size(); ++image) {
    const auto image_block = static_cast<int32_t>(image / images_per_block_);
    for (const LandmarkIdx landmark : rows_.images[image].landmarks) {
      std::vector<int32_t>& image_blocks = image_blocks_of_block_[landmark_block_[landmark]];
      if (image_blocks.empty() || image_blocks.back() != image_block) image_blocks.push_back(image_block);
    }
  }
}

LandmarkBlock MapLayout::MakeLandmarkBlock(const BlockEntry& entry) const {
  const int32_t ordinal = landmark_block_[entry.first];
  LandmarkBlock block;
  block.first = static_cast<LandmarkIdx>(entry.first);
  block.landmarks.assign(rows_.landmarks.begin() + entry.first,
                         rows_.landmarks.begin() + entry.first + entry.count);
  block.descriptors = rows_.descriptors.middleRows(entry.first, entry.count);
  block.regions = regions_of_block_[ordinal];
  block.image_blocks = image_blocks_of_block_[ordinal];
  block.descriptor_code = rows_.descriptor_code;
  return block;
}

ImageBlock MapLayout::MakeImageBlock(const BlockEntry& entry) const {
  const auto begin = rows_.images.begin() + entry.first;
  return {static_cast<int32_t>(entry.first), {begin, begin + entry.count}, entry.is_packed};
}

StationBlock MapLayout::MakeStationBlock(const BlockEntry& entry) const {
  StationBlock block;
  block.first = static_cast<StationIdx>(entry.first);
  const auto begin = rows_.stations.begin() + entry.first;
  block.stations.assign(begin, begin + entry.count);
  const auto regions = regions_of_station_.begin() + entry.first;
  block.regions.assign(regions, regions + entry.count);
  block.neighbours.resize(entry.count);
  auto edge = std::lower_bound(rows_.station_edges.begin(), rows_.station_edges.end(),
                               std::pair(block.first, StationIdx{-1}));
  for (; edge != rows_.station_edges.end() && edge->first < static_cast<int64_t>(entry.first) + entry.count;
       ++edge) {
    block.neighbours[edge->first - block.first].push_back(edge->second);
  }
  return block;
}

RegionBlock MapLayout::MakeRegionBlock(const BlockEntry& entry) const {
  const auto begin = blocks_of_region_.begin() + entry.first;
  return {static_cast<RegionIdx>(entry.first), {begin, begin + entry.count}};
}

WordBlock MapLayout::MakeWordBlock(const BlockEntry& entry) const {
  const auto begin = rows_.vocabulary.inverted_files.begin() + entry.first;
  std::vector<std::vector<Posting>> postings(begin, begin + entry.count);
  for (std::vector<Posting>& of_word : postings) {
    for (Posting& posting : of_word) posting.document = image_of_document_[posting.document];
  }
  return PackWords(static_cast<WordIdx>(entry.first), postings);
}

AppearanceBlock MapLayout::MakeAppearanceBlock(const BlockEntry& entry) const {
  const auto begin = rows_.appearance.begin() + entry.first;
  return {static_cast<int32_t>(entry.first), {begin, begin + entry.count}};
}

AmbiguityBlock MapLayout::MakeAmbiguityBlock(const BlockEntry& entry) const {
  AmbiguityBlock block{static_cast<int32_t>(entry.first), {}};
  for (uint32_t i = entry.first; i < entry.first + entry.count; ++i)
    block.nodes.push_back({*rows_.appearance[i].entropy, rows_.appearance[i].look_alikes});
  return block;
}

void MapLayout::CutViews() {
  const Views& views = rows_.views;
  CutEvenly(BlockKind::kFloorPlan, views.plan.walls.size(), std::numeric_limits<int32_t>::max());
  CutEvenly(BlockKind::kViewRegions, views.parents.size(), kViewRegionsPerBlock);
  int32_t next = 0;  // vertices are numbered as regions name them
  size_t link = 0;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    if (face % kViewRegionsPerBlock == 0) first_vertices_.push_back(next);
    for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i)
      next = std::max(next, views.face_vertices[i] + 1);
    for (; link < views.links.size() && views.links[link].a == face; ++link)
      next = std::max({next, views.links[link].start + 1, views.links[link].end + 1});
  }
  first_vertices_.push_back(next);
}

ViewBlock MapLayout::MakeViewBlock(const BlockEntry& entry) const {
  const Views& views = rows_.views;
  const auto first = static_cast<FaceIdx>(entry.first);
  const FaceIdx ordinal = first / kViewRegionsPerBlock;
  ViewBlock block{.first = first, .first_vertex = first_vertices_[ordinal]};
  block.vertices.assign(views.vertices.begin() + block.first_vertex,
                        views.vertices.begin() + first_vertices_[ordinal + 1]);
  int32_t next = block.first_vertex;
  auto link = std::lower_bound(views.links.begin(), views.links.end(), ViewLink{.a = first});
  for (FaceIdx face = first; face < static_cast<FaceIdx>(entry.first + entry.count); ++face) {
    ViewBlock::Region& region = block.regions.emplace_back();
    region.corners.assign(views.face_vertices.begin() + views.face_offsets[face],
                          views.face_vertices.begin() + views.face_offsets[face + 1]);
    region.parent = views.parents[face];
    region.toggled.assign(views.toggled_labels.begin() + views.toggle_offsets[face],
                          views.toggled_labels.begin() + views.toggle_offsets[face + 1]);
    region.index = views.index[face];
    for (const int32_t corner : region.corners) next = std::max(next, corner + 1);
    const int32_t next_of_corners = next;
    for (; link != views.links.end() && link->a == face; ++link) {
      region.links.push_back(*link);
      next = std::max({next, link->start + 1, link->end + 1});
    }
    region.num_more_vertices = next - next_of_corners;
  }
  return block;
}

VisualBlock MapLayout::MakeVisualBlock(const BlockEntry& entry) const {
  const VisualMapData& all = rows_.visual_map;
  const auto begin = all.landmarks.begin() + entry.first;
  return {static_cast<LandmarkIdx>(entry.first),
          {all.camera_id, all.focal_px, all.errors, all.headings_deg, {begin, begin + entry.count}}};
}

std::vector<float> MapLayout::MakeDocumentNorms() const {
  std::vector<float> norms(rows_.images.size(), 0);
  for (size_t document = 0; document < image_of_document_.size(); ++document) {
    norms[image_of_document_[document]] = rows_.vocabulary.document_norms[document];
  }
  return norms;
}

std::string MapLayout::Encode(const BlockEntry& entry) const {
  switch (static_cast<BlockKind>(entry.kind)) {
    case BlockKind::kStations:
      return EncodeBlock(MakeStationBlock(entry));
    case BlockKind::kRegions:
      return EncodeBlock(MakeRegionBlock(entry));
    case BlockKind::kVocabularyTree:
      return EncodeVocabularyTree(rows_.vocabulary);
    case BlockKind::kDocumentNorms:
      return EncodeDocumentNorms(MakeDocumentNorms());
    case BlockKind::kWords:
      return EncodeBlock(MakeWordBlock(entry));
    case BlockKind::kImages:
      return EncodeBlock(MakeImageBlock(entry));
    case BlockKind::kLandmarks:
      return EncodeBlock(MakeLandmarkBlock(entry));
    case BlockKind::kAppearance:
      return EncodeBlock(MakeAppearanceBlock(entry));
    case BlockKind::kAmbiguity:
      return EncodeBlock(MakeAmbiguityBlock(entry));
    case BlockKind::kFloorPlan:
      return EncodeFloorPlan(rows_.views.plan);
    case BlockKind::kViewRegions:
      return EncodeBlock(MakeViewBlock(entry));
    case BlockKind::kLandmarkModels:
      return EncodeBlock(MakeVisualBlock(entry));
  }
  return "";
}

}  // namespace cairn
