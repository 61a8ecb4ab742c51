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

struct Arguments {
  std::string path_a;
  std::string path_b;
  bool json = false;
  CompareMapsOptions options;
};

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
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
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "diff",
      .summary =
          "Shows what changed between two maps of one place: landmarks, regions, coverage, options, "
          "self-test",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("a", arguments->path_a, "Map")->required()->type_name("A");
            app.add_option("b", arguments->path_b, "Map in the same frame")->required()->type_name("B");
            app.add_flag("--json", arguments->json, "Print JSON");
            CompareMapsOptions& options = arguments->options;
            app.add_option("--max-landmark-distance", options.max_landmark_distance_m,
                           "Farther apart, landmarks are not the same, m")
                ->check(CLI::Range(1e-4, 100.0))
                ->capture_default_str();
            app.add_option("--max-station-distance", options.max_station_distance_m,
                           "Farther apart, stations are not the same, m")
                ->check(CLI::Range(1e-4, 100.0))
                ->capture_default_str();
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
