// The source's experiment on maps of one survey [Sala06 Table V, Table VI]: held-out images localized by the
// visual map, and by PnP with the same landmarks and features.  The first map is the one of all features:
// divergences are from its posteriors.
//
// As the source counts: the likeliest place of the lattice, of all images, whatever this project thinks of
// them, and divergences of the posteriors over the lattice.  Ours beside it: fixes, which have no flag, and
// divergences of the posteriors that a robot gets, with "elsewhere" and with what flags do to them.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <opencv2/core/utility.hpp>

#include "bench/visual_map/pictures.h"
#include "core/base/quantiles.h"
#include "core/blocks/map_blocks.h"
#include "core/capture/capture.h"
#include "core/files/file.h"
#include "core/geometry/floor_pose.h"
#include "core/images/image_file.h"
#include "core/line/command.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/visual_map/lattice_posterior.h"
#include "runtime/visual_map/visual_estimate.h"

namespace cairn {
namespace {

struct Arguments {
  std::string capture;
  std::vector<std::string> maps;
  std::string queries;
  std::string pictures;
  std::string csv;
  SiftOptions sift{.max_num_features = 450};
  double uniform_weight = 0.1;
  VisualMapOptions map_options;
  VisualEstimateOptions estimate_options;
  OptionArguments option_arguments;
  bool print_all = false;
};

// Processor time: others may use the machine.
double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double Mean(const std::vector<double>& values) {
  return values.empty()
             ? std::numeric_limits<double>::quiet_NaN()
             : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double Deviation(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += (value - Mean(values)) * (value - Mean(values));
  return std::sqrt(sum / static_cast<double>(std::max<size_t>(values.size(), 1)));
}

double MedianOrNan(const std::vector<double>& values) {
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : UpperMedian(values);
}

struct TestImage {
  std::string name;
  Query query;
  FloorPose truth;
  Pose cam_from_world;
  double out_m = 0;  // of the hull of the survey's places
  bool is_inside() const { return out_m <= 0; }
  double feature_seconds = 0;
};

// How far a point lies outside the convex hull of others, metres; below zero inside: the maximum over all
// directions of its distance beyond them all.
double MetresOutOfHull(const std::vector<Eigen::Vector2d>& points, const Eigen::Vector2d& at) {
  double out_m = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < 720; ++i) {
    const Eigen::Vector2d direction(std::cos(i * 3.14159265358979 / 360),
                                    std::sin(i * 3.14159265358979 / 360));
    double farthest = -std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& point : points) farthest = std::max(farthest, direction.dot(point));
    out_m = std::max(out_m, direction.dot(at) - farthest);
  }
  return out_m;
}

Result<std::vector<TestImage>> ReadTestImages(const Arguments& arguments, const Map& map,
                                              const VisualMap& visual) {
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture));
  std::vector<CaptureImage> queries = capture.queries;
  if (!arguments.queries.empty()) {
    std::vector<Reject> rejects;
    CAIRN_ASSIGN_OR_RETURN(queries, ReadImagesText(arguments.queries, &rejects));
  }
  std::vector<TestImage> images;
  for (const CaptureImage& image : queries) {
    if (!image.cam_from_world) continue;
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(capture.ImagePath(image)));
    TestImage& test = images.emplace_back();
    test.name = image.name;
    const double start = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(Features features, ExtractSift(grey, arguments.sift));
    test.query = MakeQuery(std::move(features), capture.cameras.at(image.camera_id), {});
    test.feature_seconds = CpuSeconds() - start;
    test.truth = FloorPoseOf(*image.cam_from_world, map.head().floor_from_world);
    test.cam_from_world = *image.cam_from_world;
    test.out_m = MetresOutOfHull(visual.places(), test.truth.position);
  }
  return images;
}

struct Row {
  std::string name;
  int64_t num_landmarks = 0;
  double megabytes = 0, model_bytes = 0;
  int num_fixes = 0, num_wrong = 0, num_flagged_outside = 0, num_honest_outside = 0, num_outside = 0,
      num_inside = 0;
  // As the source counts, of all images; the second divergence is that of all features' map from this one.
  std::vector<double> lattice_cm, lattice_divergences, reverse_divergences;
  int num_without_match = 0;
  std::vector<double> errors_cm, all_errors_cm, errors_deg, seconds, search_seconds, divergences, nees,
      matches;
  int num_pnp = 0, num_pnp_wrong = 0;
  std::vector<double> pnp_cm, pnp_seconds;
};

// Of the squares of three normal numbers the sum is below this in 997 of 1000 cases, as one lies
// within 3 sigma.
constexpr double kThreeSigma = 14.16;

