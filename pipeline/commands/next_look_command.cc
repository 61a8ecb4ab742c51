#include "pipeline/commands/commands.h"

#include <algorithm>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "pipeline/commands/path_json.h"
#include "pipeline/program/json_text.h"
#include "runtime/looks/next_look.h"
#include "runtime/looks/surveyed_looks.h"
#include "runtime/map/map.h"
#include "runtime/map/open_views.h"
#include "stages/decompose_views/picture.h"

namespace cairn::pipeline {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using Vec2 = Eigen::Vector2d;

constexpr int kMaxNumDrawnLooks = 6;

struct NextLookArguments {
  std::string plan;
  std::string places;
  std::optional<std::string> scan;  // otherwise the last line
  bool camera = false;
  std::vector<double> laser;  // empty: at the camera
  std::string svg;
  NextLookOptions options;
  OptionArguments option_arguments;
};

// Of a line of `cairn plan locate` ("solutions") or `cairn plan follow` ("places").
Result<std::vector<PossiblePlace>> ParsePlaces(const json& line, const std::string& where) {
  const char* key = line.contains("solutions") ? "solutions" : "places";
  const auto list = line.find(key);
  const auto fault = [&](const std::string& what) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {}; expected a line of cairn plan locate or follow",
                     where, what);
  };
  if (list == line.end() || !list->is_array()) return fault("no list of \"solutions\" or \"places\"");
  std::vector<PossiblePlace> places;
  for (const json& entry : *list) {
    const auto number = [&](const char* name) -> std::optional<double> {
      if (!entry.is_object()) return std::nullopt;
      const auto value = entry.find(name);
      if (value == entry.end() || !value->is_number()) return std::nullopt;
      return value->get<double>();
    };
    const auto x = number("x"), y = number("y"), heading_deg = number("heading_deg"),
               probability = number("probability");
    if (!x || !y || !heading_deg || !probability)
      return fault(fmt::format("{}[{}] lacks one of the numbers x, y, heading_deg and probability", key,
                               places.size()));
    PossiblePlace place;
    place.pose = {{*x, *y}, WrapAngle(RadFromDeg(*heading_deg))};
    place.probability = *probability;
    const auto covariance = entry.find("covariance");
    if (covariance != entry.end()) {
      if (!covariance->is_array() || covariance->size() != 9 ||
          !std::all_of(covariance->begin(), covariance->end(),
                       [](const json& value) { return value.is_number(); }))
        return fault(fmt::format("{}[{}]: its covariance has not 9 numbers", key, places.size()));
      for (int i = 0; i < 9; ++i) place.covariance(i / 3, i % 3) = (*covariance)[i].get<double>();
    }
    places.push_back(place);
  }
  return places;
}

// Of the chosen scan, or of the last line.  Errors: those of ReadFile; InvalidArgument.
Result<std::vector<PossiblePlace>> ReadPlaces(const NextLookArguments& arguments) {
  int64_t wanted = 0;
  if (arguments.scan && !ParseNumber(*arguments.scan, &wanted)) {
    return MakeError(ErrorCode::kInvalidArgument, "--scan '{}': expected the number of a scan, from 0",
                     *arguments.scan);
  }
  std::string text;
  if (arguments.places == "-") {
    text.assign(std::istreambuf_iterator<char>(std::cin), {});
  } else {
    CAIRN_ASSIGN_OR_RETURN(text, ReadFile(arguments.places));
  }
  const std::string file = arguments.places == "-" ? "standard input" : arguments.places;
  std::optional<json> chosen;
  std::string where;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    if (Trim(line).empty()) continue;
    json parsed = json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (!parsed.is_object()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}:{}: no JSON object; expected lines of cairn plan locate or follow", file, number);
    }
    if (arguments.scan) {
      const auto scan = parsed.find("scan");
      if (scan == parsed.end() || !scan->is_number_integer() || scan->get<int64_t>() != wanted) continue;
    }
    chosen = std::move(parsed);
    where = fmt::format("{}:{}", file, number);
  }
  if (!chosen) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {}", file,
                     arguments.scan ? fmt::format("no line of scan {}", *arguments.scan)
                                    : "no line; expected those of cairn plan locate or follow");
  }
  return ParsePlaces(*chosen, where);
}

const char* OutcomeName(NextLookOutcome outcome) {
  switch (outcome) {
    case NextLookOutcome::kFound:
      return "found";
    case NextLookOutcome::kAlike:
      return "alike";
    case NextLookOutcome::kOutOfReach:
      return "out_of_reach";
    case NextLookOutcome::kOnePlace:
      return "one_place";
  }
  return "";
}

std::vector<Vec2> PathAt(const NextLook& next, const PlanarPose& pose) {
  std::vector<Vec2> path;
  for (const Vec2& point : next.path) path.push_back(pose.FloorFromRobot(point));
  return path;
}

