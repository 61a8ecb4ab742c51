// views_logs LOG [MAX_SCANS]: a map of segments built from every second scan of a Carmen log at the log's
// poses, the other scans localized in it without odometry.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <Eigen/LU>

#include "core/base/parallel.h"
#include "core/line/memory.h"
#include "core/plan/views_database.h"
#include "runtime/laser/interpretation_tree.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;
using Vec2 = Eigen::Vector2d;

constexpr double kDegree = std::numbers::pi / 180;

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// One wall of the map: points of all segments that lie on it, as a line with an extent.
struct MapWall {
  Vec2 centre, along;
  double low, high, weight;
  int num_scans;
};

// Joins a segment to the wall that it continues or repeats, walls seen from one side only being one-sided.
void AddSegment(const Vec2& start, const Vec2& end, std::vector<MapWall>* walls) {
  const Vec2 along = (end - start).normalized(), middle = 0.5 * (start + end);
  const double length = (end - start).norm();
  for (MapWall& wall : *walls) {
    if (wall.along.dot(along) < std::cos(6 * kDegree)) continue;
    const Vec2 normal(-wall.along.y(), wall.along.x());
    const double a = wall.along.dot(start - wall.centre), b = wall.along.dot(end - wall.centre);
    if (std::max(std::abs(normal.dot(start - wall.centre)), std::abs(normal.dot(end - wall.centre))) > 0.12)
      continue;
    if (b < wall.low - 0.3 || a > wall.high + 0.3) continue;
    const double weight = wall.weight + length;
    const double share = length / weight;
    // The line moves towards the segment, by its share.
    const Vec2 low = wall.centre + wall.low * wall.along, high = wall.centre + wall.high * wall.along;
    wall.centre += share * normal.dot(middle - wall.centre) * normal;
    wall.along = (wall.along + share * (along - wall.along)).normalized();
    wall.low = std::min(wall.along.dot(low - wall.centre), wall.along.dot(start - wall.centre));
    wall.high = std::max(wall.along.dot(high - wall.centre), wall.along.dot(end - wall.centre));
    wall.weight = weight;
    ++wall.num_scans;
    return;
  }
  walls->push_back({middle, along, -0.5 * length, 0.5 * length, length, 1});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: views_logs LOG [MAX_SCANS]\n");
    return 2;
  }
  const auto scans = ReadCarmenLog(argv[1]);
  if (!scans.ok()) {
    std::fprintf(stderr, "%s\n", scans.error().message.c_str());
    return 1;
  }
  const ScanSegmentsOptions segment_options;
  std::vector<MapWall> walls;
  for (size_t i = 0; i < scans->size(); i += 2) {
    for (const ScanSegment& segment : FindScanSegments((*scans)[i], segment_options))
      AddSegment((*scans)[i].pose.FloorFromRobot(segment.start), (*scans)[i].pose.FloorFromRobot(segment.end),
                 &walls);
  }
  decompose_views::InputPlan input;
  for (const MapWall& wall : walls) {
    if (wall.num_scans < 3 || wall.high - wall.low < 0.4) continue;
    input.segments.push_back({wall.centre + wall.low * wall.along, wall.centre + wall.high * wall.along,
                              static_cast<int>(input.segments.size()) + 1});
  }
  decompose_views::DecomposeViewsOptions options;
  options.clean.snap_m = 0.05;
  options.clean.simplify_m = 0.03;
  NoProgress progress;
  double start = Seconds();
  const auto result = decompose_views::DecomposeViews(input, options, 0, DefaultMemoryMib(), progress);
  if (!result.ok()) {
    std::fprintf(stderr, "%s\n", result.error().message.c_str());
    return 1;
  }
  std::printf("%zu scans, %zu walls, %d regions in %.1f s\n", scans->size(), input.segments.size(),
              result->views.num_faces(), Seconds() - start);
  if (const char* path = std::getenv("VIEWS_DB"))
    (void)WriteViews(result->views, path, progress, [](SQLite::Database&) { return Ok(); });
  const ViewSearchIndex index(result->views);
  std::vector<size_t> queries;
  const size_t max_scans = argc > 2 ? std::atoi(argv[2]) : scans->size();
  const size_t step = std::max<size_t>(2, 2 * (scans->size() / 2 / std::max<size_t>(1, max_scans)));
  for (size_t i = 1; i < scans->size(); i += step) queries.push_back(i);
  std::printf(
      "| search | scans | fewer than 3 segments | segments | first right | any right | no solution | wrong | "
      "nodes | ms |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const char* search : {"standard", "vir"}) {
    struct Outcome {
      bool tried = false, first = false, any = false, none = false;
      double segments = 0, nodes = 0, seconds = 0, nees = -1;  // of the first pose, where it is right
    };
    std::vector<Outcome> outcomes(queries.size());
    ParallelFor(static_cast<int64_t>(queries.size()), 0, [&](int64_t i) {
      const RangeScan& scan = (*scans)[queries[i]];
      std::vector<ScanSegment> segments = FindScanSegments(scan, segment_options);
      Outcome& outcome = outcomes[i];
      if (segments.size() < 3) return;
      outcome.tried = true;
      outcome.segments = static_cast<double>(segments.size());
      InterpretationTreeOptions tree;
      tree.search = search;
      tree.max_null_ratio = 0.4;
      tree.one_segment_per_wall = false;
      tree.position_tolerance_m = 0.15;
      tree.length_tolerance_m = 0.4;
      tree.angle_tolerance_deg = 3;
      tree.max_num_nodes = 2e6;
      const double begin = Seconds();
      auto found = SearchInterpretations(index, segments, tree);
      int64_t num_nodes = found->num_nodes;
      if (found->solutions.empty()) {  // what stands in the room may be most of what is seen
        tree.max_null_ratio = 0.6;
        found = SearchInterpretations(index, segments, tree);
        num_nodes += found->num_nodes;
      }
      outcome.seconds = Seconds() - begin;
      outcome.nodes = static_cast<double>(num_nodes);
      outcome.none = found->solutions.empty();
      for (size_t k = 0; k < found->solutions.size(); ++k) {
        const PlanarPose& pose = found->solutions[k].pose;
        const bool right = (pose.position - scan.pose.position).norm() <= 0.25 &&
                           std::abs(WrapAngle(pose.heading_rad - scan.pose.heading_rad)) <= 5 * kDegree;
        outcome.any = outcome.any || right;
        outcome.first = outcome.first || (k == 0 && right);
        if (k > 0 || !right) continue;
        Eigen::Vector3d error;
        error << pose.position - scan.pose.position, WrapAngle(pose.heading_rad - scan.pose.heading_rad);
        outcome.nees = error.dot(found->solutions[0].covariance.inverse() * error);
      }
      if (std::getenv("SHOW_FAILURES") != nullptr && !outcome.first && search[0] == 's') {
        std::string text = fmt::format("scan {}: {} segments, {} solutions\n", queries[i], segments.size(),
                                       found->solutions.size());
        for (size_t k = 0; k < found->solutions.size(); ++k) {
          const Interpretation& solution = found->solutions[k];
          const double off_m = (solution.pose.position - scan.pose.position).norm();
          const double off_deg =
              std::abs(WrapAngle(solution.pose.heading_rad - scan.pose.heading_rad)) / kDegree;
          if (k > 0 && (off_m > 0.5 || off_deg > 10)) continue;
          text += fmt::format(
              "  {}: off {:.2f} m {:.1f} deg, matched {} of {:.2f} m, hidden {:.2f} m, rms {:.3f} m\n", k,
              off_m, off_deg, solution.num_matched, solution.matched_length_m, solution.hidden_length_m,
              solution.rms_m);
        }
        std::fputs(text.c_str(), stdout);
      }
    });
    int tried = 0, first = 0, any = 0, none = 0;
    double nodes = 0, seconds = 0, num_segments = 0;
    std::vector<double> nees;
    for (const Outcome& outcome : outcomes) {
      tried += outcome.tried;
      first += outcome.first;
      any += outcome.any;
      none += outcome.none;
      nodes += outcome.nodes;
      seconds += outcome.seconds;
      num_segments += outcome.segments;
      if (outcome.nees >= 0) nees.push_back(outcome.nees);
    }
    std::printf("| %s | %zu | %zu | %.1f | %d (%.1f %%) | %d (%.1f %%) | %d | %d | %.0f | %.1f |\n", search,
                queries.size(), queries.size() - tried, num_segments / tried, first,
                100.0 * first / queries.size(), any, 100.0 * any / queries.size(), none, tried - none - first,
                nodes / tried, 1e3 * seconds / tried);
    std::sort(nees.begin(), nees.end());
    if (!nees.empty()) {  // 3 degrees of freedom: mean 3, median 2.37
      std::printf("normalised error squared of right first poses: median %.2f, 90th percentile %.2f\n",
                  nees[nees.size() / 2], nees[nees.size() * 9 / 10]);
    }
    std::fflush(stdout);
  }
  return 0;
}
