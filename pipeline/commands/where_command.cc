#include "pipeline/commands/commands.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "core/blocks/map_rows.h"
#include "core/images/image_file.h"
#include "pipeline/commands/odometry.h"
#include "pipeline/commands/query_images.h"
#include "pipeline/program/json_text.h"
#include "runtime/drive/place_belief.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"

namespace cairn::pipeline {
namespace {

struct WhereArguments {
  std::string map_path;
  std::vector<std::string> images;
  std::string list_path;
  std::string camera;
  std::string cameras_path;
  std::string odometry_path;
  GravityArguments gravity;
  double period_s = 1;
  int num_places = 3;
  bool json = false;
  LocalizerOptions localizer_options;
  PlaceBeliefOptions options;
  OptionArguments option_arguments;
};

// What is believed after an image.
struct Step {
  std::string image;
  Localization found;
  std::vector<PlaceHypothesis> places;
  double elsewhere = 0;
};

nlohmann::ordered_json StepJson(const Step& step) {
  auto json = nlohmann::ordered_json{{"image", step.image}, {"fix", step.found.has_fix()}};
  if (step.found.has_fix()) {
    json["fix_probability"] = step.found.probability;
  } else {
    json["reason"] = NoFixName(step.found.reason);
  }
  json["places"] = nlohmann::ordered_json::array();
  for (const PlaceHypothesis& place : step.places)
    json["places"].push_back({{"image", place.name}, {"probability", place.probability}});
  json["elsewhere"] = step.elsewhere;
  return json;
}

std::string StepText(const Step& step, int number) {
  std::string text =
      fmt::format("{:>4}  {:<24} {:<18} {:>5.1f} %", number, step.image.substr(step.image.rfind('/') + 1),
                  step.found.has_fix() ? fmt::format("fix, P {:.2f}", step.found.probability)
                                       : NoFixName(step.found.reason),
                  100 * step.elsewhere);
  for (const PlaceHypothesis& place : step.places) {
    constexpr double kLeast = 0.0005;  // shown as 0.1 % or more
    if (place.probability >= kLeast)
      text += fmt::format("  {:>5.1f} % {}", 100 * place.probability, place.name);
  }
  return text + "\n";
}

// What the robot knows in the end, and what it should look at where it does not.
Result<std::string> Conclusion(const PlaceBelief& belief, const Step& last, const Map& map) {
  constexpr double kKnown = 0.95, kPossible = 0.05;
  if (last.elsewhere >= kKnown) return std::string("the map does not show where these images are from\n");
  if (last.places[0].probability >= kKnown)
    return fmt::format("at {} ({:.1f} %)\n", last.places[0].name, 100 * last.places[0].probability);
  std::string text = "not known:";
  for (const PlaceHypothesis& place : last.places) {
    if (place.probability >= kPossible)
      text += fmt::format(" {} ({:.0f} %),", place.name, 100 * place.probability);
  }
  text += fmt::format(" or elsewhere ({:.0f} %)\n", 100 * last.elsewhere);
  const int32_t telling = belief.NextTellingImage(last.places[0].image);
  if (telling >= 0 && telling != last.places[0].image) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(telling));
    text += fmt::format("what {} shows looks like no other place: from {} that would tell\n", image->name,
                        last.places[0].name);
  }
  return text;
}