double SquaredMahalanobis(const TestImage& test, const VisualPose& pose) {
  Eigen::Vector3d error;
  error << pose.position - test.truth.position,
      RadFromDeg(std::remainder(pose.heading_deg - test.truth.heading_deg, 360));
  return error.dot(pose.covariance.ldlt().solve(error));
}

void AddVisual(const TestImage& test, const VisualPose& pose, Row* row) {
  const double error_cm = 100 * (pose.position - test.truth.position).norm();
  if (!test.is_inside()) {
    ++row->num_outside;
    row->num_flagged_outside += pose.flag != VisualFlag::kNone ? 1 : 0;
    if (pose.flag == VisualFlag::kNone) row->num_wrong += error_cm > 100 ? 1 : 0;
    row->num_honest_outside +=
        pose.flag != VisualFlag::kNone || SquaredMahalanobis(test, pose) <= kThreeSigma ? 1 : 0;
    return;
  }
  ++row->num_inside;
  row->all_errors_cm.push_back(error_cm);
  row->matches.push_back(pose.num_agreeing);
  if (pose.flag != VisualFlag::kNone) return;
  ++row->num_fixes;
  row->num_wrong += error_cm > 100 ? 1 : 0;
  row->errors_cm.push_back(error_cm);
  row->errors_deg.push_back(AngleBetweenDeg(pose.heading_deg, test.truth.heading_deg));
  row->nees.push_back(SquaredMahalanobis(test, pose));
}

// [Sala06 Table V] "the mean distance between the maximum-likelihood pose estimate and ground truth"
void AddLattice(const TestImage& test, const VisualMap& map, const LatticePosterior& posterior,
                const LatticePosterior* of_all, double uniform_weight, Row* row) {
  row->num_without_match += posterior.num_matches == 0 ? 1 : 0;
  row->lattice_cm.push_back(
      100 * (map.places()[LikeliestPlace(map, posterior.at_place)] - test.truth.position).norm());
  if (!of_all) return;
  // [Sala06 Table VI] D = sum of p_d log(p_d / p_all)
  row->lattice_divergences.push_back(KlDivergence(posterior.at_place, of_all->at_place, uniform_weight));
  row->reverse_divergences.push_back(KlDivergence(of_all->at_place, posterior.at_place, uniform_weight));
}

Status AddPnp(const TestImage& test, Localizer* localizer, Row* row) {
  const double start = CpuSeconds();
  CAIRN_ASSIGN_OR_RETURN(const Localization found,
                         localizer->LocalizeFeatures(test.query.features, test.query.camera));
  row->pnp_seconds.push_back(test.feature_seconds + CpuSeconds() - start);
  if (!found.has_fix() || !test.is_inside()) return Ok();
  ++row->num_pnp;
  row->pnp_cm.push_back(100 * CenterErrorM(found.cam_from_world, test.cam_from_world));
  row->num_pnp_wrong += row->pnp_cm.back() > 100 ? 1 : 0;
  return Ok();
}

std::string MeanText(const std::vector<double>& values) {
  return values.empty() ? "–" : fmt::format("{:.3f} ± {:.3f}", Mean(values), Deviation(values));
}

// [Sala06 Table V, Table VI]
void PrintRow(const Row& row) {
  fmt::print(
      "| {} | {} | {:.2f} | {:.1f} of {} | {} | {} | {:.0f} | {} of {} | {} | {:.1f} | {:.1f} | {:.1f} | "
      "{:.2f} | {:.3f} | "
      "{:.4f} | {} | "
      "{:.2f} | {:.0f} | {} of {} | {} | {} | {:.1f} | {:.1f} | {:.3f} |\n",
      row.name, row.num_landmarks, row.megabytes, Mean(row.lattice_cm), row.lattice_cm.size(),
      MeanText(row.lattice_divergences), MeanText(row.reverse_divergences), row.model_bytes, row.num_fixes,
      row.num_inside, row.num_wrong, Mean(row.errors_cm), MedianOrNan(row.errors_cm), Mean(row.all_errors_cm),
      MedianOrNan(row.errors_deg), Mean(row.seconds), Mean(row.search_seconds), MeanText(row.divergences),
      Mean(row.nees), Mean(row.matches), row.num_flagged_outside, row.num_outside, row.num_honest_outside,
      row.num_pnp, Mean(row.pnp_cm), MedianOrNan(row.pnp_cm), Mean(row.pnp_seconds));
}

constexpr char kCsvHead[] =
    "map,landmarks,megabytes,queries,without_match,lattice_mean_cm,lattice_median_cm,kl_mean,kl_sd,kl_"
    "reverse_"
    "mean,kl_reverse_sd,seconds,fixes,inside,fix_mean_cm,flagged_too_mean_cm,over_1_m,our_kl_mean,our_kl_"
    "sd\n";

