#include "core/view_regions/label_faces.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "core/base/random.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Directions closer than this count as equal, rad.
constexpr double kSameDirection = 1e-12;
// Regions this deep in the tree begin a new tree, so that a label set is found in few steps.
constexpr int kMaxDepth = 128;
constexpr int64_t kItemsPerCheck = 4096;  // between checks for cancellation

class FaceLabeller {
 public:
  FaceLabeller(const FloorPlan& plan, const WallRays& rays, const std::vector<ViewBoundary>& boundaries,
               const Arrangement& arrangement)
      : plan_(plan), rays_(rays), boundaries_(boundaries), arrangement_(arrangement) {
    num_faces_ = arrangement.num_faces();
    windows_.assign(plan.num_labels(), 0);
    for (LabelIdx label = 0; label < plan.num_labels(); ++label) keys_.push_back(MixSeed(0, label));
  }

  Status Run(Progress& progress, LabelFacesResult* result) {
    result_ = result;
    const auto cancelled = MakeError(ErrorCode::kCancelled, "cancelled");
    if (!ListBorders(progress)) return cancelled;
    new_index_.assign(num_faces_, -1);
    hashes_.assign(num_faces_, 0);
    const std::vector<int32_t> roots = Roots(progress);
    if (progress.Cancelled()) return cancelled;
    progress.Begin("label sets", num_faces_, "regions");
    bool walked = true;
    for (size_t i = 0; i < roots.size() && walked; ++i) walked = Walk(roots[i], progress);
    progress.End();
    if (!walked || !TakeLinks(progress)) return cancelled;
    return Ok();
  }

 private:
  struct Border {
    int64_t edge;
    int32_t other;
  };

  // For each face the edges to others, shared ends first in the order of edges.  False: cancelled.
  bool ListBorders(const Progress& progress) {
    border_offsets_.assign(num_faces_ + 1, 0);
    const auto is_link = [](const Arrangement::Edge& edge) {
      return !edge.is_wall && edge.left >= 0 && edge.right >= 0 && edge.left != edge.right;
    };
    for (size_t i = 0; i < arrangement_.edges.size(); ++i) {
      if (i % kItemsPerCheck == 0 && progress.Cancelled()) return false;
      const Arrangement::Edge& edge = arrangement_.edges[i];
      if (!is_link(edge)) continue;
      ++border_offsets_[edge.left + 1];
      ++border_offsets_[edge.right + 1];
    }
    std::partial_sum(border_offsets_.begin(), border_offsets_.end(), border_offsets_.begin());
    borders_.resize(border_offsets_.back());
    std::vector<int64_t> next(border_offsets_.begin(), border_offsets_.end() - 1);
    for (size_t i = 0; i < arrangement_.edges.size(); ++i) {
      if (i % kItemsPerCheck == 0 && progress.Cancelled()) return false;
      const Arrangement::Edge& edge = arrangement_.edges[i];
      if (!is_link(edge)) continue;
      borders_[next[edge.left]++] = {static_cast<int64_t>(i), edge.right};
      borders_[next[edge.right]++] = {static_cast<int64_t>(i), edge.left};
    }
    return true;
  }

  // The largest face of each connected part, large ones first; some only if cancelled.
  std::vector<int32_t> Roots(const Progress& progress) const {
    int64_t num_visited = 0;
    std::vector<bool> seen(num_faces_, false);
    std::vector<std::pair<double, int32_t>> roots;  // area, -face: of equal ones the first
    std::vector<int32_t> open;
    for (int32_t face = 0; face < num_faces_; ++face) {
      if (seen[face]) continue;
      std::pair<double, int32_t> largest{0, -face};
      seen[face] = true;
      open.push_back(face);
      while (!open.empty()) {
        if (++num_visited % kItemsPerCheck == 0 && progress.Cancelled()) return {};
        const int32_t at = open.back();
        open.pop_back();
        largest = std::max(largest, {Area(at), -at});
        for (int64_t i = border_offsets_[at]; i < border_offsets_[at + 1]; ++i) {
          if (seen[borders_[i].other]) continue;
          seen[borders_[i].other] = true;
          open.push_back(borders_[i].other);
        }
      }
      roots.push_back(largest);
    }
    std::sort(roots.rbegin(), roots.rend());
    std::vector<int32_t> faces;
    for (const auto& [area, minus_face] : roots) faces.push_back(-minus_face);
    return faces;
  }

  double Area(int32_t face) const {
    const int64_t first = arrangement_.face_offsets[face];
    const GridPoint& origin = Corner(first);
    double twice = 0;
    for (int64_t i = first + 1; i + 1 < arrangement_.face_offsets[face + 1]; ++i)
      twice += static_cast<double>(Orientation(origin, Corner(i), Corner(i + 1)));
    return 0.5 * twice;
  }

