// views_logs LOG [MAX_SCANS]: a map of segments built from every second scan of a Carmen log at the log's
// poses, the other scans localized in it without odometry; and a robot that wakes up at each of them, and
// drives on by the log's odometry.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include <Eigen/LU>

#include "bench/views/log_map.h"
#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/line/memory.h"
#include "core/plan/views_database.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/belief/plan_tracker.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;
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

// A robot that wakes up at a scan and drives on for 10 m.
struct Drive {
  bool right = false, sure = false;  // in the end
  bool first_sure_right = false, ever_sure_wrong = false;
  double sure_after_m = -1;  // -1: never
  double seconds = 0;
  int num_scans = 0;
};
constexpr double kDriveM = 10, kSure = 0.99;

Drive DriveFrom(size_t start, const std::vector<RangeScan>& scans, const std::vector<ScanView>& views,
                PlanTracker tracker) {
  Drive drive;
  double way = 0;
  const double begin = Seconds();
  // The scans between are the map's.
  for (size_t i = start; i < scans.size() && way < kDriveM; i += 2) {
    if (i > start) {
      const PlanarPose moved = MotionBetween(*views[i - 2].odometry, *views[i].odometry);
      (void)tracker.Move({moved.position, moved.heading_rad});
      way += (scans[i].pose.position - scans[i - 2].pose.position).norm();
    }
    (void)tracker.SeeScan(views[i]);
    ++drive.num_scans;
    const std::vector<PossiblePlace>& places = tracker.belief().places();
    if (places.empty()) continue;
    drive.right = IsRight(places[0].pose, scans[i].pose);
    drive.sure = places[0].probability >= kSure && IsDetermined(places[0].covariance);
    drive.ever_sure_wrong = drive.ever_sure_wrong || (drive.sure && !drive.right);
    if (!drive.sure || drive.sure_after_m >= 0) continue;
    drive.sure_after_m = way;
    drive.first_sure_right = drive.right;
  }
  drive.seconds = Seconds() - begin;
  return drive;
}

std::string Figures(const std::vector<Drive>& drives) {
  int right = 0, sure = 0, sure_wrong = 0, first_right = 0, ever = 0, any = 0, num_scans = 0;
  double seconds = 0;
  std::vector<double> after;
  for (const Drive& drive : drives) {
    right += drive.right;
    sure += drive.sure;
    sure_wrong += drive.sure && !drive.right;
    any += drive.sure_after_m >= 0;
    first_right += drive.first_sure_right;
    ever += drive.ever_sure_wrong;
    num_scans += drive.num_scans;
    seconds += drive.seconds;
    after.push_back(drive.sure_after_m >= 0 ? drive.sure_after_m : 2 * kDriveM);
  }
  std::sort(after.begin(), after.end());
  const auto num = static_cast<double>(drives.size());
  return fmt::format(
      "{:g} m by odometry from {} starts: {} right in the end ({:.2f} %), sure of one place {}, wrongly {}; "
      "sure within them {}, the first time rightly {} ({:.2f} %), wrongly at any scan {} (starts); sure "
      "after "
      "{:.1f} m (median), {:.1f} (90 %), {:.1f} (99 %); {:.1f} ms a scan\n",
      kDriveM, drives.size(), right, 100 * right / num, sure, sure_wrong, any, first_right,
      100 * first_right / num, ever, after[after.size() / 2], after[after.size() * 9 / 10],
      after[after.size() * 99 / 100], 1e3 * seconds / num_scans);
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
  const decompose_views::InputPlan input = MapOfEverySecond(*scans, segment_options);
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
  if (!(*scans)[0].odometry) return 0;
  const auto tracker = PlanTracker::Make(result->views);
  if (!tracker.ok()) {
    std::fprintf(stderr, "%s\n", tracker.error().message.c_str());
    return 1;
  }
  std::vector<ScanView> views;
  for (const RangeScan& scan : *scans) views.push_back(ViewOf(scan, segment_options));
  std::vector<Drive> drives(queries.size());
  ParallelFor(static_cast<int64_t>(queries.size()), 0,
              [&](int64_t i) { drives[i] = DriveFrom(queries[i], *scans, views, *tracker); });
  std::fputs(Figures(drives).c_str(), stdout);
  return 0;
}
