#include "stages/decompose_views/decompose_views.h"

#include <filesystem>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>

#include "core/base/random.h"
#include "core/files/file.h"
#include "core/plan/views_database.h"
#include "core/view_regions/label_faces.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;
using testing::ElementsAre;
using testing::HasSubstr;

double TotalArea(const Views& views) {
  double area = 0;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) area += views.Area(face);
  return area;
}

std::vector<LabelIdx> LabelsAt(const Views& views, const Vec2& place) {
  const FaceIdx face = FaceLocator(views).Find(place);
  EXPECT_GE(face, 0);
  return face < 0 ? std::vector<LabelIdx>{} : views.LabelSet(face);
}

// What a point sees, with none of the decomposition's code: every direction between neighbouring ends of
// pieces, every piece, the nearest.
std::set<LabelIdx> LookAround(const FloorPlan& plan, const Vec2& place) {
  std::vector<double> angles;
  for (const GridPoint& vertex : plan.vertices) {
    const Vec2 to = plan.Metres(vertex) - place;
    angles.push_back(std::atan2(to.y(), to.x()));
  }
  std::sort(angles.begin(), angles.end());
  angles.push_back(angles[0] + 2 * std::numbers::pi);
  std::set<LabelIdx> seen;
  for (size_t i = 0; i + 1 < angles.size(); ++i) {
    if (angles[i + 1] - angles[i] < 1e-12) continue;
    const double angle = 0.5 * (angles[i] + angles[i + 1]);
    const Vec2 ray(std::cos(angle), std::sin(angle));
    double nearest = std::numeric_limits<double>::infinity();
    LabelIdx label = -1;
    for (const PlanPiece& piece : plan.pieces) {
      const Vec2 a = plan.Metres(plan.vertices[piece.start]) - place,
                 b = plan.Metres(plan.vertices[piece.end]) - place;
      const double side_a = ray.x() * a.y() - ray.y() * a.x(), side_b = ray.x() * b.y() - ray.y() * b.x();
      if ((side_a > 0) == (side_b > 0)) continue;
      const Vec2 hit = a + (b - a) * (side_a / (side_a - side_b));
      if (hit.dot(ray) <= 0 || hit.norm() >= nearest) continue;
      nearest = hit.norm();
      label = LabelOf(piece.wall, a.x() * b.y() - a.y() * b.x() < 0);
    }
    if (label >= 0) seen.insert(label);
  }
  return seen;
}

// Compares label sets at random points with what LookAround sees, except near to borders.
void ExpectLabelsAsSeen(const DecomposeViewsResult& result, int num_points) {
  const Views& views = result.views;
  EXPECT_EQ(result.num_disagreements, 0);
  const FaceLocator locator(views);
  Random random(1);
  const Vec2 low = views.plan.Metres(views.plan.low), high = views.plan.Metres(views.plan.high);
  int compared = 0;
  for (int i = 0; i < num_points; ++i) {
    const Vec2 place(random.Uniform(low.x(), high.x()), random.Uniform(low.y(), high.y()));
    const FaceIdx face = locator.Find(place);
    if (face < 0) {
      EXPECT_TRUE(views.plan.closed);
      continue;
    }
    if (locator.BorderDistance(face, place) < 3 * views.plan.grid_m) continue;
    const std::set<LabelIdx> seen = LookAround(views.plan, place);
    EXPECT_EQ(views.LabelSet(face), std::vector<LabelIdx>(seen.begin(), seen.end())) << place.transpose();
    ++compared;
  }
  EXPECT_GT(compared, num_points / 10);
}

TEST(DecomposeViews, AConvexRoomIsOneRegion) {
  const auto result = Decomposed(PolygonText({{{0, 0}, {4, 0}, {4, 3}, {0, 3}}}));
  ASSERT_EQ(result.views.num_faces(), 1);
  EXPECT_THAT(result.views.LabelSet(0), ElementsAre(0, 2, 4, 6));
  EXPECT_NEAR(result.views.Area(0), 12, 1e-9);
  EXPECT_EQ(result.num_boundaries, 0);
}

