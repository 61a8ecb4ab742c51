#include "core/promise/later_views.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

using testing::Each;
using testing::ElementsAre;

// Images at these places along a wall 2 m away, so that a view is 0.2 m wide; each of a session.
Classes SurveyAt(const std::vector<std::pair<std::string, double>>& images) {
  Classes classes = WallSurvey(static_cast<int>(images.size()), 0);
  for (size_t i = 0; i < images.size(); ++i) {
    classes.images[i].name = images[i].first + "/" + std::to_string(i) + ".png";
    classes.images[i].cam_from_world.translation = {-images[i].second, 0, 0};
  }
  AddClass({images[0].second, 0, 2}, {1}, 3, &classes);
  return classes;
}

std::vector<int32_t> LaterViewsOf(const Classes& classes) {
  return LaterViews(classes, ViewDistance(classes, {}));
}

TEST(LaterViews, OfTwoRadiiTheNearestShowsTheView) {
  Classes classes = SurveyAt({{"a", 0}, {"a", 1}, {"a", 5}, {"b", 0.39}, {"b", 0.3}, {"b", 1.41}});
  EXPECT_THAT(LaterViewsOf(classes), Each(-1));  // one survey
  classes.sessions = {"a", "b"};
  EXPECT_THAT(LaterViewsOf(classes), ElementsAre(4, -1, -1, -1, -1, -1));
  classes.sessions = {"b", "a"};
  EXPECT_THAT(LaterViewsOf(classes), ElementsAre(-1, -1, -1, 0, 0, -1));
}

TEST(LaterViews, OfTwoThatAreAsNearTheOneOfTheLaterSessionShowsTheView) {
  Classes classes = SurveyAt({{"a", 0}, {"b", 0.25}, {"c", -0.25}});
  classes.sessions = {"a", "b", "c"};
  EXPECT_THAT(LaterViewsOf(classes), ElementsAre(2, -1, -1));
}

// A chain of sessions, each a little farther on: what stands for an image is of today itself.
TEST(LaterViews, AreOfToday) {
  Classes classes = SurveyAt({{"a", 0}, {"b", 0.3}, {"c", 0.6}, {"a", 0.25}, {"c", 0.9}});
  classes.sessions = {"a", "b", "c"};
  EXPECT_THAT(LaterViewsOf(classes), ElementsAre(-1, 2, -1, 2, -1));
  EXPECT_THAT(ImagesOfToday(LaterViewsOf(classes)), ElementsAre(0, 2, 4));
}

// The first image of the survey may be the one that stands for others.
TEST(LaterViews, AreOfTodayWhereTheLastSessionIsListedFirst) {
  Classes classes = SurveyAt({{"a", 0}, {"b", 0.3}, {"c", 0.6}});
  classes.sessions = {"c", "b", "a"};
  EXPECT_THAT(LaterViewsOf(classes), ElementsAre(-1, 0, -1));
  EXPECT_THAT(ImagesOfToday(LaterViewsOf(classes)), ElementsAre(0, 2));
}

TEST(LaterViews, ImagesOfNoSessionStandForThemselvesAndForNoOther) {
  Classes classes = SurveyAt({{"a", 0}, {"x", 0}, {"b", 0.1}, {"x", 0.05}});
  classes.sessions = {"a", "b"};
  EXPECT_THAT(LaterViewsOf(classes), ElementsAre(2, -1, -1, -1));
}

}  // namespace
}  // namespace cairn
