#include "stages/link_appearance/link_appearance.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "core/world/appearance.h"
#include "stages/link_appearance/check_appearance.h"
#include "stages/link_appearance/picture.h"
#include "tests/link_appearance/graphs.h"
#include "tests/link_appearance/matches.h"

namespace cairn::link_appearance {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string TemporaryPath(const std::string& name) { return testing::TempDir() + "/" + name; }

TEST(LinkAppearance, KeepsTheMiddleOfAStarAndSaysThatOneIsNeeded) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(GraphOf(5, {{2, 0}, {2, 1}, {2, 3}, {2, 4}})), nullptr, {}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_THAT(result->appearance.KeptImages(), ElementsAre(3));
  EXPECT_EQ(result->appearance.LowerBound(), 1);
  EXPECT_THAT(result->notes, IsEmpty());
}

TEST(LinkAppearance, OneImageIsKept) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(AppearanceGraph(1, {})), nullptr, {}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_THAT(result->appearance.KeptImages(), ElementsAre(1));
}

TEST(LinkAppearance, NoImageIsAnError) {
  const Result<LinkAppearanceResult> result = LinkAppearance({}, nullptr, {}, 0);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kNoData);
}

TEST(LinkAppearance, WithoutAnyLinkEveryImageIsKeptAndItIsSaid) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(AppearanceGraph(4, {})), nullptr, {}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->appearance.KeptImages().size(), 4u);
  EXPECT_THAT(result->notes, ElementsAre(HasSubstr("no two of the 4 nodes are linked")));
}

TEST(LinkAppearance, ComponentsAreCountedAndSmallOnesMayBeLeftOut) {
  //  0 - 1 - 2    3 - 4    5
  const ImageLinks images = ImagesOf(GraphOf(6, {{0, 1}, {1, 2}, {3, 4}}));
  Result<LinkAppearanceResult> result = LinkAppearance(images, nullptr, {}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_THAT(result->notes, ElementsAre(HasSubstr("3 components, 1 of them of one node")));
  EXPECT_EQ(result->appearance.Kept().size(), 3u);
  EXPECT_EQ(result->appearance.LowerBound(), 3);
  result = LinkAppearance(images, nullptr, {.min_component_nodes = 3}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_THAT(result->appearance.Kept(), ElementsAre(1));
  EXPECT_THAT(result->undominated, IsEmpty());
}

TEST(LinkAppearance, ASizeThatCannotDominateIsKeptExactlyAndTheMessageSaysWhatIsNeeded) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(PathGraph(12)), nullptr, {.num_kept = 4}, 0);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->appearance.Kept().size(), 4u);
  EXPECT_EQ(result->undominated.size(), 6u);
  EXPECT_THAT(result->notes,
              ElementsAre(AllOf(HasSubstr("num_kept = 4 leaves 6 of 12"), HasSubstr("at least 10"))));
}

TEST(LinkAppearance, ALargerSizeDominatesAndIsKeptExactly) {
  const ImageLinks images = ImagesOf(GeometricGraph(60, 8, 2));
  for (const int size : {25, 40, 60}) {
    const Result<LinkAppearanceResult> result = LinkAppearance(images, nullptr, {.num_kept = size}, 0);
    ASSERT_TRUE(result.ok());
    EXPECT_EQ(static_cast<int>(result->appearance.Kept().size()), size);
    EXPECT_THAT(result->undominated, IsEmpty());
  }
  const Result<LinkAppearanceResult> all = LinkAppearance(images, nullptr, {.num_kept = 100}, 0);
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->appearance.Kept().size(), 60u);
  EXPECT_THAT(all->notes, Contains(HasSubstr("num_kept = 100: there are 60 nodes")));
}

TEST(LinkAppearance, NodesThatRestoreCyclesSaySo) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(PathGraph(12, true)), nullptr, {.max_detour_links = 5}, 0);
  ASSERT_TRUE(result.ok());
  int num_restored = 0;
  for (const AppearanceNode& node : result->appearance.nodes)
    num_restored += node.role == NodeRole::kRestored;
  EXPECT_EQ(num_restored, 2);
  EXPECT_EQ(result->appearance.LowerBound(), 10);
}