TEST(DecomposeViews, AnElbowHasFiveRegions) {
  //  +--+         From the corner square all six walls are seen; above it not the
  //  |\ |         one that faces down, and above the line from the reflex corner
  //  |_\+--+      to (0, 2), which is that of (2, 0), not the right end either.
  //  |  |\ |
  //  +--+-\+
  const auto result = Decomposed(PolygonText({{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}}));
  const Views& views = result.views;
  ASSERT_EQ(views.num_faces(), 5);
  EXPECT_THAT(LabelsAt(views, {0.5, 0.5}), ElementsAre(0, 2, 4, 6, 8, 10));
  EXPECT_THAT(LabelsAt(views, {0.2, 1.1}), ElementsAre(0, 2, 6, 8, 10));
  EXPECT_THAT(LabelsAt(views, {0.5, 1.8}), ElementsAre(0, 6, 8, 10));
  EXPECT_THAT(LabelsAt(views, {1.8, 0.5}), ElementsAre(0, 2, 4, 10));
  EXPECT_NEAR(TotalArea(views), 3, 1e-9);
  EXPECT_EQ(views.links.size(), 4u);
  ExpectLabelsAsSeen(result, 500);
}

TEST(DecomposeViews, AWallAloneIsSeenFromBothSides) {
  // Regions: above and below the wall's line in the box around it.
  const auto result = Decomposed("0,0,2,0");
  const Views& views = result.views;
  ASSERT_EQ(views.num_faces(), 2);
  EXPECT_THAT(LabelsAt(views, {1, 0.5}), ElementsAre(0));
  EXPECT_THAT(LabelsAt(views, {1, -0.5}), ElementsAre(1));
  EXPECT_EQ(views.links.size(), 2u);
  EXPECT_NEAR(TotalArea(views), 4 * 2, 1e-9);
}

TEST(DecomposeViews, AWallSeenThroughTwoWindowsStaysVisibleWhileOneIsLeft) {
  // A pillar before the lower wall: seen on both sides of it from above, on one side from the left.
  const auto result =
      Decomposed(PolygonText({{{0, 0}, {10, 0}, {10, 6}, {0, 6}}, {{4.5, 3}, {4.5, 4}, {5.5, 4}, {5.5, 3}}}));
  const Views& views = result.views;
  const WallRays rays(views.plan);
  const auto lower_windows = [&](const Vec2& place) {
    const auto windows = CountWindows(views.plan, rays, views.plan.Grid(place));
    EXPECT_EQ(windows[0].label, 0);
    return windows[0].windows;
  };
  EXPECT_EQ(lower_windows({5.01, 5.5}), 2);
  EXPECT_EQ(lower_windows({1, 5.5}), 1);
  EXPECT_EQ(LabelsAt(views, {5.01, 5.5})[0], 0);
  EXPECT_EQ(LabelsAt(views, {1, 5.5})[0], 0);
  ExpectLabelsAsSeen(result, 2000);
}

TEST(DecomposeViews, LabelsAreWhatIsSeenWhereManyVerticesAreInOneLine) {
  // A corridor with niches on both sides, opposite each other, and pillars in a row: all on one lattice.
  std::string text = "0,0,9,0\n0,5,9,5\n0,0,0,5\n9,0,9,5\n";
  for (int i = 1; i < 9; i += 2) {
    text += fmt::format("{0},0,{0},1\n{1},0,{1},1\n{0},4,{0},5\n{1},4,{1},5\n", i, i + 1);
    text += fmt::format("{0},2,{1},2\n{1},2,{1},3\n{1},3,{0},3\n{0},3,{0},2\n", i, i + 1);
  }
  ExpectLabelsAsSeen(Decomposed(text), 3000);
}

TEST(DecomposeViews, LabelsAreWhatIsSeenAmongRandomWalls) {
  for (int seed = 0; seed < 6; ++seed) {
    Random random(seed);
    std::string text;
    for (int i = 0; i < 12; ++i) {
      const double x = random.Uniform(0, 8), y = random.Uniform(0, 8), angle = random.Uniform(0, 7);
      text += fmt::format("{},{},{},{}\n", x, y, x + 3 * std::cos(angle), y + 3 * std::sin(angle));
    }
    ExpectLabelsAsSeen(Decomposed(text), 500);
  }
}

