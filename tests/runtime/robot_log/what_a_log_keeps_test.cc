// Which frames a log keeps, and what it says of them: distances, bytes, cameras, lists; and a log that
// several localizers share.
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/capture/capture_features.h"
#include "core/files/file.h"
#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/localize/localizer.h"
#include "runtime/robot_log/robot_log.h"
#include "runtime/robot_log/shared_log.h"
#include "tests/core/capture/features_database.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kDay = 86400;
// What a frame of ten features counts: rows and pages, and 144 bytes for each.
constexpr double kFrameBytes = 16384 + 10 * 144;

class KeptFrames : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        testing::TempDir() + "/kept_frames_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    map_.name = "hall";
    camera_ = FeaturesCamera(5);
  }
  // With a budget for so many frames of ten features at once.
  void Open(double num_frames = 1e3, double at_s = 0) {
    log_.reset();
    auto log =
        RobotLog::Open(folder_, map_, {.max_mb_per_day = 2 * num_frames * kFrameBytes / 1e6}, ClocksAt(at_s));
    ASSERT_TRUE(log.ok()) << log.error().message;
    log_.emplace(std::move(*log));
  }
  bool Offer(double x, double turn_deg = 0, double at_s = 0, int num_features = 10) {
    const Features features = RandomFeatures(1, num_features);
    const LoggedFrame frame{&features, &camera_, PoseOf(x, turn_deg), "some/where.png"};
    const auto kept = log_->Offer(frame, ClocksAt(at_s));
    EXPECT_TRUE(kept.ok()) << kept.error().message;
    return kept.ok() && *kept;
  }
  bool IsWanted(double x) { return log_->IsWanted(PoseOf(x, 0), ClocksAt(0)); }
  static MachineClocks ClocksAt(double at_s) { return {1e6 + at_s, at_s, "boot"}; }
  static Pose PoseOf(double x, double turn_deg) {
    Pose pose;
    pose.rotation = Eigen::AngleAxisd(RadFromDeg(turn_deg), Eigen::Vector3d::UnitY());
    pose.translation = -(pose.rotation * Eigen::Vector3d(x, 0.25, 0));
    return pose;
  }

  std::string folder_;
  MapHead map_;
  Camera camera_;
  std::optional<RobotLog> log_;
};

TEST_F(KeptFrames, DifferByHalfAMetreOrThirtyDegreesOrSomeOfBoth) {
  Open();
  EXPECT_TRUE(Offer(0));
  EXPECT_FALSE(Offer(0.49));
  EXPECT_FALSE(Offer(0, 29));
  EXPECT_FALSE(Offer(0.35, 20));
  EXPECT_TRUE(Offer(0.4, 20));  // 0.8^2 + 0.667^2 > 1
  EXPECT_TRUE(Offer(-0.51));
  EXPECT_TRUE(Offer(0, -31));
}

TEST_F(KeptFrames, AreFartherApartWhereTheBudgetIsLow) {
  Open(2.5);
  EXPECT_TRUE(Offer(0));
  EXPECT_FALSE(Offer(0.82)) << "3 fifths are left: 0.5 m / 0.6";
  EXPECT_TRUE(Offer(0.85));
}

TEST_F(KeptFrames, AreNoMoreThanEightTimesAsFarApart) {
  Open(9.05);
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(Offer(100 * i));
  EXPECT_FALSE(Offer(3.9));
  EXPECT_TRUE(Offer(4.1));
}

TEST_F(KeptFrames, FitTheBudgetAndAreWantedWhereHalfOfTheLastWould) {
  Open(1.5);
  EXPECT_FALSE(Offer(0, 0, 0, 100));
  EXPECT_TRUE(Offer(0));
  EXPECT_EQ(log_->num_kept(), 1);
  EXPECT_FALSE(Offer(50));
  EXPECT_FALSE(IsWanted(50));
  // Of what two frames take, 1.1 with 16384 bytes and half of the features that there were are enough.
  fs::remove_all(folder_);
  Open(2.6);
  EXPECT_TRUE(Offer(0));
  EXPECT_TRUE(IsWanted(50)) << "1.6 frames are left, and 0.92 and half a frame are asked for";
  fs::remove_all(folder_);
  Open(2.3);
  EXPECT_TRUE(Offer(0));
  EXPECT_FALSE(IsWanted(50)) << "1.3 are left";
}

TEST_F(KeptFrames, MayTakeAllThatIsLeft) {
  Open(1);
  EXPECT_TRUE(Offer(0));
  fs::remove_all(folder_);
  Open(16384 / kFrameBytes);
  EXPECT_TRUE(IsWanted(0)) << "of features of which none was kept before";
  EXPECT_FALSE(Offer(0));
}

TEST_F(KeptFrames, AreLockedByAFileThatAllMayWrite) {
  const mode_t mask = umask(0);
  Open();
  umask(mask);
  EXPECT_EQ(fs::status(folder_ + "/lock").permissions(), static_cast<fs::perms>(0666));
}

