// views_logs LOG [MAX_SCANS]: a map of segments built from every second scan of a Carmen log at the log's
// poses, the other scans localized in it without odometry.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include <Eigen/LU>

#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/line/memory.h"
#include "core/plan/views_database.h"
#include "runtime/beams/scan_locator.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;
using Vec2 = Eigen::Vector2d;

constexpr double kDegree = std::numbers::pi / 180;

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

// What became of one scan.
struct Outcome {
  bool first = false, any = false, none = true, single = false;
  double probability = 0;
  double tried = 0, seconds = 0;
  double nees = -1;  // of the first pose, where it is right
};

Outcome LocateOne(const ScanLocator& locator, const RangeScan& scan, const ScanSegmentsOptions& options) {
  Outcome outcome;
  const double begin = Seconds();
  const auto located = locator.Locate(ViewOf(scan, options));
  outcome.seconds = Seconds() - begin;
  if (!located.ok()) return outcome;
  outcome.tried = static_cast<double>(located->num_tried);
  outcome.none = located->hypotheses.empty();
  for (size_t k = 0; k < located->hypotheses.size(); ++k) {
    const ScanHypothesis& found = located->hypotheses[k];
    const bool right = IsRight(found.pose, scan.pose);
    outcome.any = outcome.any || right;
    if (k > 0) continue;
    outcome.first = right;
    outcome.probability = found.probability;
    outcome.single = located->hypotheses.size() == 1 && found.determined;
    if (!right) continue;
    Eigen::Vector3d error;
    error << found.pose.position - scan.pose.position,
        WrapAngle(found.pose.heading_rad - scan.pose.heading_rad);
    outcome.nees = error.dot(found.covariance.inverse() * error);
  }
  return outcome;
}

std::string Row(const std::string& search, const std::vector<Outcome>& outcomes) {
  int first = 0, any = 0, none = 0, single = 0, single_right = 0;
  double tried = 0, seconds = 0;
  for (const Outcome& outcome : outcomes) {
    first += outcome.first;
    any += outcome.any;
    none += outcome.none;
    single += outcome.single;
    single_right += outcome.single && outcome.first;
    tried += outcome.tried;
    seconds += outcome.seconds;
  }
  const auto num = static_cast<double>(outcomes.size());
  return fmt::format("| {} | {} | {} ({:.1f} %) | {} ({:.1f} %) | {} | {} of {} | {:.0f} | {:.1f} |\n",
                     search, outcomes.size(), first, 100 * first / num, any, 100 * any / num, none,
                     single_right, single, tried / num, 1e3 * seconds / num);
}

// How far probabilities and covariances may be believed.
std::string Figures(const std::string& search, const std::vector<Outcome>& outcomes) {
  std::string text = fmt::format("{}: right of those with a probability", search);
  const std::array<double, 6> bins = {0, 0.5, 0.9, 0.99, 0.999, 1.1};
  for (size_t bin = 0; bin + 1 < bins.size(); ++bin) {
    int num = 0, right = 0;
    double sum = 0;
    for (const Outcome& outcome : outcomes) {
      if (outcome.none || outcome.probability < bins[bin] || outcome.probability >= bins[bin + 1]) continue;
      ++num;
      right += outcome.first;
      sum += outcome.probability;
    }
    if (num > 0)
      text += fmt::format("; of {:g} or more: {} of {}, {:.1f} expected", bins[bin], right, num, sum);
  }
  std::vector<double> nees;
  for (const Outcome& outcome : outcomes) {
    if (outcome.nees >= 0) nees.push_back(outcome.nees);
  }
  std::sort(nees.begin(), nees.end());
  if (nees.empty()) return text + "\n";
  // 3 degrees of freedom: mean 3, median 2.37
  return text + fmt::format(
                    "\n{}: normalised error squared of right first poses: mean {:.2f}, median {:.2f}, "
                    "90th percentile {:.2f}\n",
                    search, std::accumulate(nees.begin(), nees.end(), 0.0) / nees.size(),
                    nees[nees.size() / 2], nees[nees.size() * 9 / 10]);
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
  std::vector<size_t> queries;
  const size_t max_scans = argc > 2 ? std::atoi(argv[2]) : scans->size();
  const size_t step = std::max<size_t>(2, 2 * (scans->size() / 2 / std::max<size_t>(1, max_scans)));
  for (size_t i = 1; i < scans->size(); i += step) queries.push_back(i);
  std::printf(
      "| search | scans | first right | any right | no solution | one solution, determined: right | tried | "
      "ms |\n|---|---|---|---|---|---|---|---|\n");
  std::string more;
  for (const char* search : {"beams", "vir", "standard"}) {
    ScanLocatorOptions locator_options;
    locator_options.search = search;
    const auto locator = ScanLocator::Make(result->views, locator_options);
    if (!locator.ok()) {
      std::fprintf(stderr, "%s\n", locator.error().message.c_str());
      return 1;
    }
    std::vector<Outcome> outcomes(queries.size());
    ParallelFor(static_cast<int64_t>(queries.size()), 0,
                [&](int64_t i) { outcomes[i] = LocateOne(*locator, (*scans)[queries[i]], segment_options); });
    std::fputs(Row(search, outcomes).c_str(), stdout);
    std::fflush(stdout);
    more += Figures(search, outcomes);
  }
  std::fputs(more.c_str(), stdout);
  return 0;
}
