#include "core/capture/capture_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {
namespace {

using testing::HasSubstr;

Result<CaptureFrame> ReadText(const std::string& text) {
  const std::string path = testing::TempDir() + "/capture_frame_test.json";
  EXPECT_TRUE(WriteFileAtomically(path, text).ok());
  return ReadCaptureFrame(path);
}

TEST(CaptureFrame, RoundTrip) {
  const CaptureFrame frame{.unit = "metre",
                           .anchor = GeodeticPosition{-33.8567844, 151.2152967, -1.25},
                           .source = "gps",
                           .is_reconstructed = true,
                           .scale_sigma_ratio = 0.0125,
                           .scale_centre = {1.5, -2, 1.0 / 3}};
  const auto read = ReadText(CaptureFrameJson(frame));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->unit, "metre");
  EXPECT_EQ(read->source, "gps");
  EXPECT_TRUE(read->is_reconstructed);
  ASSERT_TRUE(read->anchor);
  EXPECT_EQ(read->anchor->latitude_deg, -33.8567844);
  EXPECT_EQ(read->anchor->longitude_deg, 151.2152967);
  EXPECT_EQ(read->anchor->altitude_m, -1.25);
  EXPECT_EQ(read->scale_sigma_ratio, 0.0125);
  EXPECT_EQ(read->scale_centre, Eigen::Vector3d(1.5, -2, 1.0 / 3));
  const auto none = ReadText(CaptureFrameJson({.unit = "arbitrary", .source = "none"}));
  EXPECT_FALSE(none->anchor);
  EXPECT_EQ(none->scale_sigma_ratio, 0);
}

TEST(CaptureFrame, AnErrorOfTheScaleGrowsFromItsCentre) {
  const CaptureFrame frame{.scale_sigma_ratio = 0.02, .scale_centre = {1, 2, 3}};
  EXPECT_EQ(ScaleSigmaAt(frame, {1, 2, 3}), Eigen::Vector3d::Zero());
  EXPECT_TRUE(ScaleSigmaAt(frame, {11, 2, -2}).isApprox(Eigen::Vector3d(0.2, 0, -0.1)));
}

TEST(CaptureFrame, WrongFilesAreNamed) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "expected a JSON object"},
      {"[]", "expected a JSON object"},
      {R"({"unit": 3, "source": "gps"})", "expected a JSON object"},
      {R"({"unit": "feet", "source": "gps"})", "unit 'feet'"},
      {R"({"unit": "metre", "source": "gps", "anchor": 5})", "expected the number 'latitude_deg'"},
      {R"({"unit": "metre", "source": "gps", "anchor": {"latitude_deg": 91, "longitude_deg": 0, "altitude_m": 0}})",
       "expected a latitude"},
      {R"({"unit": "arbitrary", "source": "gps", "anchor": {"latitude_deg": 1, "longitude_deg": 0, "altitude_m": 0}})",
       "expected the unit metre"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": "0.1", "scale_centre": [0, 0, 0]})",
       "expected the number 'scale_sigma_ratio'"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": 0.1})", "three numbers in 'scale_centre'"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": 0.1, "scale_centre": [0, 0]})",
       "three numbers in 'scale_centre'"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": 0.1, "scale_centre": [0, 0, "0"]})",
       "three numbers in 'scale_centre'"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": 1, "scale_centre": [0, 0, 0]})",
       "in [0, 1)"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": -0.1, "scale_centre": [0, 0, 0]})",
       "in [0, 1)"},
      {R"({"unit": "metre", "source": "gps", "scale_sigma_ratio": 0.1, "scale_centre": [0, 2e7, 0]})",
       "a place within 1e+07 m"},
      {R"({"unit": "arbitrary", "source": "none", "scale_sigma_ratio": 0.1, "scale_centre": [0, 0, 0]})",
       "how well its scale is known"},
  };
  for (const auto& [text, message] : cases) {
    const auto frame = ReadText(text);
    ASSERT_FALSE(frame.ok()) << text;
    EXPECT_EQ(frame.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(frame.error().message, HasSubstr("capture_frame_test.json"));
    EXPECT_THAT(frame.error().message, HasSubstr(message));
  }
}

}  // namespace
}  // namespace cairn
