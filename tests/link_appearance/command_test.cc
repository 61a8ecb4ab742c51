#include "stages/link_appearance/command.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/line/memory.h"
#include "stages/link_appearance/check_appearance.h"
#include "tests/link_appearance/graphs.h"
#include "tests/link_appearance/matches.h"
#include "tests/ran_command.h"

namespace cairn::link_appearance {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;
using testing::StartsWith;

class LinkAppearanceCommandTest : public CommandTest {
 protected:
  void Write(const AppearanceGraph& graph) const {
    WriteMatches(Path("matches.db"), ImagesOf(graph), TwoViewConfig::kCalibrated);
  }
  // Level images a metre apart, without files: image0.jpg and so on.
  void WriteCapture(int num_images) const {
    std::filesystem::create_directories(folder_ / "capture/images");
    std::vector<CaptureImage> images;
    for (int i = 0; i < num_images; ++i) {
      const std::string name = fmt::format("image{}.jpg", i);
      images.push_back({name, 1, Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d(-i, 0, 0)}});
      ASSERT_TRUE(WriteFileAtomically(Path("capture/images/" + name), "").ok());
    }
    ASSERT_TRUE(
        WriteCamerasText(Path("capture/cameras.txt"), {{1, *ParseCamera("PINHOLE,640,480,500,500,320,240")}})
            .ok());
    ASSERT_TRUE(WriteImagesText(Path("capture/images.txt"), images).ok());
  }
  // link-appearance matches.db -o appearance.db WORDS...
  Ran Link(const std::vector<std::string>& more, int64_t memory_mib = 1 << 20) const {
    return RunWords(LinkAppearanceCommand(), {Path("matches.db"), "-o", Path("appearance.db")}, more,
                    memory_mib);
  }
  // check-appearance matches.db --num-tries 0 WORDS...
  Ran Check(const std::vector<std::string>& more) const {
    return RunWords(CheckAppearanceCommand(), {Path("matches.db"), "--num-tries", "0"}, more);
  }
};

TEST_F(LinkAppearanceCommandTest, SaysHowManyNodesItKeepsOfHowMany) {
  Write(GraphOf(5, {{2, 0}, {2, 1}, {2, 3}, {2, 4}}));
  const Ran ran = Link({});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_EQ(ran.out,
            "link_appearance: 5 images, 5 nodes, 4 links, 1 components\n"
            "link_appearance: 1 of 5 nodes kept (20.0 %), 1 before local search, at least 1 are needed\n");
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("images", 5), Pair("pairs", 4)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("nodes", 5), Pair("links", 4), Pair("kept images", 1)));
  const Result<Appearance> appearance = ReadAppearance(Path("appearance.db"));
  ASSERT_TRUE(appearance.ok());
  EXPECT_THAT(appearance->KeptImages(), ElementsAre(3));
  const Ran all = Link({"--algorithm", "all", "--lower-bound", "none"});
  ASSERT_TRUE(all.status.ok()) << all.status.error().message;
  EXPECT_THAT(all.out, HasSubstr("link_appearance: 5 of 5 nodes kept (100.0 %), 5 before local search\n"));
}

TEST_F(LinkAppearanceCommandTest, SaysWhatIsUnusualAboutTheGraph) {
  Write(GraphOf(6, {{0, 1}, {1, 2}, {3, 4}}));
  EXPECT_THAT(Link({}).out,
              HasSubstr("\nlink_appearance: the graph has 3 components, 1 of them of one node"));
}

