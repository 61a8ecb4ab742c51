#include "pipeline/commands/commands.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/atlas/atlas_file.h"
#include "core/blocks/map_rows.h"
#include "core/capture/sessions.h"
#include "core/features/features.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/world/decomposition.h"
#include "pipeline/commands/in_atlas.h"
#include "pipeline/commands/inspect_ambiguity.h"
#include "pipeline/commands/inspect_place.h"
#include "pipeline/explain/block_bytes.h"
#include "pipeline/explain/inspect_drops.h"
#include "pipeline/explain/place_changes.h"
#include "pipeline/program/json_text.h"
#include "pipeline/report/ambiguity_svg.h"
#include "pipeline/report/floor_svg.h"
#include "stages/check_map/promise_figures.h"
#include "stages/check_map/report.h"

namespace cairn::pipeline {
namespace {

constexpr int kMaxRegionLines = 30;
constexpr int kMaxStationLines = 10;
constexpr int kMaxPlaceLines = 10;
constexpr int kMaxChangeLines = 20;

struct InspectArguments {
  PlaceQuestion question;
  std::string svg_path;
  std::string ambiguity_svg_path;
};

// Bytes of the pages of each table (its indices included), largest first; the file's remainder is
// SQLite's own.
Result<std::vector<std::pair<std::string, int64_t>>> BytesPerTable(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::vector<std::pair<std::string, int64_t>>> {
    std::vector<std::pair<std::string, int64_t>> tables;
    // A table of that name would hide SQLite's own.
    if (database.execAndGet("SELECT count(*) FROM sqlite_master WHERE name = 'dbstat' COLLATE NOCASE")
            .getInt() > 0)
      return Corrupt(path, "has a table or view 'dbstat', which no map has");
    SQLite::Statement query(
        database,
        "SELECT coalesce(s.tbl_name, d.name), sum(d.pgsize) FROM dbstat d LEFT JOIN sqlite_master s "
        "ON s.name = d.name GROUP BY 1 ORDER BY 2 DESC, 1");
    while (query.executeStep())
      tables.emplace_back(query.getColumn(0).getString(), query.getColumn(1).getInt64());
    return tables;
  });
}

// Images and landmarks of each survey, and how many landmarks several of them see.
nlohmann::ordered_json SessionsJson(const MapRows& rows) {
  std::vector<int64_t> num_images(rows.sessions.size()), num_landmarks(rows.sessions.size()),
      num_only(rows.sessions.size());
  std::vector<std::vector<int64_t>> num_shared(rows.sessions.size(),
                                               std::vector<int64_t>(rows.sessions.size()));
  for (const MapImage& image : rows.images) {
    if (const int session = SessionOfImage(rows.sessions, image.name); session >= 0) ++num_images[session];
  }
  for (const std::vector<int>& seen_by : LandmarkSessions(rows)) {
    if (seen_by.size() == 1) ++num_only[seen_by[0]];
    for (const int session : seen_by) {
      ++num_landmarks[session];
      for (const int other : seen_by) ++num_shared[session][other];
    }
  }
  auto sessions = nlohmann::ordered_json::array();
  for (size_t i = 0; i < rows.sessions.size(); ++i) {
    nlohmann::ordered_json session = {{"name", rows.sessions[i]},
                                      {"num_images", num_images[i]},
                                      {"num_landmarks", num_landmarks[i]},
                                      {"num_landmarks_of_it_alone", num_only[i]},
                                      {"num_landmarks_shared_with", nlohmann::ordered_json::object()}};
    for (size_t j = 0; j < rows.sessions.size(); ++j) {
      if (j != i) session["num_landmarks_shared_with"][rows.sessions[j]] = num_shared[i][j];
    }
    sessions.push_back(std::move(session));
  }
  return sessions;
}

// Counts of landmark models and of their sights, and their bytes.
void AddVisualMap(const MapDirectory& directory, const VisualMapData& visual_map,
                  nlohmann::ordered_json* json) {
  int64_t num_models = 0, num_bad = 0, num_sights = 0, num_bytes = 0;
  for (const std::vector<HeadingModel>& models : visual_map.landmarks) {
    num_models += static_cast<int64_t>(models.size());
    for (const HeadingModel& model : models) {
      num_bad += model.predicts_badly ? 1 : 0;
      num_sights += static_cast<int64_t>(model.sights.size());
    }
  }
  for (int64_t i = 0; i < directory.NumBlocks(BlockKind::kLandmarkModels); ++i)
    num_bytes += directory.Entry(BlockKind::kLandmarkModels, i).num_bytes;
  (*json)["num_landmark_models"] = num_models;
  (*json)["num_bad_landmark_models"] = num_bad;
  (*json)["num_landmark_sights"] = num_sights;
  (*json)["num_landmark_model_bytes"] = num_bytes;
}

nlohmann::ordered_json CurveJson(const std::vector<PromiseBin>& bins) {
  auto json = nlohmann::ordered_json::array();
  for (const PromiseBin& bin : bins)
    json.push_back({{"promised", bin.mean_promised}, {"num_images", bin.num}, {"num_kept", bin.num_kept}});
  return json;
}

// Without the nodes, which `inspect --at` tells of.
nlohmann::ordered_json PromiseJson(const MapPromise& promise) {
  return {{"probability", promise.terms.probability},
          {"min_matches", promise.terms.min_matches},
          {"max_error_m", promise.terms.max_error_m},
          {"max_error_deg", promise.terms.max_error_deg},
          {"num_nodes", promise.nodes.size()},
          {"num_kept", promise.NumKept()},
          {"landmarks_lower_bound", promise.landmarks_lower_bound},
          {"left_out", CurveJson(promise.left_out)},
          {"held_out", CurveJson(promise.held_out)}};
}

std::string CameraText(const Camera& camera) {
  return fmt::format("{} {} x {} px, {:.6g}", CameraModelName(camera.model), camera.width, camera.height,
                     fmt::join(camera.params, ", "));
}

// Each camera by its number, and as it was stated where the survey's images showed that it is another.
nlohmann::ordered_json CamerasJson(const MapRows& rows) {
  auto json = nlohmann::ordered_json::object();
  for (const Camera& camera : rows.cameras) json[std::to_string(camera.camera_id)] = CameraText(camera);
  for (const Camera& stated : rows.stated_cameras)
    json[fmt::format("{} as stated", stated.camera_id)] = CameraText(stated);
  return json;
}

nlohmann::ordered_json MapJson(const MapFile& file, const MapRows& rows, int64_t num_bytes,
                               const std::vector<std::pair<std::string, int64_t>>& tables) {
  size_t num_postings = 0, num_edges = rows.station_edges.size(), num_uncovered = 0, num_region_landmarks = 0;
  for (const auto& postings : rows.vocabulary.inverted_files) num_postings += postings.size();
  const auto num_kept = std::count_if(rows.appearance.begin(), rows.appearance.end(),
                                      [](const MapAppearanceNode& node) { return node.is_kept; });
  for (const MapStation& station : rows.stations) num_uncovered += station.is_covered ? 0 : 1;
  for (const MapRegion& region : rows.regions) num_region_landmarks += region.landmarks.size();
  nlohmann::ordered_json json = {
      {"name", rows.name},
      {"format", fmt::format("{}.{}", MapVersionMajor(rows.descriptor_kind), file.minor_version())},
      {"descriptors", ToString(rows.descriptor_kind)},
      {"writer", rows.writer},
      {"instruction_set", rows.instruction_set},
      {"sealed", rows.sealed},
      {"seed", rows.seed},
      {"unit", rows.frame.unit},
      {"frame_source", rows.frame.source},
      {"scale_sigma_ratio", rows.frame.scale_sigma_ratio},
      {"bytes", num_bytes},
      {"num_landmarks", rows.landmarks.size()},
      {"landmarks", rows.landmark_choice},
      {"num_regions", rows.regions.size()},
      {"lower_bound", nullptr},
      {"uncovered_limit", rows.uncovered_limit},
      {"num_region_landmarks", num_region_landmarks},
      {"algorithm", rows.algorithm},
      {"k", rows.k},
      {"tau", rows.tau},
      {"rho", rows.rho},
      {"num_stations", rows.stations.size()},
      {"num_station_edges", num_edges},
      {"num_uncovered_stations", num_uncovered},
      {"num_images", rows.images.size()},
      {"num_cameras", rows.cameras.size()},
      {"stated_poses_moved_m", rows.stated_pose_sigma_m},
      {"stated_poses_moved_deg", rows.stated_pose_sigma_deg},
      {"covariance_scale", rows.covariance_scale},
      {"keypoint_correlation", rows.keypoint_correlation},
      {"num_appearance_nodes", rows.appearance.size()},
      {"num_kept_nodes", num_kept},
      {"documents", rows.documents},
      {"num_words", rows.vocabulary.num_words()},
      {"vocabulary_depth", rows.vocabulary.depth},
      {"num_postings", num_postings},
      {"num_plan_walls", rows.views.plan.walls.size()},
      {"num_view_regions", rows.views.parents.size()},
      {"num_view_links", rows.views.links.size()}};
  AddVisualMap(file.directory(), rows.visual_map, &json);
  if (rows.frame.scale_sigma_ratio > 0) {
    const Eigen::Vector3d& centre = rows.frame.scale_centre;
    json["scale_centre_m"] = {centre.x(), centre.y(), centre.z()};
  }
  if (rows.frame.anchor) {
    json["anchor"] = {{"latitude_deg", rows.frame.anchor->latitude_deg},
                      {"longitude_deg", rows.frame.anchor->longitude_deg},
                      {"altitude_m", rows.frame.anchor->altitude_m}};
  }
  if (rows.lower_bound) json["lower_bound"] = *rows.lower_bound;
  json["cameras"] = CamerasJson(rows);
  json["sessions"] = SessionsJson(rows);
  if (!rows.findings.changes.empty()) json["changes"] = PlaceChangesJson(rows, rows.findings.changes);
  json["bytes_per_table"] = nlohmann::ordered_json::object();
  for (const auto& [table, bytes] : tables) json["bytes_per_table"][table] = bytes;
  json["self_test"] = rows.self_test;
  json["dropped"] = DropsJson(rows);
  json["ambiguity"] = AmbiguityJson(rows);
  if (rows.findings.promise) json["promise"] = PromiseJson(*rows.findings.promise);
  json["self_test_regions"] = check_map::SelfTestRegionsJson(rows.findings.self_test_regions);
  json["stage_options"] = rows.stage_options;
  json["input_hashes"] = rows.input_hashes;
  return json;
}

std::string SessionsText(const nlohmann::ordered_json& sessions) {
  if (sessions.empty()) return "";
  std::string text = fmt::format("\nsessions\n  {:<22} {:>8} {:>10} {:>10}  shared with\n", "", "images",
                                 "landmarks", "alone");
  for (const auto& session : sessions) {
    text += fmt::format("  {:<22} {:>8} {:>10} {:>10} ", session["name"].get<std::string>(),
                        session["num_images"].get<int64_t>(), session["num_landmarks"].get<int64_t>(),
                        session["num_landmarks_of_it_alone"].get<int64_t>());
    for (const auto& [name, count] : session["num_landmarks_shared_with"].items())
      text += fmt::format(" {} {}", name, count.get<int64_t>());
    text += "\n";
  }
  return text;
}

std::string RegionsLine(const nlohmann::ordered_json& json) {
  std::optional<int> lower_bound;
  if (!json["lower_bound"].is_null()) lower_bound = json["lower_bound"].get<int>();
  std::string line =
      fmt::format("{:<24} {}", "regions", NumRegionsText(json["num_regions"].get<size_t>(), lower_bound));
  if (const int limit = json["uncovered_limit"].get<int>(); lower_bound && limit > 0) {
    line += fmt::format(" (where up to {} coverable stations may be in none)", limit);
  }
  return line + "\n";
}

// The same values for people: a line each, options as they stand in the recipe.
std::string MapText(const nlohmann::ordered_json& json, const MapRows& rows) {
  std::string text;
  for (const auto& [key, value] : json.items()) {
    if (key == "dropped") {
      if (!value.empty()) text += "\n" + DropsText(rows, kMaxStationLines);
      continue;
    }
    if (key == "ambiguity") {
      if (!value.empty()) text += "\n" + AmbiguityText(rows, kMaxPlaceLines);
      continue;
    }
    if (key == "self_test_regions") {
      if (!value.empty())
        text += "\n" +
                check_map::SelfTestRegionsText(rows.findings.self_test_regions, kMaxRegionLines, rows.frame);
      continue;
    }
    if (key == "promise") {
      text += "\n" + check_map::PromiseText(*rows.findings.promise, LengthUnit(rows.frame));
      continue;
    }
    if (key == "changes") {
      text += "\nchanges\n" + PlaceChangesText(rows, rows.findings.changes, kMaxChangeLines);
      continue;
    }
    if (key == "lower_bound" || key == "uncovered_limit") continue;  // in the line before
    if (key == "sessions") {
      text += SessionsText(value);
    } else if (key == "num_regions") {
      text += RegionsLine(json);
    } else if (!value.is_object()) {
      text += fmt::format("{:<24} {}\n", key, value.is_string() ? value.get<std::string>() : JsonText(value));
    }
    if (!value.is_object() || value.empty()) continue;
    text += fmt::format("\n{}\n", key);
    for (const auto& [name, entry] : value.items()) {
      if (key == "stage_options") {
        text += fmt::format("  [{}]\n", name);
        std::string line;
        for (const char c : entry.get<std::string>()) {
          if (c != '\n') line += c;
          if (c == '\n') text += "  " + std::exchange(line, "") + "\n";
        }
      } else if (key == "bytes_per_table" || key == "bytes_per_block_kind") {
        text += fmt::format("  {:<22} {:>12} {:>5.1f} %\n", name, entry.get<int64_t>(),
                            100.0 * entry.get<double>() / json["bytes"].get<double>());
      } else {
        text += fmt::format("  {:<22} {}\n", name,
                            entry.is_string() ? entry.get<std::string>() : JsonText(entry));
      }
    }
  }
  return text;
}

Status RunInspect(const InspectArguments& arguments, const CommandEnvironment& environment) {
  const std::string& map_path = arguments.question.map_path;
  if (IsAtlasFile(map_path)) {
    if (!arguments.question.is_asked() && arguments.question.build_dir.empty() &&
        arguments.svg_path.empty() && arguments.ambiguity_svg_path.empty())
      return InspectAtlas(map_path, arguments.question.json, environment);
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is an atlas, of which only --json can be asked; ask one of its maps", map_path);
  }
  if (arguments.question.is_asked() || !arguments.question.build_dir.empty()) {
    if (arguments.svg_path.empty() && arguments.ambiguity_svg_path.empty())
      return AnswerPlaceQuestion(arguments.question, environment);
    return MakeError(ErrorCode::kInvalidArgument,
                     "--svg and --ambiguity-svg draw the whole map; leave them out, or --at, --image, "
                     "--advice and --build-dir");
  }
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFile::Open(map_path, {}));
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(file));
  CAIRN_ASSIGN_OR_RETURN(const auto tables, BytesPerTable(map_path));
  auto json = MapJson(file, rows, static_cast<int64_t>(std::filesystem::file_size(map_path)), tables);
  json["bytes_per_block_kind"] = BytesPerBlockKind(file.directory());
  if (file.head().epoch != 0) json["epoch"] = file.head().epoch;
  if (file.seal().is_signed()) json["signed_with"] = HexOf(file.seal().public_key);
  *environment.out << (arguments.question.json ? JsonText(json, 2) + "\n" : MapText(json, rows));
  if (!arguments.ambiguity_svg_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const std::string svg, AmbiguitySvg(rows));
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.ambiguity_svg_path, svg));
  }
  if (arguments.svg_path.empty()) return Ok();
  return WriteFileAtomically(arguments.svg_path, FloorSvg(rows));
}

}  // namespace

