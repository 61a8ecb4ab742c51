#include "stages/reconstruct/find_frame.h"

#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/core/capture/exif_jpeg.h"
#include "tests/reconstruct/inertial/simulated_imu.h"

namespace cairn::reconstruct {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Sixty images along +x, 0.1 m apart, that look up; reconstructed at a quarter of their size.
class FindFrameTest : public testing::Test {
 protected:
  void SetUp() override {
    capture_.root = testing::TempDir() + "find_frame";
    std::filesystem::remove_all(capture_.root);
    std::filesystem::create_directories(capture_.root);
    for (int i = 0; i < 60; ++i) {
      capture_.images.push_back({fmt::format("{:02}.jpg", i), 1, std::nullopt});
      model_[capture_.images.back().name] = {Eigen::Quaterniond::Identity(), {-0.025 * i, 0, 0}};
    }
  }
  void WriteOdometry(double step_m, double step_of_half_m,
                     const std::string& world_from_cam_xyzw = "0 0 0 1") {
    std::string text;
    double x = 0;
    for (int i = 0; i < 60; ++i) {
      text += fmt::format("{:02}.jpg {} 0 0 {}\n", i, x, world_from_cam_xyzw);
      x += i % 20 < 10 ? step_m : step_of_half_m;
    }
    ASSERT_TRUE(WriteFileAtomically(capture_.root + "/odometry.txt", text).ok());
  }
  // GPS of every image, `step_m` apart to the east.
  void WriteGps(double step_m) {
    capture_.images_folder = capture_.root;
    const auto seconds = [](double angle_deg) {
      return Rationals{{0, 1}, {0, 1}, {static_cast<uint32_t>(std::llround(angle_deg * 3.6e6)), 1000}};
    };
    for (int i = 0; i < 60; ++i) {
      const GeodeticPosition gps = GeodeticFromEnu({10, 20, 30}, {i * step_m, 0, 0});
      const GpsBlock block{.latitude = seconds(gps.latitude_deg),
                           .longitude = seconds(gps.longitude_deg),
                           .altitude = {{30, 1}}};
      Write(fmt::format("{:02}.jpg", i), ExifJpeg(block));
    }
  }
  // Two distances, by which the images are `step_m` apart.
  void WriteDistances(double step_m) {
    Write("distances.txt", fmt::format("00.jpg 30.jpg {}\n10.jpg 50.jpg {}\n", 30 * step_m, 40 * step_m));
    options_.distances = "distances.txt";
  }
  void Write(const std::string& name, const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(capture_.root + "/" + name, text).ok());
  }
  Result<Similarity> Find(const std::string& scale_from) {
    result_ = {};
    options_.scale_from = scale_from;
    ColmapModel reconstruction;
    for (const auto& [name, pose] : model_) {
      const auto image_id = static_cast<ImageId>(reconstruction.images.size() + 1);
      reconstruction.images.push_back(
          {.image_id = image_id, .name = name, .camera_id = 1, .cam_from_world = pose, .keypoints = {}});
    }
    reconstruction.points = points_;
    return FindFrame(reconstruction, capture_, options_, &result_);
  }
  std::vector<std::string> Sources() const {
    std::vector<std::string> names;
    for (const ScaleFound& scale : result_.scales) names.push_back(scale.source);
    return names;
  }
  ReconstructOptions options_;
  Capture capture_;
  ModelPoses model_;
  std::vector<ModelPoint> points_;
  ReconstructResult result_;
};

