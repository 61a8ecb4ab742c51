#include "stages/decompose_views/formats/plan_units.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/decompose_views/plan/read_plan.h"

namespace cairn::decompose_views {
namespace {

using testing::HasSubstr;

// Rooms side by side, each of 5 x 4 m with a door of 1 m, by a factor; as lines.
std::string Rooms(int num, double factor = 1) {
  std::string text;
  const auto wall = [&](double x0, double y0, double x1, double y1) {
    text += fmt::format("{},{},{},{}\n", factor * x0, factor * y0, factor * x1, factor * y1);
  };
  for (int i = 0; i < num; ++i) {
    const double x = 5.0 * i;
    wall(x, 0, x + 2, 0);
    wall(x + 3, 0, x + 5, 0);
    wall(x, 4, x + 5, 4);
    wall(x, 0, x, 4);
  }
  wall(5.0 * num, 0, 5.0 * num, 4);
  return text;
}

Error ErrorOfPlan(const std::string& text, const ReadPlanOptions& options = {}) {
  const auto plan = ParsePlan(text, "plan", options);
  EXPECT_FALSE(plan.ok());
  return plan.ok() ? Error{} : plan.error();
}

TEST(PlanUnits, OtherUnitsThanMetresAreRefusedByTheirSize) {
  EXPECT_TRUE(ParsePlan(Rooms(1), "plan").ok());
  EXPECT_TRUE(ParsePlan(Rooms(100), "plan").ok());
  EXPECT_TRUE(ParsePlan(Rooms(1, 0.1), "plan").ok());  // a model of it, half a metre across
  const struct {
    double factor;
    const char* unit;
  } cases[] = {{1000, "mm"}, {100, "cm"}, {1 / 0.0254, "in"}};
  for (const auto& [factor, unit] : cases) {
    const Error error = ErrorOfPlan(Rooms(4, factor));
    EXPECT_EQ(error.code, ErrorCode::kUnsupported);
    EXPECT_THAT(error.message, HasSubstr("no building has this size"));
    // What is advised gives the plan.
    const auto plan = ParsePlan(Rooms(4, factor), "plan", {.units = unit});
    ASSERT_TRUE(plan.ok()) << plan.error().message;
    EXPECT_NEAR(plan->segments.back().start.x(), 20, 1e-9);
  }
  EXPECT_THAT(
      ErrorOfPlan(Rooms(4, 1000)).message,
      HasSubstr(
          "in m (the file does not say in which unit) it has 20000 m x 4000 m, walls of 4000 m (median); "
          "say its unit by units (--units), cm: 200 m x 40 m, walls of 40 m (median); mm: 20 m x 4 m, "
          "walls of 4 m (median); if it is right so, give units = \"m\" (--units m)"));
  // A hall that is so large is taken on request.
  EXPECT_TRUE(ParsePlan(Rooms(4, 1000), "plan", {.units = "m"}).ok());
  EXPECT_THAT(ErrorOfPlan(Rooms(4), {.units = "mm"}).message, HasSubstr("units"));
  EXPECT_THAT(ErrorOfPlan(Rooms(4), {.units = "miles"}).message, HasSubstr("units"));
}

TEST(PlanUnits, DegreesAreRecognised) {
  // In Stockholm.
  std::string text =
      "{\"type\": \"LineString\", \"coordinates\": [[18.07,59.33],[18.0704,59.33],[18.0704,59.33004],"
      "[18.07,59.33004]]";
  const Error error = ErrorOfPlan(text + "}");
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_THAT(error.message, HasSubstr("degrees"));
  EXPECT_THAT(error.message, HasSubstr("22.7 m x 4.45 m near (18.07020, 59.33002)"));
  EXPECT_THAT(error.message, HasSubstr("EPSG:32634"));
  // As the file says it, whatever the numbers are.
  const auto with_crs = [](const std::string& name) {
    return "{\"type\": \"FeatureCollection\", \"crs\": {\"type\": \"name\", \"properties\": {\"name\": \"" +
           name +
           "\"}}, \"features\": [{\"type\": \"Feature\", \"geometry\": {\"type\": \"LineString\", "
           "\"coordinates\": "
           "[[0,0],[5,0],[5,4]]}}]}";
  };
  EXPECT_THAT(ErrorOfPlan(with_crs("urn:ogc:def:crs:OGC:1.3:CRS84")).message, HasSubstr("CRS84"));
  EXPECT_THAT(ErrorOfPlan(with_crs("EPSG:4326")).message, HasSubstr("EPSG:4326"));
  EXPECT_TRUE(ParsePlan(with_crs("urn:ogc:def:crs:EPSG::25832"), "plan").ok());
  EXPECT_TRUE(ParsePlan(with_crs("EPSG:4326"), "plan", {.units = "m"}).ok());
  // Lines, south and west.
  EXPECT_THAT(ErrorOfPlan("-70.64,-33.45,-70.6399,-33.45\n-70.6399,-33.45,-70.6399,-33.4501\n").message,
              HasSubstr("EPSG:32719"));
}

TEST(PlanUnits, ThePlansOfTheBenchmarksAreInMetres) {
  const std::string folder = CAIRN_SOURCE_DIR "/../shared/data/floorplans/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string path = entry.path().string();
    const auto plan = ReadPlan(path);
    ASSERT_TRUE(plan.ok()) << plan.error().message;
    for (const double factor : {100.0, 1000.0}) {
      InputPlan other = *plan;
      ScalePlan(factor, &other);
      EXPECT_FALSE(CheckPlanSize(other, {}, path).ok()) << path << " " << factor;
    }
  }
}

}  // namespace
}  // namespace cairn::decompose_views
