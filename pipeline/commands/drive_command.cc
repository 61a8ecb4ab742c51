#include "pipeline/commands/commands.h"

#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/blocks/map_rows.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "pipeline/program/json_text.h"
#include "runtime/drive/place_model.h"
#include "runtime/drive/route.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/map.h"
#include "sim/render/building.h"
#include "sim/robot/robot_drive.h"
#include "sim/survey/survey.h"
#include "stages/simulate/read_recipe.h"

namespace cairn::pipeline {
namespace {

struct DriveArguments {
  std::string map_path, building_path, start, goal, kidnap;
  std::string output_path, picture_path;
  sim::RobotDriveOptions options;
  OptionArguments option_arguments;
};

// "x,y,heading": metres, metres, degrees.
Result<PlanarPose> ParsePose(const std::string& text, const char* option) {
  const auto numbers = ParseNumbers(text);
  if (!numbers || numbers->size() != 3) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} {}: expected X,Y,HEADING in metres and degrees, as in 1.5,0.8,90", option, text);
  }
  return PlanarPose{{(*numbers)[0], (*numbers)[1]}, WrapAngle(RadFromDeg((*numbers)[2]))};
}

// "LEG:x,y,heading"; nothing for an empty text.
Result<std::optional<sim::Kidnapping>> ParseKidnapping(const std::string& text) {
  if (text.empty()) return std::optional<sim::Kidnapping>();
  sim::Kidnapping kidnapping;
  const size_t colon = text.find(':');
  if (colon == std::string::npos || !ParseNumber(text.substr(0, colon), &kidnapping.before_leg) ||
      kidnapping.before_leg < 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--kidnap {}: expected STEP:X,Y,HEADING, as in 3:1.5,0.8,90", text);
  }
  CAIRN_ASSIGN_OR_RETURN(kidnapping.pose, ParsePose(text.substr(colon + 1), "--kidnap"));
  return std::optional<sim::Kidnapping>(kidnapping);
}

nlohmann::ordered_json PoseJson(const PlanarPose& pose) {
  return {
      {"x_m", pose.position.x()}, {"y_m", pose.position.y()}, {"heading_deg", DegFromRad(pose.heading_rad)}};
}

nlohmann::ordered_json LegJson(const sim::DriveLeg& leg) {
  nlohmann::ordered_json json = {{"kind", leg.kind},
                                 {"node", leg.node},
                                 {"target", PoseJson(leg.target)},
                                 {"pose", PoseJson(leg.pose)},
                                 {"arrived", leg.arrived},
                                 {"why", leg.why},
                                 {"verdict", leg.verdict},
                                 {"followed", leg.followed},
                                 {"hypotheses", nlohmann::ordered_json::array()},
                                 {"steps", nlohmann::ordered_json::array()}};
  for (const sim::DriveHypothesis& hypothesis : leg.hypotheses) {
    json["hypotheses"].push_back({{"start", hypothesis.start},
                                  {"start_pose", PoseJson(hypothesis.start_pose)},
                                  {"posterior", hypothesis.posterior},
                                  {"path", hypothesis.path}});
  }
  for (const sim::RobotStep& step : leg.steps) {
    json["steps"].push_back({{"pose", PoseJson(step.pose)},
                             {"speed_m_s", step.command.speed_m_s},
                             {"turn_deg_s", DegFromRad(step.command.turn_rad_s)},
                             {"state", ServoStateName(step.command.state)},
                             {"num_matches", step.command.num_matches}});
  }
  return json;
}

nlohmann::ordered_json DriveJson(const sim::RobotDrive& drive, const std::string& goal_name) {
  nlohmann::ordered_json json = {{"reached", !drive.error.has_value()},
                                 {"error", drive.error ? drive.error->message : std::string()},
                                 {"goal_image", goal_name},
                                 {"start", PoseJson(drive.start)},
                                 {"goal", PoseJson(drive.goal)},
                                 {"goal_error_m", drive.goal_error_m},
                                 {"goal_error_deg", drive.goal_error_deg},
                                 {"way_m", drive.way_m},
                                 {"num_switches", drive.num_switches},
                                 {"num_relocalizations", drive.num_relocalizations},
                                 {"legs", nlohmann::ordered_json::array()}};
  for (const sim::DriveLeg& leg : drive.legs) json["legs"].push_back(LegJson(leg));
  return json;
}