TEST_F(FindFrameTest, OdometryGivesMetresWhereItIsThere) {
  WriteOdometry(0.1, 0.1);
  for (const std::string from : {"auto", "odometry"}) {
    const auto similarity = Find(from);
    ASSERT_TRUE(similarity.ok()) << similarity.error().message;
    EXPECT_NEAR(similarity->scale, 4, 1e-9);
    EXPECT_EQ(result_.frame.source, "odometry");
    EXPECT_EQ(result_.frame.unit, "metre");
    // Of forty pieces that agree to 0.5 %, and a wheel's radius that they share.
    EXPECT_GT(result_.frame.scale_sigma_ratio, 0.01);
    EXPECT_LT(result_.frame.scale_sigma_ratio, 0.0102);
    EXPECT_GE(result_.residuals.size(), 3u);
    EXPECT_FALSE(result_.residuals[0].is_off);
    EXPECT_THAT(result_.warnings, IsEmpty());
  }
  ASSERT_TRUE(Find("none").ok());
  EXPECT_EQ(result_.frame.source, "none");
}

// 0.1 m a step, told in other units; what is seen is 2 m away.
TEST_F(FindFrameTest, OdometryInMillimetresIsWarnedOf) {
  points_.push_back({.position = {0, 0, 0.5}, .track = {{1, 0}}});
  for (const auto& [step, warning] : std::vector<std::pair<double, std::string>>{
           {0.1, ""}, {100, "2000 m away on the median"}, {10, ""}, {0.0001, "kilometres"}}) {
    WriteOdometry(step, step);
    ASSERT_TRUE(Find("odometry").ok());
    if (warning.empty()) {
      EXPECT_THAT(result_.warnings, IsEmpty());
    } else {
      EXPECT_THAT(result_.warnings, ElementsAre(AllOf(HasSubstr("odometry.txt"), HasSubstr(warning))));
    }
  }
}

// A centimetre apart or a metre: what they look at says how large the unit is.
TEST_F(FindFrameTest, WithoutScaleTheUnitIsThatOfWhatIsSeenHoweverDenselyPicturesAreTaken) {
  points_.resize(3);
  points_[0] = {.position = {0, 0, 1}, .track = {{1, 0}}};
  points_[1] = {.position = {0.025 * 9, 0, 5}, .track = {{10, 0}}};  // the median
  points_[2] = {.position = {0.025 * 20, 3, 4}, .track = {{10, 0}, {21, 0}}};
  ASSERT_DOUBLE_EQ(options_.unscaled_depth, 2.5);
  const auto similarity = Find("none");
  ASSERT_TRUE(similarity.ok()) << similarity.error().message;
  EXPECT_EQ(result_.frame.unit, "arbitrary");
  EXPECT_NEAR(similarity->scale, 0.5, 1e-12);
  points_.clear();
  EXPECT_DOUBLE_EQ(Find("none")->scale, 1);
}

// A walk of a minute, and the IMU that was in the hand.
class FindFrameByImu : public FindFrameTest {
 protected:
  void Walk(const Motion& motion) {
    const ImuRecording imu = RecordImu(motion, {}, 60, 5);
    model_.clear();
    capture_.images.clear();
    for (const TimedImage& image : ModelOfMotion(motion, {.model_per_metre = 0.25}, 60, 0, 5)) {
      model_[image.name] = image.cam_from_model;
      capture_.images.push_back({image.name, 1, std::nullopt});
    }
    for (const ImuSample& s : imu.samples) {
      csv_ += fmt::format("{},{},{},{},{},{},{}\n", s.time_ns, s.gyro.x(), s.gyro.y(), s.gyro.z(),
                          s.accel.x(), s.accel.y(), s.accel.z());
    }
    Write("imu.csv", csv_);
  }
  // Of what is found, against the world's.
  double UpErrorDeg(const Similarity& world_from_model) const {
    const Eigen::Vector3d up = ModelFromWorld(1).rotation * Eigen::Vector3d::UnitZ();
    return DegFromRad(std::acos(std::min(1.0, (world_from_model.rotation * up).z())));
  }
  std::string csv_;
};

