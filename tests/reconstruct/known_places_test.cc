#include "stages/reconstruct/known_places.h"

#include <cmath>
#include <cstdint>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

class KnownPlacesTest : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"a.jpg", "b c.jpg", "d.jpg"}) capture_.images.push_back({name, 1, std::nullopt});
  }
  std::string Write(const std::string& text) {
    const std::string path = testing::TempDir() + "/known_places.txt";
    EXPECT_TRUE(WriteFileAtomically(path, text).ok());
    return path;
  }
  Capture capture_;
};

TEST_F(KnownPlacesTest, ReadsDistancesBetweenImagesWithSpacesInTheirNames) {
  const auto distances =
      ReadKnownDistances(Write("# from the tape\n\na.jpg b c.jpg 2.5\nb c.jpg  d.jpg 1e1\r\n"), capture_);
  ASSERT_TRUE(distances.ok()) << distances.error().message;
  ASSERT_EQ(distances->size(), 2u);
  EXPECT_EQ((*distances)[0].name1, "a.jpg");
  EXPECT_EQ((*distances)[0].name2, "b c.jpg");
  EXPECT_EQ((*distances)[1].distance_m, 10);
}

TEST_F(KnownPlacesTest, WrongDistancesNameTheLine) {
  for (const char* line : {"a.jpg d.jpg", "a.jpg d.jpg x", "a.jpg d.jpg -1", "a.jpg d.jpg 0",
                           "a.jpg d.jpg inf", "a.jpg e.jpg 1", "a.jpg 1", "a.jpg a.jpg 1"}) {
    const auto distances = ReadKnownDistances(Write(std::string("a.jpg d.jpg 1\n") + line), capture_);
    ASSERT_FALSE(distances.ok()) << line;
    EXPECT_EQ(distances.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(distances.error().message, HasSubstr("known_places.txt:2: "));
  }
  EXPECT_EQ(ReadKnownDistances("/no/such/file", capture_).error().code, ErrorCode::kNotFound);
}

TEST_F(KnownPlacesTest, CamerasOfARigAreAsFarApartInAllPairsOfOneName) {
  for (const char* name : {"left/1.jpg", "left/2.jpg", "left/in/3.jpg", "leftover/1.jpg", "right/1.jpg",
                           "right/in/3.jpg", "right/4.jpg", "top/9.jpg"})
    capture_.images.push_back({name, 1, std::nullopt});
  const auto pairs = ReadRigBaselines(Write("# m\nleft right 0.12\nright leftover 0.3\n"), capture_);
  ASSERT_TRUE(pairs.ok()) << pairs.error().message;
  ASSERT_EQ(pairs->size(), 3u);
  EXPECT_EQ((*pairs)[0].name1, "left/1.jpg");
  EXPECT_EQ((*pairs)[0].name2, "right/1.jpg");
  EXPECT_EQ((*pairs)[1].name2, "right/in/3.jpg");
  EXPECT_EQ((*pairs)[1].distance_m, 0.12);
  EXPECT_EQ((*pairs)[2].distance_m, 0.3);
  for (const auto& [line, message] :
       {std::pair("left right", "expected FOLDER1 FOLDER2 METRES"),
        std::pair("left right 0", "expected FOLDER1 FOLDER2 METRES"),
        std::pair("left right x", "expected FOLDER1 FOLDER2 METRES"),
        std::pair("left left 1", "expected FOLDER1 FOLDER2 METRES"),
        std::pair("left lef 1", "no image below 'lef/'"),
        std::pair("left top 1", "no image below 'left/' has the name of one")}) {
    const auto wrong = ReadRigBaselines(Write(line), capture_);
    ASSERT_FALSE(wrong.ok()) << line;
    EXPECT_EQ(wrong.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(wrong.error().message, HasSubstr("known_places.txt:1: "));
    EXPECT_THAT(wrong.error().message, HasSubstr(message));
  }
  EXPECT_EQ(ReadRigBaselines(Write("# nothing\n"), capture_).error().code, ErrorCode::kNoData);
}

TEST_F(KnownPlacesTest, ReadsControlPoints) {
  const auto points = ReadControlPoints(Write("a.jpg 1 2 3\nb c.jpg -1.5 0 2e-1\n"), capture_);
  ASSERT_TRUE(points.ok()) << points.error().message;
  EXPECT_EQ(points->at("a.jpg"), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(points->at("b c.jpg"), Eigen::Vector3d(-1.5, 0, 0.2));
}

TEST_F(KnownPlacesTest, ReadsOdometryInItsOrderAndLeavesOutImagesThatTheCaptureLacks) {
  const auto odometry = ReadOdometry(
      Write("# t q\nd.jpg 1 2 3 0 0 0 1\nb c.jpg -1.5 0 2e-1 0.6 0 0 0.8\ne.jpg 0 0 0 0 0 0 1\n"), capture_);
  ASSERT_TRUE(odometry.ok()) << odometry.error().message;
  ASSERT_EQ(odometry->size(), 2u);
  EXPECT_EQ((*odometry)[0].name, "d.jpg");
  EXPECT_EQ((*odometry)[0].world_from_cam.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ((*odometry)[1].name, "b c.jpg");
  EXPECT_NEAR((*odometry)[1].world_from_cam.rotation.x(), 0.6, 1e-12);
  EXPECT_NEAR((*odometry)[1].world_from_cam.rotation.w(), 0.8, 1e-12);
  const auto none = ReadOdometry(Write("e.jpg 0 0 0 0 0 0 1\n"), capture_);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNoData);
  EXPECT_THAT(none.error().message, HasSubstr("names none of the 3 images"));
}

// A table of a spreadsheet; names may have commas where spaces separate.
TEST_F(KnownPlacesTest, ReadsOdometryWithCommasAndAHeader) {
  const auto odometry = ReadOdometry(
      Write("image,x,y,z,qx,qy,qz,qw\na.jpg,1,2,3,0,0,0,1\nb c.jpg, 4, 5, 6, 0, 0, 0, 1\n"), capture_);
  ASSERT_TRUE(odometry.ok()) << odometry.error().message;
  ASSERT_EQ(odometry->size(), 2u);
  EXPECT_EQ((*odometry)[0].world_from_cam.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ((*odometry)[1].name, "b c.jpg");
  EXPECT_EQ((*odometry)[1].world_from_cam.translation, Eigen::Vector3d(4, 5, 6));
  capture_.images.push_back({.name = "x,y.jpg"});
  EXPECT_EQ(ReadOdometry(Write("x,y.jpg 1 2 3 0 0 0 1\n"), capture_)->front().name, "x,y.jpg");
}

// A drive of 1 m/s along x, stated 0.1 s apart images by seconds or nanoseconds.
TEST_F(KnownPlacesTest, ReadsOdometryByTime) {
  const double start_s = 1.7e9;
  std::string text = "timestamp tx ty tz qx qy qz qw\n";
  for (int i = 0; i <= 10; ++i)
    text += fmt::format("{:.1f} {:.1f} 0 0 0 0 0 1\n", start_s + 0.1 * i, 0.1 * i);
  text += fmt::format("{:.0f} 1.5 0 0 0 0 0 1\n", 1e9 * (start_s + 1.5));  // 0.5 s later, in nanoseconds
  for (const bool is_in_ns : {false, true}) {
    const auto name = [&](double seconds) {
      if (!is_in_ns) return fmt::format("cam/{:.2f}.png", start_s + seconds);
      return fmt::format("cam/{}.png", std::llround(1e9 * start_s) + std::llround(1e9 * seconds));
    };
    capture_.images.clear();
    for (const double seconds : {0.75, 0.25, 1.2, 0.0}) capture_.images.push_back({.name = name(seconds)});
    const auto odometry = ReadOdometry(Write(text), capture_);
    ASSERT_TRUE(odometry.ok()) << is_in_ns << ": " << odometry.error().message;
    // In the order of time; not the one in the gap.
    ASSERT_EQ(odometry->size(), 3u) << is_in_ns;
    EXPECT_NEAR((*odometry)[0].world_from_cam.translation.x(), 0, 1e-6);
    EXPECT_NEAR((*odometry)[1].world_from_cam.translation.x(), 0.25, 1e-6);
    EXPECT_NEAR((*odometry)[2].world_from_cam.translation.x(), 0.75, 1e-6);
    EXPECT_EQ((*odometry)[2].name, capture_.images[0].name);
  }
}

// Poses of keyframes, seconds apart, at the images' own times and however these are written: no other is
// near.
TEST_F(KnownPlacesTest, OdometryByTimeOfKeyframesIsThatOfTheirImages) {
  capture_.images = {{.name = "1305031102.175304.png"}, {.name = "1305031105.843310001.png"}};
  const auto exact =
      ReadOdometry(Write("1305031102.175304 1 0 0 0 0 0 1\n1305031105.843310001 2 0 0 0 0 0 1\n"), capture_);
  ASSERT_TRUE(exact.ok()) << exact.error().message;
  EXPECT_EQ(exact->size(), 2u);
  capture_.images[1].name = "1305031105.843311.png";
  const auto exponents = ReadOdometry(
      Write("1.305031102175304000e+09 1 0 0 0 0 0 1\n1.305031105843311000e+09 2 0 0 0 0 0 1\n"), capture_);
  ASSERT_TRUE(exponents.ok()) << exponents.error().message;
  EXPECT_EQ(exponents->size(), 2u);
  capture_.images = {{.name = "1403636579763555585.png"}};
  EXPECT_TRUE(ReadOdometry(Write("1403636579763555585 1 0 0 0 0 0 1\n"), capture_).ok());
  // Whole seconds of ten digits are no nanoseconds.
  capture_.images = {{.name = "1305031102.000.png"}};
  EXPECT_TRUE(ReadOdometry(Write("1305031102 1 0 0 0 0 0 1\n"), capture_).ok());
}

// Two sessions that were joined: each has a clock and a world of its own.
TEST_F(KnownPlacesTest, OdometryByTimeIsThatOfTheImagesFolder) {
  capture_.images = {{.name = "one/5.50.jpg"}, {.name = "two/5.50.jpg"}};
  const auto odometry =
      ReadOdometry(Write("one/5 1 0 0 0 0 0 1\none/5.6 1 0 0 0 0 0 1\none/5.4 1 0 0 0 0 0 1\n"
                         "two/5.5 2 0 0 0 0 0 1\n"),
                   capture_);
  ASSERT_TRUE(odometry.ok()) << odometry.error().message;
  ASSERT_EQ(odometry->size(), 2u);
  EXPECT_EQ((*odometry)[0].world_from_cam.translation.x(), 1);
  EXPECT_EQ((*odometry)[1].world_from_cam.translation.x(), 2);
}

// Numbers that count images are no times.
TEST_F(KnownPlacesTest, OdometryByTimeNeedsNamesThatAreTimes) {
  const std::string path = Write("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n3 0 0 0 0 0 0 1\n");
  for (const char* name : {"0002.jpg", "a.jpg", "nan.0.jpg", "9.0.jpg"}) {
    capture_.images = {{.name = name}};
    const auto odometry = ReadOdometry(path, capture_);
    ASSERT_FALSE(odometry.ok()) << name;
    EXPECT_EQ(odometry.error().code, ErrorCode::kNoData);
    EXPECT_THAT(odometry.error().message, HasSubstr("begin with times"));
  }
  capture_.images = {{.name = "2.0.jpg"}};
  EXPECT_TRUE(ReadOdometry(path, capture_).ok());
  // Nor is what no clock says.
  EXPECT_EQ(ReadOdometry(Write("1e10 0 0 0 0 0 0 1\nnan 0 0 0 0 0 0 1\n9e18 0 0 0 0 0 0 1\n"), capture_)
                .error()
                .code,
            ErrorCode::kNoData);
}

TEST_F(KnownPlacesTest, WrongOdometryNamesTheLine) {
  for (const char* line :
       {"d.jpg 1 2 3 0 0 0", "d.jpg 1 2 3 0 0 0 x", "d.jpg 1 nan 3 0 0 0 1", "1 2 3 0 0 0 1",
        "d.jpg 1 2 3 0 0 0 1.02", "d.jpg 1 2 3 0 0 0 0", "a.jpg 0 0 0 0 0 0 1"}) {
    const auto odometry = ReadOdometry(Write(std::string("a.jpg 0 0 0 0 0 0 1\n") + line), capture_);
    ASSERT_FALSE(odometry.ok()) << line;
    EXPECT_EQ(odometry.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(odometry.error().message, HasSubstr("known_places.txt:2: "));
  }
  EXPECT_TRUE(ReadOdometry(Write("a.jpg 0 0 0 0 0 0 1.009"), capture_).ok());
  EXPECT_EQ(ReadOdometry("/no/such/file", capture_).error().code, ErrorCode::kNotFound);
}

TEST_F(KnownPlacesTest, WrongControlPointsNameTheLine) {
  for (const char* line :
       {"a.jpg 1 2", "d.jpg 1 2 z", "d.jpg 1 nan 2", "e.jpg 1 2 3", "a.jpg 1 2 4", "1 2 3"}) {
    const auto points = ReadControlPoints(Write(std::string("a.jpg 1 2 3\n") + line), capture_);
    ASSERT_FALSE(points.ok()) << line;
    EXPECT_THAT(points.error().message, HasSubstr("known_places.txt:2: "));
  }
}

TEST_F(KnownPlacesTest, FilesThatSayNothingAreErrors) {
  EXPECT_EQ(ReadControlPoints(Write("# nothing yet\n"), capture_).error().code, ErrorCode::kNoData);
  EXPECT_EQ(ReadKnownDistances(Write(""), capture_).error().code, ErrorCode::kNoData);
}

TEST_F(KnownPlacesTest, AnchorIsTheMedianAlsoAcrossThe180thMeridian) {
  std::map<std::string, ExifTags> tags;
  const double longitudes[] = {179.9999, -179.9999, -179.9998, 170};  // the last is a wild fix
  for (int i = 0; i < 4; ++i) {
    tags["image" + std::to_string(i)] = {.gps = GeodeticPosition{-17 - 1e-4 * i, longitudes[i], 10.0 + i},
                                         .has_altitude = i != 0};
  }
  const GeodeticPosition anchor = MedianPosition(tags);
  EXPECT_NEAR(std::abs(anchor.longitude_deg), 179.9999, 1e-6);
  EXPECT_NEAR(anchor.latitude_deg, -17.0001, 2e-4);
  EXPECT_DOUBLE_EQ(anchor.altitude_m, 12);
}

}  // namespace
}  // namespace cairn::reconstruct
