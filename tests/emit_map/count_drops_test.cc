#include "stages/emit_map/count_drops.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "tests/core/map/example.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// The example of tests/core/map/example.h: images 1, 2 and 4 at stations 0, 1 and 2.
std::vector<DropCount> Count(const std::vector<DroppedItem>& items) {
  const EmitExample example = MakeEmitExample();
  const auto counts = CountDrops(example.classes, example.world, items);
  EXPECT_TRUE(counts.ok()) << (counts.ok() ? "" : counts.error().message);
  return counts.ok() ? *counts : std::vector<DropCount>();
}

DropCount CountOne(const std::vector<DroppedItem>& items) {
  const std::vector<DropCount> counts = Count(items);
  EXPECT_EQ(counts.size(), 1u);
  return counts.empty() ? DropCount() : counts[0];
}

TEST(CountDrops, TracksCountOnceAtEachStationWithOneOfTheirKeypoints) {
  const DropCount count =
      CountOne({{.reason = DropReason::kFewObservations, .item_id = 0, .seen_at = {1, 7, 2, 9}},
                {.reason = DropReason::kFewObservations, .item_id = 5, .seen_at = {2, 3, 3, 0}}});
  EXPECT_EQ(count.reason_id, static_cast<int>(DropReason::kFewObservations));
  EXPECT_EQ(count.stage, "group_classes");
  EXPECT_EQ(count.kind, "feature");
  EXPECT_EQ(count.name, "few_observations");
  EXPECT_THAT(count.text, HasSubstr("min_num_observations"));
  EXPECT_EQ(count.num_dropped, 2);
  EXPECT_THAT(count.at_stations, ElementsAre(1, 2, 0));  // image 3 is at no station
}

TEST(CountDrops, OutliersCountByTheKeypointAndViewsByTheStation) {
  const DropCount outliers =
      CountOne({{.reason = DropReason::kOutlier, .item_id = 10, .seen_at = {1, 7, 1, 8, 4, 2}}});
  EXPECT_EQ(outliers.num_dropped, 3);
  EXPECT_THAT(outliers.at_stations, ElementsAre(2, 0, 1));
  const DropCount views = CountOne({{.reason = DropReason::kOutsideArea, .item_id = 10, .seen_at = {0, 2}},
                                    {.reason = DropReason::kOutsideArea, .item_id = 11, .seen_at = {2}}});
  EXPECT_EQ(views.num_dropped, 3);
  EXPECT_THAT(views.at_stations, ElementsAre(1, 0, 2));
}

TEST(CountDrops, ClassesFeaturesStationsImagesAndPairsCountWhereTheyAre) {
  // Class 11 is seen in images 1 and 2, feature 1 of the world from stations 1 and 2.
  EXPECT_THAT(CountOne({{.reason = DropReason::kFewStations, .item_id = 11}}).at_stations,
              ElementsAre(1, 1, 0));
  EXPECT_THAT(CountOne({{.reason = DropReason::kNotChosen, .item_id = 1}}).at_stations, ElementsAre(0, 1, 1));
  EXPECT_THAT(CountOne({{.reason = DropReason::kLeftOver, .item_id = 2}}).at_stations, ElementsAre(0, 0, 1));
  EXPECT_THAT(CountOne({{.reason = DropReason::kNoFeatures, .item_id = 2}}).at_stations,
              ElementsAre(0, 1, 0));
  EXPECT_THAT(
      CountOne({{.reason = DropReason::kFewMatches, .item_id = PairIdFromImageIds(1, 4)}}).at_stations,
      ElementsAre(1, 0, 1));
}

TEST(CountDrops, WhatIsAtNoStationCountsInTheTotalOnly) {
  const DropCount count = CountOne({{.reason = DropReason::kUnreadable},
                                    {.reason = DropReason::kUnreadable},
                                    {.reason = DropReason::kUnreadable}});
  EXPECT_EQ(count.num_dropped, 3);
  EXPECT_THAT(count.at_stations, IsEmpty());
}

TEST(CountDrops, ReasonsAreAscendingAndOnlyThoseThatOccurred) {
  const std::vector<DropCount> counts = Count({{.reason = DropReason::kLeftOver, .item_id = 0},
                                               {.reason = DropReason::kNoPose, .item_id = 3},
                                               {.reason = DropReason::kLeftOver, .item_id = 1}});
  ASSERT_EQ(counts.size(), 2u);
  EXPECT_EQ(counts[0].name, "no_pose");
  EXPECT_EQ(counts[1].num_dropped, 2);
  EXPECT_TRUE(Count({}).empty());
}

TEST(CountDrops, ItemsOfOtherFilesAreErrors) {
  const EmitExample example = MakeEmitExample();
  for (const DroppedItem& item :
       {DroppedItem{.reason = DropReason::kFewStations, .item_id = 99},
        DroppedItem{.reason = DropReason::kNotChosen, .item_id = 3},
        DroppedItem{.reason = DropReason::kLeftOver, .item_id = 3},
        DroppedItem{.reason = DropReason::kOutsideArea, .item_id = 10, .seen_at = {3}},
        DroppedItem{.reason = DropReason::kOutsideArea, .item_id = 10, .seen_at = {0xffffffff}}}) {
    const auto counts = CountDrops(example.classes, example.world, {item});
    ASSERT_FALSE(counts.ok()) << DescribeDropReason(item.reason).name;
    EXPECT_EQ(counts.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(counts.error().message, HasSubstr(DescribeDropReason(item.reason).name));
  }
}

TEST(DropReasons, HaveDistinctNumbersAndNames) {
  std::set<std::string> names;
  int last = 0;
  for (const DropReasonEntry& entry : AllDropReasons()) {
    EXPECT_GT(static_cast<int>(entry.reason), last);
    last = static_cast<int>(entry.reason);
    EXPECT_TRUE(names.insert(entry.name).second) << entry.name;
    EXPECT_EQ(FindDropReason(last), &entry);
    EXPECT_EQ(std::string(DescribeDropReason(entry.reason).name), entry.name);
  }
  EXPECT_EQ(FindDropReason(0), nullptr);
  EXPECT_EQ(FindDropReason(last + 1), nullptr);
}

TEST(DropReasons, StandInTheDocumentAsInTheProgram) {
  const std::string document = *ReadFile(CAIRN_SOURCE_DIR "/schemas/drops.md");
  for (const DropReasonEntry& entry : AllDropReasons()) {
    EXPECT_THAT(document,
                HasSubstr(fmt::format("| {} | `{}` | {} | `{}` | {} |\n", static_cast<int>(entry.reason),
                                      entry.stage, DropKindName(entry.kind), entry.name, entry.text)));
  }
}

}  // namespace
}  // namespace cairn::emit_map
