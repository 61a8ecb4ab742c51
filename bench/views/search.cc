// views_search NUM_POSITIONS noise-free|noisy|all PLAN...: nodes of the standard interpretation tree and of
// the VIR search, and right poses.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <Eigen/Eigenvalues>

#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/line/memory.h"
#include "runtime/laser/interpretation_tree.h"
#include "stages/decompose_views/decompose_views.h"
#include "tests/runtime/scans/simulated_scan.h"

namespace {

using namespace cairn;

constexpr double kDegree = std::numbers::pi / 180;

struct Sample {
  bool valid = false;
  double num_segments = 0, candidates = 0;
  double standard_first = 0, standard_all = 0, vir_first = 0, vir_ranked = 0, vir_all = 0;
  bool listed = false, first_right = false, ambiguous = false, uncertain = false, complete = true;
  double seconds = 0;
};

struct Mean {
  double sum = 0, squares = 0;
  int count = 0;
  void Add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
  double mean() const { return count > 0 ? sum / count : 0; }
  double sd() const {
    return count > 1 ? std::sqrt(std::max(0.0, (squares - sum * sum / count) / (count - 1))) : 0;
  }
};

// Sets the standard deviations that fits to the simulated points would have.
void SetSigmas(std::vector<ScanSegment>* segments) {
  constexpr double kSigma = 0.02;
  for (ScanSegment& segment : *segments) {
    const double num_points = std::clamp(segment.Length() / 0.05, 6.0, 200.0);
    segment.sigma_offset_m = kSigma / std::sqrt(num_points);
    segment.sigma_angle_rad = kSigma / (segment.Length() * std::sqrt(num_points / 12));
  }
}

Sample TryPlace(const ViewSearchIndex& index, const FaceLocator& locator, bool noisy, bool with_standard,
                uint64_t seed) {
  Random random(seed);
  Sample sample;
  const Views& views = index.views();
  const auto pose = RandomPose(views, locator, 0.2, &random);
  if (!pose) return sample;
  const FaceIdx face = locator.Find(pose->position);
  SimulatedScanOptions scan_options;
  if (noisy)
    scan_options = {.sigma_m = 0.02, .missing_ratio = 0.2, .spurious_ratio = 0.1, .min_length_m = 0.3};
  const std::vector<ScanSegment> segments = SimulateScan(views, face, *pose, scan_options, &random);
  if (segments.size() < 3) return sample;
  sample.valid = true;
  sample.num_segments = static_cast<double>(segments.size());
  InterpretationTreeOptions options;
  if (noisy) {
    options.max_null_ratio = 0.25;
    options.one_segment_per_wall = false;
    options.max_num_nodes = 2e7;
    options.sigma_wall_m = options.sigma_wall_deg = 0;  // the plan is exact
  } else {
    options.angle_tolerance_deg = 0.01;
    options.position_tolerance_m = 1e-3;
    options.length_tolerance_m = 1e-3;
    options.fix_pose_early = false;
    options.max_num_nodes = 1e8;
  }
  // [Simsarian96 §3] nodes of both searches at a random place
  const auto run = [&](const char* search, bool first, int growth) {
    options.search = search;
    options.first_only = first;
    options.rank_growth = growth;
    return *SearchInterpretations(index, segments, options);
  };
  if (with_standard) {
    sample.standard_first = static_cast<double>(run("standard", true, 1).num_nodes);
    sample.standard_all = static_cast<double>(run("standard", false, 1).num_nodes);
  }
  if (!noisy) {
    sample.vir_first = static_cast<double>(run("vir", true, 1).num_nodes);
    sample.vir_ranked = static_cast<double>(run("vir", true, 4).num_nodes);
  }
  const double start = Seconds();
  const InterpretationTreeResult all = run("vir", false, 1);
  sample.seconds = Seconds() - start;
  sample.vir_all = static_cast<double>(all.num_nodes);
  sample.candidates = static_cast<double>(all.num_candidates);
  sample.complete = all.complete;
  const double metres = noisy ? 0.1 : 0.01, degrees = noisy ? 2 : 0.1;
  for (size_t i = 0; i < all.solutions.size(); ++i) {
    const bool right =
        all.solutions[i].determined
            ? IsRight(all.solutions[i].pose, *pose, metres, degrees)
            : std::abs(WrapAngle(all.solutions[i].pose.heading_rad - pose->heading_rad)) <= degrees * kDegree;
    sample.listed = sample.listed || right;
    sample.first_right = sample.first_right || (i == 0 && right && all.complete);
  }
  // Ambiguous: without noise the same portions fit elsewhere too, or nowhere in particular.  Uncertain: they
  // do so within what the noise allows, or from the right pairings a pose follows that has twice its standard
  // deviation beyond what counts as right.
  Random again(seed);
  const auto same = RandomPose(views, locator, 0.2, &again);
  scan_options.sigma_m = scan_options.spurious_ratio = 0;
  std::vector<ScanSegment> exact = SimulateScan(views, face, *same, scan_options, &again);
  InterpretationTreeOptions exact_options;
  exact_options.angle_tolerance_deg = noisy ? 2 : 0.01;
  exact_options.position_tolerance_m = noisy ? 0.1 : 1e-3;
  exact_options.length_tolerance_m = noisy ? 0.1 : 1e-3;
  exact_options.max_num_nodes = 2e7;
  exact_options.one_segment_per_wall = !noisy;
  exact_options.sigma_wall_m = exact_options.sigma_wall_deg = 0;
  const auto twins = SearchInterpretations(index, exact, exact_options);
  sample.ambiguous = !twins.ok() || twins->solutions.size() != 1 || !twins->solutions[0].determined;
  if (noisy && !sample.ambiguous) {
    SetSigmas(&exact);
    const auto found = SearchInterpretations(index, exact, exact_options);
    sample.uncertain = !found.ok() || found->solutions.size() != 1;
    if (!sample.uncertain) {
      const Eigen::Matrix3d& covariance = found->solutions[0].covariance;
      sample.uncertain =
          2 * std::sqrt(covariance.topLeftCorner<2, 2>().eigenvalues().real().maxCoeff()) > metres ||
          2 * std::sqrt(covariance(2, 2)) > degrees * kDegree;
    }
  }
  if (noisy && !sample.ambiguous && !sample.uncertain && !sample.first_right &&
      std::getenv("SHOW_FAILURES") != nullptr) {
    std::printf("seed %llu: %zu segments, %zu solutions, listed %d\n", static_cast<unsigned long long>(seed),
                segments.size(), all.solutions.size(), sample.listed);
    for (size_t i = 0; i < std::min<size_t>(4, all.solutions.size()); ++i)
      std::printf("   off by %.3f m %.2f deg, determined %d, matched %d %.2f m, rms %.3f, sd %.3f\n",
                  (all.solutions[i].pose.position - pose->position).norm(),
                  std::abs(WrapAngle(all.solutions[i].pose.heading_rad - pose->heading_rad)) / kDegree,
                  all.solutions[i].determined, all.solutions[i].num_matched,
                  all.solutions[i].matched_length_m, all.solutions[i].rms_m,
                  std::sqrt(all.solutions[i].covariance.topLeftCorner<2, 2>().trace()));
  }
  return sample;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: views_search NUM_POSITIONS noise-free|noisy PLAN...\n");
    return 2;
  }
  const int num_positions = std::atoi(argv[1]);
  const bool noisy = std::strcmp(argv[2], "noisy") == 0,
             with_standard = std::strcmp(argv[2], "noise-free") == 0;
  std::printf(
      "| plan | walls N | regions | positions | segments | candidates | standard, first | standard, all | "
      "VIR, first | VIR ranked, first | VIR, all | all: ratio | ms | truth listed | first right | "
      "unambiguous: first right | certain: first right |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::vector<std::array<double, 4>> curve;
  for (int i = 3; i < argc; ++i) {
    const std::string path = argv[i];
    const auto input = decompose_views::ReadPlan(path);
    NoProgress progress;
    const auto result = input.ok()
                            ? decompose_views::DecomposeViews(*input, {}, 0, DefaultMemoryMib(), progress)
                            : Result<decompose_views::DecomposeViewsResult>(input.error());
    if (!result.ok()) {
      std::fprintf(stderr, "%s: %s\n", argv[i], result.error().message.c_str());
      return 1;
    }
    const ViewSearchIndex index(result->views);
    const FaceLocator locator(result->views);
    std::vector<Sample> samples(num_positions);
    ParallelFor(num_positions, 0, [&](int64_t k) {
      samples[k] = TryPlace(index, locator, noisy, with_standard, MixSeed(11, k));
    });
    Mean segments, candidates, standard_first, standard_all, vir_first, vir_ranked, vir_all, ms;
    int num = 0, listed = 0, first = 0, unambiguous = 0, unambiguous_right = 0, certain = 0,
        certain_right = 0, incomplete = 0;
    for (const Sample& sample : samples) {
      if (!sample.valid) continue;
      ++num;
      segments.Add(sample.num_segments);
      candidates.Add(sample.candidates);
      standard_first.Add(sample.standard_first);
      standard_all.Add(sample.standard_all);
      vir_first.Add(sample.vir_first);
      vir_ranked.Add(sample.vir_ranked);
      vir_all.Add(sample.vir_all);
      ms.Add(1e3 * sample.seconds);
      listed += sample.listed;
      first += sample.first_right;
      unambiguous += !sample.ambiguous;
      unambiguous_right += !sample.ambiguous && sample.first_right;
      const bool is_certain = !sample.ambiguous && !sample.uncertain;
      certain += is_certain;
      certain_right += is_certain && sample.first_right;
      incomplete += !sample.complete;
    }
    std::printf(
        "| %s | %d | %d | %d | %.1f ± %.1f | %.0f | %.0f ± %.0f | %.0f ± %.0f | %.0f ± %.0f | %.0f ± %.0f | "
        "%.0f ± %.0f | %.1f | %.1f | %d | %d | %d of %d | %d of %d |%s\n",
        path.substr(path.rfind('/') + 1).c_str(), result->views.plan.num_walls(), result->views.num_faces(),
        num, segments.mean(), segments.sd(), candidates.mean(), standard_first.mean(), standard_first.sd(),
        standard_all.mean(), standard_all.sd(), vir_first.mean(), vir_first.sd(), vir_ranked.mean(),
        vir_ranked.sd(), vir_all.mean(), vir_all.sd(), standard_all.mean() / vir_all.mean(), ms.mean(),
        listed, first, unambiguous_right, unambiguous, certain_right, certain,
        incomplete > 0 ? " (not all complete)" : "");
    std::fflush(stdout);
    curve.push_back({std::log(result->views.plan.num_walls()), std::log(std::max(1.0, standard_all.mean())),
                     std::log(std::max(1.0, vir_all.mean())), std::log(std::max(1.0, vir_ranked.mean()))});
  }
  if (curve.size() < 2) return 0;
  for (const auto& [name, column] :
       {std::pair{"standard, all", 1}, {"VIR, all", 2}, {"VIR ranked, first", 3}}) {
    double x = 0, y = 0, xx = 0, xy = 0;
    const auto n = static_cast<double>(curve.size());
    for (const auto& point : curve) {
      x += point[0];
      y += point[column];
      xx += point[0] * point[0];
      xy += point[0] * point[column];
    }
    std::printf("%s: nodes grow with N^%.2f\n", name, (n * xy - x * y) / (n * xx - x * x));
  }
  return 0;
}
