#include "pipeline/commands/in_atlas.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/atlas/atlas_file.h"
#include "core/base/parallel.h"
#include "core/images/image_file.h"
#include "pipeline/commands/localization_json.h"
#include "pipeline/program/json_text.h"
#include "runtime/atlas/atlas.h"
#include "runtime/atlas/atlas_route.h"

namespace cairn::pipeline {
namespace {

nlohmann::ordered_json AnswerJson(const Atlas& atlas, const std::string& image,
                                  const Result<AtlasAnswer>& answer) {
  if (!answer.ok()) return ErrorJson(image, answer.error());
  nlohmann::ordered_json json = {{"image", image}};
  const auto& hypotheses = answer->hypotheses;
  if (hypotheses.empty()) {
    json.update(LocalizationJson(answer->best_failure));
  } else {
    json["map"] = atlas.map_name(hypotheses[0].map);
    json.update(LocalizationJson(hypotheses[0].found));
    json["probability"] = hypotheses[0].probability;
  }
  json["other_places"] = nlohmann::ordered_json::array();
  for (size_t i = 1; i < hypotheses.size(); ++i) {
    nlohmann::ordered_json other = {{"map", atlas.map_name(hypotheses[i].map)}};
    other.update(LocalizationJson(hypotheses[i].found));
    other["probability"] = hypotheses[i].probability;
    json["other_places"].push_back(std::move(other));
  }
  json["elsewhere"] = answer->elsewhere;
  json["maps_tried"] = nlohmann::ordered_json::array();
  for (const int map : answer->maps_tried) json["maps_tried"].push_back(atlas.map_name(map));
  return json;
}

}  // namespace

Status LocalizeInAtlas(const std::string& path, const CameraChoice& cameras,
                       const LocalizerOptions& localizer_options, const AtlasLocalizerOptions& options,
                       ImageNames* names, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const auto atlas, Atlas::Open(path));
  std::optional<Error> first_error;
  int num_images = 0, num_failed = 0, num_localized = 0;
  const size_t batch_size = 4 * static_cast<size_t>(NumThreads(environment.num_threads));
  for (std::vector<std::string> batch; !(batch = names->Next(batch_size)).empty();) {
    std::vector<Result<AtlasAnswer>> answers(batch.size(), Error{});
    ParallelFor(static_cast<int64_t>(batch.size()), environment.num_threads, [&](int64_t i) {
      answers[i] = [&]() -> Result<AtlasAnswer> {
        CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(batch[i]));
        CAIRN_ASSIGN_OR_RETURN(const auto camera, cameras.GivenForImage(grey.cols, grey.rows));
        return AtlasLocalizer(atlas, localizer_options, options).Localize(grey, camera);
      }();
    });
    for (size_t i = 0; i < batch.size(); ++i) {
      *environment.out << JsonText(AnswerJson(*atlas, batch[i], answers[i])) << "\n" << std::flush;
      ++num_images;
      if (!answers[i].ok()) {
        ++num_failed;
        if (!first_error) first_error = answers[i].error();
      } else if (!answers[i]->hypotheses.empty() && answers[i]->hypotheses[0].found.has_fix()) {
        ++num_localized;
      }
    }
    if (environment.progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "localizing was stopped");
  }
  spdlog::info("{} of {} images localized", num_localized, num_images);
  if (!first_error) return Ok();
  return MakeError(first_error->code, "{} of {} images could not be tried; the first: {}", num_failed,
                   num_images, first_error->message);
}

Status RouteInAtlas(const std::string& path, const std::string& from, const std::string& to,
                    const RouteOptions& options, bool as_json, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const auto atlas, Atlas::Open(path));
  CAIRN_ASSIGN_OR_RETURN(const AtlasImage start, FindImage(*atlas, from));
  CAIRN_ASSIGN_OR_RETURN(const AtlasImage goal, FindImage(*atlas, to));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<AtlasLeg> legs, PlanRoute(*atlas, start, goal, options));
  auto json = nlohmann::ordered_json{{"legs", nlohmann::ordered_json::array()}};
  std::string text;
  for (const AtlasLeg& leg : legs) {
    CAIRN_ASSIGN_OR_RETURN(const auto map, atlas->OpenMap(leg.map));
    nlohmann::ordered_json of_leg = {{"map", atlas->map_name(leg.map)},
                                     {"cost", leg.route.cost},
                                     {"images", nlohmann::ordered_json::array()}};
    text += fmt::format("in {}\n", atlas->map_name(leg.map));
    for (const int32_t index : leg.route.images) {
      CAIRN_ASSIGN_OR_RETURN(const std::string name, map->ImageName(index));
      text += fmt::format("{:>4}  {}\n", of_leg["images"].size(), name);
      of_leg["images"].push_back(name);
    }
    if (!leg.passage.empty()) {
      of_leg["passage"] = leg.passage;
      text += fmt::format("by {}\n", leg.passage);
    }
    json["legs"].push_back(std::move(of_leg));
  }
  *environment.out << (as_json ? JsonText(json, 2) + "\n" : text);
  return Ok();
}

Status InspectAtlas(const std::string& path, bool as_json, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const AtlasRows atlas, ReadAtlas(path, std::nullopt));
  std::error_code error;
  const auto num_bytes = std::filesystem::file_size(path, error);
  uint64_t num_map_bytes = 0;
  auto json = nlohmann::ordered_json{{"name", atlas.name}, {"epoch", atlas.epoch}, {"num_bytes", num_bytes}};
  if (atlas.is_signed()) json["signed_with"] = HexOf(atlas.public_key);
  std::string maps_text;
  std::map<std::pair<int32_t, int32_t>, int> pairs;  // of maps, images of the first that look like the other
  for (const AtlasLookAlike& pair : atlas.look_alikes) ++pairs[{pair.image.map, pair.other.map}];
  for (const AtlasMap& map : atlas.maps) {
    size_t num_codes = 0;
    for (const auto& place : map.places) num_codes += place.size();
    num_map_bytes += map.num_bytes;
    json["maps"].push_back({{"name", map.name},
                            {"file", map.file},
                            {"num_bytes", map.num_bytes},
                            {"num_images", map.num_images},
                            {"num_codes", num_codes},
                            {"num_code_bytes", NumBytesOfPlaces(map.places)}});
    maps_text += fmt::format("{:>9}  {:>6}  {:>6}  {:>6}  {}  ({})\n", map.num_bytes, map.num_images,
                             num_codes, NumBytesOfPlaces(map.places), map.name, map.file);
  }
  std::string text =
      fmt::format("atlas {}: {} maps, {} bytes, {:.2f} % of theirs; {}\n{:>9}  {:>6}  {:>6}  {:>6}  map\n",
                  atlas.name, atlas.maps.size(), num_bytes,
                  100.0 * static_cast<double>(num_bytes) / static_cast<double>(num_map_bytes),
                  atlas.is_signed() ? "signed with key " + HexOf(atlas.public_key) : "not signed", "bytes",
                  "images", "codes", "bytes");
  text += maps_text;
  json["look_alikes"] = nlohmann::ordered_json::array();
  for (const auto& [maps, count] : pairs) {
    const std::string &first = atlas.maps[maps.first].name, &second = atlas.maps[maps.second].name;
    json["look_alikes"].push_back({{"map", first}, {"other", second}, {"num_images", count}});
    text += fmt::format("{} image{} of {} look like a place of {}\n", count, count == 1 ? "" : "s", first,
                        second);
  }
  json["passages"] = nlohmann::ordered_json::array();
  for (const AtlasPassage& passage : atlas.passages) {
    const std::string &from = atlas.maps[passage.from.map].name, &to = atlas.maps[passage.to.map].name;
    json["passages"].push_back({{"name", passage.name},
                                {"from", {{"map", from}, {"image_idx", passage.from.image}}},
                                {"to", {{"map", to}, {"image_idx", passage.to.image}}},
                                {"cost", passage.cost}});
    text += fmt::format("{} leads from {} to {}, cost {:g}\n", passage.name, from, to, passage.cost);
  }
  *environment.out << (as_json ? JsonText(json, 2) + "\n" : text);
  return Ok();
}

}  // namespace cairn::pipeline