ordered_json LookJson(const NextLook& next) {
  ordered_json places = ordered_json::array();
  for (size_t i = 0; i < next.places.size(); ++i) {
    const PossiblePlace& place = next.places[i];
    ordered_json entry = {{"of", next.hypotheses[i]},
                          {"x", place.pose.position.x()},
                          {"y", place.pose.position.y()},
                          {"heading_deg", DegFromRad(place.pose.heading_rad)},
                          {"probability", place.probability}};
    if (next.outcome == NextLookOutcome::kFound) {
      entry["path"] = PathJson(PathAt(next, place.pose));
      entry["left"] = next.left[i];
    }
    places.push_back(std::move(entry));
  }
  ordered_json line = {{"outcome", OutcomeName(next.outcome)}};
  if (next.outcome == NextLookOutcome::kFound) {
    line["path"] = PathJson(next.path);
    line["heading_deg"] = DegFromRad(next.heading_rad);
    line["length_m"] = next.length_m;
    line["expected_length_m"] = next.expected_length_m;
  }
  line["alike"] = next.alike;
  line["looks"] = next.num_looks;
  line["places"] = std::move(places);
  return line;
}

std::string Drawn(const Views& views, const NextLook& next) {
  decompose_views::ViewsOverlay overlay;
  for (size_t i = 0; i < next.places.size() && i < kMaxNumDrawnLooks; ++i) {
    const PossiblePlace& place = next.places[i];
    overlay.robots.push_back({place.pose.position, place.pose.heading_rad,
                              fmt::format("{}: {:.0f} %", i + 1, 100 * place.probability)});
    if (next.path.size() > 1) overlay.paths.push_back(PathAt(next, place.pose));
  }
  overlay.captions = {fmt::format("{} places", next.places.size())};
  switch (next.outcome) {
    case NextLookOutcome::kFound:
      overlay.captions.push_back(next.path.size() > 1
                                     ? fmt::format("next look after {:.1f} m", next.length_m)
                                     : fmt::format("turn by {:.0f} degrees", DegFromRad(next.heading_rad)));
      overlay.captions.push_back(
          fmt::format("one is left after {:.1f} m, on average", next.expected_length_m));
      break;
    case NextLookOutcome::kAlike:
      overlay.captions.push_back("nothing tells them apart");
      break;
    case NextLookOutcome::kOutOfReach:
      overlay.captions.push_back("nothing within reach tells them apart");
      break;
    case NextLookOutcome::kOnePlace:
      overlay.captions.push_back("nothing to tell apart");
      break;
  }
  return decompose_views::DrawViews(views, overlay, /*regions=*/false);
}

Status RunNextLook(const NextLookArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  if (!arguments.camera && !arguments.laser.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--laser-in-camera is of a robot with a camera; say so with --camera");
  }
  CAIRN_ASSIGN_OR_RETURN(const std::vector<PossiblePlace> places, ReadPlaces(arguments));
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Views> views, OpenPlan(arguments.plan));
  std::optional<SurveyedLooks> images;
  if (arguments.camera) {
    const auto map = Map::Open(arguments.plan);
    if (!map.ok())
      return MakeError(map.error().code, "--camera needs a map with images: {}", map.error().message);
    PlanarPose robot_in_camera;
    if (!arguments.laser.empty())
      robot_in_camera = {{arguments.laser[0], arguments.laser[1]}, RadFromDeg(arguments.laser[2])};
    CAIRN_ASSIGN_OR_RETURN(images, SurveyedLooks::Make(**map, robot_in_camera));
  }
  CAIRN_ASSIGN_OR_RETURN(const NextLook next,
                         PlanNextLook(PlanSpace(*views), places, images ? &*images : nullptr,
                                      arguments.options, environment.num_threads));
  *environment.out << JsonText(LookJson(next)) << "\n";
  environment.report->in = {{"places", std::ssize(next.places)}};
  environment.report->out = {{"looks compared", next.num_looks}};
  if (!arguments.svg.empty()) CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.svg, Drawn(*views, next)));
  if (next.outcome != NextLookOutcome::kOutOfReach) return Ok();
  return MakeError(ErrorCode::kFailed,
                   "gave up: no look within {:g} m tells any two of {} places apart, and there are places "
                   "farther away; allow more with --reach-m",
                   arguments.options.reach_m, next.places.size());
}

}  // namespace

Command NextLookCommand() {
  auto arguments = std::make_shared<NextLookArguments>();
  Command command;
  command.name = "next-look";
  command.summary = "Plan where to look next to tell which of several places is the right one";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("plan", arguments->plan, "the plan (views.db, or a map that has it)").Required().Type("FILE");
    parser
        .Add("places", arguments->places,
             "what `cairn plan locate` or `cairn plan follow` printed; -: standard input")
        .Required()
        .Type("FILE");
    parser.Add("--scan", arguments->scan, "the line of this scan [the last line]").Type("INT");
    parser.AddFlag(
        "--camera", arguments->camera,
        "the robot also has a camera, like the survey's: count on what images of the map would tell");
    parser
        .Add("--laser-in-camera", arguments->laser,
             "where the laser is: metres ahead and to the left of the camera, degrees to the left")
        .Values(3)
        .SeparatedByCommas()
        .Type("X,Y,DEG");
    parser.Add("--svg", arguments->svg, "also draw it").Type("FILE.svg");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) {
    return RunNextLook(*arguments, environment);
  };
  return command;
}

}  // namespace cairn::pipeline
