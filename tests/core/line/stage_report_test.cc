#include "core/line/stage_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::ElementsAre;

const std::vector<Reject> kRejects = {{"a.jpg", "is black"}, {"b.jpg", "/tmp/b.jpg: cut off"},
                                      {"c.jpg", "is black"}, {"d.jpg", "d.jpg: cut off"},
                                      {"e.jpg", "is black"}, {"f.jpg", "g.jpg: cut off"},
                                      {"h.jpg", "is black"}};

TEST(AddRejects, OfOneReasonAreTogether) {
  StageReport report;
  AddRejects("images", kRejects, &report);
  ASSERT_EQ(report.rejected.size(), 3u);
  EXPECT_EQ(report.rejected[0].reason, "is black");
  EXPECT_EQ(report.rejected[0].count, 4);
  EXPECT_THAT(report.rejected[0].names, ElementsAre("a.jpg", "c.jpg", "e.jpg", "h.jpg"));
  // Their own names do not make reasons differ; another's does.
  EXPECT_EQ(report.rejected[1].reason, "cut off");
  EXPECT_THAT(report.rejected[1].names, ElementsAre("b.jpg", "d.jpg"));
  EXPECT_EQ(report.rejected[2].reason, "g.jpg: cut off");
  AddRejects("classes", {{"", "is black"}}, &report);
  EXPECT_EQ(report.rejected.size(), 4u);
}

TEST(RejectLines, MoreThanTenOfOneReasonAreOneLine) {
  EXPECT_THAT(RejectLines("images", kRejects),
              ElementsAre("rejected a.jpg: is black", "rejected c.jpg: is black", "rejected e.jpg: is black",
                          "rejected h.jpg: is black", "rejected b.jpg: cut off", "rejected d.jpg: cut off",
                          "rejected f.jpg: g.jpg: cut off"));
  std::vector<Reject> many;
  for (char name = 'a'; name <= 'j'; ++name) many.push_back({std::string(1, name), "x"});
  EXPECT_EQ(RejectLines("images", many).size(), 10u);
  many.push_back({"z", "y"});
  many.push_back({"k", "x"});
  EXPECT_THAT(RejectLines("images", many), ElementsAre("rejected 11 images, a to k: x", "rejected z: y"));
  EXPECT_THAT(RejectLines("images", {}), ElementsAre());
}

}  // namespace
}  // namespace cairn
