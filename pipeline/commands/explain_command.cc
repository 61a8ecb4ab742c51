#include "pipeline/commands/commands.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "pipeline/explain/advise.h"
#include "pipeline/explain/explain_place.h"
#include "pipeline/explain/station_losses.h"
#include "pipeline/program/json_text.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Farther from the origin nothing was surveyed: a slip of the keyboard.
constexpr double kFarthestM = 1e7;

struct Arguments {
  std::string map_path;
  std::optional<std::string> place;
  std::optional<std::string> image;
  std::string build_dir;
  bool json = false;
};

Result<AskedPlace> ParsePlace(const std::string& text) {
  AskedPlace place;
  double heading_deg = 0;
  char rest = 0;
  const int num_read = std::sscanf(text.c_str(), "%lf,%lf,%lf%c", &place.position.x(), &place.position.y(),
                                   &heading_deg, &rest);
  const bool ends_there = num_read == 3 || (num_read == 2 && std::count(text.begin(), text.end(), ',') == 1 &&
                                            text.find_last_not_of("0123456789.eE+-, ") == std::string::npos);
  if (!ends_there || !(place.position.cwiseAbs().maxCoeff() < kFarthestM) || !std::isfinite(heading_deg)) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--at {}: expected X,Y or X,Y,HEADING in metres and degrees (floor frame), as in 1.5,0.8,90", text);
  }
  if (num_read == 3) place.heading_deg = heading_deg;
  return place;
}

nlohmann::ordered_json AdviceJson(const std::vector<Advice>& advice) {
  auto list = nlohmann::ordered_json::array();
  for (const Advice& entry : advice) {
    list.push_back({{"text", entry.text},
                    {"stations", entry.stations},
                    {"images_to_take", nlohmann::ordered_json::array()}});
    for (const Advice::View& view : entry.images_to_take) {
      list.back()["images_to_take"].push_back({{"x_m", view.position.x()}, {"y_m", view.position.y()}});
      if (view.heading_deg) list.back()["images_to_take"].back()["heading_deg"] = *view.heading_deg;
    }
  }
  return list;
}

// Why the build folder's stages rejected an image; empty: they did not, or there is no such folder.
Result<std::string> WhyRejected(const Arguments& arguments) {
  const fs::path folder = arguments.build_dir.empty()
                              ? fs::path(arguments.map_path).replace_extension(".build")
                              : fs::path(arguments.build_dir);
  std::error_code error;
  if (!fs::exists(folder / "features.db", error)) {
    return arguments.build_dir.empty()
               ? fmt::format(
                     "the build folder, which would tell whether a stage rejected it, is not at {}: "
                     "--build-dir says where it is",
                     folder.string())
               : fmt::format("there is no features.db in {}", folder.string());
  }
  const std::string path = (folder / "features.db").string();
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::string> {
    if (HasTable(database, "cairn_rejects")) {
      SQLite::Statement query(database, "SELECT reason FROM cairn_rejects WHERE name = ?");
      query.bind(1, *arguments.image);
      if (query.executeStep())
        return fmt::format("extract_features rejected it: {}", query.getColumn(0).getString());
    }
    SQLite::Statement query(database, "SELECT count(*) FROM images WHERE name = ?");
    query.bind(1, *arguments.image);
    query.executeStep();
    if (query.getColumn(0).getInt() > 0)
      return std::string(
          "it has features, but no pose: it is held out for the self-test, or was not registered");
    return fmt::format("{} does not know it either", path);
  });
}

