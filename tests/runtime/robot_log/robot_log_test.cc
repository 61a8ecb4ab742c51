#include "runtime/robot_log/robot_log.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/files/file.h"
#include "tests/core/capture/features_database.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kHourS = 3600, kDayS = 24 * kHourS;
constexpr double kMaxBytes = 1000;

MachineClocks At(double wall_s, double boot_s, const std::string& boot_id = "first") {
  return {wall_s, boot_s, boot_id};
}

TEST(LogBudget, GrowsByHalfOfTheBoundInADayAndUpToThat) {
  LogBudget budget = LogBudget::Begin(kMaxBytes, At(0, 0));
  EXPECT_EQ(budget.bytes, 500);
  budget.bytes = 0;
  budget.Advance(kMaxBytes, At(6 * kHourS, 6 * kHourS));
  EXPECT_NEAR(budget.bytes, 125, 1e-9);
  budget.Advance(kMaxBytes, At(9 * kDayS, 9 * kDayS));
  EXPECT_EQ(budget.bytes, 500);
  EXPECT_EQ(budget.Fill(kMaxBytes), 1);
  // However it is spent: in no 24 hours more than the bound.
  double spent = 0;
  for (int hour = 0; hour < 24; ++hour) {
    spent += budget.bytes;
    budget.bytes = 0;
    budget.Advance(kMaxBytes, At(10 * kDayS + hour * kHourS, 9 * kDayS + hour * kHourS));
  }
  EXPECT_LE(spent, kMaxBytes);
}

TEST(LogBudget, WallClockThatJumpsWhileTheMachineRunsChangesNothing) {
  LogBudget budget = LogBudget::Begin(kMaxBytes, At(1000 * kDayS, 0));
  budget.bytes = 0;
  budget.Advance(kMaxBytes, At(5000 * kDayS, 1));
  budget.Advance(kMaxBytes, At(0, 2));
  budget.Advance(kMaxBytes, At(9000 * kDayS, 3));
  EXPECT_NEAR(budget.bytes, 500 * 3 / kDayS, 1e-9);
}

TEST(LogBudget, WallClockThatJumpsBetweenStartsGivesAFullAmountOnceAtMost) {
  LogBudget budget = LogBudget::Begin(kMaxBytes, At(1000 * kDayS, 7));
  budget.bytes = 0;
  budget.Advance(kMaxBytes, At(1000 * kDayS + 12 * kHourS, 5, "second"));  // half a day switched off
  EXPECT_NEAR(budget.bytes, 250, 1e-9);
  budget.Advance(kMaxBytes, At(0, 5, "third"));  // the battery of its clock is empty
  EXPECT_NEAR(budget.bytes, 250, 1e-9);
  budget.Advance(kMaxBytes, At(9000 * kDayS, 5, "fourth"));
  EXPECT_EQ(budget.bytes, 500);
  budget.bytes = 0;
  for (int i = 0; i < 20; ++i) {  // to and fro
    budget.Advance(kMaxBytes, At(1001 * kDayS, 5, fmt::format("{}", 2 * i)));
    budget.Advance(kMaxBytes, At(9000 * kDayS, 5, fmt::format("{}", 2 * i + 1)));
  }
  EXPECT_EQ(budget.bytes, 0);
}

class RobotLogTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        testing::TempDir() + "/robot_log_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    map_.name = "hall";
    image_ = testing::TempDir() + "/robot_log_image.jpg";
    ASSERT_TRUE(WriteFileAtomically(image_, std::string(2000, 'x')).ok());
  }
  // Offers a frame at this place, looking ahead, with ten features.
  bool Offer(double x, double at_s, RobotLog* log) { return OfferMany(x, at_s, 10, log); }
  bool OfferMany(double x, double at_s, int num_features, RobotLog* log) {
    const Features features = RandomFeatures(static_cast<uint64_t>(100 * x), num_features);
    const Camera camera = FeaturesCamera(5);
    Pose pose;
    pose.translation.x() = -x;
    const auto kept = log->Offer({&features, &camera, pose, image_}, At(at_s, at_s));
    EXPECT_TRUE(kept.ok()) << kept.error().message;
    return kept.ok() && *kept;
  }
  Result<RobotLog> Open(double at_s = 0, const RobotLogOptions& options = {}) {
    return RobotLog::Open(folder_, map_, options, At(at_s, at_s));
  }

  std::string folder_, image_;
  MapHead map_;
};

TEST_F(RobotLogTest, SaysWhetherAFrameIsWantedBeforeItsFeaturesAreKnown) {
  auto log = Open();
  Pose here, elsewhere;
  elsewhere.translation.x() = -2;
  EXPECT_TRUE(log->IsWanted(here, At(1, 1)));
  EXPECT_TRUE(Offer(0, 1, &*log));
  EXPECT_FALSE(log->IsWanted(here, At(2, 2)));
  EXPECT_TRUE(log->IsWanted(elsewhere, At(2, 2)));
  EXPECT_TRUE(Offer(2, 2, &*log));
  EXPECT_FALSE(log->IsWanted(elsewhere, At(3, 3)));
}

