// An option is honoured or refused: of all commands, through the program as it is.
#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "pipeline/build/stage_options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/program/program.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

struct Refusal {
  std::vector<std::string> words;
  std::string message;
};

// Refused with exit code 2 and a sentence, before any file is read.
void ExpectRefused(const Refusal& refusal) {
  std::vector<const char*> argv = {"cairn"};
  for (const std::string& word : refusal.words) argv.push_back(word.c_str());
  std::ostringstream out, err;
  EXPECT_EQ(RunProgram(AllCommands(), static_cast<int>(argv.size()), argv.data(), out, err), 2)
      << refusal.words[0] << ": " << err.str();
  EXPECT_THAT(err.str(), HasSubstr(refusal.message)) << refusal.words[0];
}

TEST(OptionsRead, WhatOtherOptionsTurnOffIsRefused) {
  const std::vector<std::string> match = {"stage", "match-features", "f.db", "-o", "m.db"};
  const std::vector<std::string> link = {"stage", "link-appearance", "m.db", "v.db", "-o", "a.db"};
  const std::vector<std::string> group = {"stage", "group-classes", "m.db", "--capture", "c", "-o", "c.db"};
  const std::vector<std::string> regions = {"stage", "decompose-regions", "w.db", "--classes", "c.db", "-o",
                                            "r.db"};
  const std::vector<std::string> world = {"stage", "filter-visibility", "c.db", "-o", "w.db"};
  const std::vector<std::string> words = {"stage", "build-vocabulary", "f.db", "-o", "v.db"};
  const std::vector<std::string> emit = {"stage",     "emit-map", "--classes",    "c", "--world", "w",
                                         "--regions", "r",        "--vocabulary", "v", "--name",  "n",
                                         "-o",        "u.cairn"};
  const auto with = [](std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  for (const Refusal& refusal : std::vector<Refusal>{
           {with(match, {"--pairs", "exhaustive", "--num-retrieved", "3"}),
            "num_retrieved is only read where pairs is auto or retrieval, and it is exhaustive"},
           {with(match, {"--sequence-window", "3"}), "sequence_window is only read where pairs is sequence"},
           {with(match, {"--pairs", "retrieval", "--frustum-far-m", "3"}), "where pairs is auto or frustum"},
           {with(match, {"--guided-matching", "none", "--guided-max-ratio", "0.5"}),
            "guided_max_ratio is only read where guided_matching is posed or all"},
           {with(link, {"--same-place-m", "1"}), "same_place_m is only read where fuse is place"},
           {with(link, {"--max-num-dropped", "1"}), "where algorithm is online, and it is greedy"},
           {with(link, {"--num-kept", "9", "--max-detour-links", "3"}), "where num_kept is 0, and it is 9"},
           {with(link, {"--lower-bound", "counting", "--max-num-branches", "3"}),
            "lower_bound is auto or program"},
           {with(link, {"--max-num-confusable", "0", "--confusable-distance-m", "3"}),
            "where max_num_confusable is not 0"},
           {with(group, {"--refine-poses", "never", "--num-rounds", "3"}), "refine_poses is auto or always"},
           {with(group, {"--refine-cameras", "false", "--focal-sigma-ratio", "0.1"}),
            "where refine_cameras is true, and it is false"},
           {with(regions, {"--alpha", "0.5"}), "alpha is only read where algorithm is c, and it is best"},
           {with(regions, {"--algorithm", "a1", "--best-num-repairs", "3"}), "where algorithm is best"},
           {with(regions, {"--feature-choice", "cover", "--rough-sigma-m", "3"}), "feature_choice is pose"},
           {with(world, {"--survey", "driven", "--min-block-side", "3"}), "where survey is auto or lattice"},
           {with(world, {"--up", "0,0,1", "--up-snap-deg", "3"}), "where up is auto, and it is 0,0,1"},
           {with(words, {"--depth", "4", "--descriptors-per-word", "3"}), "where depth is 0, and it is 4"},
           {with(words, {"--tree-from", "t.db", "--branching", "4"}),
            "where tree_from is empty, and it is t.db"},
           {with(emit, {"--landmarks", "all", "--left-out-max-error-m", "1"}),
            "where landmarks is fewest or max_bytes is not 0"},
           {with(emit, {"--landmarks", "all", "--min-recall-ratio", "1"}),
            "where landmarks is fewest, and it is all"},
           {with(emit, {"--max-bytes", "9", "--max-error-ratio", "2"}), "where max_bytes is 0, and it is 9"},
           {with(emit, {"--max-num-sights", "32"}), "where visual_map is true"}}) {
    ExpectRefused(refusal);
  }
}

TEST(OptionsRead, WhatNeedsAFileThatIsNotGivenIsRefused) {
  for (const Refusal& refusal : std::vector<Refusal>{
           {{"stage", "match-features", "f.db", "-o", "m.db", "--pairs", "frustum", "--vocabulary", "v.db"},
            "words are used for --pairs retrieval, sequence or auto only, and --pairs is frustum"},
           {{"stage", "match-features", "f.db", "-o", "m.db", "--pair-list", "p", "--pairs", "exhaustive"},
            "--pairs: --pair-list gives the pairs"},
           {{"stage", "match-features", "f.db", "-o", "m.db", "--pair-list", "p", "--vocabulary", "v.db"},
            "the pairs are those of --pair-list"},
           {{"stage", "link-appearance", "m.db", "-o", "a.db", "--score-exponent", "3"},
            "by the words of vocabulary.db"},
           {{"stage", "check-appearance", "m.db", "--capture", "c"}, "poses are used for --fuse place"},
           {{"stage", "decompose-regions", "w.db", "-o", "r.db", "--feature-choice", "cover"},
            "give --classes"},
           {{"check", "m.cairn", "--capture", "c"}, "give --queries"},
           {{"check", "m.cairn", "--scans", "s.log"}, "give --queries"},
           {{"check", "m.cairn", "--min-localized-ratio", "0.9"}, "give --queries or -o"},
           {{"check", "m.cairn", "--queries", "q", "--scan-x-m", "1"}, "give --scans"},
           {{"localize", "m.cairn", "a.png", "--camera", "PINHOLE,2,2,1,1,1,1", "--cameras", "c.txt"},
            "leave one out"},
           {{"where", "m.cairn", "a.png", "--camera", "PINHOLE,2,2,1,1,1,1", "--cameras", "c.txt"},
            "leave one out"},
           {{"where", "m.cairn", "a.png", "--way-sigma-m", "1"}, "give --odometry"},
           {{"where", "m.cairn", "a.png", "--odometry", "w.txt", "--reach-links", "3"},
            "is for images without odometry"},
           {{"localize", "m.cairn", "a.png", "--min-num-votes", "3"}, "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--localize-when-lost", "false"}, "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--step-sigma-m", "1"}, "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--visual-max-ratio", "0.5"}, "--estimator visual-map or both"},
           {{"localize", "m.cairn", "a.png", "--kidnapped-ratio", "0.5"}, "--estimator visual-map or both"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--tracked-ratio", "0.5"},
            "--estimator visual-map or both"},
           {{"localize", "m.cairn", "a.png", "--odometry", "w.txt"}, "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--wheel-way-ratio", "1"}, "give --odometry"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--min-prior-sigma-m", "1"}, "give --odometry"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--period", "1"}, "--min-place-probability"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--place-fix-ratio", "0.5"},
            "min_place_probability"},
           {{"localize", "m.cairn", "a.png", "--estimator", "both", "--odometry", "w.txt"},
            "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--estimator", "both", "--tracked-ratio", "0.5"},
            "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--estimator", "both", "--kidnapped-ratio", "0.5"},
            "give --sequence"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--estimator", "visual-map", "--step-sigma-m",
             "1"},
            "--estimator pnp or both"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--estimator", "both", "--odometry-sigma-m", "1"},
            "give --odometry"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--estimator", "both", "--odometry-way-ratio",
             "0.2"},
            "give --odometry"},
           {{"localize", "m.cairn", "a.png", "--sequence", "--estimator", "both", "--odometry", "w.txt",
             "--unknown-way-sigma-m", "1"},
            "for frames without odometry"},
           {{"plan", "path", "v.db", "--from", "0,0", "--kind", "search", "--to", "1,1"}, "leave --to out"},
           {{"plan", "path", "v.db", "--from", "0,0", "--to", "1,1", "--seen-ratio", "0.5"},
            "is for --kind search"},
           {{"inspect", "m.cairn", "--build-dir", "b"}, "give --image"},
           {{"report", "m.cairn", "-o", "r.html", "--print", "--drive", "d.json"}, "--print does not show"},
           {{"clean", "/", "--build-dir", "b"}, "leave one of them out"}}) {
    ExpectRefused(refusal);
  }
}

