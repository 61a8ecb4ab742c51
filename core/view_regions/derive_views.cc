#include "core/view_regions/derive_views.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/line/memory.h"
#include "core/plan/visible_walls.h"
#include "core/view_regions/arrangement.h"
#include "core/view_regions/label_faces.h"
#include "core/view_regions/view_boundaries.h"
#include "core/view_regions/wall_rays.h"

namespace cairn {
namespace {

// Bytes of memory for a boundary and for an edge of the arrangement, measured (bench/views/README.md).
constexpr int64_t kBytesPerBoundary = 250;
constexpr double kBytesPerEdge = 250;
constexpr size_t kNumSampledVertices = 256, kNumSampledBoundaries = 4000;
// Factor by which an estimate from a sample may be too large.
constexpr double kSampleError = 1.5;
constexpr int64_t kFacesPerBlock = 1024;

// A map of another program's, or of an attacker's, may say anything.
Status CheckClean(const FloorPlan& plan) {
  CAIRN_RETURN_IF_ERROR(CheckFloorPlan(plan, "floor plan"));
  if (plan.num_walls() > kMaxNumDividedWalls || std::ssize(plan.pieces) > 2 * int64_t{kMaxNumDividedWalls})
    return MakeError(ErrorCode::kUnsupported, "a floor plan of {} walls in {} pieces; at most {} are divided",
                     plan.num_walls(), plan.pieces.size(), kMaxNumDividedWalls);
  const auto is_on_grid = [](const GridPoint& point) {
    return std::abs(point.x) <= kMaxGridCoordinate && std::abs(point.y) <= kMaxGridCoordinate;
  };
  if (!std::isfinite(plan.grid_m) || !is_on_grid(plan.low) || !is_on_grid(plan.high))
    return Corrupt("floor plan", "its grid or its box has no size");
  for (const GridPoint& vertex : plan.vertices) {
    if (vertex.x < plan.low.x || vertex.x > plan.high.x || vertex.y < plan.low.y || vertex.y > plan.high.y)
      return Corrupt("floor plan", "a vertex lies outside of its box");
  }
  std::vector<int32_t> first(plan.walls.size(), -1), last(plan.walls.size(), -1);
  for (const PlanPiece& piece : plan.pieces) {
    if (first[piece.wall] < 0) first[piece.wall] = piece.start;
    last[piece.wall] = piece.end;
  }
  for (int32_t wall = 0; wall < plan.num_walls(); ++wall) {
    const bool has_pieces = first[wall] >= 0;
    if (!has_pieces ||
        (plan.Metres(plan.vertices[first[wall]]) - plan.walls[wall].start).norm() > plan.grid_m ||
        (plan.Metres(plan.vertices[last[wall]]) - plan.walls[wall].end).norm() > plan.grid_m)
      return Corrupt("floor plan", "wall {} does not lie where its pieces do", wall);
  }
  return Ok();
}

// Refuses plans whose boundaries and regions would not fit into memory.
Status CheckSize(const FloorPlan& plan, double num_boundaries, double num_crossings, int64_t memory_mib) {
  const double num_edges = plan.num_walls() + num_boundaries + 2 * num_crossings;
  const std::string work =
      fmt::format("dividing {} walls by about {:.0f} view boundaries into about {:.0f} regions",
                  plan.num_walls(), num_boundaries, 0.5 * num_edges);
  const char* remedy =
      "simplify the plan (--simplify-m, --snap-m, no furniture), or divide it by buildings and floors";
  // No machine is large enough.
  if (num_edges > std::numeric_limits<int32_t>::max())
    return MakeError(ErrorCode::kUnsupported, "{}: more than 32 bits can number; {}", work, remedy);
  const double num_bytes = num_boundaries * kBytesPerBoundary + num_edges * kBytesPerEdge;
  const Status fits = CheckMemory(work, static_cast<int64_t>(num_bytes), memory_mib);
  return fits.ok() ? fits : MakeError(fits.error().code, "{}; or {}", fits.error().message, remedy);
}

// Refuses a large plan that, by a sample of its boundaries, takes much more memory than there is, before the
// other boundaries are found.  Of n boundaries in N, (n / N)^2 of the crossings are found.
Status CheckSample(const FloorPlan& plan, const WallRays& rays, int num_threads, int64_t memory_mib,
                   Progress& progress) {
  const auto stride = static_cast<int>(plan.vertices.size() / kNumSampledVertices);
  if (stride < 2) return Ok();
  const int64_t max_num_boundaries = (memory_mib << 20) / kBytesPerBoundary;
  auto sample = FindViewBoundaries(plan, rays, stride, max_num_boundaries, num_threads, progress);
  if (!sample.ok() && sample.error().code == ErrorCode::kFailed)
    return CheckSize(plan, static_cast<double>(stride) * static_cast<double>(max_num_boundaries), 0, 0);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<ViewBoundary> boundaries, std::move(sample));
  const size_t step = boundaries.size() / kNumSampledBoundaries + 1;
  std::vector<TaggedSegment> segments;
  for (size_t i = 0; i < boundaries.size(); i += step)
    segments.push_back({boundaries[i].start, boundaries[i].end, 0});
  CAIRN_ASSIGN_OR_RETURN(const int64_t num_crossings,
                         SegmentNoder(segments).CountCrossings(num_threads, progress));
  const double num_boundaries = static_cast<double>(stride) * static_cast<double>(boundaries.size());
  const double inverse_share = static_cast<double>(stride) * static_cast<double>(step);
  const double all_crossings = inverse_share * inverse_share * static_cast<double>(num_crossings);
  const Status fits = CheckSize(plan, num_boundaries, all_crossings,
                                static_cast<int64_t>(kSampleError * static_cast<double>(memory_mib)));
  return fits.ok() ? fits : CheckSize(plan, num_boundaries, all_crossings, memory_mib);
}

// Index values from the centroids.  Each block begins with a complete label set.
Status AddIndex(Views* views, int num_threads, Progress& progress) {
  const int64_t num_blocks = (views->num_faces() + kFacesPerBlock - 1) / kFacesPerBlock;
  views->index.resize(views->num_faces());
  progress.Begin("views", num_blocks, "blocks of regions");
  ParallelFor(num_blocks, num_threads, [&](int64_t block) {
    if (progress.Cancelled()) return;
    const auto first = static_cast<FaceIdx>(block * kFacesPerBlock);
    const FaceIdx end = std::min<FaceIdx>(views->num_faces(), first + kFacesPerBlock);
    std::vector<std::vector<LabelIdx>> sets(end - first);
    for (FaceIdx face = first; face < end; ++face) {
      std::vector<LabelIdx>& labels = sets[face - first];
      const FaceIdx parent = views->parents[face];
      if (parent >= first) {
        labels = sets[parent - first];
        ToggleLabels(views->toggled_labels.data() + views->toggle_offsets[face],
                     views->toggled_labels.data() + views->toggle_offsets[face + 1], &labels);
      } else {
        labels = views->LabelSet(face);
      }
      ViewIndex& index = views->index[face];
      // [Simsarian96 §2.3] index values: the number of visible edges, their total length, what is seen of it
      index.num_labels = static_cast<int32_t>(labels.size());
      double walls = 0, length = 0, area = 0, longest = 0;
      for (const LabelIdx label : labels) walls += views->plan.walls[WallOf(label)].Length();
      const Eigen::Vector2d centre = views->Centroid(face);
      for (const VisibleStretch& stretch : VisibleStretches(views->plan, labels, centre)) {
        length += stretch.Length();
        longest = std::max(longest, stretch.Length());
        const Eigen::Vector2d a = stretch.start - centre, b = stretch.end - centre;
        area += 0.5 * (a.x() * b.y() - a.y() * b.x());
      }
      index.wall_length_m = static_cast<float>(walls);
      index.visible_length_m = static_cast<float>(length);
      index.visible_area_m2 = static_cast<float>(area);
      index.longest_m = static_cast<float>(longest);
    }
    progress.Advance();
  });
  progress.End();
  return progress.Cancelled() ? Status(MakeError(ErrorCode::kCancelled, "cancelled")) : Ok();
}

}  // namespace

