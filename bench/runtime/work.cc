// What pieces of work take (core/work/work_budget.h): images are localized from scratch and followed, by all
// of their features and by fewer, each piece is counted, and processor time is fitted by what was counted, no
// piece less than nothing.  `--fit` prints the picoseconds for core/work/work_budget.cc, so many that work is
// more than time for 19 images in 20; without it, time over work is shown, which is what a budget is worth on
// this core and on these images.
#include <malloc.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <opencv2/core/utility.hpp>

#include "bench/runtime/fix_figures.h"
#include "core/capture/capture.h"
#include "core/images/image_file.h"
#include "core/work/work_budget.h"
#include "runtime/localize/measurement.h"
#include "runtime/track/region_tracker.h"

namespace cairn {
namespace {

constexpr int kNumKinds = static_cast<int>(Work::kNum);
constexpr std::array<const char*, kNumKinds> kNames = {
    "whole pixel", "undoubled pixel", "coarse pixel", "fine pixel", "shrunk pixel", "feature",   "ray",
    "word",        "posting",         "image",        "pair",       "landmark",     "listed",    "attempt",
    "sample",      "score",           "refine",       "project",    "near",         "match pair"};

struct Row {
  std::string kind;
  double seconds = 0;
  double work_ms = 0;
  Eigen::Vector<double, kNumKinds> nums;
};

Row MakeRow(std::string kind, double seconds, const WorkBudget& work) {
  Row row{std::move(kind), seconds, work.spent_ms()};
  for (int k = 0; k < kNumKinds; ++k) row.nums[k] = static_cast<double>(work.num(static_cast<Work>(k)));
  return row;
}

// What is counted in all of the map's images, as one looks like another where maps are small: nanoseconds of
// a sum and of two poses' distance.
constexpr double kPostingSeconds = 15e-9, kImageSeconds = 150e-9;

// Non-negative least squares of the ratios to the times, by coordinates.
Eigen::VectorXd Fit(const std::vector<Row>& rows) {
  Eigen::MatrixXd a(rows.size(), kNumKinds);
  for (size_t i = 0; i < rows.size(); ++i) a.row(i) = rows[i].nums.transpose() / rows[i].seconds;
  const Eigen::MatrixXd normal = a.transpose() * a;
  const Eigen::VectorXd right = a.transpose() * Eigen::VectorXd::Ones(a.rows());
  Eigen::VectorXd x = Eigen::VectorXd::Zero(kNumKinds);
  x[static_cast<int>(Work::kPosting)] = kPostingSeconds;
  x[static_cast<int>(Work::kImage)] = kImageSeconds;
  for (int round = 0; round < 200000; ++round) {
    for (int k = 0; k < kNumKinds; ++k) {
      if (normal(k, k) > 0 && k != static_cast<int>(Work::kPosting) && k != static_cast<int>(Work::kImage))
        x[k] = std::max(0.0, x[k] + (right[k] - normal.row(k).dot(x)) / (normal(k, k) * (1 + 1e-6)));
    }
  }
  return x;
}

template <typename T>
Status Answered(const Result<T>& result) {
  return result.ok() ? Ok() : Status(result.error());
}

Status AddRows(const std::string& map_path, const std::string& capture_path, int max_num_images,
               std::vector<Row>* rows) {
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(map_path));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(capture_path));
  std::vector<CaptureImage> images = capture.queries.empty() ? capture.images : capture.queries;
  std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  if (std::ssize(images) > max_num_images) images.resize(max_num_images);
  CAIRN_RETURN_IF_ERROR(Answered(map->AllLandmarks()));
  RegionTracker tracker(map);
  for (size_t i = 0; i < images.size(); ++i) {
    const CaptureImage& image = images[i];
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(capture_path + "/images/" + image.name));
    const Camera& camera = capture.cameras.at(image.camera_id);
    CAIRN_RETURN_IF_ERROR(Answered(Localizer(map).Localize(grey, camera)));  // its part of the map is loaded
    for (const int max_num_features : {2000, 700, 250}) {
      LocalizerOptions options;
      options.sift.max_num_features = max_num_features;
      const Localizer localizer(map, options);
      const auto features_work = localizer.MakeBudget();
      double start = CpuSeconds();
      CAIRN_ASSIGN_OR_RETURN(Query query, localizer.QueryFromImage(grey, camera, features_work));
      rows->push_back(MakeRow("features", CpuSeconds() - start, *features_work));
      query.work = localizer.MakeBudget();
      start = CpuSeconds();
      CAIRN_RETURN_IF_ERROR(Answered(localizer.LocalizeQuery(query, std::nullopt)));
      rows->push_back(MakeRow("localized", CpuSeconds() - start, *query.work));
      WorkBudget undoubled_work;
      start = CpuSeconds();
      CAIRN_ASSIGN_OR_RETURN(const Features undoubled,
                             ExtractUndoubledSift(grey, options.sift, SiftScales::kAll));
      const double seconds = CpuSeconds() - start;
      undoubled_work.Spend(Work::kUndoubledPixel, NumSiftPixels(grey.size(), options.sift));
      undoubled_work.Spend(Work::kFeature, std::ssize(undoubled.keypoints));
      rows->push_back(MakeRow("undoubled", seconds, undoubled_work));
      const auto coarse_work = localizer.MakeBudget();
      start = CpuSeconds();
      CAIRN_ASSIGN_OR_RETURN(Query coarse, localizer.CoarseQueryFromImage(grey, camera, coarse_work));
      rows->push_back(MakeRow("coarse", CpuSeconds() - start, *coarse_work));
      coarse.work = localizer.MakeBudget();
      start = CpuSeconds();
      CAIRN_RETURN_IF_ERROR(localizer.AddFineFeatures(
          grey, max_num_features, [](const Keypoint& k) { return static_cast<int>(k.x) % 3 == 0; }, &coarse));
      if (coarse.work->num(Work::kFinePixel) > 0)
        rows->push_back(MakeRow("fine", CpuSeconds() - start, *coarse.work));
    }
    QueryFrame frame(Localizer(map), grey, camera);
    const double start = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Localization found, tracker.TrackFrame(&frame));
    rows->push_back(MakeRow(found.has_fix() && found.scope == Scope::kTrack ? "tracked" : "lost",
                            CpuSeconds() - start, *frame.work()));
  }
  return Ok();
}

