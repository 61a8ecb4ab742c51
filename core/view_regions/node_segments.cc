#include "core/view_regions/node_segments.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "core/base/parallel.h"

namespace cairn {
namespace {

constexpr int64_t kItemsPerNodingBlock = 4096;

// The result of one tile: vertices, ascending, and which segments pass them.
struct TileNodes {
  struct Visit {
    int32_t segment, vertex;
  };
  std::vector<GridPoint> vertices;
  std::vector<Visit> visits;
};

bool Contains(const Tile& tile, const GridPoint& pixel) {
  return pixel.x >= tile.low.x && pixel.x < tile.high.x && pixel.y >= tile.low.y && pixel.y < tile.high.y;
}

// Pixels of a tile by columns of about equal width, each ascending by y.
class PixelColumns {
 public:
  PixelColumns(const Tile& tile, const std::vector<GridPoint>& pixels) : tile_(tile), pixels_(pixels) {
    const auto num = static_cast<int64_t>(std::sqrt(static_cast<double>(pixels.size()))) + 1;
    width_ = (tile.high.x - tile.low.x + num - 1) / num;
    columns_.resize((tile.high.x - tile.low.x + width_ - 1) / width_);
    for (size_t i = 0; i < pixels.size(); ++i) columns_[ColumnOf(pixels[i].x)].push_back(static_cast<int>(i));
    for (std::vector<int>& column : columns_) {
      std::sort(column.begin(), column.end(), [&](int a, int b) {
        return std::tie(pixels[a].y, pixels[a].x) < std::tie(pixels[b].y, pixels[b].x);
      });
    }
  }

  // Calls visit(index) for the pixels that a segment passes.
  template <typename Visit>
  void VisitPassed(const SubSegment& segment, Visit&& visit) const {
    SubSegment s = segment;
    if (s.x0 > s.x1) {
      std::swap(s.x0, s.x1);
      std::swap(s.y0, s.y1);
    }
    const int64_t first_x = PixelOf(s.x0, 0).x, last_x = PixelOf(s.x1, 0).x;
    if (last_x < tile_.low.x || first_x >= tile_.high.x) return;
    const double slope =
        s.x1 > s.x0 ? static_cast<double>(s.y1 - s.y0) / static_cast<double>(s.x1 - s.x0) : 0;
    const size_t last = ColumnOf(std::min(last_x, tile_.high.x - 1));
    for (size_t i = ColumnOf(std::max(first_x, tile_.low.x)); i <= last; ++i) {
      // The rows of the segment above this column, and one more on either side for rounding.
      int64_t low = s.y0, high = s.y1;
      if (s.x1 > s.x0) {
        const auto y_at = [&](int64_t pixel_x) {
          const int64_t x = std::clamp(pixel_x << kSubBits, s.x0, s.x1);
          return s.y0 + std::llround(slope * static_cast<double>(x - s.x0));
        };
        const auto left = tile_.low.x + static_cast<int64_t>(i) * width_;
        low = y_at(left - 1);
        high = y_at(left + width_);
      }
      if (low > high) std::swap(low, high);
      const int64_t first_row = PixelOf(0, low).y - 1, last_row = PixelOf(0, high).y + 1;
      const std::vector<int>& column = columns_[i];
      for (auto at = std::lower_bound(column.begin(), column.end(), first_row,
                                      [&](int pixel, int64_t row) { return pixels_[pixel].y < row; });
           at != column.end() && pixels_[*at].y <= last_row; ++at) {
        if (Passes(segment, pixels_[*at])) visit(*at);
      }
    }
  }

 private:
  size_t ColumnOf(int64_t x) const { return static_cast<size_t>((x - tile_.low.x) / width_); }

