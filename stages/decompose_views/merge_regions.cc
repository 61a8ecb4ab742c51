#include "stages/decompose_views/merge_regions.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <set>

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;
using Ring = std::vector<int32_t>;  // vertices, counter-clockwise

// The outline of two regions with a common border, if it is one simple ring.
std::optional<Ring> Joined(const Ring& a, const Ring& b) {
  std::set<std::pair<int32_t, int32_t>> edges_b;
  for (size_t i = 0; i < b.size(); ++i) edges_b.insert({b[i], b[(i + 1) % b.size()]});
  std::map<int32_t, int32_t> next;
  size_t num_edges = 0;
  const auto add = [&](int32_t from, int32_t to) {
    ++num_edges;
    return next.emplace(from, to).second;
  };
  bool simple = true;
  for (size_t i = 0; i < a.size(); ++i) {
    const int32_t from = a[i], to = a[(i + 1) % a.size()];
    if (edges_b.erase({to, from}) == 0) simple = add(from, to) && simple;
  }
  for (const auto& [from, to] : edges_b) simple = add(from, to) && simple;
  if (!simple || next.empty()) return std::nullopt;
  Ring ring;
  int32_t at = next.begin()->first;
  do {
    ring.push_back(at);
    const auto found = next.find(at);
    if (found == next.end()) return std::nullopt;
    at = found->second;
  } while (at != ring.front() && ring.size() <= num_edges);
  if (ring.size() != num_edges) return std::nullopt;
  return ring;
}

class Merger {
 public:
  Merger(double min_area_m2, Views* views) : min_area_(min_area_m2), views_(*views) {
    const FaceIdx num = views_.num_faces();
    for (FaceIdx face = 0; face < num; ++face) {
      rings_.emplace_back(views_.face_vertices.begin() + views_.face_offsets[face],
                          views_.face_vertices.begin() + views_.face_offsets[face + 1]);
      areas_.push_back(views_.Area(face));
    }
    into_.resize(num);
    std::iota(into_.begin(), into_.end(), 0);
    neighbours_.resize(num);
    for (const ViewLink& link : views_.links) {
      const double length =
          (views_.plan.Metres(views_.vertices[link.start]) - views_.plan.Metres(views_.vertices[link.end]))
              .norm();
      neighbours_[link.a][link.b] += length;
      neighbours_[link.b][link.a] += length;
    }
  }

  MergeLoss Run() {
    for (FaceIdx face = 0; face < views_.num_faces(); ++face) {
      if (areas_[face] < min_area_) small_.insert({areas_[face], face});
    }
    while (!small_.empty()) {
      const FaceIdx face = small_.begin()->second;
      small_.erase(small_.begin());
      Join(face);
    }
    Rebuild();
    return loss_;
  }

 private:
  // Joins a region to the best of its neighbours that are larger, if there is one.
  void Join(FaceIdx face) {
    const std::vector<LabelIdx> labels = views_.LabelSet(face);
    std::vector<std::tuple<size_t, double, FaceIdx>> order;
    for (const auto& [other, length] : neighbours_[face]) {
      if (std::pair(areas_[other], other) < std::pair(areas_[face], face)) continue;
      const std::vector<LabelIdx> others = views_.LabelSet(other);
      std::vector<LabelIdx> different;
      std::set_symmetric_difference(labels.begin(), labels.end(), others.begin(), others.end(),
                                    std::back_inserter(different));
      order.push_back({different.size(), -length, other});
    }
    std::sort(order.begin(), order.end());
    for (const auto& [num_different, length, other] : order) {
      std::optional<Ring> ring = Joined(rings_[other], rings_[face]);
      if (!ring) continue;
      rings_[other] = std::move(*ring);
      rings_[face].clear();
      ++loss_.num_regions;
      loss_.area_m2 += areas_[face];
      loss_.num_labels += static_cast<int64_t>(num_different);
      // The neighbour may be a small region itself, and may still be one.
      small_.erase({areas_[other], other});
      areas_[other] += areas_[face];
      if (areas_[other] < min_area_) small_.insert({areas_[other], other});
      into_[face] = other;
      for (const auto& [third, common] : neighbours_[face]) {
        neighbours_[third].erase(face);
        if (third == other) continue;
        neighbours_[third][other] += common;
        neighbours_[other][third] += common;
      }
      neighbours_[face].clear();
      return;
    }
  }

  FaceIdx Root(FaceIdx face) const {
    while (into_[face] != face) face = into_[face];
    return face;
  }

  // The remaining regions keep their order and label sets; the tree is built again, with an earlier neighbour
  // as the parent of each.
  void Rebuild() {
    Views merged;
    merged.plan = views_.plan;
    merged.vertices = views_.vertices;
    std::vector<FaceIdx> new_index(views_.num_faces(), -1);
    std::vector<std::vector<LabelIdx>> sets;
    std::vector<int> depths;
    views_.ForEachLabelSet([&](FaceIdx face, const std::vector<LabelIdx>& labels) {
      if (into_[face] != face) return;
      const FaceIdx index = merged.num_faces();
      new_index[face] = index;
      FaceIdx parent = -1;
      for (const auto& [other, length] : neighbours_[face]) {
        if (new_index[other] >= 0 && depths[new_index[other]] < kMaxDepth)
          parent = std::max(parent, new_index[other]);
      }
      std::vector<LabelIdx> toggled = labels;
      if (parent >= 0) {
        toggled.clear();
        std::set_symmetric_difference(labels.begin(), labels.end(), sets[parent].begin(), sets[parent].end(),
                                      std::back_inserter(toggled));
      }
      sets.push_back(labels);
      depths.push_back(parent >= 0 ? depths[parent] + 1 : 0);
      merged.parents.push_back(parent);
      merged.toggled_labels.insert(merged.toggled_labels.end(), toggled.begin(), toggled.end());
      merged.toggle_offsets.push_back(static_cast<int64_t>(merged.toggled_labels.size()));
      merged.face_vertices.insert(merged.face_vertices.end(), rings_[face].begin(), rings_[face].end());
      merged.face_offsets.push_back(static_cast<int64_t>(merged.face_vertices.size()));
      merged.index.push_back(views_.index[face]);
    });
    for (const ViewLink& link : views_.links) {
      const FaceIdx a = new_index[Root(link.a)], b = new_index[Root(link.b)];
      if (a == b) continue;
      merged.links.push_back(a < b ? ViewLink{a, b, link.start, link.end}
                                   : ViewLink{b, a, link.end, link.start});
    }
    std::sort(merged.links.begin(), merged.links.end());
    views_ = std::move(merged);
  }

  static constexpr int kMaxDepth = 127;

  const double min_area_;
  Views& views_;
  std::vector<Ring> rings_;
  std::vector<double> areas_;
  std::vector<FaceIdx> into_;
  std::vector<std::map<FaceIdx, double>> neighbours_;  // and the length of the common border
  std::set<std::pair<double, FaceIdx>> small_;
  MergeLoss loss_;
};

}  // namespace

MergeLoss MergeSmallRegions(double min_area_m2, Views* views) { return Merger(min_area_m2, views).Run(); }

}  // namespace cairn::decompose_views