Result<DerivedViews> DeriveViews(const FloorPlan& plan, int num_threads, int64_t memory_mib,
                                 Progress& progress) {
  CAIRN_RETURN_IF_ERROR(CheckClean(plan));
  const WallRays rays(plan);
  CAIRN_RETURN_IF_ERROR(CheckSample(plan, rays, num_threads, memory_mib, progress));
  const int64_t max_num_boundaries = (memory_mib << 20) / kBytesPerBoundary;
  auto found = FindViewBoundaries(plan, rays, /*stride=*/1, max_num_boundaries, num_threads, progress);
  if (!found.ok() && found.error().code == ErrorCode::kFailed)
    return CheckSize(plan, static_cast<double>(max_num_boundaries), 0, 0).error();
  CAIRN_ASSIGN_OR_RETURN(const std::vector<ViewBoundary> boundaries, std::move(found));
  const SegmentNoder noder(ArrangedSegments(plan, boundaries));
  CAIRN_ASSIGN_OR_RETURN(const int64_t num_crossings, noder.CountCrossings(num_threads, progress));
  CAIRN_RETURN_IF_ERROR(CheckSize(plan, static_cast<double>(boundaries.size()),
                                  static_cast<double>(num_crossings), memory_mib));
  auto arrangement = Arrange(plan, noder, num_threads, progress);
  if (!arrangement.ok()) return arrangement.error();
  CAIRN_ASSIGN_OR_RETURN(LabelFacesResult labelled,
                         LabelFaces(plan, rays, boundaries, std::move(arrangement).value(), progress));
  CAIRN_RETURN_IF_ERROR(AddIndex(&labelled.views, num_threads, progress));
  DerivedViews derived;
  derived.views = std::move(labelled.views);
  derived.num_disagreements = labelled.num_disagreements;
  derived.num_boundaries = static_cast<int64_t>(boundaries.size());
  return derived;
}

}  // namespace cairn
