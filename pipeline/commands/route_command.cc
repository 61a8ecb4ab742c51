#include "pipeline/commands/commands.h"

#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "core/atlas/atlas_file.h"
#include "core/blocks/map_rows.h"
#include "core/geometry/floor_pose.h"
#include "pipeline/commands/in_atlas.h"
#include "pipeline/program/json_text.h"
#include "runtime/drive/route.h"
#include "runtime/map/map.h"

namespace cairn::pipeline {
namespace {

struct RouteArguments {
  std::string map_path;
  std::string from;
  std::string to;
  bool json = false;
  RouteOptions options;
  OptionArguments option_arguments;
};

Status RunRoute(const RouteArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  if (IsAtlasFile(arguments.map_path)) {
    return RouteInAtlas(arguments.map_path, arguments.from, arguments.to, arguments.options, arguments.json,
                        environment);
  }
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(arguments.map_path));
  CAIRN_ASSIGN_OR_RETURN(const int32_t from, FindImage(*map, arguments.from));
  CAIRN_ASSIGN_OR_RETURN(const int32_t to, FindImage(*map, arguments.to));
  CAIRN_ASSIGN_OR_RETURN(const Route route, PlanRoute(*map, from, to, arguments.options));
  const std::string unit = LengthUnit(map->head().frame);
  auto json = nlohmann::ordered_json{
      {"num_links", route.num_links}, {"cost", route.cost}, {"images", nlohmann::ordered_json::array()}};
  std::string text =
      fmt::format("{:>4}  {:>9} {:>9} {:>8}  {}\n", "", "x, " + unit, "y, " + unit, "heading", "image");
  for (const int32_t index : route.images) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map->Image(index));
    const FloorPose place = FloorPoseOf(image->cam_from_world, map->head().floor_from_world);
    text += fmt::format("{:>4}  {:>9.2f} {:>9.2f} {:>8.1f}  {}\n", json["images"].size(), place.position.x(),
                        place.position.y(), place.heading_deg, image->name);
    json["images"].push_back({{"name", image->name},
                              {"x_m", place.position.x()},
                              {"y_m", place.position.y()},
                              {"heading_deg", place.heading_deg}});
  }
  *environment.out << (arguments.json ? JsonText(json, 2) + "\n" : text);
  return Ok();
}

}  // namespace

Command RouteCommand() {
  auto arguments = std::make_shared<RouteArguments>();
  return {
      .name = "route",
      .summary = "List the images on the route from one survey image to another",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "Map, or an atlas of maps").Required().Type("MAP");
            parser.Add("from", arguments->from, "Survey image to start at; of an atlas MAP/IMAGE")
                .Required()
                .Type("IMAGE");
            parser.Add("to", arguments->to, "Survey image to go to, likewise").Required().Type("IMAGE");
            parser.AddFlag("--json", arguments->json, "Print JSON");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return RunRoute(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
