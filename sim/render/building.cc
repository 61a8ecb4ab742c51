#include "sim/render/building.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "sim/render/furniture.h"
#include "sim/render/paint.h"

namespace cairn::sim {
namespace {

// Brightness of a box's faces, -x to +z: light comes from above and from the side of -y.
constexpr float kBrightness[6] = {0.84f, 0.92f, 1.0f, 0.88f, 0.7f, 1.0f};

// Faces of a piece of furniture that is no pillar: all but the one below.
constexpr size_t kNumFurnitureFaces = 5;

enum class Painter { kTrim, kWallPanel, kLintel, kFurniture };

// A texture to be painted.
struct PaintJob {
  Painter painter = Painter::kTrim;
  double width_m = 0, height_m = 0;
  Material material = Material::kPlaster;
};

// 0 to num_items - 1 in a random order.
std::vector<int> RandomOrder(int num_items, Random* random) {
  std::vector<int> order(num_items);
  std::iota(order.begin(), order.end(), 0);
  for (int i = num_items - 1; i > 0; --i) std::swap(order[i], order[random->UniformInt(0, i)]);
  return order;
}

class BuildingMaker {
 public:
  BuildingMaker(const SimulateOptions& options, uint64_t seed) : options_(options), seed_(seed) {}

  Building Make(Layout layout, int num_threads) {
    building_.layout = std::move(layout);
    building_.height_m = options_.height_m;
    jobs_.push_back({Painter::kTrim});
    for (size_t w = 0; w < building_.layout.walls.size(); ++w) AddWall(static_cast<int>(w));
    FurnishRooms();
    AssignPanels();
    ChangePanels();
    Paint(num_threads);
    BuildGrid();
    return std::move(building_);
  }

 private:
  // The texture's first column is at the face's left and its first row at the top, seen from outside
  // of the box.
  Surface FaceSurface(const Box& box, int face, int texture) const {
    Surface surface;
    surface.texture = texture;
    surface.brightness = kBrightness[face];
    const int axis = face / 2;
    const bool positive = face % 2 == 1;
    const double density = 1 / options_.texel_m;
    surface.u_axis = axis == 0 ? 1 : 0;
    surface.v_axis = axis == 2 ? 1 : 2;
    const bool u_grows = axis == 2 || (axis == 0) == positive;  // +x sees +y to the right, -y sees +x
    surface.u_scale = u_grows ? density : -density;
    surface.u_offset = -surface.u_scale * (u_grows ? box.min : box.max)[surface.u_axis];
    surface.v_scale = -density;
    surface.v_offset = density * box.max[surface.v_axis];
    return surface;
  }

  int AddBox(const Rect& rect, double z0, double z1) {
    Box box{{rect.x0, rect.y0, z0}, {rect.x1, rect.y1, z1}, {}};
    for (int face = 0; face < 6; ++face) box.faces[face] = FaceSurface(box, face, 0);
    building_.boxes.push_back(box);
    if (z0 == 0) building_.obstacles.push_back(rect);
    return static_cast<int>(building_.boxes.size()) - 1;
  }

  int AddJob(const PaintJob& job) {
    jobs_.push_back(job);
    return static_cast<int>(jobs_.size()) - 1;
  }