// The same for programs; nothing where a column has no value.
std::string CsvLine(const Row& row) {
  const auto number = [](double value) { return std::isnan(value) ? "" : fmt::format("{:.6g}", value); };
  const auto mean_and_deviation = [&](const std::vector<double>& values) {
    return values.empty() ? "," : number(Mean(values)) + "," + number(Deviation(values));
  };
  return fmt::format("{},{},{:.3f},{},{},{},{},{},{},{:.4f},{},{},{},{},{},{}\n", row.name, row.num_landmarks,
                     row.megabytes, row.lattice_cm.size(), row.num_without_match,
                     number(Mean(row.lattice_cm)), number(MedianOrNan(row.lattice_cm)),
                     mean_and_deviation(row.lattice_divergences), mean_and_deviation(row.reverse_divergences),
                     Mean(row.seconds), row.num_fixes, row.num_inside, number(Mean(row.errors_cm)),
                     number(Mean(row.all_errors_cm)), row.num_wrong, mean_and_deviation(row.divergences));
}

// What the map says about how good it is.
void PrintErrors(const std::string& name, const VisualMap& map) {
  std::vector<double> px, octaves;
  for (LandmarkIdx landmark = 0; landmark < map.num_landmarks(); ++landmark) {
    for (const VisualMap::Model& model : map.ModelsOf(landmark)) {
      px.push_back(model.sigma.head<2>().norm());
      octaves.push_back(model.sigma.z());
    }
  }
  fmt::print(
      stderr,
      "{}: {} models predict left-out sights to {:.2f} px and {:.3f} octaves (medians), {:.1f} times as "
      "far off at a metre; shared {:.2f} cm, {:.2f} deg; cameras tilted by {:.1f} deg, heights {:.3f} m\n",
      name, px.size(), MedianOrNan(px), MedianOrNan(octaves), std::hypot(1, map.errors().growth_per_m),
      100 * map.errors().shared_m, DegFromRad(map.errors().shared_rad), DegFromRad(map.errors().tilt_rad),
      map.height_sigma_m());
}

void PrintPose(const Row& row, const TestImage& test, const VisualMap& map, const VisualPose& pose) {
  fmt::print(stderr,
             "{} {} {}: {} of {} possible, {} matched; spread {:.2f}; {:.2f} m out, found {:.2f}; {:.1f} cm "
             "{:.2f} deg sd {:.1f} cm NEES {:.1f}; higher {:.3f} m; elsewhere {:.2g}; KL {:.2f}; {}; "
             "likeliest place {:.1f} cm off\n",
             row.name, test.name, test.is_inside() ? "inside" : "outside", pose.num_agreeing,
             pose.num_possible, pose.num_matches, pose.spread_ratio, test.out_m,
             MetresOutOfHull(map.places(), pose.position), 100 * (pose.position - test.truth.position).norm(),
             AngleBetweenDeg(pose.heading_deg, test.truth.heading_deg),
             100 * std::sqrt(pose.covariance.topLeftCorner<2, 2>().trace()), SquaredMahalanobis(test, pose),
             pose.higher_m, pose.elsewhere, row.divergences.empty() ? 0 : row.divergences.back(),
             VisualFlagName(pose.flag), row.lattice_cm.back());
}

Status DrawPictures(const Arguments& arguments, const std::string& map_name, const VisualMap& map,
                    const std::vector<TestImage>& images, const std::vector<VisualPose>& poses) {
  std::vector<ErrorArrow> arrows;
  for (size_t i = 0; i < images.size(); ++i)
    arrows.push_back({images[i].truth.position, poses[i].position, poses[i].flag != VisualFlag::kNone});
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
      arguments.pictures + "/errors_" + map_name + ".svg",
      ErrorSvg(fmt::format("{}: from where {} images were taken to where they were placed", map_name,
                           arrows.size()),
               map, arrows)));
  return WriteFileAtomically(
      arguments.pictures + "/posterior_" + map_name + ".svg",
      PosteriorSvg(fmt::format("{}: where {} may have been taken{}", map_name, images[0].name,
                               poses[0].flag == VisualFlag::kNone
                                   ? ""
                                   : fmt::format(" (flagged: {})", VisualFlagName(poses[0].flag))),
                   map, poses[0], images[0].truth.position));
}

