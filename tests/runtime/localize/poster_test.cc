// The whole runtime on pixels: SIFT, words, matches, pose; and the example program.
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "runtime/localize/localizer.h"
#include "tests/runtime/localize/poster_scene.h"

namespace cairn {
namespace {

TEST(Poster, PixelsAreLocalizedToCentimetres) {
  const PosterScene scene = MakePosterScene(1);
  const auto map = *Map::FromRows(MakePosterMap(scene));
  const auto found =
      *Localizer(map, PosterOptions()).Localize(RenderPoster(scene, PosterQueryPose()), scene.camera);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, PosterQueryPose()), 0.03);
  EXPECT_LT(RotationErrorDeg(found.cam_from_world, PosterQueryPose()), 0.5);
}

TEST(Poster, AnotherPosterIsRefused) {
  const auto map = *Map::FromRows(MakePosterMap(MakePosterScene(1)));
  const PosterScene other = MakePosterScene(2);
  const auto found =
      *Localizer(map, PosterOptions()).Localize(RenderPoster(other, PosterQueryPose()), other.camera);
  EXPECT_FALSE(found.has_fix());
}

// Output and exit status of the example.
std::pair<std::string, int> RunExample(const std::string& arguments) {
  FILE* pipe = popen((std::string(LOCALIZE_EXAMPLE) + " " + arguments + " 2>&1").c_str(), "r");
  std::string output;
  char block[256];
  while (std::fgets(block, sizeof(block), pipe)) output += block;
  const int status = pclose(pipe);
  return {output, status};
}

TEST(Poster, ExampleProgramPrintsThePlace) {
  const PosterScene scene = MakePosterScene(1);
  const std::string map = testing::TempDir() + "/poster.cairn", image = testing::TempDir() + "/poster.png";
  ASSERT_TRUE(WriteMapRows(MakePosterMap(scene), map).ok());
  cv::imwrite(image, RenderPoster(scene, PoseAt({0, 0, 1.5}, 0)));
  const auto [output, status] = RunExample(map + " " + image);
  EXPECT_EQ(status, 0) << output;
  EXPECT_THAT(output, testing::HasSubstr("inliers"));
  double x = 9, y = 9, z = 9;
  ASSERT_EQ(std::sscanf(output.c_str(), "%lf %lf %lf", &x, &y, &z), 3);
  EXPECT_NEAR(x, 0, 0.05);
  EXPECT_NEAR(y, 0, 0.05);
  EXPECT_NEAR(z, 1.5, 0.05);
  EXPECT_THAT(RunExample(map + " " + map).first, testing::HasSubstr("poster.cairn"));
  EXPECT_THAT(RunExample("").first, testing::HasSubstr("usage"));
}

}  // namespace
}  // namespace cairn
