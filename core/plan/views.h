#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/plan/floor_plan.h"

namespace cairn {

using FaceIdx = int32_t;

// Numbers that describe the views of one region and tell regions apart [Simsarian96 §2.3].  Lengths and areas
// are seen from the centroid of the region.
struct ViewIndex {
  int32_t num_labels = 0;      // visible walls; the same everywhere in the region
  float wall_length_m = 0;     // their total length; the same everywhere in the region
  float visible_length_m = 0;  // length of their visible parts
  float visible_area_m2 = 0;   // area between the viewer and them
  float longest_m = 0;         // length of the longest visible stretch of one wall
};

// Two regions with a common border that is not a wall.
struct ViewLink {
  FaceIdx a = 0, b = 0;        // a < b
  int32_t start = 0, end = 0;  // vertices of the border; a lies to its left
  auto operator<=>(const ViewLink&) const = default;
};

// The regions that a laser can tell apart: the view-invariant regions (VIRs) of a floor plan.  From all
// points of one region the same sides of walls (labels) are visible.
//
// Label sets are stored as differences along a tree over the adjacency graph: a region's set is its parent's
// with some labels toggled; regions without a parent toggle the empty set, and there is one every so often.
// Parents come before their children.
struct Views {
  FloorPlan plan;
  std::vector<GridPoint> vertices;  // of all regions

  // Region i: counter-clockwise polygon face_vertices[face_offsets[i] .. face_offsets[i + 1]).
  std::vector<int64_t> face_offsets{0};
  std::vector<int32_t> face_vertices;
  std::vector<FaceIdx> parents;  // -1: none
  // Labels that differ from the parent's: toggled_labels[toggle_offsets[i] .. toggle_offsets[i
  // + 1]), ascending.
  std::vector<int64_t> toggle_offsets{0};
  std::vector<LabelIdx> toggled_labels;
  std::vector<ViewIndex> index;
  std::vector<ViewLink> links;  // ascending

  FaceIdx num_faces() const { return static_cast<FaceIdx>(parents.size()); }
  // Label set of one region, ascending.  O(depth in the tree), some hundred at most.
  std::vector<LabelIdx> LabelSet(FaceIdx face) const;
  // Calls visit(face, labels) for all regions in order; `labels` ascending.
  template <typename Visit>
  void ForEachLabelSet(Visit&& visit) const;
  // Area in square metres, centroid in metres.
  double Area(FaceIdx face) const;
  Eigen::Vector2d Centroid(FaceIdx face) const;
};

// Errors: Corrupt where a reference leads out of range, a parent does not come first, or lists are out
// of order.
Status CheckViews(const Views& views, const std::string& what);

// Numbers the vertices in the order in which regions name them: each region's corners, then the other ends of
// its links (those of which it is `a`), by place.  Unused vertices are removed.
void NumberVerticesByUse(Views* views);
bool IsNumberedByUse(const Views& views);

// The database views.db; schemas/views.md.
// Errors: NotFound, Corrupt, Unsupported (another version).
Result<Views> ReadViews(const std::string& path);

// Finds the region that a point lies in.
class FaceLocator {
 public:
  // `views` outlives this.
  explicit FaceLocator(const Views& views);
  // The region that contains a point (metres); -1: none.  A point on a border may go to either side.
  FaceIdx Find(const Eigen::Vector2d& place) const;
  // Distance to the nearest border or wall of the region, metres, negative outside.
  double BorderDistance(FaceIdx face, const Eigen::Vector2d& place) const;
  // How many cells all regions together lie in, whatever a file says of them: at most 16 a region and a cell.
  int64_t num_entries() const { return static_cast<int64_t>(faces_.size()); }

 private:
  const Views& views_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_ = 1;
  int num_columns_ = 1, num_rows_ = 1;
  std::vector<int64_t> offsets_;
  std::vector<FaceIdx> faces_;
};

// Children of each region, as lists in one array.
struct FaceChildren {
  std::vector<int64_t> offsets;
  std::vector<FaceIdx> faces;
};
FaceChildren ChildrenOf(const Views& views);

// Toggles ascending `toggled` in the ascending set `labels`.
void ToggleLabels(const LabelIdx* first, const LabelIdx* last, std::vector<LabelIdx>* labels);

template <typename Visit>
void Views::ForEachLabelSet(Visit&& visit) const {
  // Parents come before children, and a child mostly follows its parent: keep the sets on the way down.
  std::vector<FaceIdx> path;
  std::vector<LabelIdx> labels;
  const auto toggle = [&](FaceIdx face) {
    ToggleLabels(toggled_labels.data() + toggle_offsets[face],
                 toggled_labels.data() + toggle_offsets[face + 1], &labels);
  };
  for (FaceIdx face = 0; face < num_faces(); ++face) {
    while (!path.empty() && path.back() != parents[face]) {
      toggle(path.back());
      path.pop_back();
    }
    if (path.empty() && parents[face] >= 0) {
      // Not in the order of a depth-first walk: start again from the root.
      for (FaceIdx at = parents[face]; at >= 0; at = parents[at]) path.push_back(at);
      std::vector<FaceIdx>(path.rbegin(), path.rend()).swap(path);
      for (const FaceIdx at : path) toggle(at);
    }
    path.push_back(face);
    toggle(face);
    visit(face, labels);
  }
}

}  // namespace cairn
