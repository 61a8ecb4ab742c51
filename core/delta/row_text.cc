#include "core/delta/row_text.h"

#include <cstdint>
#include <utility>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_layout.h"

namespace cairn {
namespace {

BlockEntry AllOf(BlockKind kind, size_t count) {
  return {.kind = static_cast<uint8_t>(kind), .count = static_cast<uint32_t>(count)};
}

// The rows with nothing but what is written here.
MapRows Bare(const MapRows& rows) {
  MapRows bare;
  bare.stations = rows.stations;
  bare.station_edges = rows.station_edges;
  bare.images = rows.images;
  for (MapImage& image : bare.images) image.landmarks.clear();
  bare.appearance = rows.appearance;
  return bare;
}

// Moves the blocks' elements into the rows.
void Take(StationBlock stations, MapRows* rows) {
  rows->stations = std::move(stations.stations);
  rows->station_edges.clear();
  for (size_t u = 0; u < stations.neighbours.size(); ++u) {
    for (const StationIdx v : stations.neighbours[u])
      rows->station_edges.emplace_back(static_cast<StationIdx>(u), v);
  }
}

void Take(ImageBlock images, MapRows* rows) {
  for (size_t i = 0; i < images.images.size(); ++i) {
    images.images[i].landmarks = std::move(rows->images[i].landmarks);
    rows->images[i] = std::move(images.images[i]);
  }
}

void Take(AmbiguityBlock nodes, MapRows* rows) {
  for (size_t i = 0; i < nodes.nodes.size(); ++i) {
    rows->appearance[i].entropy = nodes.nodes[i].entropy;
    rows->appearance[i].look_alikes = std::move(nodes.nodes[i].look_alikes);
  }
}

}  // namespace

std::string WriteRowText(const MapRows& rows) {
  const MapRows bare = Bare(rows);
  const MapLayout layout(bare);
  const size_t num_nodes = bare.appearance.size();
  const bool has_entropies = num_nodes > 0 && bare.appearance[0].entropy.has_value();
  BlobWriter writer;
  for (const std::string& block :
       {EncodeBlock(layout.MakeStationBlock(AllOf(BlockKind::kStations, bare.stations.size()))),
        EncodeBlock(layout.MakeImageBlock(AllOf(BlockKind::kImages, bare.images.size()))),
        EncodeBlock(layout.MakeAppearanceBlock(AllOf(BlockKind::kAppearance, num_nodes))),
        has_entropies ? EncodeBlock(layout.MakeAmbiguityBlock(AllOf(BlockKind::kAmbiguity, num_nodes)))
                      : std::string()}) {
    writer.Varint(block.size());
    writer.Bytes(block);
  }
  return writer.Take();
}

Status ReadRowText(std::string_view bytes, const std::string& what, MapRows* rows) {
  const BlockEntry stations = AllOf(BlockKind::kStations, rows->stations.size());
  const BlockEntry images = AllOf(BlockKind::kImages, rows->images.size());
  const BlockEntry nodes = AllOf(BlockKind::kAppearance, rows->appearance.size());
  const BlockEntry ambiguity = AllOf(BlockKind::kAmbiguity, rows->appearance.size());
  MapDirectory directory;
  for (const BlockEntry& entry : {stations, images, nodes, ambiguity}) directory.Add(entry);
  BlobReader reader(bytes);
  const auto next = [&] { return reader.Bytes(reader.Varint()); };
  const std::string_view of_stations = next(), of_images = next(), of_nodes = next(), of_ambiguity = next();
  if (!reader.Finished()) return Corrupt(what, "its stations, images and nodes are cut off");
  CAIRN_ASSIGN_OR_RETURN(StationBlock station_block,
                         DecodeStationBlock(of_stations, stations, directory, what));
  CAIRN_ASSIGN_OR_RETURN(ImageBlock image_block, DecodeImageBlock(of_images, images, directory, what));
  CAIRN_ASSIGN_OR_RETURN(AppearanceBlock node_block, DecodeAppearanceBlock(of_nodes, nodes, directory, what));
  Take(std::move(station_block), rows);
  Take(std::move(image_block), rows);
  rows->appearance = std::move(node_block.nodes);
  if (of_ambiguity.empty()) return Ok();
  CAIRN_ASSIGN_OR_RETURN(AmbiguityBlock ambiguity_block,
                         DecodeAmbiguityBlock(of_ambiguity, ambiguity, directory, what));
  Take(std::move(ambiguity_block), rows);
  return Ok();
}

}  // namespace cairn
