#include "stages/group_classes/persistence/sightings.h"

#include <gtest/gtest.h>

#include "tests/group_classes/scene_over_time.h"

namespace cairn::group_classes {
namespace {

// Two sessions of images beside each other, 4 m in front of a wall at z = 4.
SceneOverTime TwoSessions() {
  SceneOverTime scene = EmptyScene();
  for (int i = 0; i < 20; ++i) scene.AddImage(i % 2, {0.1 * i, 0, 0});
  return scene;
}

const ExpectedView* FindView(const ClassViews& views, int image) {
  for (const ExpectedView& view : views) {
    if (view.image == image) return &view;
  }
  return nullptr;
}

TEST(ExpectedViews, AreWhatImagesOfOtherSessionsNearbySaw) {
  SceneOverTime scene = TwoSessions();
  Random random(1);
  const auto in_session_0 = [&](int image, const Eigen::Vector3d&) { return image % 2 == 0 ? 1.0 : 0.0; };
  ASSERT_TRUE(scene.AddPoint({1, 0, 4}, in_session_0, &random));
  const std::vector<ClassViews> views =
      FindExpectedViews(scene.classes, {.session = scene.session_of_image}, 2);
  ASSERT_EQ(views.size(), 1u);
  for (int image = 0; image < 20; ++image) {
    const ExpectedView* view = FindView(views[0], image);
    ASSERT_NE(view, nullptr) << image;
    EXPECT_EQ(view->seen, image % 2 == 0);
    // All ten images of the other session saw it, or none that knows it is of another session.
    if (image % 2 == 1) {
      EXPECT_GT(view->visibility, 0.8) << image;
      EXPECT_LT(view->visibility, 1);
    } else {
      EXPECT_EQ(view->visibility, 0) << image;
    }
  }
}

TEST(ExpectedViews, AreTheShareThatSawIt) {
  SceneOverTime scene = TwoSessions();
  Random random(2);
  const auto a_third = [&](int image, const Eigen::Vector3d&) { return image % 2 == 0 ? 1.0 / 3 : 0.0; };
  double sum = 0;
  int num = 0;
  for (int p = 0; p < 300; ++p) {
    if (!scene.AddPoint({random.Uniform(0.5, 1.5), random.Uniform(-1, 1), 4}, a_third, &random)) continue;
  }
  for (const ClassViews& views : FindExpectedViews(scene.classes, {.session = scene.session_of_image}, 2)) {
    const ExpectedView* view = FindView(views, 9);
    if (view == nullptr) continue;
    sum += view->visibility;
    ++num;
  }
  // The images in the middle have some five neighbours' weight beside a prior of half an image.
  EXPECT_NEAR(sum / num, 1.0 / 3, 0.06);
}

TEST(ExpectedViews, FallWithTheAngleAndTheDistance) {
  SceneOverTime scene = EmptyScene();
  scene.AddImage(0, {0, 0, 0});
  scene.AddImage(1, {0.1, 0, 0});
  scene.AddImage(1, {1.2, 0, 0});       // 17 degrees
  scene.AddImage(1, {0, 0, 1.4});       // two thirds as far
  scene.AddImage(1, {0, 0, -4});        // twice as far
  scene.AddImage(1, {0, 0, -4.2});      // more
  scene.AddImage(1, {0.1, 0, 0}, 3.1);  // the other way
  Random random(3);
  // A second point lets images know how far they see.
  const auto visibility = [&](int image, const Eigen::Vector3d& point) {
    return image == 0 || point.x() > 0 ? 1.0 : 0.0;
  };
  ASSERT_TRUE(scene.AddPoint({0, 0, 4}, visibility, &random));
  ASSERT_TRUE(scene.AddPoint({0.01, 0, 4}, visibility, &random));
  const ClassViews views = FindExpectedViews(scene.classes, {.session = scene.session_of_image}, 1)[0];
  const auto visibility_of = [&](int image) {
    const ExpectedView* view = FindView(views, image);
    return view == nullptr ? 0 : view->visibility;
  };
  EXPECT_NEAR(visibility_of(1), 1 / 1.5, 0.02);
  EXPECT_LT(visibility_of(2), 0.5 * visibility_of(1));
  EXPECT_GT(visibility_of(2), 0);
  EXPECT_LT(visibility_of(3), 0.75 * visibility_of(1));
  EXPECT_GT(visibility_of(3), visibility_of(2));
  EXPECT_EQ(visibility_of(5), 0);
  EXPECT_EQ(visibility_of(6), 0);
}

TEST(ExpectedViews, EndWhereNearerThingsAreInTheWay) {
  SceneOverTime scene = TwoSessions();
  Random random(4);
  // A poster at z = 4; in session 1 a shelf with points at z = 2 stands before it.
  const auto poster = [&](int image, const Eigen::Vector3d&) { return image % 2 == 0 ? 1.0 : 0.0; };
  const auto shelf = [&](int image, const Eigen::Vector3d&) { return image % 2 == 1 ? 1.0 : 0.0; };
  ASSERT_TRUE(scene.AddPoint({1, 0, 4}, poster, &random));
  std::vector<ClassViews> views = FindExpectedViews(scene.classes, {.session = scene.session_of_image}, 1);
  EXPECT_NE(FindView(views[0], 9), nullptr);
  for (int p = 0; p < 400; ++p)
    scene.AddPoint({random.Uniform(0, 2), random.Uniform(-0.5, 0.5), 2}, shelf, &random);
  views = FindExpectedViews(scene.classes, {.session = scene.session_of_image}, 1);
  EXPECT_EQ(FindView(views[0], 9), nullptr);
  EXPECT_NE(FindView(views[0], 8), nullptr);  // seen: not hidden
}

TEST(ExpectedViews, AreNoneOfImagesWithoutASession) {
  SceneOverTime scene = TwoSessions();
  Random random(5);
  scene.session_of_image[9] = -1;
  ASSERT_TRUE(scene.AddPoint(
      {1, 0, 4}, [](int, const Eigen::Vector3d&) { return 1.0; }, &random));
  const std::vector<ClassViews> views =
      FindExpectedViews(scene.classes, {.session = scene.session_of_image}, 1);
  EXPECT_EQ(FindView(views[0], 9), nullptr);
  EXPECT_EQ(views[0].size(), 19u);
}

}  // namespace
}  // namespace cairn::group_classes