Status Run(const std::vector<std::string>& paths, int max_num_images, bool fit) {
  cv::setNumThreads(1);
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  std::vector<Row> rows;
  for (size_t i = 0; i + 1 < paths.size(); i += 2)
    CAIRN_RETURN_IF_ERROR(AddRows(paths[i], paths[i + 1], max_num_images, &rows));
  if (fit) {
    const Eigen::VectorXd seconds = Fit(rows);
    std::vector<double> ratios;
    for (const Row& row : rows) ratios.push_back(row.seconds / seconds.dot(row.nums));
    const double scale = QuantileOf(ratios, 0.95);
    for (int k = 0; k < kNumKinds; ++k) fmt::print("{:>12.0f}  {}\n", 1e12 * scale * seconds[k], kNames[k]);
  }
  fmt::print("| | images | ms, median | time over work, median | 90 % | most |\n|---|--:|--:|--:|--:|--:|\n");
  for (const char* kind : {"features", "undoubled", "coarse", "fine", "localized", "tracked", "lost"}) {
    std::vector<double> ms, ratios;
    for (const Row& row : rows) {
      if (row.kind != kind) continue;
      ms.push_back(1000 * row.seconds);
      ratios.push_back(1000 * row.seconds / row.work_ms);
    }
    if (!ms.empty())
      fmt::print("| {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n", kind, ms.size(), QuantileOf(ms, 0.5),
                 QuantileOf(ratios, 0.5), QuantileOf(ratios, 0.9), QuantileOf(ratios, 1));
  }
  fmt::print("\n| of work, ms on average | localized | tracked |\n|---|--:|--:|\n");
  for (int k = 0; k < kNumKinds; ++k) {
    const auto mean_ms = [&](const std::string& kind) {
      double num_rows = 0, num = 0;
      for (const Row& row : rows) {
        if (row.kind != kind) continue;
        ++num_rows;
        num += row.nums[k];
      }
      return 1e-9 * static_cast<double>(WorkBudget::PicosecondsOf(static_cast<Work>(k))) * num /
             std::max(1.0, num_rows);
    };
    fmt::print("| {} | {:.2f} | {:.2f} |\n", kNames[k], mean_ms("localized"), mean_ms("tracked"));
  }
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::vector<std::string> paths;
  int max_num_images = std::numeric_limits<int>::max();
  bool fit = false;
  CLI::App app("What pieces of work take");
  app.add_option("paths", paths, "map, capture, map, capture, ...")->required();
  app.add_option("--images", max_num_images, "most images of each");
  app.add_flag("--fit", fit, "fit what each takes");
  CLI11_PARSE(app, argc, argv);
  if (const cairn::Status status = cairn::Run(paths, max_num_images, fit); !status.ok()) {
    fmt::print(stderr, "{}\n", status.error().message);
    return 1;
  }
  return 0;
}