TEST(LinkAppearance, OptionsThatCannotBeMeantAreErrors) {
  const ImageLinks images = ImagesOf(PathGraph(3));
  for (const LinkAppearanceOptions& options :
       {LinkAppearanceOptions{.num_dominators = 0}, LinkAppearanceOptions{.max_detour_links = 1},
        LinkAppearanceOptions{.fuse = "guess"}, LinkAppearanceOptions{.algorithm = "online", .num_kept = 2},
        LinkAppearanceOptions{.fuse = "place"}}) {
    const Result<LinkAppearanceResult> result = LinkAppearance(images, nullptr, options, 0);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument) << result.error().message;
  }
}

TEST(FuseImages, HeadingsOfAStationAreOneNodeAndTheirInliersAddUp) {
  ImageLinks images;
  for (const char* name : {"s0_h0.jpg", "s0_h1.jpg", "s1_h0.jpg", "s1_h1.jpg", "single"}) {
    images.images.push_back({static_cast<ImageId>(images.images.size() + 1), name, 1});
  }
  images.links = {{0, 1, 50}, {0, 2, 20}, {1, 3, 30}, {3, 4, 40}};
  const Result<std::vector<NodeIdx>> nodes = FuseImages(images.images, "name", 0.1, nullptr);
  ASSERT_TRUE(nodes.ok());
  EXPECT_THAT(*nodes, ElementsAre(0, 0, 1, 1, 2));
  EXPECT_THAT(FusedGraph(images.links, *nodes).Links(),
              ElementsAre(AppearanceLink{0, 1, 50}, AppearanceLink{1, 2, 40}));
}

TEST(FuseImages, ImagesTakenAtOnePlaceAreOneNode) {
  Capture capture;
  std::vector<DatabaseImage> images;
  for (const double x : {0.0, 1.0, 0.05, 1.04}) {
    const std::string name = fmt::format("{}.jpg", images.size());
    images.push_back({static_cast<ImageId>(images.size() + 1), name, 1});
    capture.images.push_back({name, 1, Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d(-x, 0, 0)}});
  }
  const Result<std::vector<NodeIdx>> nodes = FuseImages(images, "place", 0.1, &capture);
  ASSERT_TRUE(nodes.ok());
  EXPECT_THAT(*nodes, ElementsAre(0, 1, 0, 1));
}

TEST(ReadImageLinks, ReadsVerifiedPairsOfEnoughInliers) {
  const std::string path = TemporaryPath("links.db");
  const ImageLinks images = ImagesOf(AppearanceGraph(3, {{0, 1, 20}, {1, 2, 40}}));
  WriteMatches(path, images, TwoViewConfig::kCalibrated);
  const Result<ImageLinks> all = ReadImageLinks(path, 15);
  ASSERT_TRUE(all.ok()) << all.error().message;
  EXPECT_EQ(all->images.size(), 3u);
  EXPECT_EQ(all->links, images.links);
  EXPECT_THAT(ReadImageLinks(path, 30)->links, ElementsAre(AppearanceLink{1, 2, 40}));
  WriteMatches(path, images, TwoViewConfig::kWatermark);
  EXPECT_THAT(ReadImageLinks(path, 15)->links, IsEmpty());
}

