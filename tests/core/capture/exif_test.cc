#include "core/capture/exif.h"

#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/core/capture/exif_jpeg.h"

namespace cairn {
namespace {

ExifTags ReadBytes(const std::string& bytes) {
  const std::string path = testing::TempDir() + "/exif_test.jpg";
  EXPECT_TRUE(WriteFileAtomically(path, bytes).ok());
  return ReadExif(path);
}
ExifTags ReadGps(const GpsBlock& gps) { return ReadBytes(ExifJpeg(gps)); }

TEST(ReadExif, ReadsDegreesMinutesSecondsAndAltitude) {
  const ExifTags tags = ReadGps({});
  ASSERT_TRUE(tags.gps);
  EXPECT_NEAR(tags.gps->latitude_deg, 55 + 41 / 60.0 + 53.4 / 3600, 1e-12);
  EXPECT_NEAR(tags.gps->longitude_deg, 13 + 11 / 60.0 + 43.4 / 3600, 1e-12);
  EXPECT_TRUE(tags.has_altitude);
  EXPECT_DOUBLE_EQ(tags.gps->altitude_m, 37.5);
  EXPECT_EQ(tags.focal_length_35mm_mm, 0);
}

TEST(ReadExif, SouthWestAndBelowSeaLevelAreNegative) {
  const ExifTags tags = ReadGps({.latitude_ref = 'S', .longitude_ref = 'W', .altitude_ref = 1});
  ASSERT_TRUE(tags.gps);
  EXPECT_LT(tags.gps->latitude_deg, -55);
  EXPECT_LT(tags.gps->longitude_deg, -13);
  EXPECT_DOUBLE_EQ(tags.gps->altitude_m, -37.5);
}

TEST(ReadExif, DecimalMinutesCount) {
  const ExifTags tags = ReadGps({.latitude = {{55, 1}, {4189, 100}, {0, 1}}});
  ASSERT_TRUE(tags.gps);
  EXPECT_NEAR(tags.gps->latitude_deg, 55 + 41.89 / 60, 1e-12);
}

TEST(ReadExif, InvalidPositionsAreNone) {
  const Rationals zero = {{0, 0}, {0, 0}, {0, 0}};  // what a receiver without a fix writes
  EXPECT_FALSE(ReadGps({.latitude = zero}).gps);
  EXPECT_FALSE(ReadGps({.longitude = zero}).gps);
  EXPECT_FALSE(ReadGps({.latitude = {{91, 1}, {0, 1}, {0, 1}}}).gps);
  EXPECT_FALSE(ReadGps({.longitude = {{180, 1}, {0, 1}, {1, 1}}}).gps);
  EXPECT_FALSE(ReadGps({.latitude = {{55, 1}}}).gps) << "minutes and seconds are missing";
  EXPECT_FALSE(ReadGps({.latitude_ref = 'X'}).gps);
  EXPECT_FALSE(ReadGps({.longitude_ref = '\0'}).gps);
}

TEST(ReadExif, PositionWithoutAValidAltitudeSaysSo) {
  const ExifTags tags = ReadGps({.altitude = {{5, 0}}});
  ASSERT_TRUE(tags.gps);
  EXPECT_FALSE(tags.has_altitude);
  EXPECT_EQ(tags.gps->altitude_m, 0);
}

TEST(ReadExif, FilesWithoutOrWithADamagedBlockHaveNoTags) {
  EXPECT_FALSE(ReadExif(testing::TempDir() + "/no such file.jpg").gps);
  EXPECT_FALSE(ReadBytes("").gps);
  EXPECT_FALSE(ReadBytes("\xff\xd8\xff\xd9").gps);
  const std::string whole = ExifJpeg({});
  for (size_t size = 0; size < whole.size(); size += 7) ReadBytes(whole.substr(0, size));  // must not crash
}

}  // namespace
}  // namespace cairn
