#include "pipeline/commands/inspect_place.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "pipeline/explain/advise.h"
#include "pipeline/explain/explain_place.h"
#include "pipeline/explain/station_losses.h"
#include "pipeline/program/json_text.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Nothing is surveyed farther from the origin, m: a larger number is a typing error.
constexpr double kFarthestM = 1e7;

Result<AskedPlace> ParsePlace(const std::string& text) {
  AskedPlace place;
  const std::vector<double> numbers = ParseNumbers(text).value_or(std::vector<double>());
  if (numbers.size() == 2 || numbers.size() == 3) place.position = {numbers[0], numbers[1]};
  if (numbers.size() < 2 || numbers.size() > 3 || !(place.position.cwiseAbs().maxCoeff() < kFarthestM)) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--at {}: expected X,Y or X,Y,HEADING in metres and degrees (floor frame), as in 1.5,0.8,90", text);
  }
  if (numbers.size() == 3) place.heading_deg = numbers[2];
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
Result<std::string> WhyRejected(const PlaceQuestion& question) {
  const fs::path folder = question.build_dir.empty() ? fs::path(question.map_path).replace_extension(".build")
                                                     : fs::path(question.build_dir);
  std::error_code error;
  if (!fs::exists(folder / "features.db", error)) {
    return question.build_dir.empty()
               ? fmt::format(
                     "the build folder, which would show whether a stage rejected it, is "
                     "not at {}: name it with --build-dir",
                     folder.string())
               : fmt::format("there is no features.db in {}", folder.string());
  }
  const std::string path = (folder / "features.db").string();
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::string> {
    if (HasTable(database, "cairn_rejects")) {
      SQLite::Statement query(database, "SELECT reason FROM cairn_rejects WHERE name = ?");
      query.bind(1, *question.image);
      if (query.executeStep())
        return fmt::format("extract_features rejected it: {}", query.getColumn(0).getString());
    }
    SQLite::Statement query(database, "SELECT count(*) FROM images WHERE name = ?");
    query.bind(1, *question.image);
    query.executeStep();
    if (query.getColumn(0).getInt() > 0)
      return std::string(
          "it has features, but no pose: it is held out for the self-test, or was not registered");
    return fmt::format("{} does not have it either", path);
  });
}

Status ExplainImage(const PlaceQuestion& question, const MapRows& rows,
                    const CommandEnvironment& environment) {
  const auto image = std::find_if(rows.images.begin(), rows.images.end(),
                                  [&](const MapImage& row) { return row.name == *question.image; });
  if (image == rows.images.end()) {
    CAIRN_ASSIGN_OR_RETURN(const std::string why, WhyRejected(question));
    return MakeError(ErrorCode::kNotFound, "{}: map '{}' has no survey image '{}' among its {}; {}",
                     question.map_path, rows.name, *question.image, rows.images.size(), why);
  }
  const auto index = static_cast<int32_t>(image - rows.images.begin());
  if (question.json) {
    nlohmann::ordered_json json = ExplainImageJson(rows, index);
    if (image->station >= 0) json["at"] = ExplainStationJson(rows, image->station);
    *environment.out << JsonText(json, 2) << "\n";
    return Ok();
  }
  *environment.out << ExplainImageText(rows, index);
  if (image->station >= 0) *environment.out << "\n" << ExplainStationText(rows, image->station);
  return Ok();
}

Status ExplainPlace(const PlaceQuestion& question, const MapRows& rows,
                    const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const AskedPlace place, ParsePlace(*question.place));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<StationIdx> stations, StationsAt(rows, place));
  const std::vector<Advice> advice = Advise(rows, stations);
  if (question.json) {
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

}  // namespace

Status AnswerPlaceQuestion(const PlaceQuestion& question, const CommandEnvironment& environment) {
  if (!question.build_dir.empty() && !question.image) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--build-dir {}: is read only to look for a rejected --image; give --image, or leave it out",
        question.build_dir);
  }
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(question.map_path));
  if (question.image) return ExplainImage(question, rows, environment);
  if (question.place) return ExplainPlace(question, rows, environment);
  const std::vector<Advice> advice = Advise(rows);
  if (question.json) {
    *environment.out << JsonText({{"advice", AdviceJson(advice)}}, 2) << "\n";
    return Ok();
  }
  const auto num_covered = std::count_if(rows.stations.begin(), rows.stations.end(),
                                         [](const MapStation& station) { return station.is_covered; });
  *environment.out << fmt::format(
      "map '{}': {} of {} stations are covered by {} regions{}\n{}{}", rows.name, num_covered,
      rows.stations.size(), rows.regions.size(), rows.k > 0 ? fmt::format(" of k = {}", rows.k) : "",
      advice.empty() ? "nothing to improve\n" : "what would help, most important first\n",
      AdviceText(advice));
  return Ok();
}

}  // namespace cairn::pipeline