TEST_F(LinkAppearanceCommandTest, UsesTheImagesOfACaptureAndDrawsThemOverTheFloor) {
  Write(PathGraph(5));
  WriteCapture(4);
  const Ran ran = Link({"--capture", Path("capture"), "--svg", Path("floor.svg")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, StartsWith("link_appearance: 4 images, 4 nodes, 3 links, 1 components\n"));
  EXPECT_THAT(*ReadFile(Path("floor.svg")), HasSubstr("<g id=\"kept_links\""));
  ASSERT_TRUE(Link({"--svg", Path("matrix.svg")}).status.ok());
  EXPECT_THAT(*ReadFile(Path("matrix.svg")), HasSubstr("<g id=\"matrix\""));
}

TEST_F(LinkAppearanceCommandTest, WithoutWordsRefusesWhatIsAboutPlacesThatLookAlike) {
  Write(PathGraph(3));
  const Ran ran = Link({"--confusable-distance-m", "5"});
  ASSERT_FALSE(ran.status.ok());
  EXPECT_THAT(ran.status.error().message, HasSubstr("give --vocabulary"));
}

TEST_F(LinkAppearanceCommandTest, NeedsNinetySixBytesOfMemoryForAPair) {
  Write(PathGraph(3));
  SQLite::Database(Path("matches.db"), SQLite::OPEN_READWRITE)
      .exec(
          "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 21843) INSERT INTO "
          "two_view_geometries(pair_id, rows, cols, config) SELECT i, 0, 2, 0 FROM n");
  // 21845 pairs are a few bytes less than two MiB.
  const Ran ran = Link({}, 1);
  EXPECT_EQ(ran.status.error().code, ErrorCode::kNoMemory);
  EXPECT_THAT(ran.status.error().message,
              HasSubstr(fmt::format("takes about {} MiB", 2 + (kProgramBytes >> 20))));
}

// Without an end the path's other end nodes are kept less
// (CheckAppearance.CountsLeaveOneOutOnAHandSizedGraph): of five images three are located by 2 nodes of 4, and
// by random ones 3.5.
TEST_F(LinkAppearanceCommandTest, ACheckIsATableOfSetsAndACurveOfSizes) {
  Write(PathGraph(5));
  const Ran ran = Check({"--kept-ratios", "0.25,0.5"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out,
              StartsWith("5 left-out images, 5 of them linked to any of 4 nodes\n"
                         "sets that dominate      kept   kept %   localized localized %    random %\n"
                         "greedy                   2.0     50.0           3        60.0        70.0\n"));
  NoProgress progress;
  const Result<AppearanceCheck> check =
      CheckAppearance(PathGraph(5), EachNodeLeftOut(PathGraph(5)), {.num_tries = 0},
                      {.kept_ratios = {0.25, 0.5}}, 5, 1, progress);
  ASSERT_TRUE(check.ok());
  std::string curve = "kept          kept %    greedy %  weighted %    2-fold %    random %\n";
  for (size_t s = 0; s < 2; ++s) {
    curve += fmt::format("{:<11}{:>9.1f}", s + 1, s == 0 ? 25 : 50.0);
    for (const auto& of_kind : check->curves)
      curve += fmt::format("{:>12.1f}", 20 * of_kind[s].num_localized);
    // One of 4 nodes is among d neighbours by d / 4; two are by 1/2, or 5/6 of two.
    curve += s == 0 ? "        40.0\n" : "        70.0\n";
  }
  EXPECT_THAT(ran.out, HasSubstr(curve));
  EXPECT_THAT(ran.out, HasSubstr("linked, and not located by the set 'improved': image0.jpg, image4.jpg\n"));
}

//  0 - 1 - 2   3 - 4 - 5   ...    Without its last image a row keeps its first, which does not see the last.
TEST_F(LinkAppearanceCommandTest, OfImagesThatAreNotLocatedTwentyAreNamed) {
  const auto missed = [&](int num_rows, const std::vector<std::string>& words) {
    std::vector<std::pair<NodeIdx, NodeIdx>> pairs;
    for (int row = 0; row < num_rows; ++row) {
      pairs.emplace_back(3 * row, 3 * row + 1);
      pairs.emplace_back(3 * row + 1, 3 * row + 2);
    }
    Write(GraphOf(3 * num_rows, pairs));
    const std::string out = Check(words).out;
    return out.substr(std::min(out.find("linked, and not located"), out.size()));
  };
  EXPECT_EQ(missed(2, {}), "linked, and not located by the set 'improved': image2.jpg, image5.jpg\n");
  const std::string twenty = missed(20, {}), more = missed(21, {});
  EXPECT_EQ(std::count(twenty.begin(), twenty.end(), ','), 20);
  EXPECT_THAT(twenty, Not(HasSubstr(" more\n")));
  EXPECT_THAT(more, HasSubstr("image59.jpg, 1 more\n"));
  // Two dominators are all of a pair; the set that is asked for is the one that counts.
  EXPECT_EQ(missed(2, {"--num-dominators", "2"}),
            "linked, and not located by the set 'as asked': image2.jpg, image5.jpg\n");
}

TEST_F(LinkAppearanceCommandTest, HeldOutImagesAreNamedInAListOrAsImagesText) {
  Write(PathGraph(5));
  ASSERT_TRUE(WriteFileAtomically(Path("names.txt"), "# the middle\n\n  image2.jpg \n").ok());
  const Ran listed = Check({"--held-out", Path("names.txt"), "--kept-ratios", "0.5"});
  ASSERT_TRUE(listed.status.ok()) << listed.status.error().message;
  EXPECT_THAT(listed.out, StartsWith("1 left-out images, 1 of them linked to any of 4 nodes\n"));
  ASSERT_TRUE(WriteImagesText(Path("queries.txt"), {{"image2.jpg", 1, Pose()}}).ok());
  EXPECT_EQ(Check({"--held-out", Path("queries.txt"), "--kept-ratios", "0.5"}).out, listed.out);
  // Of pairs 0 1 and 3 4 the first are kept, of which image 2 sees one, 3.
  EXPECT_THAT(listed.out,
              HasSubstr("greedy                   2.0     50.0           1       100.0        83.3\n"));
}

TEST_F(LinkAppearanceCommandTest, ACheckRefusesPosesThatNothingReads) {
  Write(PathGraph(5));
  WriteCapture(5);
  const auto refuses = [&](const std::vector<std::string>& words) {
    std::vector<std::string> all = {"--capture", Path("capture")};
    all.insert(all.end(), words.begin(), words.end());
    return !Check(all).status.ok();
  };
  EXPECT_TRUE(refuses({}));
  EXPECT_FALSE(refuses({"--fuse", "place"}));
  EXPECT_FALSE(refuses({"--max-link-distance-m", "1.5"}));
  EXPECT_FALSE(refuses({"--max-link-turn-deg", "90"}));
}

}  // namespace
}  // namespace cairn::link_appearance