TEST_F(FindFrameByImu, GivesMetresAndLevel) {
  Walk(Handheld(5));
  for (const std::string from : {"auto", "imu"}) {
    const auto similarity = Find(from);
    ASSERT_TRUE(similarity.ok()) << similarity.error().message;
    EXPECT_NEAR(similarity->scale, 4, 0.12);
    EXPECT_EQ(result_.frame.source, "imu");
    EXPECT_EQ(result_.frame.unit, "metre");
    EXPECT_GT(result_.frame.scale_sigma_ratio, 0.005);
    EXPECT_LT(result_.frame.scale_sigma_ratio, 0.03);
    EXPECT_LT(UpErrorDeg(*similarity), 1);
    EXPECT_THAT(result_.warnings, IsEmpty());
  }
  // A distance that says otherwise.
  const std::string first = model_.begin()->first, last = model_.rbegin()->first;
  const double apart_m = 4 * CenterErrorM(model_.at(first), model_.at(last));
  Write("distances.txt", fmt::format("{} {} {}\n", first, last, 2 * apart_m));
  options_.distances = "distances.txt";
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(Sources(), ElementsAre("imu", "distances"));
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("two sources contradict each other on the scale")));
  // It says where up is, to those that do not know it.
  EXPECT_LT(UpErrorDeg(*Find("distances")), 1);
  EXPECT_LT(UpErrorDeg(*Find("none")), 1);
}

TEST_F(FindFrameByImu, ThatIsNotAcceleratedSaysWhereUpIsAlone) {
  Walk(Steady());
  const auto similarity = Find("auto");
  ASSERT_TRUE(similarity.ok());
  EXPECT_EQ(result_.frame.unit, "arbitrary");
  EXPECT_LT(UpErrorDeg(*similarity), 1);
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("the motion does not show the scale"),
                                            HasSubstr("nothing gives a scale")));
  EXPECT_THAT(Find("imu").error().message, HasSubstr("scale_from = imu: "));
}

TEST_F(FindFrameByImu, OfImagesWithoutTimesSaysWhatTheirNamesAreToBe) {
  Walk(Handheld(5));
  model_ = {{"a.jpg", model_.begin()->second}, {"b.jpg", model_.rbegin()->second}};
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(result_.warnings[0], HasSubstr("no image is named by its time, such as"));
  std::filesystem::remove(capture_.root + "/imu.csv");
  EXPECT_EQ(Find("imu").error().code, ErrorCode::kNotFound);
  Write("imu.csv", "1,2\n");
  EXPECT_EQ(Find("auto").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(Find("none").error().code, ErrorCode::kCorrupt);
}

// Two walks, of which one measured in g.
TEST_F(FindFrameByImu, OfOneSessionGivesMetresWhereThatOfAnotherSaysNothing) {
  Walk(Handheld(5));
  ModelPoses joined;
  for (const auto& [name, pose] : model_) joined["day2/" + name] = joined["day1/" + name] = pose;
  model_ = joined;
  std::filesystem::remove(capture_.root + "/imu.csv");
  std::filesystem::create_directories(capture_.root + "/imu");
  Write("sessions.txt", "day1 /day1\nday2 /day2\n");
  Write("imu/day1.csv", "0,0,0,0,0,0,1\n5000000,0,0,0,0,0,1\n2000000000,0,0,0,0,0,1\n");
  Write("imu/day2.csv", csv_);
  const auto similarity = Find("auto");
  ASSERT_TRUE(similarity.ok()) << similarity.error().message;
  EXPECT_NEAR(similarity->scale, 4, 0.12);
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("imu/day1.csv: ")));
  Write("imu/day1.csv", "1,2\n");
  EXPECT_EQ(Find("auto").error().code, ErrorCode::kCorrupt);
}

TEST_F(FindFrameTest, OdometryThatDisagreesWithTheImagesIsReported) {
  WriteOdometry(0.1, 0.2);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("the odometry and the images disagree by")));
}

TEST_F(FindFrameTest, OdometryWhoseZPointsDownIsReported) {
  WriteOdometry(0.1, 0.1, "0.7071067812 0 0 0.7071067812");  // the image's down is +z
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("upside down (180 degrees)")));
  WriteOdometry(0.1, 0.1, "-0.7071067812 0 0 0.7071067812");
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(result_.warnings, IsEmpty());
}

