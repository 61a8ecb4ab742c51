#include "core/plan/views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

}  // namespace

void ToggleLabels(const LabelIdx* first, const LabelIdx* last, std::vector<LabelIdx>* labels) {
  for (const LabelIdx* label = first; label != last; ++label) {
    const auto at = std::lower_bound(labels->begin(), labels->end(), *label);
    if (at != labels->end() && *at == *label) {
      labels->erase(at);
    } else {
      labels->insert(at, *label);
    }
  }
}

std::vector<LabelIdx> Views::LabelSet(FaceIdx face) const {
  std::vector<LabelIdx> toggled;
  for (; face >= 0; face = parents[face]) {
    toggled.insert(toggled.end(), toggled_labels.begin() + toggle_offsets[face],
                   toggled_labels.begin() + toggle_offsets[face + 1]);
  }
  std::sort(toggled.begin(), toggled.end());
  std::vector<LabelIdx> labels;
  for (size_t i = 0; i < toggled.size();) {
    size_t end = i;
    while (end < toggled.size() && toggled[end] == toggled[i]) ++end;
    if ((end - i) % 2 == 1) labels.push_back(toggled[i]);
    i = end;
  }
  return labels;
}

double Views::Area(FaceIdx face) const {
  const int64_t first = face_offsets[face];
  const Vec2 origin = Real(vertices[face_vertices[first]]);
  double twice = 0;
  for (int64_t i = first + 1; i + 1 < face_offsets[face + 1]; ++i)
    twice += Cross(Real(vertices[face_vertices[i]]) - origin, Real(vertices[face_vertices[i + 1]]) - origin);
  return 0.5 * twice * plan.grid_m * plan.grid_m;
}

Vec2 Views::Centroid(FaceIdx face) const {
  const int64_t first = face_offsets[face];
  const Vec2 origin = Real(vertices[face_vertices[first]]);
  double twice = 0;
  Vec2 sum = Vec2::Zero();
  for (int64_t i = first + 1; i + 1 < face_offsets[face + 1]; ++i) {
    const Vec2 a = Real(vertices[face_vertices[i]]) - origin,
               b = Real(vertices[face_vertices[i + 1]]) - origin;
    const double area = Cross(a, b);
    twice += area;
    sum += area * (a + b);
  }
  const Vec2 centre = origin + sum / (3 * twice);
  return plan.Metres(centre.x(), centre.y());
}

Status CheckViews(const Views& views, const std::string& what) {
  CAIRN_RETURN_IF_ERROR(CheckFloorPlan(views.plan, what));
  const FaceIdx num_faces = views.num_faces();
  const auto num_vertices = static_cast<int32_t>(views.vertices.size());
  if (views.face_offsets.size() != static_cast<size_t>(num_faces) + 1 ||
      views.toggle_offsets.size() != static_cast<size_t>(num_faces) + 1 ||
      views.index.size() != static_cast<size_t>(num_faces)) {
    return Corrupt(what, "lists of different lengths for {} regions", num_faces);
  }
  for (FaceIdx face = 0; face < num_faces; ++face) {
    if (views.face_offsets[face + 1] - views.face_offsets[face] < 3) {
      return Corrupt(what, "region {} has fewer than 3 vertices", face);
    }
    for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i) {
      if (views.face_vertices[i] < 0 || views.face_vertices[i] >= num_vertices) {
        return Corrupt(what, "region {} has vertex {} of {}", face, views.face_vertices[i], num_vertices);
      }
    }
    if (!(views.Area(face) > 0)) return Corrupt(what, "region {} has no area", face);
    if (views.parents[face] < -1 || views.parents[face] >= face) {
      return Corrupt(what, "region {} has parent {}, which does not come before it", face,
                     views.parents[face]);
    }
    for (int64_t i = views.toggle_offsets[face]; i < views.toggle_offsets[face + 1]; ++i) {
      const LabelIdx label = views.toggled_labels[i];
      const bool ascending = i == views.toggle_offsets[face] || views.toggled_labels[i - 1] < label;
      if (label < 0 || label >= views.plan.num_labels() || !ascending) {
        return Corrupt(what, "region {}: label {} is out of order or not below {}", face, label,
                       views.plan.num_labels());
      }
    }
  }
  for (const ViewLink& link : views.links) {
    if (link.a < 0 || link.a >= link.b || link.b >= num_faces || link.start < 0 || link.end < 0 ||
        link.start >= num_vertices || link.end >= num_vertices || link.start == link.end) {
      return Corrupt(what, "a link joins regions {} and {} of {}", link.a, link.b, num_faces);
    }
  }
  if (!std::is_sorted(views.links.begin(), views.links.end())) return Corrupt(what, "links are out of order");
  return Ok();
}

