// Blocks of the floor plan and its view-invariant regions as bytes: drawn in schemas/FORMAT.md.
#include <cstdlib>
#include <limits>

#include "core/blocks/map_blocks.h"
#include "core/packing/map_codes.h"

namespace cairn {
namespace {

void WriteStep(const GridPoint& point, GridPoint* before, BlobWriter* writer) {
  writer->Varint(ZigZag(point.x - before->x));
  writer->Varint(ZigZag(point.y - before->y));
  *before = point;
}

// A point off the grid makes the reader fail.
GridPoint ReadStep(GridPoint* before, BlobReader* reader) {
  before->x += UnZigZag(reader->Varint());  // a varint has 63 bits at most
  before->y += UnZigZag(reader->Varint());
  if (std::abs(before->x) > kMaxGridCoordinate || std::abs(before->y) > kMaxGridCoordinate) {
    reader->Fail();
    *before = {};
  }
  return *before;
}

// Vertices of regions by how long ago they were first named.
class VertexWriter {
 public:
  VertexWriter(const ViewBlock& block, BlobWriter* writer)
      : block_(block), writer_(*writer), next_(block.first_vertex) {}
  void Write(int32_t vertex) {
    writer_.Varint(static_cast<uint64_t>(next_ - vertex));
    if (vertex == next_) WriteNext();
  }
  void WriteNext() { WriteStep(block_.vertices[next_++ - block_.first_vertex], &last_, &writer_); }

 private:
  const ViewBlock& block_;
  BlobWriter& writer_;
  int32_t next_;
  GridPoint last_;
};

class VertexReader {
 public:
  VertexReader(BlobReader* reader, ViewBlock* block) : reader_(*reader), block_(*block) {}
  int32_t Read() {
    const int64_t next = Next();
    const uint64_t back = reader_.Varint();
    if (back == 0) ReadNext();
    if (back > static_cast<uint64_t>(next)) reader_.Fail();
    return reader_.ok() ? static_cast<int32_t>(next - static_cast<int64_t>(back)) : 0;
  }
  void ReadNext() {
    if (Next() >= std::numeric_limits<int32_t>::max()) return reader_.Fail();
    block_.vertices.push_back(ReadStep(&last_, &reader_));
  }
  int64_t Next() const { return block_.first_vertex + static_cast<int64_t>(block_.vertices.size()); }

