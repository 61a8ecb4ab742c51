#include "stages/emit_map/fit_size.h"

#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "stages/emit_map/choose_landmarks.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Images in a row, a metre apart, that look at a wall; class i is seen by the images that `seen_by` lists,
// and lies in front of their middle.
Classes WallOf(int num_images, const std::vector<std::vector<ImageId>>& seen_by) {
  Classes classes;
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 400;
  camera.height = 400;
  camera.params = {200, 200, 200};
  classes.cameras = {camera};
  for (int i = 0; i < num_images; ++i) {
    SurveyImage image{.image_id = static_cast<ImageId>(i + 1), .name = std::to_string(i), .camera_id = 1};
    image.cam_from_world.translation = {-1.0 * i, 0, 0};
    classes.images.push_back(image);
  }
  for (size_t i = 0; i < seen_by.size(); ++i) {
    FeatureClass feature_class;
    feature_class.class_id = static_cast<ClassId>(10 + i);
    double x = 0;
    for (const ImageId image : seen_by[i]) {
      feature_class.observations.push_back({image, 0, Keypoint{200, 200, 3, 0}});
      x += (image - 1.0) / static_cast<double>(seen_by[i].size());
    }
    feature_class.position = {x, 0, 2};
    classes.classes.push_back(feature_class);
  }
  return classes;
}

std::vector<size_t> All(const Classes& classes) {
  std::vector<size_t> pool(classes.classes.size());
  std::iota(pool.begin(), pool.end(), size_t{0});
  return pool;
}

TEST(OrderByUse, ServesImagesThatHaveNothingBeforeThoseThatHaveSome) {
  // Three classes in images 1 and 2, one in images 5 and 6: it comes second, not last.
  const Classes classes = WallOf(6, {{1, 2}, {1, 2}, {1, 2}, {5, 6}});
  EXPECT_THAT(OrderByUse(classes, All(classes), 1, 1), ElementsAre(0, 3, 1, 2));
}

TEST(OrderByUse, ClassesThatMoreImagesSeeComeFirst) {
  const Classes classes = WallOf(4, {{1, 2}, {1, 2, 3, 4}, {3, 4}});
  EXPECT_EQ(OrderByUse(classes, All(classes), 20, 1)[0], 1U);
}

TEST(OrderByUse, ClassesThatSomeImagesMissCountLess) {
  // Both are seen by two images; images 2 and 3 look at the second class too and do not see it.
  const Classes classes = WallOf(4, {{2, 3}, {1, 4}});
  EXPECT_THAT(OrderByUse(classes, All(classes), 20, 1), ElementsAre(0, 1));
}

TEST(OrderByUse, IsWithinItsBoundOfTheBestChoiceAndNestedForAnyNumberOfThreads) {
  Random random(5);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<std::vector<ImageId>> seen_by;
    for (int i = 0; i < 9; ++i) {
      std::vector<ImageId> images;
      for (ImageId image = 1; image <= 6; ++image) {
        if (random.Uniform() < 0.4) images.push_back(image);
      }
      if (images.empty()) images.push_back(1);
      seen_by.push_back(images);
    }
    Classes classes = WallOf(6, seen_by);
    for (SurveyImage& image : classes.images) image.camera_id = 2;  // unknown: no class is missed
    const std::vector<size_t> order = OrderByUse(classes, All(classes), 1, 1);
    EXPECT_EQ(OrderByUse(classes, All(classes), 1, 3), order);
    const auto value = [&](unsigned chosen) {
      std::vector<int> seen(7, 0);
      for (size_t i = 0; i < seen_by.size(); ++i) {
        if ((chosen >> i & 1) == 0) continue;
        for (const ImageId image : seen_by[i]) ++seen[image];
      }
      double sum = 0;
      for (int image = 1; image <= 6; ++image) sum += 1 - std::exp(-seen[image]);
      return sum;
    };
    double best = 0;
    for (unsigned chosen = 0; chosen < 1U << 9; ++chosen) {
      if (__builtin_popcount(chosen) == 3) best = std::max(best, value(chosen));
    }
    const unsigned greedy = 1U << order[0] | 1U << order[1] | 1U << order[2];
    EXPECT_GE(value(greedy), (1 - 1 / std::exp(1)) * best);
  }
}

TEST(GuaranteeOf, CountsCommonLandmarksAndPoorStations) {
  MapRows rows;
  rows.k = 2;
  rows.stations.resize(2);
  rows.landmarks.resize(3);
  rows.images = {{.image_id = 1, .station = 0, .landmarks = {0, 1, 2}},
                 {.image_id = 2, .station = 1, .landmarks = {2}}};
  rows.regions = {{.stations = {0}, .landmarks = {0, 1, 2}}, {.stations = {0, 1}, .landmarks = {2}}};
  const SizeGuarantee guarantee = GuaranteeOf(rows);
  EXPECT_EQ(guarantee.min_common_landmarks, 1);
  EXPECT_EQ(guarantee.num_stations_below_k, 1);
  EXPECT_EQ(GuaranteeOf({}).min_common_landmarks, 0);
}

}  // namespace
}  // namespace cairn::emit_map
