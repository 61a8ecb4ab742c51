#include "pipeline/commands/commands.h"

#include <algorithm>
#include <optional>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "core/plan/views.h"
#include "pipeline/commands/open_plan.h"
#include "pipeline/program/json_text.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/scans/read_scans.h"
#include "stages/decompose_views/picture.h"

namespace cairn::pipeline {
namespace {

using nlohmann::ordered_json;

constexpr int kMaxDrawnSolutions = 6;

struct LocateScanArguments {
  std::string views;
  std::string scans;
  std::optional<std::string> scan;  // otherwise all
  std::string svg;
  ScanSegmentsOptions segment_options;
  ScanLocatorOptions locator_options;
  OptionArguments option_arguments;
};

// `regions`: null where the plan has none.
ordered_json HypothesisJson(const ScanHypothesis& found, const FaceLocator* regions) {
  ordered_json json = {
      {"x", found.pose.position.x()},
      {"y", found.pose.position.y()},
      {"heading_deg", DegFromRad(found.pose.heading_rad)},
      {"probability", found.probability},
      {"determined", found.determined},
      {"explained", found.explained_ratio},
      {"matched", found.num_matched},
      {"matched_length_m", found.matched_length_m},
      {"hidden_length_m", found.hidden_length_m},
      {"rms_m", found.rms_m},
      {"labels", found.labels},
      {"covariance", std::vector<double>(found.covariance.data(), found.covariance.data() + 9)}};
  if (regions != nullptr) json["region"] = regions->Find(found.pose.position);
  return json;
}

decompose_views::ViewsOverlay Overlay(const ScanView& scan, const LocatedScan& result) {
  decompose_views::ViewsOverlay overlay;
  for (size_t i = 0; i < result.hypotheses.size() && i < kMaxDrawnSolutions; ++i) {
    const PlanarPose& pose = result.hypotheses[i].pose;
    overlay.robots.push_back(
        {pose.position, pose.heading_rad, result.hypotheses.size() > 1 ? std::to_string(i + 1) : ""});
  }
  if (result.hypotheses.empty()) return overlay;
  const ScanHypothesis& best = result.hypotheses[0];
  for (const Beam& beam : scan.beams)
    overlay.beams.emplace_back(best.pose.FloorFromRobot(beam.End()), beam.met);
  for (size_t i = 0; i < scan.segments.size(); ++i) {
    overlay.segments.push_back({best.pose.FloorFromRobot(scan.segments[i].start),
                                best.pose.FloorFromRobot(scan.segments[i].end), best.labels[i] >= 0});
  }
  overlay.captions = {fmt::format("{} of {} segments on walls", best.num_matched, scan.segments.size()),
                      fmt::format("{:.0f} % of beam ends on walls", 100 * best.explained_ratio),
                      fmt::format("{} {}", result.hypotheses.size(),
                                  result.hypotheses.size() == 1 ? "solution" : "solutions"),
                      fmt::format("probability of the first: {:.3f}", best.probability)};
  return overlay;
}

// The first of the scans to locate, and the one after the last.  Errors: InvalidArgument for a --scan that is
// not the number of a scan.
Result<std::pair<int, int>> ChosenScans(const LocateScanArguments& arguments, int num_scans) {
  if (!arguments.scan) return std::pair(0, num_scans);
  int scan = 0;
  if (ParseNumber(*arguments.scan, &scan) && scan >= 0 && scan < num_scans) return std::pair(scan, scan + 1);
  return MakeError(ErrorCode::kInvalidArgument, "{}: --scan '{}': it has {} scan(s), numbered 0 to {}",
                   arguments.scans, *arguments.scan, num_scans, num_scans - 1);
}

Status RunLocateScan(const LocateScanArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Views> opened,
                         OpenPlanFor(arguments.views, arguments.locator_options, environment));
  const Views& views = *opened;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<ScanView> scans,
                         ReadScans(arguments.scans, arguments.segment_options));
  CAIRN_ASSIGN_OR_RETURN(const auto chosen, ChosenScans(arguments, static_cast<int>(scans.size())));
  const auto [first, end] = chosen;
  const auto locator = ScanLocator::Make(views, arguments.locator_options);
  if (!locator.ok())
    return MakeError(locator.error().code, "{}: {}", arguments.views, locator.error().message);
  std::optional<FaceLocator> regions;
  if (views.num_faces() > 0) regions.emplace(views);
  int64_t num_located = 0;
  environment.progress->Begin("locate-scan", end - first, "scans");
  // A batch on all threads, then its lines in order.
  const int batch_size = 8 * NumThreads(environment.num_threads);
  for (int begin = first; begin < end; begin += batch_size) {
    std::vector<std::optional<Result<LocatedScan>>> batch(std::min(batch_size, end - begin));
    ParallelFor(std::ssize(batch), environment.num_threads, [&](int64_t i) {
      if (environment.progress->Cancelled()) return;
      batch[i] = locator->Locate(scans[begin + i]);
      environment.progress->Advance();
    });
    if (environment.progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
    for (int i = begin; i < begin + std::ssize(batch); ++i) {
      const Result<LocatedScan>& result = *batch[i - begin];
      ordered_json line = {
          {"scan", i}, {"beams", scans[i].beams.size()}, {"segments", scans[i].segments.size()}};
      if (!result.ok()) {
        if (result.error().code != ErrorCode::kNoData || end - first == 1)
          return MakeError(result.error().code, "{}: scan {}: {}", arguments.scans, i,
                           result.error().message);
        line["reason"] = result.error().message;
        line["solutions"] = ordered_json::array();
      } else {
        ordered_json solutions = ordered_json::array();
        for (const ScanHypothesis& found : result->hypotheses)
          solutions.push_back(HypothesisJson(found, regions ? &*regions : nullptr));
        num_located += !result->hypotheses.empty();
        line["tried"] = result->num_tried;
        line["complete"] = result->complete;
        line["solutions"] = std::move(solutions);
        if (!arguments.svg.empty() && i == first) {
          CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
              arguments.svg,
              decompose_views::DrawViews(views, Overlay(scans[i], *result), /*regions=*/false)));
        }
      }
      *environment.out << JsonText(line) << "\n";
    }
  }
  environment.progress->End();
  environment.report->in = {{"scans", end - first}};
  environment.report->out = {{"scans located", num_located}};
  return Ok();
}

}  // namespace

