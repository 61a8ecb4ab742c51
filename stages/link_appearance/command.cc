#include "stages/link_appearance/command.h"

#include <optional>

#include "core/capture/capture.h"
#include "core/files/file.h"
#include "core/line/memory.h"
#include "core/promise/view_distance.h"
#include "core/world/appearance.h"
#include "core/world/feature_class.h"
#include "stages/link_appearance/contradicted_links.h"
#include "stages/link_appearance/link_appearance.h"
#include "stages/link_appearance/picture.h"

namespace cairn::link_appearance {
namespace {

// Bytes per pair: links as read, those of the survey, fused ones, and the graph's in both directions.
constexpr int64_t kMemoryPerPair = 96;

struct Arguments {
  std::string matches;
  std::string vocabulary;
  std::string capture;
  std::string classes;
  std::string output;
  std::string svg;
  LinkAppearanceOptions options;
  OptionArguments option_arguments;
};

// "25 of 234 nodes kept (10.7 %), at least 20 are needed"
std::string KeptText(const LinkAppearanceResult& result) {
  const Appearance& appearance = result.appearance;
  const size_t num_kept = appearance.Kept().size();
  std::string text =
      fmt::format("{} of {} nodes kept ({:.1f} %)", num_kept, appearance.nodes.size(),
                  100.0 * static_cast<double>(num_kept) / static_cast<double>(appearance.nodes.size()));
  if (result.num_greedy > 0) text += fmt::format(", {} before local search", result.num_greedy);
  if (const int bound = appearance.LowerBound(); bound > 0) {
    text += fmt::format(", at least {} are needed", bound);
  }
  return text;
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  if (arguments.vocabulary.empty()) {
    AmbiguityOptions of_ambiguity;
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        NamesOf(DescribeOptions(&of_ambiguity)),
        "places are compared by the words of vocabulary.db; give --vocabulary, or leave this out"));
  }
  std::optional<Capture> capture;
  if (!arguments.capture.empty()) {
    CAIRN_ASSIGN_OR_RETURN(capture, ReadCapture(arguments.capture));
  }
  CAIRN_ASSIGN_OR_RETURN(const int64_t num_pairs, CountPairs(arguments.matches));
  CAIRN_RETURN_IF_ERROR(CheckMemory(fmt::format("linking the {} pairs of {}", num_pairs, arguments.matches),
                                    num_pairs * kMemoryPerPair, environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(ImageLinks images,
                         ReadImageLinks(arguments.matches, arguments.options.min_num_inliers));
  if (capture) images = SurveyImagesOf(*capture, images);
  AmbiguityOptions ambiguity = arguments.options.ambiguity;
  if (!arguments.classes.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.classes));
    CAIRN_RETURN_IF_ERROR(TellLookAlikes(classes, arguments.matches, environment.progress, &images));
    // A survey without scale: its own measure of what is near.
    if (capture && capture->frame && !IsMetric(*capture->frame))
      ambiguity.confusable_distance_m = ViewDistance(classes, {}).depth();
  }
  CAIRN_ASSIGN_OR_RETURN(LinkAppearanceResult result,
                         LinkAppearance(images, capture ? &*capture : nullptr, arguments.options,
                                        environment.seed, environment.progress));
  const Appearance& appearance = result.appearance;
  const std::vector<std::optional<FloorPose>> places =
      capture ? NodePlaces(appearance, images.images, *capture) : std::vector<std::optional<FloorPose>>();
  if (!arguments.vocabulary.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Vocabulary vocabulary, ReadVocabulary(arguments.vocabulary));
    CAIRN_RETURN_IF_ERROR(FindAmbiguity(vocabulary, places, ambiguity, environment.num_threads,
                                        environment.progress, &result.appearance, &result.look_alikes));
  }
  CAIRN_RETURN_IF_ERROR(WriteAppearance(appearance, arguments.output));
  if (!arguments.svg.empty()) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
        arguments.svg, DrawAppearance(appearance, NodeNames(appearance, images.images), places)));
  }
  environment.report->in = {{"images", static_cast<int64_t>(images.images.size())},
                            {"pairs", static_cast<int64_t>(images.links.size())}};
  environment.report->out = {{"nodes", appearance.graph.num_nodes()},
                             {"links", appearance.graph.num_links()},
                             {"kept images", static_cast<int64_t>(appearance.KeptImages().size())}};
  *environment.out << fmt::format("link_appearance: {} images, {} nodes, {} links, {} components\n",
                                  images.images.size(), appearance.graph.num_nodes(),
                                  appearance.graph.num_links(), appearance.NumComponents());
  if (!images.look_alikes.empty()) {
    *environment.out << fmt::format(
        "link_appearance: {} pairs more match and only look alike: their matches contradict where the images "
        "stand\n",
        images.look_alikes.size());
  }
  *environment.out << fmt::format("link_appearance: {}\n", KeptText(result));
  for (const std::string& note : result.notes) *environment.out << fmt::format("link_appearance: {}\n", note);
  return Ok();
}

}  // namespace

Command LinkAppearanceCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {
      .name = "link-appearance",
      .summary = "Link images that see the same and keep the fewest that locate the robot (stage 7)",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("matches", arguments->matches, "COLMAP database with verified matches")
                .Required()
                .Type("matches.db");
            parser
                .Add("vocabulary", arguments->vocabulary,
                     "visual words, to find places that look alike [not searched]")
                .Type("vocabulary.db");
            parser
                .Add("--capture", arguments->capture,
                     "Capture folder: only images of its survey are used, and its poses are used for fuse = "
                     "place, max_link_distance_m, max_link_turn_deg and the picture [all images]")
                .Type("CAPTURE");
            parser
                .Add("--classes", arguments->classes,
                     "feature classes of the survey: matches that contradict where the images stand join "
                     "places that look alike, and lead nowhere [all matches lead]")
                .Type("classes.db");
            parser.Add("-o,--output", arguments->output, "File to write").Required().Type("appearance.db");
            parser
                .Add("--svg", arguments->svg,
                     "also draw the graph as SVG: over the floor, or without poses as a matrix")
                .Type("FILE.svg");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); }};
}

}  // namespace cairn::link_appearance