  const Tile& tile_;
  const std::vector<GridPoint>& pixels_;
  int64_t width_ = 1;
  std::vector<std::vector<int>> columns_;
};

// Visits the crossings of segments in a tile: visit(low, high) with the pixels that a crossing may lie in.
// False: stopped.
template <typename Visit>
bool VisitCrossings(const std::vector<SubSegment>& segments, const SegmentTiles& tiles, const Tile& tile,
                    const Progress& progress, Visit&& visit) {
  GridPoint low, high;
  int64_t compared = 0;
  for (int64_t i = tile.first; i < tile.last; ++i) {
    for (int64_t j = tile.first; j < i; ++j) {
      if (CrossAt(segments[tiles.segments[i]], segments[tiles.segments[j]], &low, &high)) visit(low, high);
    }
    compared += i - tile.first;
    if (compared > int64_t{1} << 20) {
      if (progress.Cancelled()) return false;
      compared = 0;
    }
  }
  return true;
}

TileNodes NodeTile(const std::vector<SubSegment>& segments, const SegmentTiles& tiles, const Tile& tile,
                   const Progress& progress) {
  std::vector<GridPoint> hot;
  const auto add = [&](const GridPoint& pixel) {
    if (Contains(tile, pixel)) hot.push_back(pixel);
  };
  for (int64_t i = tile.first; i < tile.last; ++i) {
    const SubSegment& segment = segments[tiles.segments[i]];
    add(PixelOf(segment.x0, segment.y0));
    add(PixelOf(segment.x1, segment.y1));
  }
  TileNodes nodes;
  // A pixel more than needed does no harm: vertices are needed at crossings, and may be anywhere.
  const bool finished =
      VisitCrossings(segments, tiles, tile, progress, [&](const GridPoint& low, const GridPoint& high) {
        for (int64_t x = low.x; x <= high.x; ++x) {
          for (int64_t y = low.y; y <= high.y; ++y) add({x, y});
        }
      });
  if (!finished || hot.empty()) return nodes;
  std::sort(hot.begin(), hot.end());
  hot.erase(std::unique(hot.begin(), hot.end()), hot.end());
  const PixelColumns columns(tile, hot);
  for (int64_t i = tile.first; i < tile.last; ++i) {
    const int32_t segment = tiles.segments[i];
    columns.VisitPassed(segments[segment], [&](int pixel) { nodes.visits.push_back({segment, pixel}); });
  }
  // Only pixels that segments pass.
  std::vector<int32_t> numbers(hot.size(), -1);
  for (const TileNodes::Visit& visit : nodes.visits) numbers[visit.vertex] = 0;
  for (size_t i = 0; i < hot.size(); ++i) {
    if (numbers[i] < 0) continue;
    numbers[i] = static_cast<int32_t>(nodes.vertices.size());
    nodes.vertices.push_back(hot[i]);
  }
  for (TileNodes::Visit& visit : nodes.visits) visit.vertex = numbers[visit.vertex];
  nodes.vertices.shrink_to_fit();
  nodes.visits.shrink_to_fit();
  return nodes;
}

// Calls body(first, end) for blocks of [0, num_items) on threads, and reports them.  False: cancelled.
template <typename Body>
bool ForBlocks(int64_t num_items, int num_threads, std::string_view task, Progress& progress, Body&& body) {
  const int64_t num_blocks = (num_items + kItemsPerNodingBlock - 1) / kItemsPerNodingBlock;
  progress.Begin(task, num_blocks, "blocks");
  ParallelFor(num_blocks, num_threads, [&](int64_t block) {
    if (progress.Cancelled()) return;
    body(block * kItemsPerNodingBlock, std::min(num_items, (block + 1) * kItemsPerNodingBlock));
    progress.Advance();
  });
  progress.End();
  return !progress.Cancelled();
}

// Joins the results of the tiles.  All steps are short or done in blocks.
class Joiner {
 public:
  Joiner(const std::vector<SubSegment>& segments, const std::vector<int32_t>& tags, int num_threads,
         Progress& progress)
      : segments_(segments), tags_(tags), num_threads_(num_threads), progress_(progress) {}

  Result<NodedSegments> Run(std::vector<TileNodes>* tiles) {
    if (!SortVertices(*tiles)) return Cancelled();
    GatherVisits(tiles);
    if (!SortVisits() || !MakeEdges()) return Cancelled();
    return std::move(result_);
  }

