#include "stages/match_features/command.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include <spdlog/spdlog.h>

#include "core/files/disk_space.h"
#include "core/line/memory.h"
#include "core/line/reuse_arguments.h"
#include "stages/match_features/match_features.h"

namespace cairn::match_features {
namespace {

namespace fs = std::filesystem;

// Size of matches.db over that of features.db, which it contains a copy of.
constexpr double kMatchesPerFeaturesBytes = 1.25;

struct Arguments {
  bool no_space_check = false;
  MatchFeaturesInputs inputs;
  std::string capture;
  std::string output;
  MatchFeaturesOptions options;
  OptionArguments option_arguments;
  ReuseArguments reuse;
  PlanOptions plan;
};

void PrintPlan(const MatchFeaturesSummary& summary, const PlanOptions& plan, std::ostream& out) {
  const int num_shards = summary.num_shards_with_work;
  const std::string what = summary.image_step.empty()
                               ? fmt::format("round {} of pairs ({})", summary.num_rounds, summary.pairs)
                               : summary.image_step + " of images";
  out << fmt::format("match_features: plan for {} shards: {}: ", plan.num_shards, what)
      << (num_shards == 0 ? "too little left to be divided\n"
                          : fmt::format("{} left to {} of them\n", summary.num_left_to_others, num_shards));
}

void Print(const MatchFeaturesSummary& summary, const ReuseOptions& reuse, std::ostream& out) {
  if (!reuse.shard) {
    out << fmt::format(
        "match_features: {} images, {} pairs tried ({}), {} verified, {} of {} matches, {} taken over\n",
        summary.num_images, summary.num_pairs_tried, summary.pairs, summary.num_pairs_verified,
        summary.num_inliers, summary.num_putative, summary.num_taken_over);
    return;
  }
  const std::string shard = fmt::format("shard {}/{}", reuse.shard->index, reuse.shard->count);
  if (!summary.image_step.empty()) {
    out << fmt::format("match_features: {}: {} of {} images, {} taken over; {} left to other shards\n", shard,
                       summary.image_step, summary.num_image_results, summary.num_taken_over,
                       summary.num_left_to_others);
    return;
  }
  if (summary.num_pairs_tried + summary.num_left_to_others == 0) {
    out << fmt::format("match_features: {}: nothing to do, all pairs ({}) are known\n", shard, summary.pairs);
    return;
  }
  const std::string round = summary.num_rounds > 0 ? fmt::format("round {} of ", summary.num_rounds) : "";
  out << fmt::format(
      "match_features: {}: {}pairs ({}): {} tried, {} verified, {} taken over; {} left to other "
      "shards\n",
      shard, round, summary.pairs, summary.num_pairs_tried, summary.num_pairs_verified,
      summary.num_taken_over, summary.num_left_to_others);
}

// Refuses arguments for choosing pairs that are not used.
Status CheckWhatChoosesPairs(const Arguments& arguments) {
  const bool is_listed = !arguments.inputs.pair_list_path.empty();
  if (is_listed) {
    MatchFeaturesOptions options;
    std::vector<std::string> names = NamesOf(DescribeOptions(&options));
    MatchPairsOptions of_pairs;
    const std::vector<std::string> for_pairs = NamesOf(DescribeOptions(&of_pairs));
    std::erase_if(names, [&](const std::string& name) {
      return std::find(for_pairs.begin(), for_pairs.end(), name) != for_pairs.end();
    });
    CAIRN_RETURN_IF_ERROR(
        arguments.option_arguments.RefuseGiven(names, "--pair-list gives the pairs; leave one of them out"));
  }
  const std::string& pairs = arguments.options.pairs;
  const bool reads_words = !is_listed && (pairs == "auto" || pairs == "retrieval" || pairs == "sequence");
  if (reads_words || arguments.inputs.vocabulary_path.empty()) return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "--vocabulary {}: words are used for --pairs retrieval, sequence or auto only, and {}; leave it out",
      arguments.inputs.vocabulary_path,
      is_listed ? "the pairs are those of --pair-list" : "--pairs is " + pairs);
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const ReuseOptions reuse,
                         arguments.reuse.Apply(arguments.output, arguments.plan.num_shards > 0));
  CAIRN_RETURN_IF_ERROR(CheckWhatChoosesPairs(arguments));
  if (!arguments.inputs.plan_path.empty() && !reuse.shard) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--planned {}: a plan is for shards; say which one this is with --shard I/N",
                     arguments.inputs.plan_path);
  }
  std::optional<Capture> capture;
  if (!arguments.capture.empty()) {
    CAIRN_ASSIGN_OR_RETURN(capture, ReadCapture(arguments.capture));
  }
  MatchFeaturesInputs inputs = arguments.inputs;
  MatchFeaturesOptions options = arguments.options;
  CAIRN_RETURN_IF_ERROR(CheckMemory("matching two images", 0, environment.memory_mib));
  int& budget_mib = options.matching.memory_budget_mib;
  const auto share_mib = static_cast<int>(std::min<int64_t>(environment.memory_mib * 3 / 4, 1 << 24));
  budget_mib = std::max(1, environment.memory_given ? share_mib : std::min(share_mib, budget_mib));
  if (capture) inputs.capture = &*capture;
  std::error_code error;  // the stage reports a missing file
  const auto features_bytes = static_cast<double>(fs::file_size(inputs.features_path, error));
  const bool is_plan = arguments.plan.num_shards > 0;
  if (!arguments.no_space_check && !error && !is_plan) {
    CAIRN_RETURN_IF_ERROR(CheckDiskSpace("a copy of the features with matches",
                                         fs::absolute(arguments.output).parent_path(),
                                         static_cast<int64_t>(kMatchesPerFeaturesBytes * features_bytes)));
  }
  CAIRN_ASSIGN_OR_RETURN(const MatchFeaturesSummary summary,
                         is_plan
                             ? PlanShards(inputs, options, arguments.plan, arguments.output, environment.seed,
                                          environment.num_threads, *environment.progress, reuse)
                             : MatchFeatures(inputs, options, arguments.output, environment.seed,
                                             environment.num_threads, *environment.progress, reuse));
  for (const std::string& message : summary.not_reused) spdlog::debug("nothing taken over: {}", message);
  if (summary.num_without_features > 0) {
    spdlog::warn("{}: {} of {} images without features are skipped", inputs.features_path,
                 summary.num_without_features, summary.num_images + summary.num_without_features);
  }
  environment.report->in = {{"images", summary.num_images}, {"pairs", summary.num_pairs_tried}};
  environment.report->out = {{"verified pairs", summary.num_pairs_verified},
                             {"matches", summary.num_inliers}};
  environment.report->taken_over = {{"pairs", summary.num_taken_over}};
  AddDropped("images", {{"no features", summary.num_without_features}}, environment.report);
  AddDropped("pairs", summary.dropped_pairs, environment.report);
  if (is_plan) {
    PrintPlan(summary, arguments.plan, *environment.out);
  } else {
    Print(summary, reuse, *environment.out);
  }
  return Ok();
}

}  // namespace

Command MatchFeaturesCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {.name = "match-features",
          .summary = "Match and verify pairs of images (stage 2)",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser.Add("features", arguments->inputs.features_path, "COLMAP database with features")
                    .Required()
                    .Type("features.db");
                parser
                    .Add("--capture", arguments->capture,
                         "Capture folder: its poses are used to choose and verify pairs")
                    .Type("CAPTURE");
                parser
                    .Add("--vocabulary", arguments->inputs.vocabulary_path,
                         "Vocabulary for retrieval and loop candidates [one grown from the images]")
                    .Type("vocabulary.db");
                parser
                    .Add("--pair-list", arguments->inputs.pair_list_path,
                         "Match these pairs instead: the names of two images per line, as in COLMAP")
                    .Type("FILE");
                parser.Add("-o,--output", arguments->output, "COLMAP database to write")
                    .Required()
                    .Type("matches.db");
                const Argument shard = arguments->reuse.Add(parser, "pairs");
                parser
                    .Add("--plan", arguments->plan.num_shards,
                         "Write which pairs each of N shards matches next, given what --reuse files have, "
                         "instead of matching (docs/cluster.md)")
                    .Range(1, 100000)
                    .Type("N")
                    .Excludes(shard);
                parser
                    .Add("--shard-images", arguments->plan.min_num_images,
                         "--plan: fewest images of a shard, or pairs that take as long; of less, fewer "
                         "shards have work [64]")
                    .Range(1, 1000000)
                    .Type("N");
                parser
                    .Add("--planned", arguments->inputs.plan_path,
                         "--shard: the plan that says which pairs are the shard's")
                    .Type("PLAN.db");
                parser.AddFlag("--no-space-check", arguments->no_space_check,
                               "Begin even if the disk seems too full for the result");
                arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
              },
          .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
          .may_be_output = {"--reuse"}};
}

}  // namespace cairn::match_features