namespace {

// New number of every vertex by first use; -1: not used.  REQUIRES: CheckViews(views)
std::vector<int32_t> NumbersByUse(const Views& views) {
  std::vector<int32_t> numbers(views.vertices.size(), -1);
  int32_t next = 0;
  const auto name = [&](int32_t vertex) {
    if (numbers[vertex] < 0) numbers[vertex] = next++;
  };
  std::vector<std::pair<GridPoint, int32_t>> more;
  size_t link = 0;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i)
      name(views.face_vertices[i]);
    more.clear();
    for (; link < views.links.size() && views.links[link].a == face; ++link) {
      for (const int32_t end : {views.links[link].start, views.links[link].end}) {
        if (numbers[end] < 0) more.emplace_back(views.vertices[end], end);
      }
    }
    std::sort(more.begin(), more.end());
    for (const auto& [place, vertex] : more) name(vertex);
  }
  return numbers;
}

}  // namespace

void NumberVerticesByUse(Views* views) {
  const std::vector<int32_t> numbers = NumbersByUse(*views);
  std::vector<GridPoint> vertices(
      std::count_if(numbers.begin(), numbers.end(), [](int32_t n) { return n >= 0; }));
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] >= 0) vertices[numbers[i]] = views->vertices[i];
  }
  views->vertices = std::move(vertices);
  for (int32_t& vertex : views->face_vertices) vertex = numbers[vertex];
  for (ViewLink& link : views->links) {
    link.start = numbers[link.start];
    link.end = numbers[link.end];
  }
  std::sort(views->links.begin(), views->links.end());
}

bool IsNumberedByUse(const Views& views) {
  const std::vector<int32_t> numbers = NumbersByUse(views);
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] != static_cast<int32_t>(i)) return false;
  }
  return true;
}

FaceChildren ChildrenOf(const Views& views) {
  FaceChildren children;
  children.offsets.assign(views.num_faces() + 1, 0);
  for (const FaceIdx parent : views.parents) {
    if (parent >= 0) ++children.offsets[parent + 1];
  }
  for (FaceIdx face = 0; face < views.num_faces(); ++face)
    children.offsets[face + 1] += children.offsets[face];
  children.faces.resize(children.offsets.back());
  std::vector<int64_t> next(children.offsets.begin(), children.offsets.end() - 1);
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    if (views.parents[face] >= 0) children.faces[next[views.parents[face]]++] = face;
  }
  return children;
}