Command LocateScanCommand() {
  auto arguments = std::make_shared<LocateScanArguments>();
  Command command;
  command.name = "locate";
  command.former_names = {"locate-scan"};
  command.summary = "Find where a laser scan was taken in a floor plan";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("views", arguments->views, "the plan (views.db, or a map that has it)")
        .Required()
        .Type("FILE");
    parser
        .Add("scans", arguments->scans,
             "Carmen log, LaserScan messages as JSON lines, or lines x0,y0,x1,y1 of the walls seen (robot "
             "frame, metres)")
        .Required()
        .Type("FILE");
    // As text, for one error that says how many scans there are.
    parser.Add("--scan", arguments->scan, "number of the only scan to locate, from 0").Type("INT");
    parser.Add("--svg", arguments->svg, "also draw the first scan over the plan").Type("FILE.svg");
    OptionTable table = DescribeOptions(&arguments->segment_options);
    for (Option& option : DescribeOptions(&arguments->locator_options)) table.push_back(std::move(option));
    arguments->option_arguments.Add(
        parser, std::move(table),
        {"search", "least_odds", "max_range_m", "sigma_range_m", "sigma_wall_m", "sigma_wall_deg"});
  };
  command.run = [arguments](const CommandEnvironment& environment) {
    return RunLocateScan(*arguments, environment);
  };
  return command;
}

}  // namespace cairn::pipeline