TEST_F(FindFrameTest, WithoutOdometryNothingGivesAScale) {
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.unit, "arbitrary");
  EXPECT_THAT(result_.warnings,
              ElementsAre(HasSubstr("control_points, camera_height_m or distances for metres")));
  const auto asked = Find("odometry");
  ASSERT_FALSE(asked.ok());
  EXPECT_EQ(asked.error().code, ErrorCode::kNotFound);
}

TEST_F(FindFrameTest, OdometryThatStandsSaysNothingAndThatIsSaid) {
  WriteOdometry(0, 0);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.unit, "arbitrary");
  EXPECT_THAT(result_.warnings,
              ElementsAre(HasSubstr("moves over 0 pieces"), HasSubstr("nothing gives a scale")));
  EXPECT_EQ(Find("odometry").error().code, ErrorCode::kNoData);
}

// The frame is held where the source holds it, and that is where its scale errs from.
TEST_F(FindFrameTest, TheFirstImageStaysWhereOdometryHasIt) {
  std::string text;
  for (int i = 0; i < 60; ++i) text += fmt::format("{:02}.jpg {} 7 0 0 0 0 1\n", i, 5 + 0.1 * i);
  Write("odometry.txt", text);
  options_.odometry_sigma_ratio = 0.03;
  const auto similarity = Find("auto");
  ASSERT_TRUE(similarity.ok());
  EXPECT_TRUE(result_.frame.scale_centre.isApprox(Eigen::Vector3d(5, 7, 0)));
  EXPECT_TRUE((*similarity * model_["00.jpg"].Center()).isApprox(Eigen::Vector3d(5, 7, 0)));
  EXPECT_NEAR(result_.frame.scale_sigma_ratio, 0.03, 0.0002);
}

TEST_F(FindFrameTest, KnownDistancesGiveTheScaleAndSayHowWell) {
  WriteDistances(0.2);
  const auto similarity = Find("auto");
  ASSERT_TRUE(similarity.ok());
  EXPECT_NEAR(similarity->scale, 8, 1e-9);
  EXPECT_NEAR(result_.frame.scale_sigma_ratio, 0.02 / std::sqrt(2), 1e-6);
  EXPECT_EQ(result_.frame.scale_centre, Eigen::Vector3d::Zero());
  EXPECT_THAT(Sources(), ElementsAre("distances"));
  EXPECT_NEAR(result_.scales[0].span_m, 59 * 0.2, 1e-9);
  EXPECT_THAT(result_.warnings, IsEmpty());
}

// Odometry is trusted more than distances; both are heard.
TEST_F(FindFrameTest, SourcesThatContradictEachOtherAreReportedWithTheirScales) {
  WriteOdometry(0.1, 0.1);
  WriteDistances(0.104);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.source, "odometry");
  EXPECT_THAT(Sources(), ElementsAre("odometry", "distances"));
  EXPECT_THAT(result_.warnings, IsEmpty());  // 4 % are less than three times 1.7 %
  WriteDistances(0.108);
  ASSERT_TRUE(Find("auto").ok());
  ASSERT_THAT(result_.warnings, testing::SizeIs(1));
  EXPECT_EQ(result_.warnings[0],
            capture_.root +
                ": two sources contradict each other on the scale by 4 standard deviations: the "
                "images' places span 5.9 m (+- 1.0 %) by " +
                capture_.root + "/odometry.txt, 6.372 m (+- 1.4 %) by " + capture_.root +
                "/distances.txt; the scale is that of " + capture_.root +
                "/odometry.txt.  Check the units and the files; scale_from = \"odometry\" or \"distances\" "
                "chooses one");
  const auto asked = Find("distances");
  EXPECT_NEAR(asked->scale, 4 * 1.08, 1e-9);
  EXPECT_EQ(result_.frame.source, "distances");
  EXPECT_THAT(result_.warnings,
              ElementsAre(HasSubstr("the scale is that of " + capture_.root + "/distances.txt")));
  ASSERT_TRUE(Find("none").ok());
  EXPECT_THAT(result_.scales, IsEmpty());
  EXPECT_EQ(result_.frame.scale_sigma_ratio, 0);
}

