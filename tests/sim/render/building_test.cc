#include "sim/render/building.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "core/base/random.h"
#include "sim/render/renderer.h"
#include "sim/survey/survey.h"

namespace cairn::sim {
namespace {

// Large texels: quick to paint.
SimulateOptions QuickOptions() {
  SimulateOptions options;
  options.texel_m = 0.02;
  return options;
}

Building Make(const SimulateOptions& options, uint64_t seed = 0) {
  Result<Building> building = MakeBuilding(options, seed);
  if (!building.ok()) ADD_FAILURE() << building.error().message;
  return building.ok() ? *std::move(building) : Building();
}

bool SamePicture(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
}

// How many wall faces show each texture; panels reach from the floor to the ceiling and are seen from
// one side.
std::map<int, int> PanelsPerTexture(const Building& building, const SimulateOptions& options) {
  std::map<int, int> panels;
  std::set<std::pair<double, double>> pillars;
  for (const Furniture& piece : building.layout.furniture) pillars.insert({piece.rect.x0, piece.rect.y0});
  for (const Box& box : building.boxes) {
    const bool is_wall = box.max.z() == options.height_m && box.min.z() == 0;
    if (!is_wall || pillars.count({box.min.x(), box.min.y()})) continue;
    for (const Surface& face : box.faces) panels[face.texture] += face.texture > 0;
  }
  panels.erase(0);
  return panels;
}

TEST(MakeBuilding, IsTheSameForAnyNumberOfThreads) {
  const Building one = *MakeBuilding(QuickOptions(), 5, 1), three = *MakeBuilding(QuickOptions(), 5, 3);
  ASSERT_EQ(one.textures.size(), three.textures.size());
  ASSERT_EQ(one.boxes.size(), three.boxes.size());
  for (size_t i = 0; i < one.textures.size(); ++i) {
    EXPECT_TRUE(SamePicture(one.textures[i].base(), three.textures[i].base())) << i;
  }
}

TEST(MakeBuilding, DiffersBetweenSeeds) {
  EXPECT_NE(Make(QuickOptions(), 1).layout.rooms[0].rect.x1, Make(QuickOptions(), 2).layout.rooms[0].rect.x1);
}

TEST(MakeBuilding, GivesEveryPanelItsOwnTextureWithoutRepetition) {
  SimulateOptions options = QuickOptions();
  options.repetition_ratio = 0;
  const Building building = Make(options);
  const std::map<int, int> panels = PanelsPerTexture(building, options);
  EXPECT_EQ(static_cast<int>(panels.size()), building.num_wall_panels);
  for (const auto& [texture, count] : panels) EXPECT_EQ(count, 1);
  for (const auto& [a, count_a] : panels) {
    for (const auto& [b, count_b] : panels) {
      if (a < b) {
        EXPECT_FALSE(SamePicture(building.textures[a].base(), building.textures[b].base()));
      }
    }
  }
}

TEST(MakeBuilding, RepeatsTheAskedShareOfPanels) {
  SimulateOptions options = QuickOptions();
  options.repetition_ratio = 0.5;
  options.num_shared_textures = 2;
  const Building building = Make(options);
  EXPECT_EQ(building.num_repeated_panels, std::lround(0.5 * building.num_wall_panels));
  std::vector<int> shared;
  for (const auto& [texture, count] : PanelsPerTexture(building, options)) {
    if (count > 1) shared.push_back(count);
  }
  ASSERT_EQ(shared.size(), 2u);
  EXPECT_EQ(shared[0] + shared[1], building.num_repeated_panels);
}

TEST(MakeBuilding, KeepsRoomsApartAndInside) {
  SimulateOptions options = QuickOptions();
  options.width_m = 24, options.depth_m = 24, options.num_rooms = 20;  // two corridors and a spine
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const Result<Layout> layout = MakeLayout(options, seed);
    ASSERT_TRUE(layout.ok()) << layout.error().message;
    int num_rooms = 0;
    for (const Room& room : layout->rooms) {
      num_rooms += !room.is_corridor;
      EXPECT_TRUE(room.rect.x0 >= 0 && room.rect.y0 >= 0 && room.rect.x1 <= 24 && room.rect.y1 <= 24 + 1e-9);
      for (const Room& other : layout->rooms) {
        if (&room != &other && !(room.is_corridor && other.is_corridor)) {
          EXPECT_FALSE(room.rect.Grown(-1e-6).Overlaps(other.rect)) << room.name << ", " << other.name;
        }
      }
      for (const Wall& wall : layout->walls)
        EXPECT_FALSE(room.rect.Grown(-1e-6).Overlaps(wall.rect)) << room.name;
    }
    EXPECT_EQ(num_rooms, 20);
  }
}

TEST(MakeBuilding, SaysWhatDoesNotFit) {
  SimulateOptions many = QuickOptions();
  many.num_rooms = 40;
  SimulateOptions flat = QuickOptions();
  flat.depth_m = 4;
  SimulateOptions low = QuickOptions();
  low.height_m = 2.2, low.door_height_m = 2.3;
  SimulateOptions wrong = QuickOptions();
  wrong.repetition_ratio = 1.5;
  for (const auto& [options, word] : std::vector<std::pair<SimulateOptions, std::string>>{
           {many, "num_rooms"}, {flat, "depth_m"}, {low, "door_height_m"}, {wrong, "repetition_ratio"}}) {
    const Result<Building> building = MakeBuilding(options, 0);
    ASSERT_FALSE(building.ok()) << word;
    EXPECT_EQ(building.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(building.error().message.find(word), std::string::npos) << building.error().message;
  }
}

// The grid against a test of all boxes.
TEST(CastRay, FindsTheFirstBox) {
  const Building building = Make(QuickOptions(), 3);
  Random random(1);
  int num_hits = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d origin(random.Uniform(0, 9.5), random.Uniform(0, 7.5),
                                 random.Uniform(0.1, 2.05));  // below the lintels
    const Eigen::Vector3d ray(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 0.3));
    if (ClearanceM(building, origin.x(), origin.y()) < 0.01) continue;
    double nearest = ((ray.z() < 0 ? 0 : building.height_m) - origin.z()) / ray.z();
    for (const Box& box : building.boxes) {
      const Eigen::Array3d a = (box.min - origin).array() / ray.array(),
                           b = (box.max - origin).array() / ray.array();
      const double enter = a.min(b).maxCoeff(), leave = a.max(b).minCoeff();
      if (enter <= leave && enter > 0) nearest = std::min(nearest, enter);
    }
    const std::optional<RayHit> hit = CastRay(building, origin, ray);
    ASSERT_TRUE(hit.has_value());
    ASSERT_NEAR(hit->distance, nearest, 1e-9);
    num_hits += hit->face >= 0;
  }
  EXPECT_GT(num_hits, 5000);
}