 private:
  static Error Cancelled() { return MakeError(ErrorCode::kCancelled, "cancelled"); }

  // All vertices ascending, in strips of x that are sorted one by one; ranks_: where each tile's are.
  bool SortVertices(const std::vector<TileNodes>& tiles) {
    struct Numbered {
      GridPoint place;
      int32_t number;
    };
    std::vector<int64_t> xs;
    int32_t num_vertices = 0;
    for (const TileNodes& tile : tiles) {
      num_vertices += static_cast<int32_t>(tile.vertices.size());
      if (!tile.vertices.empty()) xs.push_back(tile.vertices[tile.vertices.size() / 2].x);
    }
    std::sort(xs.begin(), xs.end());
    const size_t num_strips = num_vertices / kItemsPerNodingBlock + 1;
    std::vector<int64_t> strip_starts;  // of all strips but the first
    for (size_t i = 1; i < num_strips && !xs.empty(); ++i)
      strip_starts.push_back(xs[i * xs.size() / num_strips]);
    std::vector<std::vector<Numbered>> strips(strip_starts.size() + 1);
    int32_t number = 0;
    for (const TileNodes& tile : tiles) {
      for (const GridPoint& vertex : tile.vertices) {
        const auto strip = std::upper_bound(strip_starts.begin(), strip_starts.end(), vertex.x);
        strips[strip - strip_starts.begin()].push_back({vertex, number++});
      }
    }
    std::vector<int32_t> offsets(strips.size() + 1, 0);
    for (size_t i = 0; i < strips.size(); ++i)
      offsets[i + 1] = offsets[i] + static_cast<int32_t>(strips[i].size());
    ranks_.resize(num_vertices);
    result_.vertices.resize(num_vertices);
    ParallelFor(static_cast<int64_t>(strips.size()), num_threads_, [&](int64_t i) {
      if (progress_.Cancelled()) return;
      std::sort(strips[i].begin(), strips[i].end(),
                [](const Numbered& a, const Numbered& b) { return a.place < b.place; });
      for (size_t k = 0; k < strips[i].size(); ++k) {
        ranks_[strips[i][k].number] = offsets[i] + static_cast<int32_t>(k);
        result_.vertices[offsets[i] + k] = strips[i][k].place;
      }
      std::vector<Numbered>().swap(strips[i]);
    });
    return !progress_.Cancelled();
  }

  // Vertices of each segment, visits_[offsets_[i] .. offsets_[i + 1]); frees the tiles.
  void GatherVisits(std::vector<TileNodes>* tiles) {
    offsets_.assign(segments_.size() + 1, 0);
    for (const TileNodes& tile : *tiles) {
      for (const TileNodes::Visit& visit : tile.visits) ++offsets_[visit.segment + 1];
    }
    std::partial_sum(offsets_.begin(), offsets_.end(), offsets_.begin());
    visits_.resize(offsets_.back());
    std::vector<int64_t> next(offsets_.begin(), offsets_.end() - 1);
    int32_t base = 0;
    for (TileNodes& tile : *tiles) {
      for (const TileNodes::Visit& visit : tile.visits)
        visits_[next[visit.segment]++] = ranks_[base + visit.vertex];
      base += static_cast<int32_t>(tile.vertices.size());
      tile = {};
    }
    std::vector<int32_t>().swap(ranks_);
  }

  // Along each segment: both coordinates go one way.
  bool SortVisits() {
    const std::vector<GridPoint>& vertices = result_.vertices;
    return ForBlocks(static_cast<int64_t>(segments_.size()), num_threads_, "segments divided", progress_,
                     [&](int64_t first, int64_t end) {
                       for (int64_t i = first; i < end; ++i) {
                         const int sign_x = segments_[i].x1 < segments_[i].x0 ? -1 : 1;
                         const int sign_y = segments_[i].y1 < segments_[i].y0 ? -1 : 1;
                         std::sort(visits_.begin() + offsets_[i], visits_.begin() + offsets_[i + 1],
                                   [&](int32_t a, int32_t b) {
                                     const GridPoint &p = vertices[a], &q = vertices[b];
                                     return p.x != q.x ? sign_x * p.x < sign_x * q.x
                                                       : sign_y * p.y < sign_y * q.y;
                                   });
                       }
                     });
  }