Status ExplainImage(const Arguments& arguments, const MapRows& rows, const CommandEnvironment& environment) {
  const auto image = std::find_if(rows.images.begin(), rows.images.end(),
                                  [&](const MapImage& row) { return row.name == *arguments.image; });
  if (image == rows.images.end()) {
    CAIRN_ASSIGN_OR_RETURN(const std::string why, WhyRejected(arguments));
    return MakeError(ErrorCode::kNotFound, "{}: map '{}' has no survey image '{}' among its {}; {}",
                     arguments.map_path, rows.name, *arguments.image, rows.images.size(), why);
  }
  const auto index = static_cast<int32_t>(image - rows.images.begin());
  if (arguments.json) {
    nlohmann::ordered_json json = ExplainImageJson(rows, index);
    if (image->station >= 0) json["at"] = ExplainStationJson(rows, image->station);
    *environment.out << JsonText(json, 2) << "\n";
    return Ok();
  }
  *environment.out << ExplainImageText(rows, index);
  if (image->station >= 0) *environment.out << "\n" << ExplainStationText(rows, image->station);
  return Ok();
}

Status ExplainPlace(const Arguments& arguments, const MapRows& rows, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const AskedPlace place, ParsePlace(*arguments.place));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<StationIdx> stations, StationsAt(rows, place));
  const std::vector<Advice> advice = Advise(rows, stations);
  if (arguments.json) {
    nlohmann::ordered_json json = {{"stations", nlohmann::ordered_json::array()},
                                   {"advice", AdviceJson(advice)}};
    for (const StationIdx station : stations) json["stations"].push_back(ExplainStationJson(rows, station));
    *environment.out << JsonText(json, 2) << "\n";
    return Ok();
  }
  std::string text;
  // Of several headings, all in a line each and the one that sees the fewest landmarks in full.
  const StationLosses losses(rows);
  const StationIdx weakest = *std::min_element(
      stations.begin(), stations.end(),
      [&](StationIdx a, StationIdx b) { return losses.NumLandmarks(a) < losses.NumLandmarks(b); });
  if (stations.size() > 1)
    text += fmt::format("{} headings here\n{}\nthe one that sees the fewest landmarks: ", stations.size(),
                        StationSummaryText(rows, stations));
  text += ExplainStationText(rows, weakest);
  if (!advice.empty()) text += "\nwhat would help\n" + AdviceText(advice);
  *environment.out << text;
  return Ok();
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  if (!arguments.build_dir.empty() && !arguments.image) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--build-dir {}: is where --image is looked for among the rejected; give --image, or leave it "
        "out",
        arguments.build_dir);
  }
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(arguments.map_path));
  if (arguments.image) return ExplainImage(arguments, rows, environment);
  if (arguments.place) return ExplainPlace(arguments, rows, environment);
  const std::vector<Advice> advice = Advise(rows);
  if (arguments.json) {
    *environment.out << JsonText({{"advice", AdviceJson(advice)}}, 2) << "\n";
    return Ok();
  }
  const auto num_covered = std::count_if(rows.stations.begin(), rows.stations.end(),
                                         [](const MapStation& station) { return station.is_covered; });
  *environment.out << fmt::format(
      "map '{}': {} of {} stations are covered by {} regions of k = {}\n{}{}", rows.name, num_covered,
      rows.stations.size(), rows.regions.size(), rows.k,
      advice.empty() ? "nothing to say against it\n" : "what would help, most important first\n",
      AdviceText(advice));
  return Ok();
}

}  // namespace

Command ExplainCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "explain",
      .summary =
          "Tells why a place is covered by a map or not, what was dropped there, and which images to take "
          "next",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("map", arguments->map_path, "Map; without --at or --image: advice on all of it")
                ->required()
                ->type_name("MAP");
            CLI::Option* at = app.add_option("--at", arguments->place,
                                             "Place, floor frame: metres, degrees counter-clockwise from +x")
                                  ->type_name("X,Y[,HEADING]");
            app.add_option("--image", arguments->image, "Survey image, by its name in the capture")
                ->type_name("NAME")
                ->excludes(at);
            app.add_option("--build-dir", arguments->build_dir,
                           "Build folder, for images that stages rejected [MAP with .build for .cairn]")
                ->type_name("DIR");
            app.add_flag("--json", arguments->json, "Print JSON");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