TEST(CastRay, GivesNothingFromInsideAWallOrOutside) {
  const Building building = Make(QuickOptions());
  const Rect& wall = building.layout.walls[4].rect;
  EXPECT_FALSE(CastRay(building, {(wall.x0 + wall.x1) / 2, (wall.y0 + wall.y1) / 2, 2.3}, {1, 0.2, 0.1}));
  EXPECT_FALSE(CastRay(building, {-3, 1, 1}, {1, 0, 0}));
  EXPECT_FALSE(CastRay(building, {4, 3.5, 2.7}, {0, 0, -1}));
}

// The picture from a place and from the same place of the other twin.
double TwinDifference(const Building& building, double x, double y, double heading_rad) {
  Camera camera = {.model = CameraModel::kSimplePinhole, .width = 160, .height = 120, .params = {80, 80, 60}};
  const Renderer renderer(building, camera);
  const double offset = building.layout.twins->offset_m;
  return cv::norm(renderer.Render(MakePose({x, y, 1.0}, heading_rad)),
                  renderer.Render(MakePose({x + offset, y, 1.0}, heading_rad)), cv::NORM_INF);
}

// Faces of the first building's boxes that show something else in the second, by where their boxes are; boxes
// that the second lacks are left out.
std::vector<std::pair<Eigen::Vector3d, int>> DifferentFaces(const Building& before, const Building& after) {
  std::vector<std::pair<Eigen::Vector3d, int>> different;
  for (const Box& box : before.boxes) {
    const auto same = std::find_if(after.boxes.begin(), after.boxes.end(),
                                   [&](const Box& b) { return b.min == box.min && b.max == box.max; });
    if (same == after.boxes.end()) continue;
    for (int face = 0; face < 6; ++face) {
      const auto picture = [&](const Building& building, const Box& b) {
        return building.textures[b.faces[face].texture].base();
      };
      if (!SamePicture(picture(before, box), picture(after, *same))) different.emplace_back(box.min, face);
    }
  }
  return different;
}

TEST(ChangedBuilding, ShowsSomethingElseOnSomePanelsAndTheSameElsewhere) {
  SimulateOptions options = QuickOptions();
  const Building before = Make(options);
  EXPECT_TRUE(before.changed.empty());
  options.change = 1;
  options.changed_panel_ratio = 0.3;
  const Building after = Make(options);
  const size_t num_changed = std::lround(0.3 * before.num_wall_panels);
  ASSERT_EQ(after.changed.size(), num_changed);
  const auto different = DifferentFaces(before, after);
  EXPECT_EQ(different.size(), num_changed);
  for (const ChangedSurface& changed : after.changed) {
    EXPECT_EQ(changed.kind, ChangedSurface::Kind::kPanel);
    // Flat, on a face that differs.
    const Eigen::Vector3d size = changed.max - changed.min;
    int axis = -1;
    EXPECT_EQ(size.minCoeff(&axis), 0);
    EXPECT_NEAR(size.z(), options.height_m, 1e-12);
    EXPECT_TRUE(std::any_of(different.begin(), different.end(), [&](const auto& face) {
      const Box& box = *std::find_if(before.boxes.begin(), before.boxes.end(),
                                     [&](const Box& b) { return b.min == face.first; });
      const double plane = (face.second % 2 == 0 ? box.min : box.max)[axis];
      return face.second / 2 == axis && plane == changed.min[axis];
    }));
  }
  EXPECT_TRUE(
      SamePicture(before.textures[before.floor.texture].base(), after.textures[after.floor.texture].base()));
  EXPECT_TRUE(SamePicture(before.textures[before.ceiling.texture].base(),
                          after.textures[after.ceiling.texture].base()));

  options.change = 2;
  EXPECT_NE(DifferentFaces(before, Make(options)), different);
  EXPECT_GT(DifferentFaces(after, Make(options)).size(), different.size());
}

TEST(ChangedBuilding, PanelsExchangeWhatTheyShow) {
  SimulateOptions options = QuickOptions();
  options.change = 1;
  options.changed_panel_ratio = 0.2;
  const Building before = Make(options);
  options.moved_panel_ratio = 0.3;
  const Building after = Make(options);
  const size_t num_changed = std::lround(0.2 * before.num_wall_panels);
  const size_t num_pairs = std::lround(0.3 * before.num_wall_panels / 2);
  ASSERT_GT(num_pairs, 0u);
  ASSERT_EQ(after.changed.size(), num_changed + 2 * num_pairs);
  EXPECT_EQ(DifferentFaces(before, after).size(), 2 * num_pairs);
  const auto picture = [](const Building& building, const Eigen::Vector3d& min, const Eigen::Vector3d& max) {
    const Eigen::Vector3d size = max - min;
    int axis = -1;
    size.minCoeff(&axis);
    for (const Box& box : building.boxes) {
      for (const int face : {2 * axis, 2 * axis + 1}) {
        Eigen::Vector3d low = box.min, high = box.max;
        (face % 2 == 0 ? high : low)[axis] = (face % 2 == 0 ? box.min : box.max)[axis];
        if (low.isApprox(min) && high.isApprox(max)) return building.textures[box.faces[face].texture].base();
      }
    }
    ADD_FAILURE() << "no such panel";
    return cv::Mat();
  };
  for (size_t i = num_changed; i < after.changed.size(); ++i) {
    const ChangedSurface& moved = after.changed[i];
    EXPECT_EQ(moved.kind, ChangedSurface::Kind::kMovedPanel);
    const cv::Mat was_here = picture(before, moved.min, moved.max);
    EXPECT_TRUE(SamePicture(was_here, picture(after, moved.now_min, moved.now_max)));
    EXPECT_FALSE(SamePicture(was_here, picture(after, moved.min, moved.max)));
  }
  // However many are wanted, each is exchanged once.
  options.moved_panel_ratio = 1;
  EXPECT_LE(Make(options).changed.size(), static_cast<size_t>(before.num_wall_panels));
}