Command InspectCommand() {
  auto arguments = std::make_shared<InspectArguments>();
  return {
      .name = "inspect",
      .summary = "Show what is in a map, or why a place is covered or not",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            PlaceQuestion& question = arguments->question;
            parser.Add("map", question.map_path, "Map").Required().Type("MAP");
            const Argument at =
                parser
                    .Add("--at", question.place,
                         "Why this place is covered or not, and what was dropped there: floor frame, metres, "
                         "degrees counter-clockwise from +x")
                    .Type("X,Y[,HEADING]");
            const Argument image =
                parser
                    .Add("--image", question.image, "The same for a survey image, by its name in the capture")
                    .Type("NAME")
                    .Excludes(at);
            parser
                .AddFlag("--advice", question.advice, "What would make the map better, most important first")
                .Excludes(at)
                .Excludes(image);
            parser
                .Add("--build-dir", question.build_dir,
                     "Build folder, for an --image that a stage rejected [MAP with .build for .cairn]")
                .Type("FOLDER");
            parser.AddFlag("--json", question.json, "Print JSON");
            parser.Add("--svg", arguments->svg_path, "Write a picture of the floor").Type("FILE.svg");
            parser
                .Add("--ambiguity-svg", arguments->ambiguity_svg_path,
                     "Write a picture of the places that look like others")
                .Type("FILE.svg");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunInspect(*arguments, environment); },
      .former_names = {"explain"},
  };
}

}  // namespace cairn::pipeline