TEST_F(KeptFrames, OfThePlacesOfADayAreRememberedByTheNextProcess) {
  Open();
  EXPECT_TRUE(Offer(0));
  Open(1e3, 0.99 * kDay);
  EXPECT_FALSE(Offer(0, 0, 0.99 * kDay));
  EXPECT_TRUE(Offer(7, 0, 0.99 * kDay));
  Open(1e3, kDay);
  EXPECT_TRUE(Offer(0, 0, kDay));
  EXPECT_FALSE(Offer(7, 0, kDay));
  Open(1e3, 1.5 * kDay);
  EXPECT_FALSE(Offer(7, 0, 1.5 * kDay));
}

TEST_F(KeptFrames, OfOnePlaceAreADayApart) {
  Open();
  EXPECT_TRUE(Offer(0));
  EXPECT_FALSE(Offer(0, 0, kDay - 1));
  EXPECT_TRUE(Offer(0, 0, kDay));
}

TEST_F(KeptFrames, WithoutFeaturesAreNone) {
  Open();
  EXPECT_FALSE(Offer(0, 0, 0, 0));
  EXPECT_EQ(log_->num_kept(), 0);
}

TEST_F(KeptFrames, AreOfAsManyCamerasAsThereAre) {
  Open();
  const Camera first = camera_;
  EXPECT_TRUE(Offer(0));
  camera_.camera_id = 77;  // which says nothing
  EXPECT_TRUE(Offer(1));
  camera_.params[0] += 1;
  EXPECT_TRUE(Offer(2));
  camera_ = first;
  camera_.height += 1;
  EXPECT_TRUE(Offer(3));
  Open();
  EXPECT_TRUE(Offer(4));
  camera_.width += 1;
  EXPECT_TRUE(Offer(5));
  camera_ = first;
  EXPECT_TRUE(Offer(6));
  const auto capture = ReadCapture(folder_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  std::vector<CameraId> cameras;
  for (const auto& image : capture->images) cameras.push_back(image.camera_id);
  EXPECT_THAT(cameras, testing::ElementsAre(1, 1, 2, 3, 3, 4, 1));
  EXPECT_EQ(capture->cameras.at(2).params[0], first.params[0] + 1);
  EXPECT_EQ(capture->cameras.at(4).width, first.width + 1);
}

TEST_F(KeptFrames, AreListedWithTheirPosesByTheNextProcessToo) {
  Open();
  EXPECT_TRUE(Offer(1.25, 40));
  const std::string list = ReadFile(folder_ + "/images.txt").value();
  const Pose pose = PoseOf(1.25, 40);
  EXPECT_EQ(list,
            fmt::format("1 {:.9f} 0.000000000 {:.9f} 0.000000000 {:.6f} -0.250000 {:.6f} 1 00000001.png\n\n",
                        std::cos(RadFromDeg(20)), std::sin(RadFromDeg(20)), pose.translation.x(),
                        pose.translation.z()));
  fs::remove(folder_ + "/images.txt");
  Open();
  EXPECT_EQ(ReadFile(folder_ + "/images.txt").value(), list);
}

TEST_F(KeptFrames, WithImagesCountThem) {
  const std::string image = testing::TempDir() + "/kept_frames_image.png";
  ASSERT_TRUE(WriteFileAtomically(image, std::string(20000, 'x')).ok());
  const Features features = RandomFeatures(1, 10);
  const auto offer = [&](double num_bytes, const std::string& path) -> Result<bool> {
    fs::remove_all(folder_);
    auto log = RobotLog::Open(folder_, map_, {.max_mb_per_day = 2 * num_bytes / 1e6, .keep_images = true},
                              {0, 0, "boot"});
    if (!log.ok()) return log.error();
    return log->Offer({&features, &camera_, Pose(), path}, {0, 0, "boot"});
  };
  EXPECT_TRUE(offer(kFrameBytes + 20001, image).value());
  EXPECT_FALSE(offer(kFrameBytes + 19999, image).value());
  EXPECT_EQ(offer(1e9, image + ".none").error().code, ErrorCode::kIo);
}

TEST_F(KeptFrames, NeedABoundAndFeaturesOfTheKindThatLogsKeep) {
  for (const double mb :
       {0.0, -1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(RobotLog::Open(folder_, map_, {.max_mb_per_day = mb}, {}).error().code,
              ErrorCode::kInvalidArgument);
  map_.descriptor_kind = {.type = DescriptorType::kBinary, .num_values = 256};
  EXPECT_EQ(RobotLog::Open(folder_, map_, {}, {}).error().code, ErrorCode::kUnsupported);
}

TEST(MachineClocks, AreThoseOfTheMachine) {
  const auto wall_s = [] {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  };
  for (int i = 0; i < 5; ++i) {
    const double before = wall_s();
    const MachineClocks now = ReadMachineClocks();
    // A clock may be set meanwhile, by little.
    EXPECT_GE(now.wall_s, before - 1);
    EXPECT_LE(now.wall_s, wall_s() + 1);
    EXPECT_GT(now.boot_s, 0);
    EXPECT_EQ(now.boot_id, ReadMachineClocks().boot_id);
  }
}

TEST(LogBudget, IsAsFullAsWhatIsLeft) {
  LogBudget budget = LogBudget::Begin(1000, {50, 5, "a"});
  budget.bytes = 125;
  EXPECT_EQ(budget.Fill(1000), 0.25);
  EXPECT_EQ(budget.Fill(100), 1) << "of a bound that was larger before";
  budget.bytes = 10;
  EXPECT_EQ(budget.Fill(1000), 0.02);
  budget.bytes = 125;
  budget.Advance(1000, {50, 5, "a"});
  EXPECT_EQ(budget.bytes, 125);
  budget.Advance(1000, {60, 25, "a"});
  EXPECT_EQ(budget.lived_s, 20);
  EXPECT_EQ(budget.latest_wall_s, 60);
  // A clock of the machine that goes back is that of another start.
  budget.Advance(1000, {90, 24, "a"});
  EXPECT_EQ(budget.lived_s, 50);
  budget.Advance(1000, {70, 1, "b"});
  EXPECT_EQ(budget.lived_s, 50);
  EXPECT_EQ(budget.latest_wall_s, 90);
}

class SharedLogTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/shared_log";
    fs::remove_all(folder_);
    map_ = *Map::FromRows(MakeSyntheticRoom(1, 40).rows);
    log_ = SharedLog::Open(folder_, *map_).value();
  }
  void Offer(double x, NoFix reason = NoFix::kNone) {
    Query query;
    query.features = RandomFeatures(1, 10);
    query.camera = FeaturesCamera(5);
    Localization found;
    found.reason = reason;
    found.cam_from_world.translation.x() = -x;
    log_->Offer(query, found);
  }

  std::string folder_;
  std::shared_ptr<const Map> map_;
  std::shared_ptr<SharedLog> log_;
};

TEST_F(SharedLogTest, KeepsFramesWithAFixUntilItIsClosed) {
  Offer(0);
  Offer(2, NoFix::kNoPose);
  EXPECT_EQ(log_->num_kept(), 1);
  Offer(2);
  EXPECT_EQ(log_->num_kept(), 2);
  EXPECT_EQ(ReadCapture(folder_)->images[1].name, "00000002.pgm");
  EXPECT_EQ(SharedLog::Open(folder_, *map_).error().code, ErrorCode::kBusy);
  log_->Close();
  Offer(4);
  EXPECT_EQ(log_->num_kept(), 2);
  EXPECT_TRUE(log_->error().ok());
  EXPECT_TRUE(SharedLog::Open(folder_, *map_).ok());
}

TEST_F(SharedLogTest, KeepsAFrameWhereItsPlaceIsNew) {
  const Localizer localizer(map_);
  Localization found;
  found.reason = NoFix::kNone;
  for (const auto& [x, num_kept] : {std::pair(0.0, 1), {0.1, 1}, {3.0, 2}, {6.0, 2}}) {
    if (x == 6) log_->Close();
    found.cam_from_world.translation.x() = -x;
    QueryFrame frame(localizer, RandomFeatures(1, 10), FeaturesCamera(5));
    log_->Offer(&frame, found);
    EXPECT_EQ(log_->num_kept(), num_kept) << x;
  }
  EXPECT_EQ(ReadCaptureFeatures(ReadCapture(folder_)->features.at("00000002.pgm"), FeaturesCamera(1))
                ->keypoints.size(),
            10U);
}

TEST_F(SharedLogTest, IsOfOneMapInItsFrame) {
  EXPECT_TRUE(log_->CheckIsOf(*map_).ok());
  MapRows rows = MakeSyntheticRoom(1, 40).rows;
  rows.frame.unit = "arbitrary";
  EXPECT_EQ(log_->CheckIsOf(**Map::FromRows(rows)).error().code, ErrorCode::kInvalidArgument);
  rows = MakeSyntheticRoom(1, 40).rows;
  rows.name = "kitchen";
  EXPECT_THAT(log_->CheckIsOf(**Map::FromRows(rows)).error().message, HasSubstr("not of 'kitchen'"));
}

TEST_F(SharedLogTest, SaysWhyItKeepsNothingMore) {
  Offer(0);
  fs::remove(folder_ + "/images.txt");
  fs::create_directories(folder_ + "/images.txt/full");
  Offer(2);
  ASSERT_FALSE(log_->error().ok());
  const int kept = log_->num_kept();
  fs::remove_all(folder_ + "/images.txt");
  Offer(4);
  EXPECT_EQ(log_->num_kept(), kept);
  EXPECT_FALSE(log_->error().ok());
}

}  // namespace
}  // namespace cairn
