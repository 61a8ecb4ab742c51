// views_growth: time and regions of the decomposition over polygons of growing size, with and without holes;
// and the source's experiment, nodes of both searches, on seven plans of growing size.
// Plans of up to 10,000 segments, to be decomposed by the program.
//   views_growth time | plans FOLDER | large FOLDER
#include <cmath>
#include <cstdio>
#include <cstring>

#include "bench/views/scan_places.h"
#include "core/base/random.h"
#include "core/files/file.h"
#include "core/line/memory.h"
#include "core/view_regions/arrangement.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;
using Vec2 = Eigen::Vector2d;

// A corridor with rooms of different width and depth on both sides, joined by doors: 8 corners a room.
std::vector<Vec2> Office(int num_rooms, uint64_t seed) {
  Random random(seed);
  const int below = num_rooms / 2, above = num_rooms - below;
  const double length = 4.5 * std::max(below, above) + 1;
  std::vector<Vec2> ring;
  const auto side = [&](int rooms, bool up) {
    const double pitch = length / rooms;
    for (int i = 0; i < rooms; ++i) {
      const double x0 = i * pitch + random.Uniform(0.2, 0.6), x1 = (i + 1) * pitch - random.Uniform(0.2, 0.6);
      const double depth = random.Uniform(2.5, 6), door = random.Uniform(x0 + 0.3, x1 - 1.3), wall = 0.2;
      const std::vector<Vec2> corners = {{door, 0},    {door, -wall}, {x0, -wall},       {x0, -depth},
                                         {x1, -depth}, {x1, -wall},   {door + 1, -wall}, {door + 1, 0}};
      for (const Vec2& corner : corners)
        ring.push_back(up ? Vec2(length - corner.x(), 2 - corner.y()) : corner);
    }
  };
  ring.push_back({0, 0});
  side(below, false);
  ring.push_back({length, 0});
  ring.push_back({length, 2});
  side(above, true);
  ring.push_back({0, 2});
  return ring;
}

// Pillars of four corners in the corridor.
std::vector<std::vector<Vec2>> Pillars(int num, double length, uint64_t seed) {
  Random random(seed);
  std::vector<std::vector<Vec2>> rings;
  for (int i = 0; i < num; ++i) {
    const double x = length * (i + random.Uniform(0.3, 0.7)) / num, y = random.Uniform(0.5, 1.2),
                 size = random.Uniform(0.15, 0.4);
    rings.push_back({{x, y}, {x, y + size}, {x + size, y + size}, {x + size, y}});
  }
  return rings;
}

std::string GeoJson(const std::vector<std::vector<Vec2>>& rings) {
  std::string text = "{\"type\": \"Polygon\", \"coordinates\": [";
  for (size_t i = 0; i < rings.size(); ++i) {
    text += i > 0 ? ",\n[" : "[";
    for (const Vec2& point : rings[i]) text += fmt::format("[{:.4f},{:.4f}],", point.x(), point.y());
    text += fmt::format("[{:.4f},{:.4f}]]", rings[i][0].x(), rings[i][0].y());
  }
  return text + "]}\n";
}

int Time() {
  std::printf(
      "| vertices n | holes | boundaries | edges I | regions | s | s / (n² log n + I), ns "
      "|\n|---|---|---|---|---|---|---|\n");
  for (const bool holes : {false, true}) {
    for (const int rooms : {2, 4, 8, 16, 24, 36, 48}) {
      std::vector<std::vector<Vec2>> rings{Office(rooms, rooms)};
      const double length = 4.5 * ((rooms + 1) / 2) + 1;
      if (holes) {
        for (auto& ring : Pillars(std::max(1, rooms / 4), length, rooms)) rings.push_back(ring);
      }
      const auto input = decompose_views::ParsePlan(GeoJson(rings), "office");
      NoProgress progress;
      double seconds = 1e9;
      Result<decompose_views::DecomposeViewsResult> result = MakeError(ErrorCode::kFailed, "not run");
      for (int run = 0; run < 3; ++run) {
        const double start = Seconds();
        result = decompose_views::DecomposeViews(*input, {}, 0, DefaultMemoryMib(), progress);
        seconds = std::min(seconds, Seconds() - start);
      }
      if (!result.ok()) {
        std::fprintf(stderr, "%s\n", result.error().message.c_str());
        return 1;
      }
      const auto n = static_cast<double>(result->views.plan.vertices.size());
      const auto edges = static_cast<double>(result->views.links.size());
      std::printf("| %.0f | %zu | %lld | %.0f | %d | %.3f | %.0f |\n", n, rings.size() - 1,
                  static_cast<long long>(result->num_boundaries), edges, result->views.num_faces(), seconds,
                  1e9 * seconds / (n * n * std::log2(n) + edges));
      std::fflush(stdout);
    }
  }
  return 0;
}

// Rooms of 4 m side by side, with doors of 1 m in random places between them: `n` in a row, 4 n^2 segments.
std::string Rooms(int n) {
  Random random(1);
  std::string text;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (const bool upright : {false, true}) {
        const double door = random.Uniform(0.5, 2.5);
        const auto wall = [&](double from, double to) {
          text += upright ? fmt::format("{},{:.4f},{},{:.4f}\n", 4 * i, from, 4 * i, to)
                          : fmt::format("{:.4f},{},{:.4f},{}\n", from, 4 * i, to, 4 * i);
        };
        if (i == 0 || i == n) {
          wall(4 * j, 4 * j + 4);
        } else {
          wall(4 * j, 4 * j + door);
          wall(4 * j + door + 1, 4 * j + 4);
        }
      }
    }
  }
  return text;
}

// `n` walls of 0.5 to 3 m anywhere and any way, one on 3.6 m2.
std::string Loose(int n) {
  Random random(2);
  const double side = std::sqrt(3.6 * n);
  std::string text;
  for (int i = 0; i < n; ++i) {
    const Vec2 start(random.Uniform(0, side), random.Uniform(0, side));
    const double turn = random.Uniform(0, 3.14159), length = random.Uniform(0.5, 3);
    const Vec2 end = start + length * Vec2(std::cos(turn), std::sin(turn));
    text += fmt::format("{:.4f},{:.4f},{:.4f},{:.4f}\n", start.x(), start.y(), end.x(), end.y());
  }
  return text;
}

int Plans(const std::string& folder) {
  for (const int rooms : {2, 4, 6, 10, 16, 24, 36}) {
    const std::string path = fmt::format("{}/office_{:02}.geojson", folder, rooms);
    if (!WriteFileAtomically(path, GeoJson({Office(rooms, rooms)})).ok()) return 1;
  }
  return 0;
}

int LargePlans(const std::string& folder) {
  for (const int n : {16, 25, 35, 50}) {
    if (!WriteFileAtomically(fmt::format("{}/rooms_{}.txt", folder, n), Rooms(n)).ok()) return 1;
  }
  for (const int n : {300, 1000, 2500, 10000}) {
    if (!WriteFileAtomically(fmt::format("{}/loose_{}.txt", folder, n), Loose(n)).ok()) return 1;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "time") == 0) return Time();
  if (argc == 3 && std::strcmp(argv[1], "plans") == 0) return Plans(argv[2]);
  if (argc == 3 && std::strcmp(argv[1], "large") == 0) return LargePlans(argv[2]);
  std::fprintf(stderr, "usage: views_growth time | plans FOLDER | large FOLDER\n");
  return 2;
}
