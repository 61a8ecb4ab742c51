#include "core/structure/scored_matches.h"

#include <filesystem>
#include <fstream>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/structure/union_matches.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class ScoredMatchesTest : public testing::Test {
 protected:
  ScoredMatchesTest() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ScoredMatchesTest() override { fs::remove_all(folder_); }

  int NumFiles() const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  std::string Beside() const { return folder_ / "classes.db"; }

  // Of three images with 40 keypoints each; many are equally alike.
  ScoredMatches Make(size_t num_matches, size_t max_num_in_memory) const {
    ScoredMatches matches({40, 40, 40}, Beside(), max_num_in_memory);
    Random random(num_matches);
    for (size_t k = 0; k < num_matches; ++k) {
      const auto keypoint = [&] { return static_cast<KeypointIdx>(random.UniformInt(0, 39)); };
      const auto image = static_cast<int32_t>(random.UniformInt(0, 1));
      const TrackElement first = {image, keypoint()}, second = {image + 1, keypoint()};
      matches.Add(first, second, static_cast<int32_t>(random.UniformInt(0, 9)));
    }
    return matches;
  }

  static std::vector<std::tuple<int32_t, int32_t, int32_t>> Visited(ScoredMatches matches) {
    std::vector<std::tuple<int32_t, int32_t, int32_t>> visited;
    EXPECT_TRUE(std::move(matches)
                    .Visit([&](const ScoredMatches::Match& match) {
                      visited.emplace_back(-match.dot_product, match.keypoint1, match.keypoint2);
                    })
                    .ok());
    return visited;
  }

 private:
  const fs::path folder_ = fs::path(testing::TempDir()) / "scored_matches_test";
};

TEST_F(ScoredMatchesTest, AreVisitedMostAlikeFirstWhereverTheyAre) {
  for (const size_t num_matches : {0, 1, 6, 7, 100, 1000}) {
    const auto expected = Visited(Make(num_matches, std::numeric_limits<size_t>::max()));
    EXPECT_EQ(expected.size(), num_matches);
    EXPECT_TRUE(std::is_sorted(expected.begin(), expected.end()));
    for (const size_t max_num_in_memory : {1, 2, 7, 100, 999, 1000, 1001})
      EXPECT_EQ(Visited(Make(num_matches, max_num_in_memory)), expected)
          << num_matches << " " << max_num_in_memory;
  }
}

TEST_F(ScoredMatchesTest, RunsLongerThanWhatIsReadAtOnceAreRead) {
  const size_t num_matches = 200000;
  EXPECT_EQ(Visited(Make(num_matches, 70000)), Visited(Make(num_matches, num_matches)));
}

TEST_F(ScoredMatchesTest, KeypointsAreCountedOverAllImages) {
  ScoredMatches matches({3, 0, 5});
  matches.Add({0, 2}, {2, 4}, 1);
  EXPECT_EQ(matches.first_keypoint(), (std::vector<int32_t>{0, 3, 3, 8}));
  EXPECT_EQ(Visited(std::move(matches)).front(), (std::tuple<int32_t, int32_t, int32_t>(-1, 2, 7)));
}

TEST_F(ScoredMatchesTest, NothingIsLeftInTheFolder) {
  ScoredMatches matches = Make(100, 10);
  EXPECT_EQ(NumFiles(), 0);  // the file has no name
  Visited(std::move(matches));
  EXPECT_EQ(NumFiles(), 0);
}

TEST_F(ScoredMatchesTest, TracksAreTheSameWhereverMatchesAre) {
  int64_t num_conflicts = 0, num_expected = 0;
  const std::vector<Track> expected = UnionMatches(Make(500, 1000), &num_expected).value();
  EXPECT_GT(num_expected, 0);
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(UnionMatches(Make(500, 7), &num_conflicts).value(), expected);
  EXPECT_EQ(num_conflicts, num_expected);
}

TEST_F(ScoredMatchesTest, AFolderThatIsNotThereIsAnError) {
  ScoredMatches matches({4, 4}, Beside() + ".d/classes.db", 2);
  for (KeypointIdx k = 0; k < 4; ++k) matches.Add({0, k}, {1, k}, 1);
  int num_visited = 0;
  const Status status = std::move(matches).Visit([&](const ScoredMatches::Match&) { ++num_visited; });
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_NE(status.error().message.find(Beside() + ".d/classes.db"), std::string::npos);
  EXPECT_EQ(num_visited, 0);
  ScoredMatches others({4, 4}, Beside() + ".d/classes.db", 2);
  for (KeypointIdx k = 0; k < 4; ++k) others.Add({0, k}, {1, k}, 1);
  int64_t num_conflicts = 0;
  EXPECT_FALSE(UnionMatches(std::move(others), &num_conflicts).ok());
}

TEST_F(ScoredMatchesTest, SoManyAreInMemoryAndNoMore) {
  ScoredMatches matches({4, 4}, Beside() + ".d/classes.db", 3);
  for (KeypointIdx k = 0; k < 3; ++k) matches.Add({0, k}, {1, k}, 1);
  EXPECT_TRUE(matches.status().ok());  // nothing was written yet
  matches.Add({0, 3}, {1, 3}, 1);
  EXPECT_FALSE(matches.status().ok());
}

}  // namespace
}  // namespace cairn