TEST_F(FindFrameTest, EachTwoOfThreeAreCompared) {
  WriteOdometry(0.1, 0.1);
  WriteGps(0.2);
  options_.gps_sigma_m = options_.gps_altitude_sigma_m = 0.1;
  WriteDistances(0.3);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(Sources(), ElementsAre("odometry", "gps", "distances"));
  EXPECT_THAT(result_.warnings, testing::SizeIs(3));
}

// Sixty images over 30 m whose GPS errs by 10 m say little beside a measured distance.
TEST_F(FindFrameTest, WhatKnowsTheScaleFarWorseGivesWay) {
  WriteGps(0.5);
  options_.gps_sigma_m = 4;
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.source, "gps");
  EXPECT_TRUE(result_.frame.anchor);
  EXPECT_THAT(result_.warnings, IsEmpty());
  EXPECT_NEAR(result_.frame.scale_sigma_ratio, 4 / std::sqrt(60 * 899.75 / 12), 0.002);
  EXPECT_NEAR(result_.frame.scale_centre.norm(), 0, 0.5);  // the middle, near the anchor
  WriteDistances(0.51);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.source, "distances");
  EXPECT_FALSE(result_.frame.anchor);
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("the GPS of 60 images knows the scale to 6.0 % only")));
  options_.distance_sigma_ratio = 0.027;  // over the root of two: 3.1 times as well
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.source, "distances");
  options_.distance_sigma_ratio = 0.029;  // 2.9 times
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.source, "gps");
  ASSERT_TRUE(Find("gps").ok());
  EXPECT_EQ(result_.frame.source, "gps");
}

// The cameras look along z, and y is down: 0.2 units are 0.8 m.
TEST_F(FindFrameTest, TheCamerasHeightOverTheFloorGivesTheScale) {
  options_.camera_height_m = 0.9;
  EXPECT_THAT(Find("auto").error().message, AllOf(HasSubstr("camera_height_m = 0.9: no floor is found"),
                                                  HasSubstr("0 of 0 points lie below")));
  for (int i = 0; i < 59; ++i) {
    for (int row = 0; row < 5; ++row) {
      ModelPoint point;
      point.position = {0.025 * i, 0.2, 0.05 * row + 0.001 * (i * row % 7)};
      for (const int image : {i + 1, i + 2}) point.track.emplace_back(static_cast<ImageId>(image), row);
      points_.push_back(std::move(point));
    }
  }
  const auto similarity = Find("auto");
  ASSERT_TRUE(similarity.ok()) << similarity.error().message;
  EXPECT_NEAR(similarity->scale, 4.5, 1e-9);
  EXPECT_EQ(result_.frame.source, "camera_height");
  EXPECT_NEAR(result_.frame.scale_sigma_ratio, std::hypot(0.005, 0.02 / 0.9), 1e-6);
  EXPECT_EQ(result_.residuals.size(), 60u);
  EXPECT_NEAR((*similarity * Eigen::Vector3d(0.7, 0.2, 0.1)).z(), -0.9, 1e-9);  // the floor is level
  EXPECT_THAT(result_.scales[0].told_by, HasSubstr("over 295 points of the floor"));
  // Trusted less than odometry, more than distances.
  WriteDistances(0.1);
  WriteOdometry(0.1, 0.1);
  options_.camera_height_m = 0.8;
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(Sources(), ElementsAre("odometry", "camera_height", "distances"));
  EXPECT_THAT(result_.warnings, IsEmpty());
  EXPECT_NEAR(Find("camera_height")->scale, 4, 1e-9);
}