TEST_F(RobotLogTest, IsACaptureOfFeaturesThatLaterRunsAddTo) {
  {
    auto log = Open();
    ASSERT_TRUE(log.ok()) << log.error().message;
    EXPECT_TRUE(Offer(0, 1, &*log));
    EXPECT_TRUE(Offer(2, 2, &*log));
    EXPECT_EQ(log->num_kept(), 2);
  }
  {
    auto log = Open(10);
    ASSERT_TRUE(log.ok()) << log.error().message;
    EXPECT_FALSE(Offer(0, 11, &*log));
    EXPECT_TRUE(Offer(4, 12, &*log));
  }
  const auto capture = ReadCapture(folder_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  ASSERT_EQ(capture->images.size(), 3u);
  EXPECT_THAT(capture->warnings, testing::IsEmpty());
  EXPECT_EQ(capture->images[2].name, "00000003.jpg");
  EXPECT_EQ(capture->images[2].cam_from_world->translation.x(), -4);
  EXPECT_EQ(capture->cameras.size(), 1u);
  EXPECT_EQ(capture->frame->unit, "metre");
  const auto features = ReadCaptureFeatures(capture->features.at("00000003.jpg"), capture->cameras.at(1));
  ASSERT_TRUE(features.ok()) << features.error().message;
  EXPECT_EQ(features->keypoints[9].x, RandomFeatures(400, 10).keypoints[9].x);
  EXPECT_FALSE(fs::exists(folder_ + "/images"));
}

TEST_F(RobotLogTest, FramesOfAPlaceAreKeptOnceADay) {
  auto log = Open();
  ASSERT_TRUE(log.ok());
  EXPECT_TRUE(Offer(0, 0, &*log));
  EXPECT_FALSE(Offer(0.3, 1, &*log));
  EXPECT_TRUE(Offer(0.6, 2, &*log));
  EXPECT_FALSE(Offer(0, 0.9 * kDayS, &*log));
  EXPECT_TRUE(Offer(0, 1.1 * kDayS, &*log));
}

// Frames of 161 kB and a bound of 2 MB: half of it at once, the other half over the day, whatever comes.
TEST_F(RobotLogTest, FolderGrowsByNoMoreThanTheBoundInADay) {
  auto log = Open(0, {.max_mb_per_day = 2});
  ASSERT_TRUE(log.ok());
  int num_kept = 0, num_at_once = 0;
  for (int minute = 0; minute < 24 * 60; minute += 10) {
    num_kept += OfferMany(5 * minute, 60 * minute, 1000, &*log);
    if (minute == 60) num_at_once = num_kept;
  }
  EXPECT_GE(num_at_once, 5);
  EXPECT_GE(num_kept, num_at_once + 5);
  log = MakeError(ErrorCode::kFailed, "closed");
  uintmax_t num_bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
    if (entry.is_regular_file()) num_bytes += entry.file_size();
  }
  EXPECT_LE(num_bytes, 2e6);
  EXPECT_GE(num_bytes, 1.6e6);
}

TEST_F(RobotLogTest, ImagesAreKeptOnlyWhereTheyAreAskedFor) {
  auto log = Open(0, {.keep_images = true});
  ASSERT_TRUE(log.ok());
  EXPECT_TRUE(Offer(0, 0, &*log));
  EXPECT_EQ(ReadFile(folder_ + "/images/00000001.jpg").value(), std::string(2000, 'x'));
}

TEST_F(RobotLogTest, ListsThatMissTheLastFrameAreWrittenAgain) {
  {
    auto log = Open();
    ASSERT_TRUE(log.ok());
    EXPECT_TRUE(Offer(1, 0, &*log));
    EXPECT_TRUE(Offer(3, 0, &*log));
  }
  const std::string list = ReadFile(folder_ + "/images.txt").value();
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/images.txt", list.substr(0, list.find("\n\n") + 2)).ok());
  EXPECT_EQ(ReadCapture(folder_)->images.size(), 1u);
  ASSERT_TRUE(Open().ok());
  EXPECT_EQ(ReadFile(folder_ + "/images.txt").value(), list);
}

TEST_F(RobotLogTest, OnlyOneProcessWritesAndOnlyToALogOfThisMap) {
  {
    const auto log = Open();
    ASSERT_TRUE(log.ok());
    const auto second = Open();
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, ErrorCode::kBusy);
  }
  map_.name = "kitchen";
  EXPECT_THAT(Open().error().message, HasSubstr("the log of another map"));
  map_.name = "hall";
  map_.frame.unit = "arbitrary";
  EXPECT_EQ(Open().error().code, ErrorCode::kInvalidArgument);
  fs::remove_all(folder_);
  fs::create_directories(folder_ + "/images");
  EXPECT_THAT(Open().error().message, HasSubstr("is no log of a robot"));
  fs::remove_all(folder_);
  fs::create_directories(folder_);
  ASSERT_TRUE(WriteFeaturesDatabase(folder_ + "/features.db", FeaturesCamera(1), {}).ok());
  EXPECT_THAT(Open().error().message, HasSubstr("no log of a robot"));
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/features.db", "text").ok());
  EXPECT_EQ(Open().error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn
