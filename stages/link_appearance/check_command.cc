#include <algorithm>
#include <optional>
#include <set>

#include "core/base/text.h"
#include "core/capture/capture.h"
#include "core/files/file.h"
#include "stages/link_appearance/check_appearance.h"
#include "stages/link_appearance/command.h"
#include "stages/link_appearance/contradicted_links.h"

namespace cairn::link_appearance {
namespace {

struct CheckArguments {
  std::string matches;
  std::string capture;
  std::string classes;
  std::string held_out;
  LinkAppearanceOptions options;
  CheckAppearanceOptions check_options;
  OptionArguments option_arguments;
};

// The options of link_appearance that choose links, nodes and sets: the other options of the stage's own set
// (its algorithm, cycles and bound) and those for places that look alike are not used by this check.
OptionTable LinkOptionsRead(LinkAppearanceOptions* options) {
  static const std::set<std::string> kRead = {"min_num_inliers",
                                              "max_link_distance_m",
                                              "max_link_turn_deg",
                                              "fuse",
                                              "same_place_m",
                                              "max_num_dropped",
                                              "num_dominators",
                                              "strong_num_inliers",
                                              "min_component_nodes",
                                              "num_kept",
                                              "num_tries"};
  OptionTable table = DescribeOptions(options);
  std::erase_if(table, [](const Option& option) { return !kRead.contains(option.name); });
  return table;
}

// Names, one per line, or from COLMAP's images.txt, where they end every line of ten words.
Result<std::vector<std::string>> ReadNames(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::vector<std::string> names;
  bool is_list = true;
  for (const std::string_view line : SplitLines(text)) {
    const std::string_view name = Trim(line);
    if (name.empty() || name[0] == '#') continue;
    is_list = is_list && SplitWords(name).size() < 10;
    names.emplace_back(name);
  }
  if (is_list) return names;
  std::vector<Reject> rejects;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<CaptureImage> images, ReadImagesText(path, &rejects));
  names.clear();
  for (const CaptureImage& image : images) names.push_back(image.name);
  for (const Reject& reject : rejects) names.push_back(reject.name);
  return names;
}

std::string Table(const AppearanceCheck& check) {
  const auto percent = [&](double num) { return 100 * num / check.num_left_out; };
  std::string text = fmt::format("{} left-out images, {} of them linked to any of {} nodes\n",
                                 check.num_left_out, check.num_linked, check.num_nodes);
  text += fmt::format("{:<20}{:>8}{:>9}{:>12}{:>12}{:>12}\n", "sets that dominate", "kept", "kept %",
                      "localized", "localized %", "random %");
  for (size_t i = 0; i < check.sets.size(); ++i) {
    const AppearanceFigure& figure = check.sets[i];
    text += fmt::format("{:<20}{:>8.1f}{:>9.1f}{:>12.0f}{:>12.1f}{:>12.1f}\n", check.set_names[i],
                        figure.num_kept, 100 * figure.num_kept / std::max(1, check.num_nodes),
                        figure.num_localized, percent(figure.num_localized), percent(figure.num_by_random));
  }
  text += fmt::format("{:<11}{:>9}", "kept", "kept %");
  for (const std::string& name : check.curve_names) text += fmt::format("{:>12}", name + " %");
  text += fmt::format("{:>12}\n", "random %");
  for (size_t s = 0; s < check.sizes.size(); ++s) {
    text +=
        fmt::format("{:<11}{:>9.1f}", check.sizes[s], 100.0 * check.sizes[s] / std::max(1, check.num_nodes));
    for (const auto& curve : check.curves) text += fmt::format("{:>12.1f}", percent(curve[s].num_localized));
    text += fmt::format("{:>12.1f}\n", percent(check.curves[0][s].num_by_random));
  }
  return text;
}

// Which images the set that is asked for loses, or, where none is, the improved one.
std::string MissedText(const AppearanceCheck& check) {
  constexpr size_t kMaxNumNames = 20;
  auto set_name = std::find(check.set_names.begin(), check.set_names.end(), "as asked");
  if (set_name == check.set_names.end())
    set_name = std::find(check.set_names.begin(), check.set_names.end(), "improved");
  if (set_name == check.set_names.end()) return "";
  const auto set = static_cast<size_t>(set_name - check.set_names.begin());
  if (check.missed[set].empty()) return "";
  const std::vector<std::string>& missed = check.missed[set];
  std::string text =
      fmt::format("linked, and not located by the set '{}': {}", check.set_names[set],
                  fmt::join(missed.begin(), missed.begin() + std::min(missed.size(), kMaxNumNames), ", "));
  if (missed.size() > kMaxNumNames) text += fmt::format(", {} more", missed.size() - kMaxNumNames);
  return text + "\n";
}

Status RunCheck(const CheckArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  const LinkAppearanceOptions& options = arguments.options;
  if (!arguments.capture.empty() && options.fuse != "place" && options.max_link_distance_m == 0 &&
      options.max_link_turn_deg == 180) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--capture {}: poses are used for --fuse place, --max-link-distance-m and "
                     "--max-link-turn-deg only; give one of them, or leave the capture out",
                     arguments.capture);
  }
  std::optional<Capture> capture;
  if (!arguments.capture.empty()) {
    CAIRN_ASSIGN_OR_RETURN(capture, ReadCapture(arguments.capture));
  }
  CAIRN_ASSIGN_OR_RETURN(ImageLinks images, ReadImageLinks(arguments.matches, options.min_num_inliers));
  if (!arguments.classes.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.classes));
    CAIRN_RETURN_IF_ERROR(TellLookAlikes(classes, arguments.matches, environment.progress, &images));
  }
  CAIRN_ASSIGN_OR_RETURN(images.links, NearLinks(images, capture ? &*capture : nullptr, options));
  HeldOutSplit split{.survey = images};
  if (!arguments.held_out.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<std::string> names, ReadNames(arguments.held_out));
    CAIRN_ASSIGN_OR_RETURN(split, HoldOut(images, names));
  }
  CAIRN_ASSIGN_OR_RETURN(
      const std::vector<NodeIdx> node_of_image,
      FuseImages(split.survey.images, options.fuse, options.same_place_m, capture ? &*capture : nullptr));
  const AppearanceGraph graph = FusedGraph(split.survey.links, node_of_image);
  std::vector<LeftOutImage> left_out;
  if (arguments.held_out.empty()) {
    left_out = EachNodeLeftOut(graph);
    for (size_t i = node_of_image.size(); i-- > 0;)
      left_out[node_of_image[i]].name = CapturedName(split.survey.images[i].name);
  } else {
    for (const std::vector<int>& linked : split.linked) {
      LeftOutImage& image = left_out.emplace_back();
      for (const int index : linked) image.linked.push_back(node_of_image[index]);
      std::sort(image.linked.begin(), image.linked.end());
      image.linked.erase(std::unique(image.linked.begin(), image.linked.end()), image.linked.end());
      image.name = split.names[left_out.size() - 1];
    }
  }
  CAIRN_ASSIGN_OR_RETURN(const AppearanceCheck check,
                         CheckAppearance(graph, left_out, options, arguments.check_options, environment.seed,
                                         environment.num_threads, *environment.progress));
  *environment.out << Table(check) << MissedText(check);
  return Ok();
}

}  // namespace