 private:
  BlobReader& reader_;
  ViewBlock& block_;
  GridPoint last_;
};

void ReadRegion(BlobReader* reader, VertexReader* vertices, FaceIdx face, const MapDirectory& directory,
                int64_t* max_num_values, ViewBlock::Region* region) {
  const uint64_t num_corners = reader->Varint();
  if (num_corners < 3 || num_corners > reader->num_left()) return reader->Fail();
  for (uint64_t i = 0; i < num_corners && reader->ok(); ++i) region->corners.push_back(vertices->Read());
  const uint64_t num_more = reader->Varint();
  if (num_more > reader->num_left()) return reader->Fail();
  for (uint64_t i = 0; i < num_more && reader->ok(); ++i) vertices->ReadNext();
  region->num_more_vertices = static_cast<int32_t>(num_more);
  const uint64_t parent = reader->Varint();
  if (parent > static_cast<uint64_t>(face)) return reader->Fail();
  region->parent = parent == 0 ? -1 : static_cast<FaceIdx>(face - parent);
  if (!ReadRuns(reader, 2 * directory.Count(BlockKind::kFloorPlan), max_num_values, &region->toggled))
    return reader->Fail();
  const uint64_t num_labels = reader->Varint();
  if (num_labels > static_cast<uint64_t>(2 * directory.Count(BlockKind::kFloorPlan))) return reader->Fail();
  region->index.num_labels = static_cast<int32_t>(num_labels);
  for (float* value : {&region->index.wall_length_m, &region->index.visible_length_m,
                       &region->index.visible_area_m2, &region->index.longest_m}) {
    *value = reader->Float32();
  }
  const uint64_t num_links = reader->Varint();
  if (num_links > reader->num_left()) return reader->Fail();
  int64_t other = face;
  for (uint64_t i = 0; i < num_links && reader->ok(); ++i) {
    const uint64_t step = reader->Varint();
    if (step >= static_cast<uint64_t>(directory.Count(BlockKind::kViewRegions))) return reader->Fail();
    other += static_cast<int64_t>(step);
    if (other <= face || other >= directory.Count(BlockKind::kViewRegions)) return reader->Fail();
    const int32_t start = vertices->Read(), end = vertices->Read();
    region->links.push_back({face, static_cast<FaceIdx>(other), start, end});
  }
}

}  // namespace

std::string EncodeFloorPlan(const FloorPlan& plan) {
  BlobWriter writer;
  writer.Float64(plan.grid_m);
  writer.Float64(plan.origin.x());
  writer.Float64(plan.origin.y());
  writer.UInt8(plan.closed ? 1 : 0);
  GridPoint last;
  WriteStep(plan.low, &last, &writer);
  WriteStep(plan.high, &last, &writer);
  writer.Varint(plan.vertices.size());
  for (const GridPoint& vertex : plan.vertices) WriteStep(vertex, &last, &writer);
  size_t piece = 0;
  int64_t last_end = 0;
  for (size_t i = 0; i < plan.walls.size(); ++i) {
    for (const Eigen::Vector2d& end : {plan.walls[i].start, plan.walls[i].end}) {
      writer.Float64(end.x());
      writer.Float64(end.y());
    }
    size_t end = piece;
    while (end < plan.pieces.size() && plan.pieces[end].wall == static_cast<int32_t>(i)) ++end;
    writer.Varint(end - piece);
    for (; piece < end; ++piece) {
      writer.Varint(ZigZag(plan.pieces[piece].start - last_end));
      writer.Varint(ZigZag(plan.pieces[piece].end - int64_t{plan.pieces[piece].start}));
      last_end = plan.pieces[piece].end;
    }
  }
  return writer.Take();
}

Result<FloorPlan> DecodeFloorPlan(std::string_view bytes, const BlockEntry& entry, const MapDirectory&,
                                  const std::string& what) {
  BlobReader reader(bytes);
  FloorPlan plan;
  plan.grid_m = reader.Float64();
  plan.origin.x() = reader.Float64();
  plan.origin.y() = reader.Float64();
  const uint8_t flags = reader.UInt8();
  plan.closed = flags == 1;
  GridPoint last;
  plan.low = ReadStep(&last, &reader);
  plan.high = ReadStep(&last, &reader);
  const uint64_t num_vertices = reader.Varint();
  if (flags > 1 || num_vertices > reader.num_left()) return Corrupt(what, "its head makes no sense");
  for (uint64_t i = 0; i < num_vertices && reader.ok(); ++i)
    plan.vertices.push_back(ReadStep(&last, &reader));
  const auto read_vertex = [&](int64_t before) {
    const int64_t vertex = before + UnZigZag(reader.Varint());
    if (vertex < 0 || vertex >= static_cast<int64_t>(num_vertices)) reader.Fail();
    return reader.ok() ? vertex : 0;
  };
  int64_t at = 0;
  for (uint32_t i = 0; i < entry.count && reader.ok(); ++i) {
    PlanWall& wall = plan.walls.emplace_back();
    for (Eigen::Vector2d* end : {&wall.start, &wall.end}) {
      end->x() = reader.Float64();
      end->y() = reader.Float64();
    }
    const uint64_t num_pieces = reader.Varint();
    if (num_pieces > reader.num_left()) return Corrupt(what, "wall {} has {} pieces", i, num_pieces);
    for (uint64_t k = 0; k < num_pieces && reader.ok(); ++k) {
      const int64_t start = read_vertex(at);
      at = read_vertex(start);
      plan.pieces.push_back({static_cast<int32_t>(start), static_cast<int32_t>(at), static_cast<int32_t>(i)});
    }
  }
  if (!reader.Finished()) return Corrupt(what, "its bytes are not those of {} walls", entry.count);
  CAIRN_RETURN_IF_ERROR(CheckFloorPlan(plan, what));
  return plan;
}

std::string EncodeBlock(const ViewBlock& block) {
  BlobWriter writer;
  writer.Varint(static_cast<uint64_t>(block.first_vertex));
  VertexWriter vertices(block, &writer);
  for (size_t i = 0; i < block.regions.size(); ++i) {
    const ViewBlock::Region& region = block.regions[i];
    const auto face = static_cast<FaceIdx>(block.first + i);
    writer.Varint(region.corners.size());
    for (const int32_t corner : region.corners) vertices.Write(corner);
    writer.Varint(static_cast<uint64_t>(region.num_more_vertices));
    for (int32_t k = 0; k < region.num_more_vertices; ++k) vertices.WriteNext();
    writer.Varint(region.parent < 0 ? 0 : static_cast<uint64_t>(face - region.parent));
    WriteRuns(region.toggled, &writer);
    writer.Varint(static_cast<uint64_t>(region.index.num_labels));
    for (const float value : {region.index.wall_length_m, region.index.visible_length_m,
                              region.index.visible_area_m2, region.index.longest_m}) {
      writer.Float32(value);
    }
    writer.Varint(region.links.size());
    FaceIdx other = face;
    for (const ViewLink& link : region.links) {
      writer.Varint(static_cast<uint64_t>(link.b - other));
      other = link.b;
      vertices.Write(link.start);
      vertices.Write(link.end);
    }
  }
  return writer.Take();
}

Result<ViewBlock> DecodeViewBlock(std::string_view bytes, const BlockEntry& entry,
                                  const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  ViewBlock block;
  block.first = static_cast<FaceIdx>(entry.first);
  const uint64_t first_vertex = reader.Varint();
  if (first_vertex > std::numeric_limits<int32_t>::max())
    return Corrupt(what, "{} vertices come before it", first_vertex);
  block.first_vertex = static_cast<int32_t>(first_vertex);
  VertexReader vertices(&reader, &block);
  int64_t max_num_values = kMaxListElements;
  for (uint32_t i = 0; i < entry.count; ++i) {
    ReadRegion(&reader, &vertices, static_cast<FaceIdx>(entry.first + i), directory, &max_num_values,
               &block.regions.emplace_back());
    if (!reader.ok()) return Corrupt(what, "region {} of the floor plan makes no sense", entry.first + i);
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} regions", entry.count);
  return block;
}

Status AppendRegions(const ViewBlock& block, const std::string& what, Views* views) {
  if (block.first != views->num_faces() ||
      block.first_vertex != static_cast<int32_t>(views->vertices.size())) {
    return Corrupt(what, "begins with region {} and vertex {}, but {} and {} come before it", block.first,
                   block.first_vertex, views->num_faces(), views->vertices.size());
  }
  views->vertices.insert(views->vertices.end(), block.vertices.begin(), block.vertices.end());
  for (const ViewBlock::Region& region : block.regions) {
    views->face_vertices.insert(views->face_vertices.end(), region.corners.begin(), region.corners.end());
    views->face_offsets.push_back(static_cast<int64_t>(views->face_vertices.size()));
    views->parents.push_back(region.parent);
    views->toggled_labels.insert(views->toggled_labels.end(), region.toggled.begin(), region.toggled.end());
    views->toggle_offsets.push_back(static_cast<int64_t>(views->toggled_labels.size()));
    views->index.push_back(region.index);
    views->links.insert(views->links.end(), region.links.begin(), region.links.end());
  }
  return Ok();
}

int64_t NumBytes(const FloorPlan& plan) {
  return static_cast<int64_t>(sizeof(plan) + plan.vertices.size() * sizeof(GridPoint) +
                              plan.pieces.size() * sizeof(PlanPiece) + plan.walls.size() * sizeof(PlanWall));
}

int64_t NumBytes(const ViewBlock& block) {
  auto num_bytes = static_cast<int64_t>(sizeof(block) + block.vertices.size() * sizeof(GridPoint));
  for (const ViewBlock::Region& region : block.regions) {
    num_bytes += static_cast<int64_t>(sizeof(region) + region.links.size() * sizeof(ViewLink) +
                                      (region.corners.size() + region.toggled.size()) * sizeof(int32_t));
  }
  return num_bytes;
}

}  // namespace cairn