void Print(const sim::RobotDrive& drive, std::ostream* out) {
  for (const sim::DriveLeg& leg : drive.legs) {
    std::string posteriors;
    for (size_t i = 0; i < leg.hypotheses.size(); ++i) {
      posteriors += fmt::format(" {}{}:{:.3f}", static_cast<int>(i) == leg.followed ? "*" : "",
                                leg.hypotheses[i].start, leg.hypotheses[i].posterior);
    }
    *out << fmt::format(
        "{:<10} {:>5}  at {:>6.2f} {:>6.2f} {:>7.1f}  {:>3} steps  {}{}{}\n", leg.kind, leg.node,
        leg.pose.position.x(), leg.pose.position.y(), DegFromRad(leg.pose.heading_rad), leg.steps.size(),
        leg.verdict.empty() ? leg.why : leg.verdict, posteriors.empty() ? "" : " ", posteriors);
  }
  *out << fmt::format("{}: {:.2f} m and {:.1f} degrees from the goal, after {:.1f} m\n",
                      drive.error ? "stopped" : "arrived", drive.goal_error_m, drive.goal_error_deg,
                      drive.way_m);
}

Status RunDrive(const DriveArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const PlanarPose start, ParsePose(arguments.start, "--start"));
  CAIRN_ASSIGN_OR_RETURN(const auto kidnapping, ParseKidnapping(arguments.kidnap));
  sim::SimulateOptions simulate;
  uint64_t building_seed = 0;
  CAIRN_RETURN_IF_ERROR(simulate::ReadSimulateRecipe(arguments.building_path, &simulate, &building_seed));
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(arguments.map_path));
  CAIRN_ASSIGN_OR_RETURN(const int32_t goal, FindImage(*map, arguments.goal));
  CAIRN_ASSIGN_OR_RETURN(const PlaceModel model, PlaceModel::Make(*map));
  CAIRN_ASSIGN_OR_RETURN(const sim::Building building,
                         sim::MakeBuilding(simulate, building_seed, environment.num_threads));
  CAIRN_ASSIGN_OR_RETURN(
      const sim::RobotDrive drive,
      sim::DriveToImage(*map, model, building, sim::MakeQueryCamera(simulate), simulate.camera_height_m,
                        start, goal, kidnapping, arguments.options, environment.seed));
  Print(drive, environment.out);
  if (!arguments.output_path.empty()) {
    CAIRN_RETURN_IF_ERROR(
        WriteFileAtomically(arguments.output_path, JsonText(DriveJson(drive, arguments.goal), 1) + "\n"));
  }
  if (!arguments.picture_path.empty()) {
    std::vector<PlanarPose> node_poses;
    for (const std::vector<int32_t>& images : model.appearance().node_images) {
      CAIRN_ASSIGN_OR_RETURN(const auto image, map->Image(images.front()));
      node_poses.push_back(sim::PlanarPoseOf(image->cam_from_world));
    }
    CAIRN_RETURN_IF_ERROR(
        WriteFileAtomically(arguments.picture_path, sim::DriveSvg(drive, building, node_poses)));
  }
  if (drive.error) return *drive.error;
  return Ok();
}

}  // namespace

Command DriveCommand() {
  auto arguments = std::make_shared<DriveArguments>();
  return {
      .name = "drive",
      .summary = "Drive a robot that does not know where it is to a survey image, in simulation",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "Map, with an appearance graph and words = \"survey\"")
                .Required()
                .Type("MAP");
            parser
                .Add("--building", arguments->building_path,
                     "Recipe whose [simulate] table the map's survey was rendered from")
                .Required()
                .Type("RECIPE");
            parser.Add("--start", arguments->start, "Where the robot starts: X,Y,HEADING (m, m, degrees)")
                .Required()
                .Type("POSE");
            parser.Add("--goal", arguments->goal, "Survey image to go to").Required().Type("IMAGE");
            parser
                .Add("--kidnap", arguments->kidnap,
                     "STEP:X,Y,HEADING: move the robot there before it goes to its STEP-th image, counted "
                     "from 0")
                .Type("STEP:POSE");
            parser.Add("-o,--output", arguments->output_path, "JSON file to write: every step")
                .Type("RUN.json");
            parser.Add("--svg", arguments->picture_path, "SVG file to write").Type("RUN.svg");
            arguments->option_arguments.Add(
                parser, DescribeOptions(&arguments->options),
                {"max_num_legs", "servo", "radius_m", "max_speed_m_s", "max_turn_deg_s", "light_ratio",
                 "image_gain", "image_noise", "exposure_s", "slip_ratio", "on_switch", "weight"});
          },
      .run = [arguments](const CommandEnvironment& environment) { return RunDrive(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