// check-appearance has no options that it does not read.
TEST(OptionsRead, CheckAppearanceHasOnlyTheOptionsThatItReads) {
  for (const char* option :
       {"--algorithm", "--max-detour-links", "--lower-bound", "--max-num-program-links",
        "--max-num-cut-rounds", "--max-num-branches", "--score-exponent", "--entropy-over",
        "--confusable-score-ratio", "--confusable-distance-m", "--max-num-confusable"}) {
    ExpectRefused(
        {{"stage", "check-appearance", "m.db", option, "1"}, fmt::format("no option '{}'", option)});
  }
}

TEST(OptionsRead, ConditionsNameOptionsOfTheirTableAndValuesThatTheyCanHave) {
  int num_conditions = 0;
  for (const StageOptions& stage : AllStageOptions()) {
    for (const Option& option : stage.table) {
      for (const OptionCondition& condition : option.only_where) {
        ++num_conditions;
        const auto other = std::find_if(stage.table.begin(), stage.table.end(),
                                        [&](const Option& o) { return o.name == condition.option; });
        ASSERT_NE(other, stage.table.end()) << stage.stage << " " << option.name << ": " << condition.option;
        for (const std::string& value : condition.values) {
          if (value.starts_with("not ") || value.empty()) continue;
          EXPECT_TRUE(SetOption(*other, value).ok()) << stage.stage << " " << other->name << " " << value;
          EXPECT_EQ(OptionValueText(*other), value);
        }
      }
    }
  }
  EXPECT_GE(num_conditions, 60);
}