  const GridPoint& Corner(int64_t i) const { return arrangement_.vertices[arrangement_.face_vertices[i]]; }

  Vec2 Centre(int32_t face) const {
    const int64_t first = arrangement_.face_offsets[face], end = arrangement_.face_offsets[face + 1];
    Vec2 sum = Vec2::Zero();
    for (int64_t i = first; i < end; ++i) sum += Real(Corner(i));
    return sum / static_cast<double>(end - first);
  }

  // Visits what changes from one side of an edge to the other: visit(label, windows).
  template <typename Visit>
  void VisitChanges(int64_t edge_idx, bool to_left, Visit&& visit) const {
    for (int64_t i = arrangement_.edges[edge_idx].first_crossing; i < arrangement_.CrossingsEnd(edge_idx);
         ++i) {
      const Arrangement::Crossing& crossing = arrangement_.crossings[i];
      const int sign = crossing.reversed == to_left ? -1 : 1;
      for (const WindowChange& change : boundaries_[crossing.boundary].changes)
        visit(change.label, sign * change.windows);
    }
  }

  // Crosses an edge with the counts of windows; the labels that become or cease to be visible, ascending.
  // [Simsarian96 §2.2 step III] Into the light side a boundary's label is added, into the dark side dropped.
  std::vector<LabelIdx> Cross(int64_t edge, bool to_left) {
    std::vector<LabelIdx> touched;
    VisitChanges(edge, to_left, [&](LabelIdx label, int) { touched.push_back(label); });
    std::sort(touched.begin(), touched.end());
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    std::vector<bool> before;
    for (const LabelIdx label : touched) before.push_back(windows_[label] > 0);
    VisitChanges(edge, to_left, [&](LabelIdx label, int windows) {
      windows_[label] += windows;
      hash_ += keys_[label] * static_cast<uint64_t>(static_cast<int64_t>(windows));
    });
    std::vector<LabelIdx> toggled;
    for (size_t i = 0; i < touched.size(); ++i) {
      if (before[i] != (windows_[touched[i]] > 0)) toggled.push_back(touched[i]);
    }
    return toggled;
  }

  void Take(int32_t face, int32_t parent, const std::vector<LabelIdx>& toggled) {
    Views& views = result_->views;
    new_index_[face] = views.num_faces();
    hashes_[face] = hash_;
    views.parents.push_back(parent);
    views.toggled_labels.insert(views.toggled_labels.end(), toggled.begin(), toggled.end());
    views.toggle_offsets.push_back(static_cast<int64_t>(views.toggled_labels.size()));
    for (int64_t i = arrangement_.face_offsets[face]; i < arrangement_.face_offsets[face + 1]; ++i)
      views.face_vertices.push_back(arrangement_.face_vertices[i]);
    views.face_offsets.push_back(static_cast<int64_t>(views.face_vertices.size()));
  }

  // Depth first over a connected part, carrying the counts of windows along.
  // [Simsarian96 §2.2 step III] From region to region instead of along each boundary; so [Simsarian96 §2.2
  // step IV] a region's label set comes out by itself, not as the intersection of its vertices'.
  bool Walk(int32_t root, Progress& progress) {
    std::fill(windows_.begin(), windows_.end(), 0);
    hash_ = 0;
    std::vector<LabelIdx> labels;
    for (const WindowChange& count : CountWindows(plan_, rays_, Centre(root))) {
      windows_[count.label] = count.windows;
      hash_ += keys_[count.label] * static_cast<uint64_t>(count.windows);
      labels.push_back(count.label);
    }
    Take(root, -1, labels);
    struct Step {
      int32_t face;
      int64_t next_border, entered_by;
      int depth;  // below a region without a parent
    };
    std::vector<Step> path{{root, border_offsets_[root], -1, 0}};
    int64_t steps = 0, left = 0;
    while (!path.empty()) {
      if ((++steps & 0xfff) == 0 && progress.Cancelled()) return false;
      Step& step = path.back();
      if (step.next_border == border_offsets_[step.face + 1]) {
        if (step.entered_by >= 0)
          Cross(step.entered_by, arrangement_.edges[step.entered_by].right == step.face);
        path.pop_back();
        if ((++left & 0xfff) == 0) progress.Advance(0x1000);
        continue;
      }
      const Border border = borders_[step.next_border++];
      const bool to_left = arrangement_.edges[border.edge].left == border.other;
      if (new_index_[border.other] >= 0) {
        uint64_t hash = hash_;
        VisitChanges(border.edge, to_left, [&](LabelIdx label, int windows) {
          hash += keys_[label] * static_cast<uint64_t>(static_cast<int64_t>(windows));
        });
        if (hash != hashes_[border.other]) ++result_->num_disagreements;
        continue;
      }
      const std::vector<LabelIdx> toggled = Cross(border.edge, to_left);
      const int depth = step.depth + 1 < kMaxDepth ? step.depth + 1 : 0;
      if (depth > 0) {
        Take(border.other, new_index_[step.face], toggled);
      } else {
        Take(border.other, -1, LabelsNow());
      }
      path.push_back({border.other, border_offsets_[border.other], border.edge, depth});
    }
    return true;
  }

