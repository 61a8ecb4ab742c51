#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"

namespace cairn {

// How rows are cut into blocks.  Landmarks whose first region is the same lie in one block (up to 1024 of
// them), small regions share one; images, stations, regions and words are cut by number.
class MapLayout {
 public:
  // Keeps a reference.  REQUIRES: CheckMapRows(rows)
  explicit MapLayout(const MapRows& rows);

  // Of every block in file order: kind, first, count and centers; neither bytes nor hash.
  const std::vector<BlockEntry>& entries() const { return entries_; }

  // The block of an entry as it is stored.
  std::string Encode(const BlockEntry& entry) const;
  // The same before it is encoded.  REQUIRES: `entry` is of its kind
  LandmarkBlock MakeLandmarkBlock(const BlockEntry& entry) const;
  ImageBlock MakeImageBlock(const BlockEntry& entry) const;
  StationBlock MakeStationBlock(const BlockEntry& entry) const;
  RegionBlock MakeRegionBlock(const BlockEntry& entry) const;
  WordBlock MakeWordBlock(const BlockEntry& entry) const;
  AppearanceBlock MakeAppearanceBlock(const BlockEntry& entry) const;
  AmbiguityBlock MakeAmbiguityBlock(const BlockEntry& entry) const;
  ViewBlock MakeViewBlock(const BlockEntry& entry) const;
  VisualBlock MakeVisualBlock(const BlockEntry& entry) const;
  // Per image; 0 for an image that is not a document.
  std::vector<float> MakeDocumentNorms() const;

 private:
  void CutLandmarks();
  void CutEvenly(BlockKind kind, size_t count, size_t size);
  void CutWords();
  void CutViews();
  void LinkRegions();
  void LinkImages();
  void AddEntry(BlockKind kind, size_t first, size_t count);

  const MapRows& rows_;
  size_t images_per_block_;
  std::vector<BlockEntry> entries_;
  std::vector<int32_t> first_landmarks_;  // of every landmark block
  std::vector<int32_t> landmark_block_;   // ordinal, of every landmark
  std::vector<std::vector<std::pair<RegionIdx, std::vector<LandmarkIdx>>>> regions_of_block_;
  std::vector<std::vector<int32_t>> blocks_of_region_;
  std::vector<std::vector<RegionIdx>> regions_of_station_;
  std::vector<std::vector<int32_t>> image_blocks_of_block_;
  std::vector<int32_t> image_of_document_;
  std::vector<int32_t> first_vertices_;  // of every block of view regions
};

}  // namespace cairn