  // Pieces no wider than a panel between the doors, and lintels over them.
  void AddWall(int wall_idx) {
    const Wall& wall = building_.layout.walls[wall_idx];
    const double begin = wall.along_x ? wall.rect.x0 : wall.rect.y0;
    const double end = wall.along_x ? wall.rect.x1 : wall.rect.y1;
    const auto part = [&](double low, double high) {
      return wall.along_x ? Rect{low, wall.rect.y0, high, wall.rect.y1}
                          : Rect{wall.rect.x0, low, wall.rect.x1, high};
    };
    // Faces seen from rooms; of the outer walls (bottom, top, left, right) only the inner one.
    constexpr int kInnerFace[4] = {3, 2, 1, 0};
    std::vector<int> faces = wall.along_x ? std::vector<int>{2, 3} : std::vector<int>{0, 1};
    if (wall_idx < 4) faces = {kInnerFace[wall_idx]};
    Random random(MixSeed(MixSeed(seed_, 3), wall_idx));
    Material materials[6];
    for (Material& material : materials)
      material = static_cast<Material>(random.UniformInt(0, kNumMaterials - 1));

    double low = begin;
    for (size_t d = 0; d <= wall.doors.size(); ++d) {
      const double high = d < wall.doors.size() ? wall.doors[d].first : end;
      const auto add_pieces = [&](double from, double to) {
        const int num_pieces =
            std::max(1, static_cast<int>(std::ceil((to - from) / options_.panel_width_m - 1e-9)));
        for (int i = 0; i < num_pieces && to > from; ++i) {
          const double x0 = from + (to - from) * i / num_pieces;
          const double x1 = i + 1 == num_pieces ? to : from + (to - from) * (i + 1) / num_pieces;
          const int box = AddBox(part(x0, x1), 0, options_.height_m);
          for (const int face : faces) panels_.push_back({6 * box + face, x1 - x0, materials[face]});
        }
      };
      double from = low;
      for (const double joint : wall.joints) {
        if (joint <= from || joint >= high) continue;
        add_pieces(from, joint);
        from = joint;
      }
      add_pieces(from, high);
      if (d == wall.doors.size()) break;
      low = wall.doors[d].second;
      const int box = AddBox(part(high, low), options_.door_height_m, options_.height_m);
      for (const int face : faces) {
        const int job = AddJob(
            {Painter::kLintel, low - high, options_.height_m - options_.door_height_m, materials[face]});
        building_.boxes[box].faces[face] = FaceSurface(building_.boxes[box], face, job);
      }
    }
  }

  void AddFurniture(const Furniture& piece) {
    const int box = AddBox(piece.rect, 0, piece.height_m);
    for (const int face : {0, 1, 2, 3, 5}) {
      if (piece.is_pillar && face == 5) continue;
      const double width = face / 2 == 0 ? piece.rect.depth() : piece.rect.width();
      const double height = face == 5 ? piece.rect.depth() : piece.height_m;
      const int job = AddJob({Painter::kFurniture, width, height});
      building_.boxes[box].faces[face] = FaceSurface(building_.boxes[box], face, job);
    }
  }

  // A texture of its own for every wall panel, except for a random share that shows one of the shared set.
  void AssignPanels() {
    Random random(MixSeed(seed_, 4));
    const int num_panels = static_cast<int>(panels_.size());
    const int num_repeated = static_cast<int>(std::lround(options_.repetition_ratio * num_panels));
    const std::vector<int> order = RandomOrder(num_panels, &random);
    std::vector<int> shared(num_panels, -1);
    std::vector<int> shared_jobs;
    for (int i = 0; i < num_repeated; ++i) {
      if (i < options_.num_shared_textures) {
        const auto material = static_cast<Material>(random.UniformInt(0, kNumMaterials - 1));
        shared_jobs.push_back(
            AddJob({Painter::kWallPanel, options_.panel_width_m, options_.height_m, material}));
      }
      shared[order[i]] = shared_jobs[i % shared_jobs.size()];
    }
    for (int i = 0; i < num_panels; ++i) {
      const Panel& panel = panels_[i];
      const int job = shared[i] >= 0
                          ? shared[i]
                          : AddJob({Painter::kWallPanel, panel.width_m, options_.height_m, panel.material});
      Box& box = building_.boxes[panel.face / 6];
      box.faces[panel.face % 6] = FaceSurface(box, panel.face % 6, job);
    }
    if (building_.layout.twins) PairTwins();
    building_.num_wall_panels = num_panels;
    building_.num_repeated_panels = num_repeated;
  }

  // All pieces but those that a change took away, some of them elsewhere.  Those that are gone leave their
  // textures' numbers unused: whatever else there is is painted as before.
  void FurnishRooms() {
    const std::vector<std::optional<Furniture>> pieces =
        FurnitureAfterChange(options_, seed_, building_.layout);
    std::vector<Furniture> left;
    for (size_t i = 0; i < pieces.size(); ++i) {
      const Furniture& before = building_.layout.furniture[i];
      if (!pieces[i]) {
        jobs_.resize(jobs_.size() + kNumFurnitureFaces, {Painter::kTrim});
        building_.changed.push_back(Standing(ChangedSurface::Kind::kFurniture, before, before.rect));
        continue;
      }
      const Rect& now = pieces[i]->rect;
      if (now.x0 != before.rect.x0 || now.y0 != before.rect.y0)
        building_.changed.push_back(Standing(ChangedSurface::Kind::kMovedFurniture, before, now));
      AddFurniture(*pieces[i]);
      left.push_back(*pieces[i]);
    }
    building_.layout.furniture = std::move(left);
  }

  // A piece, and where it stands now.
  static ChangedSurface Standing(ChangedSurface::Kind kind, const Furniture& piece, const Rect& now) {
    const Rect& rect = piece.rect;
    ChangedSurface surface{
        .kind = kind, .min = {rect.x0, rect.y0, 0}, .max = {rect.x1, rect.y1, piece.height_m}};
    if (kind != ChangedSurface::Kind::kMovedFurniture) return surface;
    surface.now_min = {now.x0, now.y0, 0};
    surface.now_max = {now.x1, now.y1, piece.height_m};
    return surface;
  }

  // A texture of its own, painted for this change, for some of the panels.
  void ChangePanels() {
    if (options_.change == 0) return;
    Random random(MixSeed(MixSeed(seed_, 6), options_.change));
    std::vector<int> order = RandomOrder(static_cast<int>(panels_.size()), &random);
    order.resize(std::lround(options_.changed_panel_ratio * static_cast<double>(panels_.size())));
    std::sort(order.begin(), order.end());
    first_changed_job_ = static_cast<int>(jobs_.size());
    for (const int i : order) {
      const Panel& panel = panels_[i];
      Box& box = building_.boxes[panel.face / 6];
      const int face = panel.face % 6;
      const int job = AddJob({Painter::kWallPanel, panel.width_m, options_.height_m, panel.material});
      box.faces[face] = FaceSurface(box, face, job);
      building_.changed.push_back(Flat(ChangedSurface::Kind::kPanel, panel.face));
    }
    ExchangePanels(order, &random);
  }

  ChangedSurface Flat(ChangedSurface::Kind kind, int panel_face) const {
    const Box& box = building_.boxes[panel_face / 6];
    const int face = panel_face % 6, axis = face / 2;
    ChangedSurface surface{.kind = kind, .min = box.min, .max = box.max};
    (face % 2 == 0 ? surface.max : surface.min)[axis] = (face % 2 == 0 ? box.min : box.max)[axis];
    return surface;
  }

  // Pairs of panels of one width, none of which is otherwise changed, show each other's textures.
  void ExchangePanels(const std::vector<int>& changed, Random* random) {
    const auto wanted = std::lround(options_.moved_panel_ratio * static_cast<double>(panels_.size()) / 2);
    std::vector<int> free = RandomOrder(static_cast<int>(panels_.size()), random);
    std::erase_if(free, [&](int i) { return std::binary_search(changed.begin(), changed.end(), i); });
    const auto texture = [&](int i) -> int& {
      return building_.boxes[panels_[i].face / 6].faces[panels_[i].face % 6].texture;
    };
    for (int64_t n = 0; n < wanted && !free.empty(); ++n) {
      const int first = free.back();
      free.pop_back();
      const auto other = std::find_if(free.rbegin(), free.rend(), [&](int i) {
        return std::abs(panels_[i].width_m - panels_[first].width_m) < 1e-9 && texture(i) != texture(first);
      });
      if (other == free.rend()) {
        --n;
        continue;
      }
      const int second = *other;
      free.erase(std::next(other).base());
      std::swap(texture(first), texture(second));
      for (const auto& [here, there] : {std::pair(first, second), std::pair(second, first)}) {
        ChangedSurface moved = Flat(ChangedSurface::Kind::kMovedPanel, panels_[here].face);
        const ChangedSurface now = Flat(ChangedSurface::Kind::kMovedPanel, panels_[there].face);
        moved.now_min = now.min;
        moved.now_max = now.max;
        building_.changed.push_back(moved);
      }
    }
  }

  // What a texture is painted by: those of before a change are painted alike after it.
  uint64_t PaintSeed(int texture) const {
    const int num_jobs = static_cast<int>(jobs_.size());
    const int num_changed = first_changed_job_ < 0 ? 0 : num_jobs - first_changed_job_;
    if (texture >= num_jobs) return MixSeed(MixSeed(seed_, 5), texture - num_changed);
    if (texture < num_jobs - num_changed) return MixSeed(MixSeed(seed_, 5), texture);
    return MixSeed(MixSeed(MixSeed(seed_, 8), options_.change), texture);
  }

  // Panels of the second twin take the textures of the first, except those that are to differ.
  void PairTwins() {
    const Twins& twins = *building_.layout.twins;
    const Rect& rect = twins.rect;
    const Eigen::Vector2d middle(0.5 * (rect.x0 + rect.x1) + twins.offset_m, 0.5 * (twins.wing_y + rect.y1));
    struct Pair {
      double distance = 0;  // from the middle of the second wing
      int first = 0, second = 0;
    };
    std::vector<Pair> pairs;
    for (const Panel& second : panels_) {
      const Box& box = building_.boxes[second.face / 6];
      for (const Panel& first : panels_) {
        const Box& twin = building_.boxes[first.face / 6];
        const Eigen::Vector3d offset(twins.offset_m, 0, 0);
        if (first.face % 6 != second.face % 6 || !(twin.min + offset).isApprox(box.min, 1e-9) ||
            !(twin.max + offset).isApprox(box.max, 1e-9) || twin.min.x() < rect.x0 - 1e-9) {
          continue;
        }
        Eigen::Vector2d place = 0.5 * (box.min + box.max).head<2>();  // of the face
        const int face = second.face % 6;
        place[face / 2] = (face % 2 == 0 ? box.min : box.max)[face / 2];
        pairs.push_back({(place - middle).norm(), first.face, second.face});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
    int num_left = options_.num_different_panels;
    for (const Pair& pair : pairs) {
      if (num_left-- > 0) continue;
      Box& box = building_.boxes[pair.second / 6];
      box.faces[pair.second % 6] =
          FaceSurface(box, pair.second % 6, building_.boxes[pair.first / 6].faces[pair.first % 6].texture);
    }
  }

  // Copies the floor or the ceiling of the first twin to the second.
  void CopyTwin(cv::Mat picture, double texel_m) const {
    const Twins& twins = *building_.layout.twins;
    const auto column = [&](double x) { return std::clamp(static_cast<int>(x / texel_m), 0, picture.cols); };
    const int begin = column(twins.rect.x0), offset = static_cast<int>(std::lround(twins.offset_m / texel_m));
    const int end = std::min(column(twins.rect.x1), picture.cols - offset);
    if (end <= begin) return;
    picture.colRange(begin, end).clone().copyTo(picture.colRange(begin + offset, end + offset));
  }

  void Paint(int num_threads) {
    const int floor = static_cast<int>(jobs_.size()), ceiling = floor + 1;
    building_.textures.resize(jobs_.size() + 2);
    const Rect& bounds = building_.layout.bounds;
    const double coarse_texel_m = 2 * options_.texel_m;
    ParallelFor(ceiling + 1, num_threads, [&](int64_t i) {
      // The largest first: the floor and the ceiling.
      const int texture = i == 0 ? floor : i == 1 ? ceiling : static_cast<int>(i - 2);
      const uint64_t seed = PaintSeed(texture);
      cv::Mat picture;
      if (texture == floor) {
        picture = PaintFloor(bounds, building_.layout.rooms, coarse_texel_m, seed);
      } else if (texture == ceiling) {
        picture = PaintCeiling(bounds, coarse_texel_m, seed);
      } else {
        const PaintJob& job = jobs_[texture];
        Random random(seed);
        const int width = std::max(2, static_cast<int>(std::ceil(job.width_m / options_.texel_m - 1e-6)));
        const int height = std::max(2, static_cast<int>(std::ceil(job.height_m / options_.texel_m - 1e-6)));
        switch (job.painter) {
          case Painter::kTrim:
            picture = PaintTrim();
            break;
          case Painter::kWallPanel:
            picture = PaintWallPanel(width, height, options_.texel_m, job.material, random);
            break;
          case Painter::kLintel:
            picture = PaintLintel(width, height, options_.texel_m, job.material, random);
            break;
          case Painter::kFurniture:
            picture = PaintFurnitureFace(width, height, options_.texel_m, random);
            break;
        }
      }
      if (texture >= floor && building_.layout.twins) CopyTwin(picture, coarse_texel_m);
      building_.textures[texture] = Texture(picture);
    });
    // Both are maps of the building with y upwards.
    Surface& plane = building_.floor;
    plane.texture = floor;
    plane.u_axis = 0, plane.v_axis = 1;
    plane.u_scale = 1 / coarse_texel_m, plane.u_offset = -bounds.x0 / coarse_texel_m;
    plane.v_scale = -1 / coarse_texel_m, plane.v_offset = bounds.y1 / coarse_texel_m;
    plane.brightness = 0.9f;
    building_.ceiling = plane;
    building_.ceiling.texture = ceiling;
    building_.ceiling.brightness = 1;
  }

  void BuildGrid() {
    const Rect outside = building_.layout.bounds.Grown(options_.wall_thickness_m);
    Building& b = building_;
    b.grid_origin = {outside.x0, outside.y0};
    b.grid_cols = static_cast<int>(std::ceil(outside.width() / b.cell_m));
    b.grid_rows = static_cast<int>(std::ceil(outside.depth() / b.cell_m));
    std::vector<std::vector<int>> cells(static_cast<size_t>(b.grid_cols) * b.grid_rows);
    for (size_t i = 0; i < b.boxes.size(); ++i) {
      const Box& box = b.boxes[i];
      const int x0 = CellIndex(box.min.x() - 1e-6, 0), x1 = CellIndex(box.max.x() + 1e-6, 0);
      const int y0 = CellIndex(box.min.y() - 1e-6, 1), y1 = CellIndex(box.max.y() + 1e-6, 1);
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x)
          cells[static_cast<size_t>(y) * b.grid_cols + x].push_back(static_cast<int>(i));
      }
    }
    b.cell_begins = {0};
    for (const std::vector<int>& cell : cells) {
      b.cell_boxes.insert(b.cell_boxes.end(), cell.begin(), cell.end());
      b.cell_begins.push_back(static_cast<int>(b.cell_boxes.size()));
    }
  }