TEST(ReadImageLinks, PairsOfUnknownImagesAreCorrupt) {
  const std::string path = TemporaryPath("unknown.db");
  WriteMatches(path, ImagesOf(PathGraph(3)), TwoViewConfig::kCalibrated);
  SQLite::Database(path, SQLite::OPEN_READWRITE).exec("DELETE FROM images WHERE image_id = 2");
  const Result<ImageLinks> links = ReadImageLinks(path, 15);
  ASSERT_FALSE(links.ok());
  EXPECT_EQ(links.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(links.error().message, HasSubstr("images 1 and 2"));
}

TEST(ReadImageLinks, APairIsOfTwoImagesAndHasAsManyInliersAsCanBe) {
  const std::string path = TemporaryPath("pairs.db");
  const auto reads_with = [&](const std::string& change) {
    WriteMatches(path, ImagesOf(PathGraph(2)), TwoViewConfig::kCalibrated);
    SQLite::Database(path, SQLite::OPEN_READWRITE).exec("UPDATE two_view_geometries SET " + change);
    return ReadImageLinks(path, 15).ok();
  };
  EXPECT_TRUE(reads_with("rows = 0"));
  EXPECT_FALSE(reads_with("rows = -1"));
  EXPECT_TRUE(reads_with("rows = 2147483647"));
  EXPECT_FALSE(reads_with("rows = 2147483648"));
  EXPECT_FALSE(reads_with("pair_id = " + std::to_string(PairIdFromImageIds(2, 2))));
}

TEST(AppearanceDatabase, ReadsBackWhatWasWrittenAndHasTheSameBytesAgain) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(GeometricGraph(50, 6, 3)), nullptr,
                     {.num_dominators = 2, .bound = {.lower_bound = "counting"}}, 7);
  ASSERT_TRUE(result.ok());
  const std::string path = TemporaryPath("appearance.db"), again = TemporaryPath("again.db");
  ASSERT_TRUE(WriteAppearance(result->appearance, path).ok());
  const Result<Appearance> read = ReadAppearance(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->nodes, result->appearance.nodes);
  EXPECT_EQ(read->graph.Links(), result->appearance.graph.Links());
  EXPECT_EQ(read->lower_bounds, result->appearance.lower_bounds);
  EXPECT_EQ(read->num_dominators, 2);
  ASSERT_TRUE(WriteAppearance(*read, again).ok());
  EXPECT_EQ(*ReadFile(path), *ReadFile(again));
}

TEST(AppearanceDatabase, FilesThatAreNoneOrDamagedAreErrors) {
  const Result<LinkAppearanceResult> result = LinkAppearance(ImagesOf(PathGraph(5)), nullptr, {}, 0);
  const std::string path = TemporaryPath("damaged.db");
  for (const char* damage :
       {"UPDATE nodes SET role = 7 WHERE node_idx = 1", "DELETE FROM nodes WHERE node_idx = 2",
        "UPDATE nodes SET neighbours = x'00000000' WHERE node_idx = 3",
        "UPDATE nodes SET num_inliers = x'0000' WHERE node_idx = 0", "DELETE FROM components",
        "UPDATE appearance SET num_links = 9", "DELETE FROM appearance"}) {
    std::remove(path.c_str());
    ASSERT_TRUE(WriteAppearance(result->appearance, path).ok());
    SQLite::Database(path, SQLite::OPEN_READWRITE).exec(damage);
    const Result<Appearance> read = ReadAppearance(path);
    ASSERT_FALSE(read.ok()) << damage;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt) << damage;
    EXPECT_THAT(read.error().message, HasSubstr("damaged.db"));
  }
  EXPECT_EQ(ReadAppearance(TemporaryPath("none.db")).error().code, ErrorCode::kNotFound);
}

TEST(CheckAppearance, CountsLeaveOneOutOnAHandSizedGraph) {
  //  A path of five.  Without an end node the rest is a path of four: its inner two are kept, and the end's
  //  neighbour is an end of it, not kept.  Without an inner node the rest falls apart and ...
  //    without 0: 1-2-3-4 keeps 2 3, 0 sees 1: lost.          without 4: likewise, keeps 1 2, 4 sees 3: lost.
  //    without 1: 0 | 2-3-4 keeps 0 3, 1 sees 0: located.     without 3: keeps 1 4, located.
  //    without 2: 0-1 | 3-4 keeps 0 3, 2 sees 3: located.
  const AppearanceGraph graph = PathGraph(5);
  NoProgress progress;
  std::vector<LeftOutImage> left_out = EachNodeLeftOut(graph);
  for (size_t i = 0; i < left_out.size(); ++i) left_out[i].name = fmt::format("{}.jpg", i);
  const Result<AppearanceCheck> check =
      CheckAppearance(graph, left_out, {.num_tries = 0}, {}, 0, 1, progress);
  ASSERT_TRUE(check.ok());
  EXPECT_EQ(check->num_left_out, 5);
  EXPECT_THAT(check->missed[0], ElementsAre("0.jpg", "4.jpg"));
  EXPECT_EQ(check->missed.size(), check->sets.size());
  EXPECT_EQ(check->set_names[0], "greedy");
  EXPECT_EQ(check->sets[0].num_localized, 3);
  EXPECT_DOUBLE_EQ(check->sets[0].num_kept, 2);
  // Ends have one neighbour of four, the others two: 2 random ones of four hold it by 1/2, one of two by 5/6.
  EXPECT_NEAR(check->sets[0].num_by_random, 2 * 0.5 + 3 * 5.0 / 6, 1e-9);
}

// Of so many dominators, by links that count by their inliers.
TEST(CheckAppearance, ChecksTheSetThatIsAskedFor) {
  const AppearanceGraph graph = GeometricGraph(40, 7, 5);
  NoProgress progress;
  const auto check = [&](int num_dominators, int strong_num_inliers) {
    LinkAppearanceOptions options{.num_tries = 0};
    options.num_dominators = num_dominators;
    options.strong_num_inliers = strong_num_inliers;
    return *CheckAppearance(graph, EachNodeLeftOut(graph), options, {.max_num_dominators = 3}, 0, 1,
                            progress);
  };
  const auto of_set = [](const AppearanceCheck& of, const std::string& name) {
    const auto found = std::find(of.set_names.begin(), of.set_names.end(), name);
    EXPECT_NE(found, of.set_names.end()) << name;
    return of.sets[found - of.set_names.begin()];
  };
  const AppearanceCheck plain = check(1, 1), threefold = check(3, 1), both = check(3, 100);
  EXPECT_EQ(std::count(plain.set_names.begin(), plain.set_names.end(), "as asked"), 0);
  EXPECT_EQ(of_set(threefold, "as asked").num_kept, of_set(threefold, "3-fold, improved").num_kept);
  EXPECT_GT(of_set(both, "as asked").num_kept, of_set(both, "3-fold, improved").num_kept);
}

TEST(CheckAppearance, IsTheSameForAnyNumberOfThreads) {
  const AppearanceGraph graph = GeometricGraph(60, 7, 5);
  NoProgress progress;
  const auto run = [&](int num_threads) {
    return *CheckAppearance(graph, EachNodeLeftOut(graph), {.num_tries = 20}, {}, 3, num_threads, progress);
  };
  const AppearanceCheck one = run(1), four = run(4);
  for (size_t i = 0; i < one.sets.size(); ++i) {
    EXPECT_EQ(one.sets[i].num_localized, four.sets[i].num_localized);
    EXPECT_EQ(one.sets[i].num_kept, four.sets[i].num_kept);
  }
}

TEST(CheckAppearance, HeldOutImagesLeaveTheGraphAndKeepTheirLinks) {
  const ImageLinks images = ImagesOf(PathGraph(5));
  const Result<HeldOutSplit> split = HoldOut(images, {"image2.jpg"});
  ASSERT_TRUE(split.ok());
  EXPECT_EQ(split->survey.images.size(), 4u);
  EXPECT_THAT(split->survey.links, ElementsAre(AppearanceLink{0, 1, 30}, AppearanceLink{2, 3, 30}));
  EXPECT_THAT(split->linked, ElementsAre(ElementsAre(1, 2)));
  EXPECT_THAT(split->names, ElementsAre("image2.jpg"));
  EXPECT_EQ(HoldOut(images, {"nobody.jpg"}).error().code, ErrorCode::kNotFound);
}

TEST(LinkAppearance, CanBeStopped) {
  class Stopped final : public Progress {
   public:
    void Begin(std::string_view, int64_t, std::string_view) override {}
    void Advance(int64_t) override { ++num_advances; }
    void End() override {}
    bool Cancelled() const override { return num_advances >= 10; }
    int num_advances = 0;
  } progress;
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(GeometricGraph(60, 7, 5)), nullptr, {.num_tries = 1'000'000}, 0, &progress);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(progress.num_advances, 10);
}

