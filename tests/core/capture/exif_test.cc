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

// 4000 pixels, 400 a millimetre, are 10 mm: 7.2 mm see what 0.72 of the longer side sees.
TEST(FocalOf, TheLensAndTheSensorsPixelsSayIt) {
  const auto focal_px = [](const LensBlock& lens, double side_px) {
    const std::optional<ExifFocal> focal = FocalOf(ReadBytes(ExifJpegOfLens(lens)), side_px);
    EXPECT_TRUE(!focal || focal->source == FocalSource::kSensorPixels);
    return focal ? focal->focal_px : 0;
  };
  EXPECT_NEAR(focal_px({}, 4000), 2880, 1e-9);
  EXPECT_NEAR(focal_px({}, 1000), 720, 1e-9);  // made smaller since
  EXPECT_NEAR(focal_px({.per_unit = {4000, 1}, .unit = 3}, 4000), 2880, 1e-9);
  EXPECT_NEAR(focal_px({.per_unit = {400, 1}, .unit = 4}, 4000), 2880, 1e-9);
  EXPECT_NEAR(focal_px({.per_unit = {4, 10}, .unit = 5}, 4000), 2880, 1e-9);
  EXPECT_NEAR(focal_px({.unit = 0}, 4000), 2880, 1e-9);
  // Without the size that the picture had it is that of the image.
  EXPECT_NEAR(focal_px({.width_px = 0, .height_px = 0}, 2000), 2880, 1e-9);
}

TEST(FocalOf, WhatNoCameraHasIsNone) {
  const auto has_focal = [](const LensBlock& lens) {
    return FocalOf(ReadBytes(ExifJpegOfLens(lens)), 4000).has_value();
  };
  EXPECT_TRUE(has_focal({}));
  EXPECT_FALSE(has_focal({.focal_mm = {0, 1}}));
  EXPECT_FALSE(has_focal({.focal_mm = {72, 0}}));
  EXPECT_FALSE(has_focal({.per_unit = {0, 1}}));
  EXPECT_FALSE(has_focal({.per_unit = {10160, 0}}));
  EXPECT_FALSE(has_focal({.per_unit = {300, 1}}));                         // of a scanner: 340 mm
  EXPECT_FALSE(has_focal({.focal_mm = {1, 1}, .per_unit = {150000, 1}}));  // 0.7 mm
  EXPECT_FALSE(has_focal({.focal_mm = {4, 10}}));                          // sees 171 degrees
  EXPECT_FALSE(has_focal({.focal_mm = {600, 1}}));                         // sees 0.95 degrees
}

// Whole millimetres of a film that a camera has worked out are worth more than a sensor's size that may be of
// other pixels than the image's.
TEST(FocalOf, TheFilmEquivalentGoesBefore) {
  ExifTags tags = ReadBytes(ExifJpegOfLens({}));
  tags.focal_length_35mm_mm = 27;
  const std::optional<ExifFocal> focal = FocalOf(tags, 4000);
  ASSERT_TRUE(focal);
  EXPECT_EQ(focal->focal_px, 3000);
  EXPECT_EQ(focal->source, FocalSource::kFilmEquivalent);
  EXPECT_FALSE(FocalOf({}, 4000));
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
