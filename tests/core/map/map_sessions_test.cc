#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// The example's images 1, 2 and 4, of the surveys "day1", "day2" and none.
MapRows RowsOfTwoSessions() {
  const EmitExample example = MakeEmitExample();
  MapRows rows = emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                   {.landmarks = "all"})
                     .value();
  rows.sessions = {"day1", "day2"};
  rows.images[0].name = "day1/1.png";
  rows.images[1].name = "day2/1.png";
  return rows;
}

TEST(MapSessions, LandmarkIsKnownToTheSessionsOfTheImagesThatSeeIt) {
  MapRows rows = RowsOfTwoSessions();
  const auto sessions = LandmarkSessions(rows);
  for (size_t i = 0; i < rows.landmarks.size(); ++i) {
    // Classes 10 and 11 are seen in images 1 and 2, classes 12 and 13 in images 2 and 4.
    if (rows.landmarks[i].class_id <= 11) {
      EXPECT_THAT(sessions[i], ElementsAre(0, 1));
    } else {
      EXPECT_THAT(sessions[i], ElementsAre(1));
    }
  }
  rows.sessions.clear();
  for (const std::vector<int>& of_landmark : LandmarkSessions(rows)) EXPECT_THAT(of_landmark, IsEmpty());
}

TEST(MapSessions, AreReadFromAMapAsTheyWereWritten) {
  const std::string path = testing::TempDir() + "/map_sessions_test.cairn";
  ASSERT_TRUE(WriteMapRows(RowsOfTwoSessions(), path).ok());
  EXPECT_THAT(ReadMapRows(path)->sessions, ElementsAre("day1", "day2"));
  MapRows rows = RowsOfTwoSessions();
  rows.sessions.clear();
  ASSERT_TRUE(WriteMapRows(rows, path).ok());
  EXPECT_THAT(ReadMapRows(path)->sessions, IsEmpty());
}

TEST(MapSessions, NamesThatAreNoneOrStandTwiceAreNotWritten) {
  const std::string path = testing::TempDir() + "/map_sessions_test.cairn";
  MapRows rows = RowsOfTwoSessions();
  rows.sessions = {"day1", "day1"};
  EXPECT_EQ(WriteMapRows(rows, path).error().code, ErrorCode::kInvalidArgument);
  rows.sessions = {"day 1"};
  EXPECT_EQ(WriteMapRows(rows, path).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn
