#include "core/delta/row_text.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/base/blob.h"
#include "core/packing/map_codes.h"
#include "core/world/appearance.h"

namespace cairn {
namespace {

constexpr double kThousandths = 1000;
constexpr int kIsCovered = 1, kHasHeading = 2;
constexpr int kIsKept = 1, kHasEntropy = 2;

void WriteStations(const MapRows& rows, BlobWriter* writer) {
  auto edge = rows.station_edges.begin();
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    const MapStation& station = rows.stations[i];
    for (const double coordinate : {station.position.x(), station.position.y()})
      writer->Varint(ZigZag(EncodeLength(coordinate)));
    writer->UInt8(static_cast<uint8_t>((station.is_covered ? kIsCovered : 0) |
                                       (station.heading_deg ? kHasHeading : 0)));
    if (station.heading_deg) writer->Varint(ZigZag(std::llround(*station.heading_deg * kThousandths)));
    const auto begin = edge;
    while (edge != rows.station_edges.end() && edge->first == static_cast<StationIdx>(i)) ++edge;
    writer->Varint(static_cast<uint64_t>(edge - begin));
    for (auto neighbour = begin; neighbour != edge; ++neighbour)
      writer->Varint(static_cast<uint64_t>(neighbour->second) - i);
  }
}

bool ReadStations(BlobReader* reader, MapRows* rows) {
  const auto num = static_cast<int64_t>(rows->stations.size());
  for (int64_t i = 0; i < num; ++i) {
    MapStation& station = rows->stations[i];
    for (double* coordinate : {&station.position.x(), &station.position.y()})
      *coordinate = DecodeLength(UnZigZag(reader->Varint()));
    const uint8_t flags = reader->UInt8();
    if (flags > (kIsCovered | kHasHeading)) return false;
    station.is_covered = (flags & kIsCovered) != 0;
    station.heading_deg.reset();
    if ((flags & kHasHeading) != 0)
      station.heading_deg = static_cast<double>(UnZigZag(reader->Varint())) / kThousandths;
    const uint64_t num_neighbours = reader->Varint();
    if (num_neighbours > reader->num_left()) return false;
    for (uint64_t k = 0, step = 0; k < num_neighbours; ++k) {
      const uint64_t next = reader->Varint();
      if (next <= step || next >= static_cast<uint64_t>(num - i)) return false;
      step = next;
      rows->station_edges.emplace_back(static_cast<StationIdx>(i), static_cast<StationIdx>(i + step));
    }
  }
  return reader->ok();
}

void WriteImages(const MapRows& rows, BlobWriter* writer) {
  ImageId id = 0;
  std::string name;
  for (const MapImage& image : rows.images) {
    writer->Varint(ZigZag(static_cast<int64_t>(image.image_id) - id));
    id = image.image_id;
    const auto differs = std::mismatch(name.begin(), name.end(), image.name.begin(), image.name.end()).first;
    const auto num_shared = static_cast<size_t>(differs - name.begin());
    writer->Varint(num_shared);
    writer->Varint(image.name.size() - num_shared);
    writer->Bytes(std::string_view(image.name).substr(num_shared));
    name = image.name;
    writer->Varint(image.camera_id);
    writer->Varint(static_cast<uint64_t>(image.station + 1));
    WriteRotation(image.cam_from_world.rotation, writer);
    for (const double coordinate : image.cam_from_world.translation)
      writer->UInt32(static_cast<uint32_t>(EncodeLength(coordinate)));
  }
}

bool ReadImages(BlobReader* reader, MapRows* rows) {
  int64_t id = 0;
  std::string name;
  for (MapImage& image : rows->images) {
    const int64_t step = UnZigZag(reader->Varint());
    if (step <= 0 || step > std::numeric_limits<ImageId>::max() - id) return false;
    id += step;
    image.image_id = static_cast<ImageId>(id);
    const uint64_t num_shared = reader->Varint(), num_more = reader->Varint();
    if (num_shared > name.size() || num_more > kMaxNameBytes - num_shared) return false;
    image.name = name.substr(0, num_shared).append(reader->Bytes(num_more));
    name = image.name;
    const uint64_t camera_id = reader->Varint();
    if (camera_id > std::numeric_limits<CameraId>::max()) return false;
    image.camera_id = static_cast<CameraId>(camera_id);
    const uint64_t station = reader->Varint();
    if (station > rows->stations.size()) return false;
    image.station = static_cast<StationIdx>(station) - 1;
    image.cam_from_world.rotation = ReadRotation(reader);
    for (double& coordinate : image.cam_from_world.translation)
      coordinate = DecodeLength(static_cast<int32_t>(reader->UInt32()));
  }
  return reader->ok();
}

uint64_t InThousandths(double value) { return static_cast<uint64_t>(Thousandths(value)); }

// Edges to nodes of larger index, each with a number.
template <class Edge, class NumberOf>
void WriteEdges(const std::vector<Edge>& edges, size_t node, const NumberOf& number_of, BlobWriter* writer) {
  writer->Varint(edges.size());
  for (const Edge& edge : edges) {
    writer->Varint(static_cast<uint64_t>(edge.node) - node);
    writer->Varint(number_of(edge));
  }
}

// `add`: takes the other node and the number; false where that is none.
template <class Add>
bool ReadEdges(BlobReader* reader, int64_t node, int64_t num_nodes, const Add& add) {
  const uint64_t num = reader->Varint();
  if (num > reader->num_left()) return false;
  for (uint64_t k = 0, step = 0; k < num; ++k) {
    const uint64_t next = reader->Varint();
    if (next <= step || next >= static_cast<uint64_t>(num_nodes - node)) return false;
    step = next;
    if (!add(static_cast<int32_t>(node + static_cast<int64_t>(step)), reader->Varint())) return false;
  }
  return reader->ok();
}

void WriteNodes(const MapRows& rows, BlobWriter* writer) {
  for (size_t i = 0; i < rows.appearance.size(); ++i) {
    const MapAppearanceNode& node = rows.appearance[i];
    writer->UInt8(static_cast<uint8_t>((node.is_kept ? kIsKept : 0) | (node.entropy ? kHasEntropy : 0)));
    if (node.entropy) writer->Varint(InThousandths(*node.entropy));
    writer->Varint(node.images.size());
    auto before = static_cast<int64_t>(i);
    for (const int32_t image : node.images) {
      writer->Varint(ZigZag(image - before));
      before = image;
    }
    WriteEdges(
        node.links, i, [](const auto& link) { return static_cast<uint64_t>(link.num_inliers); }, writer);
    WriteEdges(
        node.look_alikes, i, [](const auto& other) { return InThousandths(other.score); }, writer);
  }
}

bool ReadNodes(BlobReader* reader, MapRows* rows) {
  const auto num_nodes = static_cast<int64_t>(rows->appearance.size());
  const auto num_images = static_cast<int64_t>(rows->images.size());
  for (int64_t i = 0; i < num_nodes; ++i) {
    MapAppearanceNode& node = rows->appearance[i];
    const uint8_t flags = reader->UInt8();
    if (flags > (kIsKept | kHasEntropy)) return false;
    node.is_kept = (flags & kIsKept) != 0;
    node.entropy.reset();
    if ((flags & kHasEntropy) != 0) {
      const uint64_t entropy = reader->Varint();
      if (entropy > InThousandths(kMaxEntropy)) return false;
      node.entropy = OfThousandths(static_cast<int64_t>(entropy));
    }
    const uint64_t num = reader->Varint();
    if (num == 0 || num > reader->num_left()) return false;
    for (uint64_t k = 0; k < num; ++k) {
      const int64_t before = k == 0 ? i : node.images.back();
      const int64_t step = UnZigZag(reader->Varint());
      if (step < -num_images || step > num_images || (k > 0 && step <= 0)) return false;
      if (before + step < 0 || before + step >= num_images) return false;
      node.images.push_back(static_cast<int32_t>(before + step));
    }
    const bool are_links = ReadEdges(reader, i, num_nodes, [&](int32_t other, uint64_t num_inliers) {
      if (num_inliers == 0 || num_inliers > std::numeric_limits<int32_t>::max()) return false;
      node.links.push_back({other, static_cast<int32_t>(num_inliers)});
      return true;
    });
    const bool are_look_alikes =
        are_links && ReadEdges(reader, i, num_nodes, [&](int32_t other, uint64_t score) {
          if (score == 0 || score > InThousandths(1)) return false;
          node.look_alikes.push_back({other, OfThousandths(static_cast<int64_t>(score))});
          return true;
        });
    if (!are_look_alikes) return false;
  }
  return reader->ok();
}

}  // namespace

std::string WriteRowText(const MapRows& rows) {
  BlobWriter writer;
  WriteStations(rows, &writer);
  WriteImages(rows, &writer);
  WriteNodes(rows, &writer);
  return writer.Take();
}

bool ReadRowText(std::string_view bytes, MapRows* rows) {
  BlobReader reader(bytes);
  rows->station_edges.clear();
  return ReadStations(&reader, rows) && ReadImages(&reader, rows) && ReadNodes(&reader, rows) &&
         reader.Finished();
}

}  // namespace cairn