FaceLocator::FaceLocator(const Views& views) : views_(views) {
  const FaceIdx num_faces = views.num_faces();
  if (views.vertices.empty()) {
    offsets_.assign(2, 0);
    return;
  }
  Vec2 low = Real(views.vertices[0]), high = low;
  for (const GridPoint& vertex : views.vertices) {
    low = low.cwiseMin(Real(vertex));
    high = high.cwiseMax(Real(vertex));
  }
  low_ = low;
  const Vec2 size = (high - low).array() + 1;
  cell_ = std::max({std::sqrt(size.x() * size.y() / std::max(1, num_faces)), size.maxCoeff() / 2048, 1.0});
  // The cells that each face's corners lie between: first column and row, last column and row.
  std::vector<std::array<int, 4>> boxes(num_faces);
  const auto take_cells = [&] {
    num_columns_ = static_cast<int>(size.x() / cell_) + 1;
    num_rows_ = static_cast<int>(size.y() / cell_) + 1;
    int64_t num_entries = 0;
    for (FaceIdx face = 0; face < num_faces; ++face) {
      Vec2 face_low = Real(views.vertices[views.face_vertices[views.face_offsets[face]]]),
           face_high = face_low;
      for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i) {
        face_low = face_low.cwiseMin(Real(views.vertices[views.face_vertices[i]]));
        face_high = face_high.cwiseMax(Real(views.vertices[views.face_vertices[i]]));
      }
      const Eigen::Vector2i from = ((face_low - low_) / cell_).cast<int>(),
                            to = ((face_high - low_) / cell_).cast<int>();
      boxes[face] = {from.x(), from.y(), to.x(), to.y()};
      num_entries += int64_t{to.x() - from.x() + 1} * (to.y() - from.y() + 1);
    }
    return num_entries;
  };
  // Regions of a real plan lie side by side; any number of a file's may lie over each other.
  constexpr int64_t kMaxEntries = 16;  // a region or a cell
  while (take_cells() > kMaxEntries * (num_faces + int64_t{num_columns_} * num_rows_) &&
         num_columns_ * num_rows_ > 1)
    cell_ *= 2;
  const auto visit_cells = [&](FaceIdx face, auto&& visit) {
    const auto [first_column, first_row, last_column, last_row] = boxes[face];
    for (int row = first_row; row <= last_row; ++row) {
      for (int column = first_column; column <= last_column; ++column)
        visit(static_cast<size_t>(row) * num_columns_ + column);
    }
  };
  offsets_.assign(static_cast<size_t>(num_columns_) * num_rows_ + 1, 0);
  for (FaceIdx face = 0; face < num_faces; ++face)
    visit_cells(face, [&](size_t cell) { ++offsets_[cell + 1]; });
  for (size_t i = 1; i < offsets_.size(); ++i) offsets_[i] += offsets_[i - 1];
  faces_.resize(offsets_.back());
  std::vector<int64_t> next(offsets_.begin(), offsets_.end() - 1);
  for (FaceIdx face = 0; face < num_faces; ++face)
    visit_cells(face, [&](size_t cell) { faces_[next[cell]++] = face; });
}

FaceIdx FaceLocator::Find(const Vec2& place) const {
  const Vec2 cell = (views_.plan.Grid(place) - low_) / cell_;
  if (!(cell.x() >= 0 && cell.y() >= 0 && cell.x() < num_columns_ && cell.y() < num_rows_)) return -1;
  const size_t index = static_cast<size_t>(cell.y()) * num_columns_ + static_cast<size_t>(cell.x());
  for (int64_t i = offsets_[index]; i < offsets_[index + 1]; ++i) {
    const FaceIdx face = faces_[i];
    const Vec2 point = views_.plan.Grid(place);
    const int64_t first = views_.face_offsets[face], end = views_.face_offsets[face + 1];
    // Even-odd, so that merged regions that are not convex are found too.  A border is taken from its lower
    // end by both regions beside it: rounding puts a point on it into just one of them.
    bool inside = false;
    for (int64_t k = first, before = end - 1; k < end; before = k++) {
      Vec2 low = Real(views_.vertices[views_.face_vertices[before]]);
      Vec2 high = Real(views_.vertices[views_.face_vertices[k]]);
      if (low.y() > high.y()) std::swap(low, high);
      if (low.y() <= point.y() && point.y() < high.y() &&
          point.x() < low.x() + (point.y() - low.y()) / (high.y() - low.y()) * (high.x() - low.x())) {
        inside = !inside;
      }
    }
    if (inside) return face;
  }
  return -1;
}

double FaceLocator::BorderDistance(FaceIdx face, const Vec2& place) const {
  const Vec2 point = views_.plan.Grid(place);
  const int64_t first = views_.face_offsets[face], end = views_.face_offsets[face + 1];
  double nearest = -1;
  for (int64_t k = first, before = end - 1; k < end; before = k++) {
    const double distance = PointToSegment(point, Real(views_.vertices[views_.face_vertices[before]]),
                                           Real(views_.vertices[views_.face_vertices[k]]));
    if (nearest < 0 || distance < nearest) nearest = distance;
  }
  return nearest * views_.plan.grid_m;
}

}  // namespace cairn
