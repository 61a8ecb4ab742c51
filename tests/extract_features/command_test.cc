#include "stages/extract_features/command.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/extract_features/capture_fixture.h"
#include "tests/ran_command.h"
#include "tests/recorded_progress.h"

namespace cairn::extract_features {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

class ExtractFeaturesCommandTest : public ExtractFeaturesTest {
 protected:
  // extract-features CAPTURE -o features.db WORDS...
  Ran Run(const std::vector<std::string>& more, int64_t memory_mib = 1 << 20) const {
    return RunWords(ExtractFeaturesCommand(), {root_, "-o", root_ + "/features.db"}, more, memory_mib);
  }
};

TEST_F(ExtractFeaturesCommandTest, SaysHowManyKeypointsItFoundAndWhatItRejected) {
  for (int i = 0; i < 3; ++i) AddImage(fmt::format("image{}.png", i), BlobImage(i));
  List("missing.png");
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok());
  std::filesystem::remove(root_ + "/features.db");
  const Ran ran = Run({"--no-reuse"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_EQ(ran.out, fmt::format("extract_features: 3 images, {} keypoints ({:.0f} an image), 1 rejected, 0 "
                                 "taken over\n",
                                 summary->num_keypoints, summary->num_keypoints / 3.0));
  EXPECT_THAT(ran.said, HasSubstr("rejected missing.png: "));
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("images", 4)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("images", 3), Pair("keypoints", summary->num_keypoints)));
  EXPECT_THAT(ran.report.taken_over, ElementsAre(Pair("images", 0)));
  ASSERT_EQ(ran.report.rejected.size(), 1U);
  const Ran again = Run({});
  EXPECT_THAT(again.out, HasSubstr("1 rejected, 3 taken over\n"));
  EXPECT_THAT(again.report.taken_over, ElementsAre(Pair("images", 3)));
}

TEST_F(ExtractFeaturesCommandTest, AShardSaysWhichItIsAndMayHaveNoImage) {
  AddImage("one.png", BlobImage(1));
  EXPECT_THAT(Run({"--shard", "1/2"}).out, HasSubstr("extract_features: shard 1/2: 1 images, "));
  EXPECT_EQ(Run({"--shard", "2/2"}).out,
            "extract_features: shard 2/2: 0 images, 0 keypoints (0 an image), 0 rejected, 0 taken over\n");
}

TEST_F(ExtractFeaturesCommandTest, TheDependencyFileNamesWhatWasReadAndItsFolders) {
  AddImage("one.png", BlobImage(1));
  std::filesystem::create_directories(root_ + "/images/room");
  AddImage("room/two.png", BlobImage(2));
  const std::string masks = testing::TempDir() + "/masks_elsewhere";
  std::filesystem::create_directories(masks);
  ASSERT_TRUE(cv::imwrite(masks + "/one.png", cv::Mat(240, 320, CV_8UC1, cv::Scalar(255))));
  ASSERT_TRUE(Run({"--depfile", root_ + "/features.d"}).status.ok());
  const std::string inside = *ReadFile(root_ + "/features.d");
  for (const char* name : {"/cameras.txt", "/images.txt", "/images/one.png", "/images/room/two.png"})
    EXPECT_THAT(inside, HasSubstr(root_ + name)) << name;
  EXPECT_THAT(inside, HasSubstr(root_ + "/images/room\n"));
  EXPECT_THAT(inside, Not(HasSubstr(masks)));
  // What lies elsewhere may vanish, too.
  ASSERT_TRUE(Run({"--depfile", root_ + "/masked.d", "--masks", masks}).status.ok());
  const std::string masked = *ReadFile(root_ + "/masked.d");
  EXPECT_THAT(masked, HasSubstr(masks + "/one.png"));
  EXPECT_THAT(masked, HasSubstr(masks + "/%"));
}

TEST_F(ExtractFeaturesCommandTest, NeedsMemoryForAnImageAtLeast) {
  AddImage("one.png", BlobImage(1));
  EXPECT_EQ(Run({}, 1).status.error().code, ErrorCode::kNoMemory);
}

TEST_F(ExtractFeaturesCommandTest, TellsHowManyImagesAreDone) {
  for (int i = 0; i < 3; ++i) AddImage(fmt::format("image{}.png", i), BlobImage(i));
  RecordedProgress progress;
  ASSERT_TRUE(ExtractFeatures(*ReadCapture(root_), {}, root_ + "/features.db", 1, progress).ok());
  progress.ExpectAllDone();
  EXPECT_EQ(progress.tasks[0].total, 3);
  RecordedProgress stopped("extract features");
  const auto none = ExtractFeatures(*ReadCapture(root_), {}, root_ + "/stopped.db", 1, stopped);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kCancelled);
  EXPECT_FALSE(std::filesystem::exists(root_ + "/stopped.db"));
}

}  // namespace
}  // namespace cairn::extract_features