// A field that a table describes and no other line reads is an option that does nothing.
TEST(OptionsRead, EveryFieldThatATableDescribesIsReadSomewhere) {
  std::string sources;
  std::set<std::string> fields;
  const std::regex field(R"(&\w+(?:->|\.)(?:\w+\.)*(\w+)\b)");
  for (const char* folder : {"core", "stages", "runtime", "sim", "pipeline"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(CAIRN_SOURCE_DIR) / folder)) {
      if (entry.path().extension() != ".cc" && entry.path().extension() != ".h") continue;
      const std::string text = ReadFile(entry.path().string()).value();
      for (size_t begin = text.find("OptionTable DescribeOptions("); begin != std::string::npos;
           begin = text.find("OptionTable DescribeOptions(", begin + 1)) {
        const size_t end = std::min(text.find("\n}\n", begin), text.size());
        const std::string body = text.substr(begin, end - begin);
        if (body.find('{') == std::string::npos) continue;  // a declaration
        for (std::sregex_iterator it(body.begin(), body.end(), field), last; it != last; ++it)
          fields.insert((*it)[1].str());
      }
      sources += text;
    }
  }
  EXPECT_GT(fields.size(), 300u);
  std::set<std::string> read;
  const std::regex use(R"((^|[^&\w])\w+[\])]*(?:->|\.)(?:\w+\.)*(\w+)\b)");
  for (std::sregex_iterator it(sources.begin(), sources.end(), use), last; it != last; ++it)
    read.insert((*it)[2].str());
  for (const std::string& name : fields) EXPECT_TRUE(read.contains(name)) << name << " is read nowhere";
}

}  // namespace
}  // namespace cairn::pipeline