TEST(DecomposeViews, LabelsAreWhatIsSeenInRandomPolygonsWithHoles) {
  for (int seed = 0; seed < 6; ++seed) {
    Random random(seed);
    const auto star = [&](double x, double y, double low, double high, int corners) {
      Corners ring;
      for (int i = 0; i < corners; ++i) {
        const double angle = 2 * std::numbers::pi * i / corners, radius = random.Uniform(low, high);
        ring.push_back({x + radius * std::cos(angle), y + radius * std::sin(angle)});
      }
      return ring;
    };
    const auto result =
        Decomposed(PolygonText({star(0, 0, 4, 9, 14), star(1, 1, 0.2, 1, 6), star(-2, -1, 0.2, 1, 5)}));
    ExpectLabelsAsSeen(result, 500);
  }
}

TEST(DecomposeViews, RegionsAreConvexAndCoverTheDomain) {
  const auto result =
      Decomposed(PolygonText({{{0, 0}, {10, 0}, {10, 6}, {6, 6}, {6, 4}, {5, 4}, {5, 6}, {0, 6}},
                              {{2, 2}, {2, 3}, {3, 3}, {3, 2}}}));
  const Views& views = result.views;
  EXPECT_NEAR(TotalArea(views), 60 - 2 - 1, 1e-6);
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    const int64_t first = views.face_offsets[face], count = views.face_offsets[face + 1] - first;
    const auto corner = [&](int64_t i) {
      return views.plan.Metres(views.vertices[views.face_vertices[first + i % count]]);
    };
    for (int64_t i = 0; i < count; ++i) {
      const Vec2 along = corner(i + 1) - corner(i), next = corner(i + 2) - corner(i + 1);
      // Up to the bend that rounding to the grid causes.
      EXPECT_GE(along.x() * next.y() - along.y() * next.x(),
                -3 * views.plan.grid_m * (along.norm() + next.norm()));
    }
  }
}

// [Simsarian96 Fig. 7] Niches along a corridor: the regions grow with a power of their number.
TEST(DecomposeViews, NichesMakeRegionsGrowAboutWithTheSquare) {
  const auto niches = [](int count) {
    Corners ring{{0, 0}, {20, 0}, {20, 20}};
    for (int i = count - 1; i >= 0; --i) {
      const double x = 20.0 * (i + 0.5) / count, half = 3.0 / count;
      ring.insert(ring.end(),
                  {{x + half, 20}, {x + half, 20 + 2 * half}, {x - half, 20 + 2 * half}, {x - half, 20}});
    }
    ring.push_back({0, 20});
    return Decomposed(PolygonText({ring})).views.num_faces();
  };
  EXPECT_GT(niches(16), 3.5 * niches(8));
}

TEST(DecomposeViews, ThreadsDoNotMatter) {
  const std::string text = PolygonText({{{0, 0}, {10, 0}, {10, 6}, {6, 6}, {6, 4}, {5, 4}, {5, 6}, {0, 6}}});
  const std::string folder = testing::TempDir();
  NoProgress progress;
  std::string bytes[2];
  for (const int threads : {1, 3}) {
    const auto result = Decomposed(text, {}, threads);
    const std::string path = folder + "threads.db";
    ASSERT_TRUE(WriteViews(result.views, path, progress, [](SQLite::Database&) { return Ok(); }).ok());
    bytes[threads == 3] = *ReadFile(path);
  }
  EXPECT_EQ(bytes[0], bytes[1]);
}

TEST(DecomposeViews, ADatabaseGivesBackWhatWasWritten) {
  const auto result = Decomposed("0,0,2,0\n1,1,3,2\n0.5,-1,0.5,0.5");
  const std::string path = testing::TempDir() + "views.db";
  NoProgress progress;
  ASSERT_TRUE(WriteViews(result.views, path, progress, [](SQLite::Database&) { return Ok(); }).ok());
  const auto read = ReadViews(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->face_vertices, result.views.face_vertices);
  EXPECT_EQ(read->toggled_labels, result.views.toggled_labels);
  EXPECT_EQ(read->parents, result.views.parents);
  EXPECT_EQ(read->links, result.views.links);
  EXPECT_EQ(read->plan.num_walls(), result.views.plan.num_walls());
  int visited = 0;
  read->ForEachLabelSet([&](FaceIdx face, const std::vector<LabelIdx>& labels) {
    EXPECT_EQ(labels, result.views.LabelSet(face));
    ++visited;
  });
  EXPECT_EQ(visited, result.views.num_faces());
}

TEST(DecomposeViews, RefusesDamagedDatabases) {
  const auto result = Decomposed("0,0,2,0\n1,1,3,2");
  const std::string path = testing::TempDir() + "damaged.db";
  NoProgress progress;
  const auto damaged = [&](const char* statement) {
    EXPECT_TRUE(WriteViews(result.views, path, progress, [](SQLite::Database&) { return Ok(); }).ok());
    {
      SQLite::Database database(path, SQLite::OPEN_READWRITE);
      database.exec(statement);
    }
    const auto read = ReadViews(path);
    return read.ok() ? ErrorCode{} : read.error().code;
  };
  EXPECT_EQ(damaged("UPDATE regions SET parent = 7 WHERE region_idx = 1"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE regions SET toggled = x'ffffffff'"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE regions SET corners = x'00'"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE plan SET vertices = x''"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE plan SET grid_m = 0"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("DELETE FROM regions WHERE region_idx = 0"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE walls SET pieces = x'0000000000000000'"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE links SET links = x'01000000010000000000000001000000'"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("DELETE FROM plan"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("PRAGMA user_version = 9"), ErrorCode::kUnsupported);
}

TEST(DecomposeViews, RefusesWhatDoesNotFitIntoMemory) {
  std::string text;
  Random random(3);
  for (int i = 0; i < 60; ++i) {
    const double x = random.Uniform(0, 50), y = random.Uniform(0, 50);
    text += fmt::format("{},{},{},{}\n", x, y, x + 1, y + 0.3);
  }
  NoProgress progress;
  const auto result = DecomposeViews(Parsed(text), {}, 1, 70, progress);
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(result.error().message, HasSubstr("regions"));
}

class CancelledProgress final : public Progress {
 public:
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t) override { ++advanced_; }
  void End() override {}
  bool Cancelled() const override { return advanced_ >= 5; }

 private:
  int advanced_ = 0;
};

TEST(DecomposeViews, StopsWhenItIsCancelled) {
  CancelledProgress progress;
  const auto result =
      DecomposeViews(Parsed("0,0,2,0\n1,1,3,2\n0.5,-1,0.5,0.5\n5,5,6,6"), {}, 1, 4096, progress);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
}

// Rooms of 4 m side by side, with doors of 1 m in random places between them: what is visible is near.
std::string RoomsText(int per_side) {
  Random random(1);
  std::string text;
  const auto wall = [&](bool upright, double across, double from, double to) {
    text += upright ? fmt::format("{},{},{},{}\n", across, from, across, to)
                    : fmt::format("{},{},{},{}\n", from, across, to, across);
  };
  for (int i = 0; i <= per_side; ++i) {
    for (int j = 0; j < per_side; ++j) {
      for (const bool upright : {false, true}) {
        const double door = random.Uniform(0.5, 2.5);
        if (i == 0 || i == per_side) {
          wall(upright, 4 * i, 4 * j, 4 * j + 4);
        } else {
          wall(upright, 4 * i, 4 * j, 4 * j + door);
          wall(upright, 4 * i, 4 * j + door + 1, 4 * j + 4);
        }
      }
    }
  }
  return text;
}

// Remembers its tasks, and cancels after a number of steps.
class StepsProgress final : public Progress {
 public:
  explicit StepsProgress(int64_t max_steps) : max_steps_(max_steps) {}
  void Begin(std::string_view task, int64_t total, std::string_view) override {
    tasks.emplace_back(std::string(task), total);
  }
  void Advance(int64_t) override { ++steps; }
  void End() override {}
  bool Cancelled() const override { return steps >= max_steps_; }
  std::vector<std::pair<std::string, int64_t>> tasks;
  int64_t steps = 0;

 private:
  int64_t max_steps_;
};

TEST(DecomposeViews, AnswersInEveryPartOfItsWorkOnALargerPlan) {
  const InputPlan input = Parsed(RoomsText(5));
  StepsProgress all(1 << 30);
  const auto whole = DecomposeViews(input, {}, 1, 4096, all);
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  EXPECT_GT(whole->views.num_faces(), 10000);
  ExpectLabelsAsSeen(*whole, 200);
  EXPECT_GT(all.steps, 300);
  for (int64_t steps = 1; steps < all.steps; steps += 1 + all.steps / 8) {
    StepsProgress some(steps);
    const auto stopped = DecomposeViews(input, {}, 1, 4096, some);
    ASSERT_FALSE(stopped.ok());
    EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
    EXPECT_EQ(some.steps, steps);  // nothing is done after it
  }
}

TEST(DecomposeViews, RefusesADensePlanBeforeAllOfItsBoundariesAreFound) {
  for (const auto& [num, memory_mib, message] :
       {std::tuple(280, 64, "regions takes about"), {600, 1024, "more than 32 bits can number"}}) {
    std::string text;
    Random random(3);
    for (int i = 0; i < num; ++i) {
      const double x = random.Uniform(0, 100), y = random.Uniform(0, 100);
      text += fmt::format("{},{},{},{}\n", x, y, x + random.Uniform(0.1, 0.5), y + random.Uniform(0.1, 0.5));
    }
    StepsProgress progress(1 << 30);
    const auto result = DecomposeViews(Parsed(text), {}, 1, memory_mib, progress);
    ASSERT_FALSE(result.ok());
    EXPECT_THAT(result.error().message, HasSubstr(message));
    EXPECT_THAT(result.error().message, HasSubstr("--simplify-m"));
    for (const auto& [task, total] : progress.tasks) EXPECT_NE(task, "view boundaries") << total;
  }
}

TEST(DecomposeViews, RealPlansHaveTheLabelsThatAreSeen) {
  const std::string folder = CAIRN_SOURCE_DIR "/../shared/data/floorplans/";
  for (const char* name : {"Obstacle_Hallway", "ICRA2022_F1Tenth_Track"}) {
    const std::string path = folder + name + ".vectormap.txt";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
    ExpectLabelsAsSeen(Decomposed(*ReadFile(path)), 3000);
  }
}

TEST(DecomposeViews, APlanWithAnOriginOfItsOwnIsPutWhereTheOptionsSay) {
  const std::string text = PolygonText({{{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 5}, {0, 5}}});
  const auto here = Decomposed(text);
  const auto there = Decomposed(text, {.plan_x_m = 100, .plan_y_m = -20, .plan_heading_deg = 90});
  ASSERT_EQ(there.views.num_faces(), here.views.num_faces());
  EXPECT_NEAR(TotalArea(there.views), TotalArea(here.views), 1e-3);
  // (x, y) comes to (100 - y, -20 + x).
  for (const Vec2& place : {Vec2(1, 1), Vec2(5, 1), Vec2(1, 4)}) {
    EXPECT_EQ(LabelsAt(there.views, {100 - place.y(), -20 + place.x()}).size(),
              LabelsAt(here.views, place).size());
  }
  EXPECT_EQ(FaceLocator(there.views).Find({100 - 4, -20 + 5}), -1);
}

TEST(DecomposeViews, SmallRegionsAreJoinedOnRequestAndTheLossIsSaid) {
  const std::string text = PolygonText(
      {{{0, 0}, {10, 0}, {10, 6}, {6, 6}, {6, 4}, {5, 4}, {5, 6}, {0, 6}}, {{2, 2}, {2, 3}, {3, 3}, {3, 2}}});
  const auto exact = Decomposed(text), merged = Decomposed(text, {.min_region_area_m2 = 0.2});
  EXPECT_EQ(exact.loss.num_regions, 0);
  EXPECT_GT(merged.loss.num_regions, 10);
  EXPECT_GT(merged.loss.num_labels, 0);
  EXPECT_EQ(merged.views.num_faces() + merged.loss.num_regions, exact.views.num_faces());
  EXPECT_NEAR(TotalArea(merged.views), TotalArea(exact.views), 1e-6);
  EXPECT_TRUE(CheckViews(merged.views, "merged").ok());
  // Large regions keep their labels, and all area except the joined part sees the same as before.
  const FaceLocator in_exact(exact.views), in_merged(merged.views);
  Random random(0);
  int same = 0, num = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec2 place(random.Uniform(0, 10), random.Uniform(0, 6));
    const FaceIdx a = in_exact.Find(place), b = in_merged.Find(place);
    EXPECT_EQ(a < 0, b < 0);
    if (a < 0) continue;
    ++num;
    same += exact.views.LabelSet(a) == merged.views.LabelSet(b);
  }
  EXPECT_GE(same, (1 - merged.loss.area_m2 / TotalArea(exact.views)) * num - 60);
  EXPECT_LT(same, num);
}

}  // namespace
}  // namespace cairn::decompose_views