  // Calls visit(edge) for the edges of all segments in order.
  template <typename Visit>
  void VisitEdges(Visit&& visit) const {
    for (size_t i = 0; i < segments_.size(); ++i) {
      for (int64_t k = offsets_[i]; k + 1 < offsets_[i + 1]; ++k)
        visit(NodedEdge{visits_[k], visits_[k + 1], tags_[i]});
    }
  }

  bool MakeEdges() {
    std::vector<int64_t> starts(result_.vertices.size() + 1, 0);  // by the lower end
    VisitEdges([&](const NodedEdge& edge) { ++starts[std::min(edge.start, edge.end) + 1]; });
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    result_.edges.resize(starts.back());
    std::vector<int64_t> next(starts.begin(), starts.end() - 1);
    VisitEdges([&](const NodedEdge& edge) { result_.edges[next[std::min(edge.start, edge.end)]++] = edge; });
    return ForBlocks(static_cast<int64_t>(result_.vertices.size()), num_threads_, "edges", progress_,
                     [&](int64_t first, int64_t end) {
                       for (int64_t i = first; i < end; ++i) {
                         std::sort(result_.edges.begin() + starts[i], result_.edges.begin() + starts[i + 1],
                                   [](const NodedEdge& a, const NodedEdge& b) {
                                     return std::tuple(std::max(a.start, a.end), a.tag, a.start) <
                                            std::tuple(std::max(b.start, b.end), b.tag, b.start);
                                   });
                       }
                     });
  }

  const std::vector<SubSegment>& segments_;
  const std::vector<int32_t>& tags_;
  int num_threads_;
  Progress& progress_;
  std::vector<int32_t> ranks_;  // of the tiles' vertices one after the other
  std::vector<int64_t> offsets_;
  std::vector<int32_t> visits_;
  NodedSegments result_;
};

}  // namespace

SegmentNoder::SegmentNoder(const std::vector<TaggedSegment>& segments) {
  for (const TaggedSegment& segment : segments) {
    segments_.push_back(MakeSubSegment(segment.start, segment.end));
    tags_.push_back(segment.tag);
  }
  tiles_ = MakeTiles(segments_);
}

Result<int64_t> SegmentNoder::CountCrossings(int num_threads, Progress& progress) const {
  std::atomic<int64_t> total{0};
  const auto num_tiles = static_cast<int64_t>(tiles_.tiles.size());
  progress.Begin("crossings counted", num_tiles, "tiles");
  ParallelFor(num_tiles, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const Tile& tile = tiles_.tiles[i];
    int64_t count = 0;
    VisitCrossings(segments_, tiles_, tile, progress,
                   [&](const GridPoint& low, const GridPoint&) { count += Contains(tile, low) ? 1 : 0; });
    total += count;
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
  return total.load();
}

Result<NodedSegments> SegmentNoder::Node(int num_threads, Progress& progress) const {
  const auto num_tiles = static_cast<int64_t>(tiles_.tiles.size());
  std::vector<TileNodes> nodes(num_tiles);
  progress.Begin("crossings", num_tiles, "tiles");
  ParallelFor(num_tiles, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    nodes[i] = NodeTile(segments_, tiles_, tiles_.tiles[i], progress);
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
  int64_t num_vertices = 0;
  for (const TileNodes& tile : nodes) num_vertices += static_cast<int64_t>(tile.vertices.size());
  if (num_vertices > std::numeric_limits<int32_t>::max()) {
    return MakeError(ErrorCode::kUnsupported, "{} vertices are more than 32 bits can number", num_vertices);
  }
  return Joiner(segments_, tags_, num_threads, progress).Run(&nodes);
}

}  // namespace cairn