TEST(ChangedBuilding, LacksSomeFurniture) {
  SimulateOptions options = QuickOptions();
  const Building before = Make(options);
  options.change = 1;
  options.changed_panel_ratio = 0;
  options.removed_furniture_ratio = 0.5;
  const Building after = Make(options);
  EXPECT_GT(after.changed.size(), 0u);
  EXPECT_EQ(after.layout.furniture.size() + after.changed.size(), before.layout.furniture.size());
  EXPECT_EQ(after.boxes.size() + after.changed.size(), before.boxes.size());
  EXPECT_EQ(DifferentFaces(before, after).size(), 0u);
  for (const ChangedSurface& gone : after.changed) {
    EXPECT_EQ(gone.kind, ChangedSurface::Kind::kFurniture);
    const double x = 0.5 * (gone.min.x() + gone.max.x()), y = 0.5 * (gone.min.y() + gone.max.y());
    EXPECT_EQ(ClearanceM(before, x, y), 0);
    EXPECT_GT(ClearanceM(after, x, y), 0);
  }
  options.removed_furniture_ratio = 1;
  for (const Furniture& piece : Make(options).layout.furniture) EXPECT_TRUE(piece.is_pillar);
}

TEST(ChangedBuilding, HasSomeFurnitureElsewhereInItsRoom) {
  SimulateOptions options = QuickOptions();
  const Building before = Make(options);
  options.change = 1;
  options.changed_panel_ratio = 0;
  options.moved_furniture_ratio = 1;
  const Building after = Make(options);
  ASSERT_GT(after.changed.size(), 0u);
  ASSERT_EQ(after.layout.furniture.size(), before.layout.furniture.size());
  EXPECT_EQ(after.boxes.size(), before.boxes.size());
  EXPECT_EQ(DifferentFaces(before, after).size(), 0u) << "they look as they did";
  size_t num_moved = 0;
  for (size_t i = 0; i < after.layout.furniture.size(); ++i) {
    const Furniture& now = after.layout.furniture[i];
    const Furniture& was = before.layout.furniture[i];
    if (now.rect.x0 == was.rect.x0 && now.rect.y0 == was.rect.y0) continue;
    const ChangedSurface& moved = after.changed[num_moved++];
    EXPECT_EQ(moved.kind, ChangedSurface::Kind::kMovedFurniture);
    EXPECT_FALSE(now.is_pillar);
    EXPECT_FALSE(now.rect.Overlaps(was.rect));
    EXPECT_NEAR(now.rect.width(), was.rect.width(), 1e-9);
    EXPECT_NEAR(now.rect.depth(), was.rect.depth(), 1e-9);
    EXPECT_EQ(moved.min, Eigen::Vector3d(was.rect.x0, was.rect.y0, 0));
    EXPECT_EQ(moved.max, Eigen::Vector3d(was.rect.x1, was.rect.y1, was.height_m));
    EXPECT_EQ(moved.now_min, Eigen::Vector3d(now.rect.x0, now.rect.y0, 0));
    EXPECT_EQ(moved.now_max, Eigen::Vector3d(now.rect.x1, now.rect.y1, now.height_m));
    const auto room_of = [&](const Rect& rect) {
      return std::find_if(after.layout.rooms.begin(), after.layout.rooms.end(),
                          [&](const Room& room) { return room.rect.Overlaps(rect); });
    };
    EXPECT_EQ(room_of(now.rect), room_of(was.rect));
    for (size_t k = 0; k < i; ++k) EXPECT_FALSE(now.rect.Overlaps(after.layout.furniture[k].rect));
  }
  EXPECT_EQ(num_moved, after.changed.size());
  // Another change moves others, and none without a change.
  options.moved_furniture_ratio = 0.5;
  EXPECT_LT(Make(options).changed.size(), after.changed.size());
  options.change = 0;
  EXPECT_EQ(Make(options).changed.size(), 0u);
}

