#include "stages/filter_visibility/command.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/line/memory.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "tests/ran_command.h"

namespace cairn::filter_visibility {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

// Cameras (z up) that look along y, half a metre apart in a square of `side` places; of classes the first is
// seen everywhere, the second at one place.
Classes SquareSurvey(int side) {
  Classes classes;
  classes.cameras = {{.camera_id = 1,
                      .model = CameraModel::kSimplePinhole,
                      .width = 640,
                      .height = 480,
                      .params = {500, 320, 240}}};
  classes.classes.resize(2);
  for (int i = 0; i < side * side; ++i) {
    SurveyImage& image = classes.images.emplace_back();
    image.image_id = static_cast<ImageId>(i + 1);
    image.name = fmt::format("{}.png", image.image_id);
    image.camera_id = 1;
    image.cam_from_world.rotation =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ());
    image.cam_from_world.translation =
        -(image.cam_from_world.rotation * Eigen::Vector3d(0.5 * (i % side), 0.5 * (i / side), 0));
    classes.classes[0].observations.push_back({.image_id = image.image_id});
  }
  classes.classes[1].observations.push_back({.image_id = 1});
  for (size_t i = 0; i < 2; ++i) classes.classes[i].class_id = static_cast<ClassId>(i + 1);
  return classes;
}

class FilterVisibilityCommandTest : public CommandTest {
 protected:
  // filter-visibility classes.db -o OUTPUT WORDS...
  Ran Run(const std::string& output, const std::vector<std::string>& more,
          int64_t memory_mib = 1 << 20) const {
    return RunWords(FilterVisibilityCommand(), {Path("classes.db"), "-o", Path(output)}, more, memory_mib);
  }
};

TEST_F(FilterVisibilityCommandTest, SaysHowManyClassesStayAndWhyOthersDoNot) {
  ASSERT_TRUE(WriteClasses(SquareSurvey(4), Path("classes.db")).ok());
  const Ran ran = Run("world.db", {"--survey", "lattice"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_EQ(ran.out,
            "filter_visibility: lattice survey, 16 stations, 1 of 2 classes kept\n"
            "filter_visibility: 1 classes dropped: few_stations\n");
  EXPECT_EQ(ran.said, "");
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("classes", 2)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("classes", 1), Pair("stations", 16)));
  ASSERT_EQ(ran.report.rejected.size(), 1U);
  EXPECT_EQ(ran.report.rejected[0].count, 1);
  const auto world = ReadWorldDatabase(Path("world.db"));
  ASSERT_TRUE(world.ok());
  EXPECT_EQ(world->num_stations(), 16);
  const auto dropped = ReadDroppedItems(Path("world.db"), kDroppedItemsTable);
  ASSERT_TRUE(dropped.ok());
  ASSERT_EQ(dropped->size(), 1U);
  EXPECT_EQ(dropped->front().item_id, 2);
}

TEST_F(FilterVisibilityCommandTest, WritesJsonWhereTheNameSaysSo) {
  ASSERT_TRUE(WriteClasses(SquareSurvey(4), Path("classes.db")).ok());
  const Ran ran = Run("world.json", {"--survey", "driven", "--min-num-stations-driven", "2"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, HasSubstr("driven survey, 16 stations, 1 of 2 classes kept"));
  const auto world = ReadWorldJson(Path("world.json"));
  ASSERT_TRUE(world.ok());
  EXPECT_EQ(world->num_features(), 1);
  EXPECT_THAT(Run("world.json", {"--survey", "driven", "--min-num-stations-driven", "1"}).out,
              HasSubstr("2 of 2 classes kept"));
}

TEST_F(FilterVisibilityCommandTest, WarnsWhereNoClassStays) {
  ASSERT_TRUE(WriteClasses(SquareSurvey(4), Path("classes.db")).ok());
  const Ran ran = Run("world.db", {"--min-num-stations", "17", "--survey", "lattice"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.said, HasSubstr("none of 2 classes is visible enough"));
}

TEST_F(FilterVisibilityCommandTest, NeedsOneAndAHalfTimesTheFileAsMemory) {
  ASSERT_TRUE(WriteClasses(SquareSurvey(4), Path("classes.db")).ok());
  std::filesystem::resize_file(Path("classes.db"), 100 << 20);
  const int64_t program_mib = kProgramBytes >> 20;
  EXPECT_EQ(Run("world.db", {}, 149 + program_mib).status.error().code, ErrorCode::kNoMemory);
  EXPECT_TRUE(Run("world.db", {}, 150 + program_mib).status.ok());
}

}  // namespace
}  // namespace cairn::filter_visibility
