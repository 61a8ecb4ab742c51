// views_grids [--cell M] [--OPTION VALUE]... PLAN... LOG.log...: floor plans read from ROS maps.  Of each
// plan two maps are made, one that draws its walls, and one as a robot's mapping makes it, with noise; of a
// log that of its even scans.  Each is written as a map's YAML file and image, read by default, and compared
// with the plan: how far walls are from each other, and how many scans are located in either.  Options are
// those of [decompose_views].
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/views/random_scan.h"
#include "bench/views/scan_places.h"
#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/files/file.h"
#include "runtime/beams/scan_locator.h"
#include "stages/decompose_views/decompose_views.h"

namespace {

using namespace cairn;
using Vec2 = Eigen::Vector2d;
using decompose_views::DecomposeViewsOptions;

constexpr int kNumPlaces = 60;

template <typename T>
T OrExit(Result<T> result) {
  if (!result.ok()) {
    std::fprintf(stderr, "%s\n", result.error().message.c_str());
    std::exit(1);
  }
  return std::move(result).value();
}

// A ROS map that is being made: how many beams ended in each cell, and how many passed it.
class MapMaker {
 public:
  MapMaker(const Vec2& low, const Vec2& high, double cell_m) : low_(low), cell_m_(cell_m) {
    const Vec2 size = ((high - low) / cell_m).array().ceil();
    ends_ = cv::Mat::zeros(static_cast<int>(size.y()) + 1, static_cast<int>(size.x()) + 1, CV_32S);
    passes_ = ends_.clone();
  }

  void AddBeam(const Vec2& from, const Vec2& direction, double range_m, bool ends_there) {
    const double step = 0.25 * cell_m_;
    cv::Point last(-1, -1);
    const cv::Point end = CellOf(from + range_m * direction);
    for (double way = 0; way < range_m; way += step) {
      const cv::Point cell = CellOf(from + way * direction);
      if (cell == last || cell == end || !Has(cell)) continue;
      last = cell;
      ++passes_.at<int>(cell);
    }
    if (ends_there && Has(end)) ++ends_.at<int>(end);
  }

  // As mapping programs do: occupied where a quarter of the beams ended, unknown where none came.
  cv::Mat Measured() const {
    cv::Mat image(ends_.size(), CV_8U);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const int ends = ends_.at<int>(y, x), all = ends + passes_.at<int>(y, x);
        image.at<uint8_t>(y, x) = all == 0 ? 205 : 4 * ends >= all ? 0 : 254;
      }
    }
    return image;
  }

  cv::Mat Drawn(const std::vector<PlanWall>& walls) const {
    cv::Mat image(ends_.size(), CV_8U, cv::Scalar(254));
    constexpr int kFraction = 8;
    const auto at = [&](const Vec2& place) {
      const Vec2 cells = ((place - low_) / cell_m_ - Vec2(0.5, 0.5)) * (1 << kFraction);
      return cv::Point(static_cast<int>(std::lround(cells.x())), static_cast<int>(std::lround(cells.y())));
    };
    for (const PlanWall& wall : walls)
      cv::line(image, at(wall.start), at(wall.end), cv::Scalar(0), 1, cv::LINE_8, kFraction);
    return image;
  }

  // Writes FOLDER/NAME.yaml and .pgm, and returns the path of the first.
  std::string Write(const cv::Mat& cells, const std::string& folder, const std::string& name) const {
    std::string pgm = fmt::format("P5\n{} {}\n255\n", cells.cols, cells.rows);
    for (int y = cells.rows - 1; y >= 0; --y) pgm.append(cells.ptr<char>(y), static_cast<size_t>(cells.cols));
    const std::string yaml = fmt::format(
        "image: {}.pgm\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
        "free_thresh: 0.196\n",
        name, cell_m_, low_.x(), low_.y());
    (void)WriteFileAtomically(folder + "/" + name + ".pgm", pgm);
    (void)WriteFileAtomically(folder + "/" + name + ".yaml", yaml);
    return folder + "/" + name + ".yaml";
  }

  // Whether a cell near to a place is occupied.
  bool IsOccupiedNear(const cv::Mat& cells, const Vec2& place) const {
    const cv::Point cell = CellOf(place);
    for (int y = cell.y - 1; y <= cell.y + 1; ++y) {
      for (int x = cell.x - 1; x <= cell.x + 1; ++x) {
        if (Has({x, y}) && cells.at<uint8_t>(y, x) == 0) return true;
      }
    }
    return false;
  }

 private:
  cv::Point CellOf(const Vec2& place) const {
    const Vec2 cell = ((place - low_) / cell_m_).array().floor();
    return {static_cast<int>(cell.x()), static_cast<int>(cell.y())};
  }
  bool Has(const cv::Point& cell) const {
    return cell.x >= 0 && cell.y >= 0 && cell.x < ends_.cols && cell.y < ends_.rows;
  }

  Vec2 low_;
  double cell_m_;
  cv::Mat ends_, passes_;
};