Status Run(const Arguments& arguments) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  cv::setNumThreads(1);
  fmt::print(
      "| map | landmarks | MB | likeliest place, mean (cm) | KL from all, mean ± sd | KL of all from it "
      "| bytes a model | fixes | > 1 m | mean error (cm) | median | mean, flagged too "
      "| median (deg) | s a pose | without features | our KL, mean ± sd | NEES (3) | agreeing | outside: "
      "flagged "
      "| or within 3 sigma | "
      "PnP fixes | mean (cm) | "
      "median | s a pose |\n|---|{}\n",
      "--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
  std::vector<TestImage> images;
  std::vector<VisualPose> reference;
  std::vector<LatticePosterior> lattice_reference;
  std::string csv = kCsvHead;
  for (const std::string& path : arguments.maps) {
    CAIRN_ASSIGN_OR_RETURN(const auto map, Map::Open(path));
    CAIRN_ASSIGN_OR_RETURN(const auto visual, VisualMap::Load(*map, arguments.map_options));
    if (images.empty()) {
      CAIRN_ASSIGN_OR_RETURN(images, ReadTestImages(arguments, *map, *visual));
    }
    Row row{.name = std::filesystem::path(path).stem().string(), .num_landmarks = map->num_landmarks()};
    row.megabytes = static_cast<double>(std::filesystem::file_size(path)) / 1e6;
    for (int64_t i = 0; i < map->directory().NumBlocks(BlockKind::kLandmarkModels); ++i)
      row.model_bytes += map->directory().Entry(BlockKind::kLandmarkModels, i).num_bytes /
                         static_cast<double>(map->num_landmarks());
    Localizer localizer(map);
    std::vector<VisualPose> poses;
    for (const TestImage& test : images) {
      const double start = CpuSeconds();
      CAIRN_ASSIGN_OR_RETURN(const auto seen, visual->Match(test.query));
      CAIRN_ASSIGN_OR_RETURN(const VisualPose pose,
                             EstimateVisualPose(*visual, seen, arguments.estimate_options));
      row.search_seconds.push_back(CpuSeconds() - start);
      row.seconds.push_back(test.feature_seconds + row.search_seconds.back());
      CAIRN_ASSIGN_OR_RETURN(LatticePosterior lattice,
                             PosteriorOnLattice(*visual, seen, arguments.estimate_options));
      const LatticePosterior* of_all = reference.empty() ? nullptr : &lattice_reference[poses.size()];
      AddLattice(test, *visual, lattice, of_all, arguments.uniform_weight, &row);
      if (reference.empty()) lattice_reference.push_back(std::move(lattice));
      if (!reference.empty() && test.is_inside()) {
        row.divergences.push_back(
            PosteriorDivergence(pose, reference[poses.size()], arguments.uniform_weight));
      }
      if (arguments.print_all) PrintPose(row, test, *visual, pose);
      AddVisual(test, pose, &row);
      poses.push_back(pose);
      CAIRN_RETURN_IF_ERROR(AddPnp(test, &localizer, &row));
    }
    if (!arguments.pictures.empty()) {
      CAIRN_RETURN_IF_ERROR(DrawPictures(arguments, row.name, *visual, images, poses));
    }
    if (reference.empty()) {
      reference = std::move(poses);
      fmt::print(stderr, "{} places, spacing {:.2f} m, focal length {:.1f} px ({})\n",
                 visual->places().size(), visual->spacing_m(), visual->focal_px(),
                 visual->has_learnt_focal() ? "learnt" : "guessed");
    }
    PrintErrors(row.name, *visual);
    PrintRow(row);
    std::fflush(stdout);
    csv += CsvLine(row);
  }
  return arguments.csv.empty() ? Ok() : WriteFileAtomically(arguments.csv, csv);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  CLI::App app{"Localizes held-out images by the visual map and by PnP"};
  cairn::Arguments arguments;
  app.add_option("capture", arguments.capture, "Capture with queries.txt")->required();
  app.add_option("maps", arguments.maps, "Maps with a visual map; the first: of all features")->required();
  app.add_option("--queries", arguments.queries, "Held-out images [the capture's queries.txt]");
  app.add_option("--pictures", arguments.pictures, "Folder for pictures of posteriors and errors");
  app.add_option("--csv", arguments.csv, "File for the table as comma-separated values");
  app.add_option("--uniform-weight", arguments.uniform_weight, "Mixed into posteriors before KL")
      ->capture_default_str();
  app.add_flag("--print-all", arguments.print_all, "A line per image and map on stderr");
  cairn::OptionTable options = cairn::DescribeOptions(&arguments.sift);
  for (const cairn::OptionTable& of_visual : {cairn::DescribeOptions(&arguments.map_options),
                                              cairn::DescribeOptions(&arguments.estimate_options)}) {
    options.insert(options.end(), of_visual.begin(), of_visual.end());
  }
  cairn::ArgumentParser parser(app);
  arguments.option_arguments.Add(parser, options);
  CLI11_PARSE(app, argc, argv);
  const cairn::Status status = cairn::Run(arguments);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
