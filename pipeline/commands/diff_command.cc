#include "pipeline/commands/commands.h"

#include <filesystem>
#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "core/blocks/map_rows.h"
#include "pipeline/explain/compare_maps.h"
#include "pipeline/program/json_text.h"

namespace cairn::pipeline {
namespace {

constexpr int kMaxLines = 20;

struct DiffArguments {
  std::string path_a;
  std::string path_b;
  bool json = false;
  CompareMapsOptions options;
};

Status RunDiff(const DiffArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const MapRows a, ReadMapRows(arguments.path_a));
  CAIRN_ASSIGN_OR_RETURN(const MapRows b, ReadMapRows(arguments.path_b));
  if (a.frame.unit != b.frame.unit) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} is in {}s and {} in {}s: their places cannot be compared", arguments.path_a,
                     a.frame.unit, arguments.path_b, b.frame.unit);
  }
  const auto bytes_a = static_cast<int64_t>(std::filesystem::file_size(arguments.path_a));
  const auto bytes_b = static_cast<int64_t>(std::filesystem::file_size(arguments.path_b));
  const MapComparison comparison = CompareMaps(a, b, arguments.options);
  *environment.out << (arguments.json ? JsonText(ComparisonJson(a, b, bytes_a, bytes_b, comparison), 2) + "\n"
                                      : fmt::format("A  {}: map '{}'\nB  {}: map '{}'\n\n", arguments.path_a,
                                                    a.name, arguments.path_b, b.name) +
                                            ComparisonText(a, b, bytes_a, bytes_b, comparison, kMaxLines));
  return Ok();
}

}  // namespace

Command DiffCommand() {
  auto arguments = std::make_shared<DiffArguments>();
  return {
      .name = "diff",
      .summary = "Compare two maps of one place: landmarks, regions, coverage, options, figures",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("a", arguments->path_a, "Map").Required().Type("A");
            parser.Add("b", arguments->path_b, "Map in the same frame").Required().Type("B");
            parser.AddFlag("--json", arguments->json, "Print JSON");
            CompareMapsOptions& options = arguments->options;
            parser
                .Add("--max-landmark-distance", options.max_landmark_distance_m,
                     "Landmarks farther apart than this are not the same, m")
                .Range(1e-4, 100.0)
                .ShowDefault();
            parser
                .Add("--max-station-distance", options.max_station_distance_m,
                     "Stations farther apart than this are not the same, m")
                .Range(1e-4, 100.0)
                .ShowDefault();
          },
      .run = [arguments](const CommandEnvironment& environment) { return RunDiff(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
