#include <vector>

#include <gtest/gtest.h>

#include "stages/reconstruct/globally/map_globally.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

// A drive through two wings that look alike, images 0 to 9 and 20 to 29: each sees 180 points of its own wing
// where the other's images see theirs, and matches them with both.  Into the second wing leads a step that
// few matches join.
SyntheticSurvey MakeTwinWings() {
  SyntheticSurvey survey = MakeSyntheticSurvey(30, 6);
  const Pose second_from_first = survey.cams_from_world[26].Inverse() * survey.cams_from_world[4];
  Random random(2);
  std::vector<Eigen::Vector3d> wing;
  for (int p = 0; p < 180; ++p)
    wing.emplace_back(random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(0, 3));
  const auto is_in_wing = [](int i) { return i < 10 || i >= 20; };
  std::vector<size_t> num_before;
  for (int i = 0; i < 30; ++i) {
    num_before.push_back(survey.input.keypoints[i].size());
    if (!is_in_wing(i)) continue;
    const Pose cam_from_wing =
        i < 10 ? survey.cams_from_world[i] : survey.cams_from_world[i] * second_from_first;
    for (const Eigen::Vector3d& point : wing) {
      const auto pixel = ImageFromCamera(survey.camera, cam_from_wing * point);
      survey.input.keypoints[i].push_back({.x = static_cast<float>(pixel->x()),
                                           .y = static_cast<float>(pixel->y()),
                                           .scale = 2,
                                           .orientation = 0});
    }
  }
  const auto add_wing = [&](int i, int j, TwoViewGeometry* geometry) {
    for (size_t k = 0; k < wing.size(); ++k) {
      if ((k + i + 2 * j) % 3 == 0) continue;  // missed, by each pair another third
      geometry->inliers.push_back(
          {static_cast<KeypointIdx>(num_before[i] + k), static_cast<KeypointIdx>(num_before[j] + k)});
    }
  };
  for (TwoViewGeometry& geometry : survey.input.geometries) {
    const int i = static_cast<int>(geometry.image_id1) - 1, j = static_cast<int>(geometry.image_id2) - 1;
    if (i < 20 && j >= 20) geometry.inliers.resize(20);
    if (is_in_wing(i) && is_in_wing(j)) add_wing(i, j, &geometry);
  }
  for (int i = 0; i < 10; ++i) {
    for (int j = 20; j < 30; ++j) {
      TwoViewGeometry geometry{.image_id1 = static_cast<ImageId>(i + 1),
                               .image_id2 = static_cast<ImageId>(j + 1),
                               .config = TwoViewConfig::kUncalibrated};
      add_wing(i, j, &geometry);
      survey.input.geometries.push_back(geometry);
    }
  }
  return survey;
}

TEST(MapGlobally, TwinWingsStayWhereTheDriveWentThrough) {
  const SyntheticSurvey survey = MakeTwinWings();
  NoProgress progress;
  const auto map = MapGlobally(survey.input, {}, {}, 2, progress);
  ASSERT_TRUE(map.ok());
  EXPECT_TRUE(map->is_drive);
  EXPECT_EQ(map->models.front().images.size(), 30u);
  EXPECT_LT(LargestErrorM(map->models.front(), survey), 0.1);
}

}  // namespace
}  // namespace cairn::reconstruct