// Two cameras 0.03 units apart, of which one pair is half as far apart as it should be.
TEST_F(FindFrameTest, TheBaselineOfARigGivesTheScale) {
  for (const auto& [name, pose] : ModelPoses(model_)) {
    for (const char* folder : {"left", "right"}) {
      const std::string image = fmt::format("{}/{}", folder, name);
      capture_.images.push_back({image, 1, std::nullopt});
      model_[image] = pose;
      if (image.front() == 'r') model_[image].translation.y() += name == "07.jpg" ? 0.015 : 0.03;
    }
  }
  model_.erase("left/09.jpg");
  Write("rig.txt", "left right 0.15\n");
  options_.rig_baselines = "rig.txt";
  const auto similarity = Find("auto");
  ASSERT_TRUE(similarity.ok()) << similarity.error().message;
  EXPECT_NEAR(similarity->scale, 5, 1e-9);
  EXPECT_EQ(result_.frame.source, "rig");
  EXPECT_THAT(result_.scales[0].told_by, HasSubstr("rig.txt of 59 pairs of images"));
  // The stated 1 %, once as it is and once as the least of what ten pairs in a row show.
  EXPECT_NEAR(result_.frame.scale_sigma_ratio, 0.01 * std::hypot(1, 1.2533 * std::sqrt(10.0 / 59)), 1e-6);
  int num_off = 0;
  for (const AlignmentResidual& residual : result_.residuals) num_off += residual.is_off ? 1 : 0;
  EXPECT_EQ(num_off, 1);
  // Trusted more than the camera's height or distances, less than GPS.
  WriteDistances(0.125);
  WriteGps(0.125);
  options_.gps_sigma_m = options_.gps_altitude_sigma_m = 0.1;
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(Sources(), ElementsAre("gps", "rig", "distances"));
  EXPECT_EQ(result_.frame.source, "gps");
  EXPECT_THAT(result_.warnings, IsEmpty());
  EXPECT_NEAR(Find("rig")->scale, 5, 1e-9);
}

TEST_F(FindFrameTest, ControlPointsNeverGiveWay) {
  Write("points.txt", "00.jpg 0 0 0\n20.jpg 2 0 0\n40.jpg 4 0 0\n");
  options_.control_points = "points.txt";
  options_.control_point_sigma_m = 0.8;  // of points 4 m apart
  WriteOdometry(0.1, 0.1);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.source, "control_points");
  EXPECT_NEAR(result_.frame.scale_sigma_ratio, 0.8 / std::sqrt(8), 1e-3);
  EXPECT_THAT(Sources(), ElementsAre("control_points", "odometry"));
}

TEST_F(FindFrameTest, WhatTheRecipeNamesMustSaySomethingUnlessAnotherDoes) {
  Write("points.txt", "00.jpg 0 0 0\n20.jpg 2 0 0\n");
  options_.control_points = "points.txt";
  const auto alone = Find("auto");
  ASSERT_FALSE(alone.ok());
  EXPECT_THAT(alone.error().message, HasSubstr("expected at least 3"));
  WriteOdometry(0.1, 0.1);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("expected at least 3")));
  Write("points.txt", "00.jpg 0 0\n");
  EXPECT_EQ(Find("auto").error().code, ErrorCode::kCorrupt);
}

TEST_F(FindFrameTest, AScaleThatIsHardlyKnownIsNone) {
  WriteDistances(0.1);
  options_.distance_sigma_ratio = 0.7;
  ASSERT_TRUE(Find("distances").ok());
  options_.distance_sigma_ratio = 0.71;  // over the root of two
  const auto refused = Find("distances");
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("it knows the scale to 50 % only, which is no scale"));
}

TEST_F(FindFrameTest, OdometryThatCannotBeReadIsAnErrorAndNotIgnored) {
  ASSERT_TRUE(WriteFileAtomically(capture_.root + "/odometry.txt", "00.jpg 1 2\n").ok());
  EXPECT_EQ(Find("auto").error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn::reconstruct