  int CellIndex(double coordinate, int axis) const {
    const int cell =
        static_cast<int>(std::floor((coordinate - building_.grid_origin[axis]) / building_.cell_m));
    return std::clamp(cell, 0, (axis == 0 ? building_.grid_cols : building_.grid_rows) - 1);
  }

  struct Panel {
    int face = 0;  // as in RayHit
    double width_m = 0;
    Material material = Material::kPlaster;
  };

  const SimulateOptions& options_;
  const uint64_t seed_;
  Building building_;
  std::vector<PaintJob> jobs_;  // job i paints texture i
  std::vector<Panel> panels_;
  int first_changed_job_ = -1;  // those from here on are of what changed; -1: none
};

}  // namespace

Result<Building> MakeBuilding(const SimulateOptions& options, uint64_t seed, int num_threads) {
  CAIRN_ASSIGN_OR_RETURN(Layout layout, MakeLayout(options, seed));
  return BuildingMaker(options, seed).Make(std::move(layout), num_threads);
}

std::optional<RayHit> CastRay(const Building& building, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double d[3], inverse[3];
  for (int axis = 0; axis < 3; ++axis) {
    d[axis] = std::abs(direction[axis]) > 1e-12 ? direction[axis] : 1e-12;  // no 0 * infinity below
    inverse[axis] = 1 / d[axis];
  }
  if (origin.z() <= 0 || origin.z() >= building.height_m) return std::nullopt;
  RayHit hit;
  hit.face = d[2] < 0 ? RayHit::kFloor : RayHit::kCeiling;
  hit.distance = ((d[2] < 0 ? 0 : building.height_m) - origin.z()) * inverse[2];

  // Walk the cells of the grid that the ray crosses, in order.
  const double gx = (origin.x() - building.grid_origin.x()) / building.cell_m;
  const double gy = (origin.y() - building.grid_origin.y()) / building.cell_m;
  int x = static_cast<int>(std::floor(gx)), y = static_cast<int>(std::floor(gy));
  if (x < 0 || y < 0 || x >= building.grid_cols || y >= building.grid_rows) return std::nullopt;
  const int step_x = d[0] > 0 ? 1 : -1, step_y = d[1] > 0 ? 1 : -1;
  const double delta_x = building.cell_m * std::abs(inverse[0]),
               delta_y = building.cell_m * std::abs(inverse[1]);
  double next_x = (d[0] > 0 ? x + 1 - gx : gx - x) * delta_x;
  double next_y = (d[1] > 0 ? y + 1 - gy : gy - y) * delta_y;
  while (true) {
    const int cell = y * building.grid_cols + x;
    for (int i = building.cell_begins[cell]; i < building.cell_begins[cell + 1]; ++i) {
      const int b = building.cell_boxes[i];
      const Box& box = building.boxes[b];
      double enter = -kInfinity, leave = kInfinity;
      int face = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const bool forward = d[axis] > 0;
        const double near = ((forward ? box.min[axis] : box.max[axis]) - origin[axis]) * inverse[axis];
        const double far = ((forward ? box.max[axis] : box.min[axis]) - origin[axis]) * inverse[axis];
        if (near > enter) enter = near, face = 2 * axis + (forward ? 0 : 1);
        leave = std::min(leave, far);
      }
      if (enter > leave || leave < 0 || enter >= hit.distance) continue;
      if (enter < 0) return std::nullopt;  // inside the box
      hit.distance = enter;
      hit.face = 6 * b + face;
    }
    if (hit.distance <= std::min(next_x, next_y)) return hit;
    if (next_x < next_y) {
      next_x += delta_x;
      x += step_x;
      if (x < 0 || x >= building.grid_cols) break;
    } else {
      next_y += delta_y;
      y += step_y;
      if (y < 0 || y >= building.grid_rows) break;
    }
  }
  return std::nullopt;
}

double ClearanceM(const Building& building, double x, double y) {
  const Rect& bounds = building.layout.bounds;
  double clearance = std::min({x - bounds.x0, bounds.x1 - x, y - bounds.y0, bounds.y1 - y});
  for (const Rect& obstacle : building.obstacles) {
    clearance = std::min(clearance, DistanceToRect(obstacle, x, y));
  }
  return std::max(clearance, 0.0);
}

}  // namespace cairn::sim