// A robot that turned around at places 20 cm from walls, one on 1 m^2, and whose mapping knows its poses to 2
// cm and 0.3 degrees; 720 beams of 12 m, 1 cm of noise.
void SimulateMapping(const FloorPlan& plan, const PlanRays& rays, MapMaker* maker) {
  constexpr int kNumBeams = 720;
  constexpr double kReachM = 12, kNoise = 0.01, kPoseM = 0.02, kPoseDeg = 0.3, kPlaceM2 = 1;
  Random random(7);
  const Vec2 low = plan.Metres(plan.low), high = plan.Metres(plan.high);
  const int num_places = static_cast<int>((high - low).prod() / kPlaceM2);
  for (int i = 0; i < num_places; ++i) {
    const double x = random.Uniform(low.x(), high.x()), y = random.Uniform(low.y(), high.y());
    const double dx = random.Normal(0, kPoseM), dy = random.Normal(0, kPoseM);
    const double turn = RadFromDeg(random.Normal(0, kPoseDeg));
    std::vector<double> ranges;
    bool is_free = true;
    for (int k = 0; k < kNumBeams; ++k) {
      const double angle = 2 * std::numbers::pi * k / kNumBeams;
      const auto hits = rays.Cast({x, y}, {std::cos(angle), std::sin(angle)}, kReachM);
      ranges.push_back(hits.size > 0 ? hits.at[0].distance_m + random.Normal(0, kNoise) : -1);
      is_free = is_free && (ranges.back() < 0 || ranges.back() > 0.2);
    }
    for (int k = 0; is_free && k < kNumBeams; ++k) {
      const double angle = 2 * std::numbers::pi * k / kNumBeams + turn;
      maker->AddBeam({x + dx, y + dy}, {std::cos(angle), std::sin(angle)},
                     ranges[k] < 0 ? kReachM : ranges[k], ranges[k] >= 0);
    }
  }
}

double DistanceTo(const std::vector<PlanWall>& walls, const Vec2& place) {
  double nearest = 1e9;
  for (const PlanWall& wall : walls) {
    const Vec2 along = wall.end - wall.start;
    const double share = std::clamp((place - wall.start).dot(along) / along.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (place - wall.start - share * along).squaredNorm());
  }
  return std::sqrt(nearest);
}

// Mean and 95th percentile of how far places on walls, 5 cm apart, are from others; those that `counts` says.
template <typename Counts>
std::string DistancesText(const std::vector<PlanWall>& from, const std::vector<PlanWall>& to,
                          const Counts& counts) {
  std::vector<double> distances;
  double sum = 0;
  for (const PlanWall& wall : from) {
    const int num = std::max(1, static_cast<int>(wall.Length() / 0.05));
    for (int i = 0; i < num; ++i) {
      const Vec2 place = wall.start + (i + 0.5) / num * (wall.end - wall.start);
      if (!counts(place)) continue;
      distances.push_back(DistanceTo(to, place));
      sum += distances.back();
    }
  }
  if (distances.empty()) return "none";
  return fmt::format("{:.1f}, {:.1f} cm", 100 * sum / static_cast<double>(distances.size()),
                     100 * Quantile(distances, 0.95));
}

// How many scans are located rightly in a plan: by their first pose, and, of those with one that is
// determined, by it.
std::string LocatedText(const FloorPlan& plan, const std::vector<RangeScan>& scans) {
  Views views;
  views.plan = plan;
  const ScanLocator locator = OrExit(ScanLocator::Make(views, {}));
  std::vector<char> first(scans.size(), 0), single(scans.size(), 0);
  ParallelFor(std::ssize(scans), 0, [&](int64_t i) {
    const auto located = locator.Locate(ViewOf(scans[i], {}));
    if (!located.ok() || located->hypotheses.empty()) return;
    first[i] = IsRight(located->hypotheses[0].pose, scans[i].pose) ? 1 : 0;
    single[i] = located->hypotheses.size() == 1 && located->hypotheses[0].determined ? 1 : 0;
  });
  int num_first = 0, num_single = 0, num_right = 0;
  for (size_t i = 0; i < scans.size(); ++i) {
    num_first += first[i];
    num_single += single[i];
    num_right += first[i] & single[i];
  }
  return fmt::format("{} of {} | {} of {}", num_first, scans.size(), num_right, num_single);
}

FloorPlan CleanedPlan(const std::string& path, const DecomposeViewsOptions& options) {
  NoProgress progress;
  const auto input = OrExit(decompose_views::ReadPlan(path, options.read));
  return OrExit(decompose_views::CleanPlan(input, options.clean, progress)).plan;
}