Status RunWhere(const WhereArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_RETURN_IF_ERROR(CheckCameraArguments(arguments.camera, arguments.cameras_path));
  if (arguments.odometry_path.empty()) {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"way_sigma_ratio", "turn_sigma_ratio", "way_sigma_m", "turn_sigma_deg"},
        "is the error of odometry; give --odometry, or leave it out"));
  } else {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"reach_links"}, "is for images without odometry; leave it out"));
  }
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
      {"budget_ms", "core_speed"},
      "bounds the work of a fix, and a belief over places takes more; leave it out"));
  CAIRN_RETURN_IF_ERROR(arguments.gravity.Check(arguments.option_arguments,
                                                {"map_up_sigma_deg", "floor_up_sigma_deg", "max_up_sigmas"}));
  cv::setNumThreads(1);
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(arguments.map_path));
  CAIRN_ASSIGN_OR_RETURN(const CameraChoice cameras,
                         CameraChoice::Make(arguments.camera, arguments.cameras_path, map));
  CAIRN_ASSIGN_OR_RETURN(ImageNames names, ImageNames::Make(arguments.images, arguments.list_path));
  std::optional<Odometry> odometry;
  if (!arguments.odometry_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(odometry, Odometry::Read(arguments.odometry_path));
  }
  std::optional<Gravity> gravity;
  if (!arguments.gravity.path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(gravity, Gravity::Read(arguments.gravity));
  }
  CAIRN_ASSIGN_OR_RETURN(PlaceBelief belief, PlaceBelief::Make(map, arguments.options));
  const Localizer localizer(map, arguments.localizer_options);
  std::optional<Step> last;
  int number = 0;
  if (!arguments.json)
    *environment.out << fmt::format("{:>4}  {:<24} {:<18} {:>7}  places\n", "", "image", "by itself", "none");
  for (std::vector<std::string> next; !(next = names.Next(1)).empty();) {
    const std::string& image = next.front();
    if (odometry) {
      CAIRN_RETURN_IF_ERROR(
          odometry->MoveToNext(image, [&](const Eigen::Vector2d& way_m, double turn_left_rad) {
            return belief.Move(way_m, turn_left_rad);
          }));
    }
    std::optional<SensedUp> up;
    if (gravity) {
      CAIRN_ASSIGN_OR_RETURN(up, gravity->Next(image));
      CAIRN_RETURN_IF_ERROR(belief.SenseUp(up->direction, up->sigma_deg));
    }
    CAIRN_RETURN_IF_ERROR(belief.Elapse(arguments.period_s));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera camera, cameras.ForImage(grey.cols, grey.rows));
    CAIRN_ASSIGN_OR_RETURN(Query query, localizer.QueryFromImage(grey, camera));
    if (up) CAIRN_RETURN_IF_ERROR(localizer.SetUp(*up, &query));
    Step step{.image = image};
    CAIRN_ASSIGN_OR_RETURN(step.found, localizer.LocalizeQuery(query, std::nullopt));
    CAIRN_RETURN_IF_ERROR(belief.See(query, step.found));
    CAIRN_ASSIGN_OR_RETURN(step.places, belief.Hypotheses(arguments.num_places));
    step.elsewhere = belief.elsewhere();
    ++number;
    *environment.out << (arguments.json ? JsonText(StepJson(step)) + "\n" : StepText(step, number))
                     << std::flush;
    last = std::move(step);
    if (environment.progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "looking was stopped");
  }
  if (last && !arguments.json) {
    CAIRN_ASSIGN_OR_RETURN(const std::string conclusion, Conclusion(belief, *last, *map));
    *environment.out << conclusion;
  }
  if (gravity) CAIRN_RETURN_IF_ERROR(gravity->CheckAllRead());
  return odometry ? odometry->CheckAllRead() : Ok();
}

}  // namespace

Command WhereCommand() {
  auto arguments = std::make_shared<WhereArguments>();
  return {
      .name = "where",
      .summary = "Say which places a sequence of images may be of, and how probably",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "Map").Required().Type("MAP");
            parser
                .Add("images", arguments->images,
                     "Image files in the order of time; '-' reads names from stdin")
                .Type("IMAGE");
            parser.Add("--list", arguments->list_path, "File with an image's name per line").Type("FILE");
            parser.Add("--camera", arguments->camera, "Camera of the images [the map's camera of that size]")
                .Type("MODEL,W,H,P...");
            parser.Add("--cameras", arguments->cameras_path, "cameras.txt; chosen by image size")
                .Type("FILE");
            parser
                .Add("--odometry", arguments->odometry_path,
                     "A line for each image, how the robot drove since the one before: metres ahead, metres "
                     "to "
                     "the left, degrees turned to the left; without it: along what the survey's images show "
                     "in "
                     "common")
                .Type("FILE");
            arguments->gravity.Add(parser,
                                   "A line for each image, which way is up in the camera's frame: to the "
                                   "right, down and ahead (of "
                                   "a level camera 0 -1 0); poses that say otherwise are refuted");
            parser.Add("--period", arguments->period_s, "Seconds from image to image [1]")
                .Range(0.0, 1e6)
                .Type("S");
            parser.Add("--places", arguments->num_places, "Most places to name, the likeliest first [3]")
                .Range(1, 1000)
                .Type("N");
            parser.AddFlag("--json", arguments->json, "JSON lines");
            OptionTable options = DescribeOptions(&arguments->options);
            for (const Option& option : DescribeOptions(&arguments->localizer_options))
              options.push_back(option);
            arguments->option_arguments.Add(
                parser, options,
                {"elsewhere_ratio", "leave_ratio", "return_ratio", "kidnapped_ratio", "reach_links"});
          },
      .run = [arguments](const CommandEnvironment& environment) { return RunWhere(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