Command CheckAppearanceCommand() {
  const auto arguments = std::make_shared<CheckArguments>();
  // Sets are chosen once for each image that is left out.
  arguments->options.num_tries = 500;
  return {.name = "check-appearance",
          .summary = "Leave images out and count those that the kept ones still locate",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser.Add("matches", arguments->matches, "COLMAP database with verified matches")
                    .Required()
                    .Type("matches.db");
                parser
                    .Add("--capture", arguments->capture,
                         "Capture folder with the survey's poses, for fuse = place, max_link_distance_m "
                         "and max_link_turn_deg")
                    .Type("CAPTURE");
                parser
                    .Add("--classes", arguments->classes,
                         "feature classes of the survey: matches that contradict where the images stand "
                         "locate nothing [all matches count]")
                    .Type("classes.db");
                parser
                    .Add("--held-out", arguments->held_out,
                         "Images of the database that do not belong to the survey: names, folders (ending in "
                         "/) or queries.txt; these are left out together, instead of each image in turn")
                    .Type("FILE");
                OptionTable table = LinkOptionsRead(&arguments->options);
                for (Option& option : DescribeOptions(&arguments->check_options)) table.push_back(option);
                arguments->option_arguments.Add(parser, std::move(table));
              },
          .run = [arguments](
                     const CommandEnvironment& environment) { return RunCheck(*arguments, environment); }};
}

}  // namespace cairn::link_appearance