void Compare(const std::string& path, double cell_m, const std::string& folder,
             const DecomposeViewsOptions& options) {
  const FloorPlan plan = CleanedPlan(path, {});
  const PlanRays rays(plan.walls);
  std::vector<RangeScan> scans;
  Random random(1);
  for (int tries = 0; tries < 1000000 && std::ssize(scans) < kNumPlaces; ++tries) {
    if (auto scan = RandomScan(plan, rays, &random)) scans.push_back(std::move(*scan));
  }
  const std::string name = std::filesystem::path(path).stem().stem().string();
  std::printf("| %s | its own walls | %d | | | %s |\n", name.c_str(), plan.num_walls(),
              LocatedText(plan, scans).c_str());
  MapMaker maker(plan.Metres(plan.low), plan.Metres(plan.high), cell_m);
  SimulateMapping(plan, rays, &maker);
  for (const auto& [kind, cells] :
       {std::pair<std::string, cv::Mat>("drawn", maker.Drawn(plan.walls)), {"mapped", maker.Measured()}}) {
    const FloorPlan read = CleanedPlan(maker.Write(cells, folder, name + "_" + kind), options);
    const auto all = [](const Vec2&) { return true; };
    const auto in_map = [&, &cells = cells](const Vec2& place) { return maker.IsOccupiedNear(cells, place); };
    std::printf("| | %s | %d | %s | %s | %s |\n", kind.c_str(), read.num_walls(),
                DistancesText(read.walls, plan.walls, all).c_str(),
                DistancesText(plan.walls, read.walls, in_map).c_str(), LocatedText(read, scans).c_str());
    std::fflush(stdout);
  }
}

// The even scans of a log make a map at its poses, the others are located in it.
void CompareLog(const std::string& path, double cell_m, const std::string& folder,
                const DecomposeViewsOptions& options) {
  const std::vector<RangeScan> scans = OrExit(ReadCarmenLog(path));
  std::vector<RangeScan> queries;
  Vec2 low(1e9, 1e9), high = -low;
  const auto for_beams = [&](const RangeScan& scan, const auto& visit) {
    for (size_t i = 0; i < scan.ranges_m.size(); ++i) {
      const double range = scan.ranges_m[i];
      if (!(range > 0.1 && range < std::min(30.0, scan.max_range_m))) continue;
      const double angle =
          scan.pose.heading_rad + scan.first_angle_rad + static_cast<double>(i) * scan.step_rad;
      visit(scan.pose.position, Vec2(std::cos(angle), std::sin(angle)), range);
    }
  };
  for (const RangeScan& scan : scans) {
    for_beams(scan, [&](const Vec2& from, const Vec2& direction, double range) {
      low = low.cwiseMin(from + range * direction);
      high = high.cwiseMax(from + range * direction);
    });
  }
  MapMaker maker(low.array() - 1, high.array() + 1, cell_m);
  for (size_t i = 0; i < scans.size(); ++i) {
    if (i % 2 == 1) {
      queries.push_back(scans[i]);
      continue;
    }
    for_beams(scans[i], [&](const Vec2& from, const Vec2& direction, double range) {
      maker.AddBeam(from, direction, range, true);
    });
  }
  const std::string name = std::filesystem::path(path).stem().string();
  const FloorPlan read = CleanedPlan(maker.Write(maker.Measured(), folder, name), options);
  std::printf("| %s | mapped | %d | | | %s |\n", name.c_str(), read.num_walls(),
              LocatedText(read, queries).c_str());
}

}  // namespace

int main(int argc, char** argv) {
  double cell_m = 0.05;
  std::string folder = ".";
  DecomposeViewsOptions options;
  const OptionTable table = decompose_views::DescribeOptions(&options);
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    std::string name = argv[i];
    if (!name.starts_with("--") || i + 1 >= argc) {
      paths.push_back(name);
      continue;
    }
    name = name.substr(2);
    const std::string value = argv[++i];
    if (name == "cell") {
      cell_m = std::atof(value.c_str());
    } else if (name == "folder") {
      folder = value;
    } else {
      for (const Option& option : table) {
        if (option.name == name) (void)SetOption(option, value);
      }
    }
  }
  std::printf(
      "| plan | map | walls | read to true: mean, 95 %% | true to read | first right | one solution, "
      "determined: right |\n"
      "|---|---|---|---|---|---|---|\n");
  for (const std::string& path : paths) {
    if (path.ends_with(".log")) {
      CompareLog(path, cell_m, folder, options);
    } else {
      Compare(path, cell_m, folder, options);
    }
    std::fflush(stdout);
  }
  return 0;
}