SimulateOptions TwinOptions() {
  SimulateOptions options = QuickOptions();
  options.width_m = 12;
  options.depth_m = 8;
  options.twin_wings = true;
  return options;
}

TEST(TwinWings, LookAlikeEverywhereInsideThem) {
  SimulateOptions options = TwinOptions();
  options.num_different_panels = 0;
  const Building building = Make(options);
  ASSERT_TRUE(building.layout.twins.has_value());
  const Rect& wing = building.layout.rooms[0].rect;
  const double x = 0.5 * (wing.x0 + wing.x1);
  for (const double y : {wing.y0 + 2.2, 0.5 * (wing.y0 + wing.y1), wing.y1 - 0.5}) {
    for (const double heading : {-1.57, -1.3, -1.8, 0.3, 1.57}) {
      EXPECT_LE(TwinDifference(building, x, y, heading), 2) << y << " " << heading;
    }
  }
}

TEST(TwinWings, DifferInOnePanel) {
  const Building building = Make(TwinOptions());
  const Rect& wing = building.layout.rooms[0].rect;
  const double x = 0.5 * (wing.x0 + wing.x1), y = 0.5 * (wing.y0 + wing.y1);
  const double west = TwinDifference(building, x, y, 3.14), east = TwinDifference(building, x, y, 0);
  EXPECT_GT(std::max(west, east), 50);
  EXPECT_LE(std::min(west, east), 2);
  EXPECT_LE(TwinDifference(building, x, wing.y1 - 0.5, 1.57), 2);
}

TEST(TwinWings, DoNotLookAlikeOutsideOfThem) {
  const Building building = Make(TwinOptions());
  const Rect& wing = building.layout.rooms[0].rect;
  EXPECT_GT(TwinDifference(building, 0.5 * (wing.x0 + wing.x1), 0.8, 0), 50);  // along the spine
}

TEST(TwinWings, LeadOnToABackCorridorLikeEachOther) {
  SimulateOptions options = TwinOptions();
  options.depth_m = 10;
  options.num_different_panels = 0;
  options.back_corridor = true;
  const Building building = Make(options);
  const Rect& wing = building.layout.rooms[0].rect;
  const double x = 0.5 * (wing.x0 + wing.x1), middle = 0.5 * (wing.y0 + wing.y1);
  for (const double heading : {-1.57, 0.3, 1.57})
    EXPECT_LE(TwinDifference(building, x, middle, heading), 2) << heading;
  // From the spine to the wall behind the back corridor, through either wing and the goal room's doors.
  const Rect& goal = building.layout.rooms.back().rect;
  for (const double way_x : {x, x + building.layout.twins->offset_m, 0.5 * (goal.x0 + options.width_m)}) {
    const auto hit = CastRay(building, {way_x, 0.5, 1}, {0, 1, 0});
    ASSERT_TRUE(hit.has_value());
    EXPECT_NEAR(hit->distance, options.depth_m - 0.5, 1e-9);
  }
  EXPECT_GT(TwinDifference(building, x, options.depth_m - 0.8, 0), 50);  // along the back corridor
}

TEST(TwinWings, NeedRoom) {
  SimulateOptions options = TwinOptions();
  options.width_m = 6;
  const Result<Building> building = MakeBuilding(options, 0);
  ASSERT_FALSE(building.ok());
  EXPECT_EQ(building.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn::sim