TEST(CheckAppearance, NothingOrEverythingLeftOutIsAnError) {
  NoProgress progress;
  const auto check = [&](const AppearanceGraph& graph, const std::vector<LeftOutImage>& left_out) {
    return CheckAppearance(graph, left_out, {}, {}, 0, 1, progress);
  };
  EXPECT_EQ(check(PathGraph(3), {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(check(AppearanceGraph(), {LeftOutImage{}}).error().code, ErrorCode::kNoData);
}

TEST(CheckAppearance, AnImageWithoutLinksIsNeverLocated) {
  NoProgress progress;
  const Result<AppearanceCheck> check = CheckAppearance(PathGraph(3), {LeftOutImage{}}, {.num_tries = 10},
                                                        {.kept_ratios = {1}}, 0, 1, progress);
  ASSERT_TRUE(check.ok());
  EXPECT_EQ(check->num_linked, 0);
  for (const auto& curve : check->curves) EXPECT_EQ(curve[0].num_localized, 0);
  for (const AppearanceFigure& set : check->sets) EXPECT_EQ(set.num_localized, 0);
}

TEST(CheckAppearance, FoldersAndPanoramasAreHeldOutWhole) {
  ImageLinks images = ImagesOf(PathGraph(5));
  const std::vector<std::string> names = {"a/0.jpg", "b/1.jpg#0of3", "b/1.jpg#1of3", "b/2.jpg", "c.jpg"};
  for (size_t i = 0; i < names.size(); ++i) images.images[i].name = names[i];
  const Result<HeldOutSplit> folder = HoldOut(images, {"b/"});
  ASSERT_TRUE(folder.ok());
  EXPECT_EQ(folder->survey.images.size(), 2u);
  EXPECT_THAT(folder->linked, ElementsAre(ElementsAre(0), ElementsAre(1)));  // the panorama, 2.jpg
  const Result<HeldOutSplit> panorama = HoldOut(images, {"b/1.jpg"});
  ASSERT_TRUE(panorama.ok());
  EXPECT_THAT(panorama->linked, ElementsAre(ElementsAre(0, 1)));
  EXPECT_EQ(HoldOut(images, {"b"}).error().code, ErrorCode::kNotFound);
}

TEST(FuseImages, ViewsOfAPanoramaAreOneNode) {
  ImageLinks images = ImagesOf(PathGraph(3));
  images.images[0].name = "p.jpg#0of2";
  images.images[1].name = "p.jpg#1of2";
  images.images[2].name = "q.jpg";
  EXPECT_THAT(*FuseImages(images.images, "none", 0.1, nullptr), ElementsAre(0, 0, 1));
}

TEST(LinkAppearance, ImagesTurnedTooFarAgainstEachOtherAreNotLinked) {
  ImageLinks images;
  Capture capture;
  for (int i = 0; i < 3; ++i) {
    const std::string name = fmt::format("{}.jpg", i);
    images.images.push_back({.image_id = static_cast<ImageId>(i + 1), .name = name});
    const Eigen::AngleAxisd turn(RadFromDeg(30 * i), Eigen::Vector3d::UnitY());
    capture.images.push_back({name, 1, Pose{Eigen::Quaterniond(turn), Eigen::Vector3d::Zero()}});
  }
  images.links = {{0, 1, 50}, {0, 2, 50}, {1, 2, 50}};
  LinkAppearanceOptions options;
  options.max_link_turn_deg = 31;
  EXPECT_EQ(LinkAppearance(images, &capture, options, 0)->appearance.graph.num_links(), 2);
  options.max_link_turn_deg = 29;
  EXPECT_EQ(LinkAppearance(images, &capture, options, 0)->appearance.graph.num_links(), 0);
  EXPECT_EQ(LinkAppearance(images, nullptr, options, 0).error().code, ErrorCode::kInvalidArgument)
      << "without poses nothing is known of turns";
  options.max_link_turn_deg = 180;
  EXPECT_EQ(LinkAppearance(images, nullptr, options, 0)->appearance.graph.num_links(), 3);
}

TEST(SurveyImagesOf, LeavesOutImagesThatTheCaptureDoesNotList) {
  ImageLinks images = ImagesOf(PathGraph(4));
  Capture capture;
  for (const int i : {0, 1, 3}) capture.images.push_back({.name = images.images[i].name});
  const ImageLinks survey = SurveyImagesOf(capture, images);
  EXPECT_EQ(survey.images.size(), 3u);
  EXPECT_THAT(survey.links, ElementsAre(AppearanceLink{0, 1, 30}));
}

// Twins 10 m apart whose images 0 and 2, 1 and 3 verify as if all that they show were far away; image 4 has
// no pose.
TEST(LinkAppearance, DoesNotLinkTwinsThatStandFarApart) {
  ImageLinks images = ImagesOf(GraphOf(5, {{0, 1}, {2, 3}, {0, 2}, {1, 3}, {3, 4}}));
  Capture capture;
  for (int i = 0; i < 5; ++i) {
    CaptureImage image{.name = images.images[i].name};
    if (i < 4) {
      image.cam_from_world.emplace();
      image.cam_from_world->translation = {-(10.0 * (i / 2) + 0.5 * (i % 2)), 0, 0};
    }
    capture.images.push_back(image);
  }
  const auto links = [&](double max_link_distance_m, const Capture* given) {
    LinkAppearanceOptions options;
    options.max_link_distance_m = max_link_distance_m;
    std::vector<std::pair<int, int>> pairs;
    const auto result = LinkAppearance(images, given, options, 0);
    for (const AppearanceLink& link : result->appearance.graph.Links())
      pairs.emplace_back(link.node1, link.node2);
    return pairs;
  };
  const auto near = ElementsAre(std::pair(0, 1), std::pair(2, 3), std::pair(3, 4));
  const auto all =
      ElementsAre(std::pair(0, 1), std::pair(0, 2), std::pair(1, 3), std::pair(2, 3), std::pair(3, 4));
  EXPECT_THAT(links(9.9, &capture), near);
  EXPECT_THAT(links(0.5, &capture), near);  // not farther than the limit
  EXPECT_THAT(links(0.49, &capture), ElementsAre(std::pair(3, 4)));
  EXPECT_THAT(links(10, &capture), all);
  EXPECT_THAT(links(0, &capture), all);
  EXPECT_THAT(links(0, nullptr), all);
  LinkAppearanceOptions limited;
  limited.max_link_distance_m = 1;  // nothing is known of where they stand
  EXPECT_EQ(LinkAppearance(images, nullptr, limited, 0).error().code, ErrorCode::kInvalidArgument);
}

TEST(DrawAppearance, MarksKeptNodesOverTheFloorOrInAMatrix) {
  const Result<LinkAppearanceResult> result =
      LinkAppearance(ImagesOf(GraphOf(3, {{0, 1}, {1, 2}})), nullptr, {}, 0);
  ASSERT_TRUE(result.ok());
  const auto count = [](const std::string& text, const std::string& what) {
    int num = 0;
    for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++num;
    return num;
  };
  const std::string matrix = DrawAppearance(result->appearance, {"1.jpg", "10.jpg", "9.jpg"}, {});
  EXPECT_THAT(matrix, HasSubstr("<g id=\"matrix\""));
  EXPECT_THAT(matrix, HasSubstr("1 of 3 nodes kept</tspan>, at least 1 needed; 2 links, 1 component<"));
  std::vector<std::optional<FloorPose>> places;
  for (const double x : {0.0, 1.0, 2.0}) places.push_back(FloorPose{Eigen::Vector2d(x, 0), 0});
  // Node 1 is kept; its image is the last by number: the marks above and beside the third column and row.
  EXPECT_THAT(matrix, HasSubstr("<g id=\"kept\">\n<rect x=\"64.00\""));
  const std::string floor = DrawAppearance(result->appearance, {"a", "b", "c"}, places);
  EXPECT_THAT(floor, HasSubstr("<g id=\"dominating_links\""));
  EXPECT_EQ(count(floor, "<path d=\"M"), 2 + 2);  // links, scale bar and legend
}

}  // namespace
}  // namespace cairn::link_appearance