  std::vector<LabelIdx> LabelsNow() const {
    std::vector<LabelIdx> labels;
    for (LabelIdx label = 0; label < plan_.num_labels(); ++label) {
      if (windows_[label] > 0) labels.push_back(label);
    }
    return labels;
  }

  // [Simsarian96 §4.1] The region adjacency graph.
  // Ascending: gathered by their lower region, then sorted among its others.
  bool TakeLinks(Progress& progress) {
    Views& views = result_->views;
    std::vector<int64_t> ends(num_faces_ + 1, 0);
    const auto visit_links = [&](auto&& visit) {
      for (size_t i = 0; i < arrangement_.edges.size(); ++i) {
        if (i % kItemsPerCheck == 0 && progress.Cancelled()) return false;
        const Arrangement::Edge& edge = arrangement_.edges[i];
        if (edge.is_wall || edge.left < 0 || edge.right < 0 || edge.left == edge.right) continue;
        const FaceIdx left = new_index_[edge.left], right = new_index_[edge.right];
        visit(left < right ? ViewLink{left, right, edge.start, edge.end}
                           : ViewLink{right, left, edge.end, edge.start});
      }
      return true;
    };
    if (!visit_links([&](const ViewLink& link) { ++ends[link.a + 1]; })) return false;
    std::partial_sum(ends.begin(), ends.end(), ends.begin());
    views.links.resize(ends.back());
    const std::vector<int64_t> starts = ends;
    if (!visit_links([&](const ViewLink& link) { views.links[ends[link.a]++] = link; })) return false;
    for (int32_t face = 0; face < num_faces_; ++face) {
      if (face % 65536 == 0 && progress.Cancelled()) return false;
      std::sort(views.links.begin() + starts[face], views.links.begin() + starts[face + 1]);
    }
    return true;
  }

  const FloorPlan& plan_;
  const WallRays& rays_;
  const std::vector<ViewBoundary>& boundaries_;
  const Arrangement& arrangement_;
  int32_t num_faces_ = 0;
  std::vector<int32_t> windows_;  // of the face that the walk is at
  uint64_t hash_ = 0;             // of these counts
  std::vector<uint64_t> keys_;    // per label
  std::vector<uint64_t> hashes_;  // per face
  std::vector<FaceIdx> new_index_;
  std::vector<int64_t> border_offsets_;
  std::vector<Border> borders_;
  LabelFacesResult* result_ = nullptr;
};

}  // namespace

// [Simsarian96 §2] The label set of a point: the edges visible from it.
std::vector<WindowChange> CountWindows(const FloorPlan& plan, const WallRays& rays, const Vec2& place) {
  std::vector<double> angles;
  for (const GridPoint& vertex : plan.vertices) {
    const Vec2 to = Real(vertex) - place;
    angles.push_back(std::atan2(to.y(), to.x()));
  }
  std::sort(angles.begin(), angles.end());
  std::vector<LabelIdx> seen;
  for (size_t i = 0; i < angles.size(); ++i) {
    const double next = i + 1 < angles.size() ? angles[i + 1] : angles[0] + 2 * std::numbers::pi;
    if (next - angles[i] < kSameDirection) continue;
    const double middle = 0.5 * (angles[i] + next);
    const LabelIdx label = rays.Look(place, {std::cos(middle), std::sin(middle)});
    if (seen.empty() || seen.back() != label) seen.push_back(label);
  }
  if (seen.size() > 1 && seen.front() == seen.back()) seen.pop_back();
  std::map<LabelIdx, int32_t> counts;
  for (const LabelIdx label : seen) {
    if (label >= 0) ++counts[label];
  }
  std::vector<WindowChange> windows;
  for (const auto& [label, count] : counts) windows.push_back({label, count});
  return windows;
}

Result<LabelFacesResult> LabelFaces(const FloorPlan& plan, const WallRays& rays,
                                    const std::vector<ViewBoundary>& boundaries, Arrangement arrangement,
                                    Progress& progress) {
  LabelFacesResult result;
  CAIRN_RETURN_IF_ERROR(FaceLabeller(plan, rays, boundaries, arrangement).Run(progress, &result));
  result.views.plan = plan;
  result.views.vertices = std::move(arrangement.vertices);
  return result;
}

}  // namespace cairn
