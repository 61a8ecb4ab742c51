#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/group_classes/group_classes.h"
#include "tests/group_classes/survey.h"
#include "tests/recorded_progress.h"

namespace cairn::group_classes {
namespace {

using testing::HasSubstr;

// As stated, which is quick.
Result<GroupClassesResult> GroupAsStated(const Survey& survey, Progress& progress,
                                         const std::vector<std::string>& sessions = {},
                                         double min_angle_deg = 0) {
  GroupClassesOptions options;
  options.refine_poses = "never";
  if (min_angle_deg > 0) options.triangulation.min_triangulation_angle_deg = min_angle_deg;
  return GroupClasses(survey.matched, survey.capture, options, 1, progress, nullptr, sessions);
}

TEST(GroupClasses, TellsHowFarItIsInEachStep) {
  RecordedProgress progress;
  ASSERT_TRUE(GroupAsStated(MakeSurvey({}), progress).ok());
  progress.ExpectAllDone();
  EXPECT_EQ(progress.tasks.front().name, "read matches");
  EXPECT_EQ(progress.tasks.front().total, 24);
  EXPECT_EQ(progress.tasks.back().name, "group classes");
}

TEST(GroupClasses, StopsInWhicheverStepItIs) {
  const Survey survey = MakeSurvey({});
  for (const auto& [step, message] : {std::pair("read matches", "stopped while reading matches"),
                                      std::pair("triangulate tracks", "stopped while adjusting poses"),
                                      std::pair("group classes", "stopped while grouping classes")}) {
    RecordedProgress progress(step);
    const auto stopped = GroupAsStated(survey, progress);
    ASSERT_FALSE(stopped.ok()) << step;
    EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
    EXPECT_EQ(stopped.error().message, message);
    EXPECT_EQ(progress.tasks.back().name, step);
  }
}

TEST(GroupClasses, OneSessionHasNothingToCompareWith) {
  NoProgress progress;
  const auto grouped = GroupAsStated(MakeSurvey({}), progress, {"a"});
  ASSERT_TRUE(grouped.ok());
  EXPECT_TRUE(grouped->classes.sessions.empty());
  EXPECT_TRUE(grouped->sessions.empty());
}

TEST(GroupClasses, NoClassIsAnErrorThatCountsWhatTookTheMost) {
  Survey survey = MakeSurvey({});
  NoProgress progress;
  const auto narrow = GroupAsStated(survey, progress, {}, 179);
  ASSERT_FALSE(narrow.ok());
  EXPECT_THAT(narrow.error().message, HasSubstr("by small_angle"));
  // One track alone, then none.
  survey.matched.geometries.resize(1);
  survey.matched.geometries[0].inliers.resize(1);
  EXPECT_THAT(GroupAsStated(survey, progress, {}, 179).error().message,
              HasSubstr("none of 1 tracks became a class (most were dropped: 1 by "));
  survey.matched.geometries.clear();
  EXPECT_THAT(GroupAsStated(survey, progress).error().message,
              HasSubstr("none of 0 tracks became a class (most were dropped: no matches)"));
}

}  // namespace
}  // namespace cairn::group_classes
