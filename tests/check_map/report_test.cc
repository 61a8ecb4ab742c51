#include "stages/check_map/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/runtime/localize/synthetic_room.h"

namespace cairn::check_map {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

HeldOutResult FixOf(const std::string& name, double probability) {
  HeldOutResult image{.name = name};
  image.localization.reason = NoFix::kNone;
  image.localization.probability = probability;
  image.localization.region = 3;
  image.localization.num_inliers = 40;
  image.localization.cam_from_world = PoseAt({1, 2, 1.2}, 90);
  image.true_cam_from_world = PoseAt({1, 2.5, 1.2}, 80);
  image.station = 7;
  image.error_m = 0.5;
  image.error_deg = 10;
  image.nees = 6;
  image.sift_ms = 20;
  image.total_ms = 30;
  return image;
}

// What is printed of a map of two landmarks and a region, and of what `held_out` says.
class ReportTest : public testing::Test {
 protected:
  ReportTest() {
    rows_.name = "hall";
    rows_.landmarks.resize(2);
    rows_.landmark_choice = "all";
    rows_.regions.resize(1);
    rows_.algorithm = "B";
    rows_.k = 4;
  }
  PrintedReport Printed() const {
    return {&rows_, 1234567, &held_out_, foreign_ ? &*foreign_ : nullptr, &options_};
  }
  std::string Text() const { return ReportText(Printed()); }
  nlohmann::json Json(bool with_times = true) const {
    return nlohmann::json::parse(ReportJson(Printed(), with_times));
  }

  MapRows rows_;
  CheckMapReport held_out_;
  std::optional<CheckMapReport> foreign_;
  CheckMapOptions options_;
};

TEST_F(ReportTest, BeginsWithWhatTheMapHas) {
  const std::string begin =
      "map                    hall (unsealed)\n"
      "landmarks              2 (all)\n"
      "regions                1 region (B, k = 4)\n"
      "MB                     1.23\n";
  EXPECT_EQ(Text(), begin);
  rows_.sealed = true;
  rows_.k = 0;
  rows_.lower_bound = 2;
  EXPECT_THAT(Text(), AllOf(HasSubstr("hall\n"), HasSubstr("1 region, at least 2 are needed (B)\n")));
  const nlohmann::json json = Json();
  EXPECT_EQ(json["map"], "hall");
  EXPECT_EQ(json["num_landmarks"], 2);
  EXPECT_EQ(json["num_regions"], 1);
  EXPECT_EQ(json["lower_bound"], 2);
  EXPECT_EQ(json["map_bytes"], 1234567);
  EXPECT_FALSE(json.contains("images"));
  EXPECT_FALSE(json.contains("mean_total_ms"));
  EXPECT_FALSE(json.contains("num_foreign"));
}

TEST_F(ReportTest, MayBeOfTheMapAlone) {
  const PrintedReport map_alone{&rows_, 1234567, nullptr, nullptr, &options_};
  EXPECT_THAT(ReportText(map_alone), testing::EndsWith("MB                     1.23\n"));
  EXPECT_FALSE(nlohmann::json::parse(ReportJson(map_alone, true)).contains("images"));
}

TEST_F(ReportTest, HasTheFiguresOfHeldOutImagesInCentimetresAndPerCent) {
  held_out_.images = {FixOf("a.png", 0.9), FixOf("b.png", 0.995)};
  held_out_.figures = {{"num_localized", 2},
                       {"localized_ratio", 0.5},
                       {"median_error_m", 0.0123},
                       {"median_error_deg", 0.25},
                       {"p90_error_m", 0.5},
                       {"p90_error_deg", 1.5},
                       {"within_5cm_5deg_ratio", 0.25},
                       {"within_10cm_2deg_ratio", 0.125},
                       {"within_10cm_5deg_ratio", 0.375},
                       {"precision_ratio", 0.75},
                       {"num_gross_errors", 1},
                       {"mean_probability", 0.875},
                       {"num_nearly_certain", 3},
                       {"num_nearly_certain_gross_errors", 2},
                       {"mean_nees", 6.5},
                       {"median_nees", 5.25},
                       {"nees_low", 4},
                       {"nees_high", 8}};
  held_out_.mean_total_ms = 31.5;
  held_out_.mean_sift_ms = 20.25;
  EXPECT_THAT(Text(),
              HasSubstr("held-out images        2\n"
                        "localized              2 (50.0 %)\n"
                        "median error           1.23 cm, 0.250 deg\n"
                        "90th percentile        50.00 cm, 1.500 deg\n"
                        "within 5 cm, 5 deg     25.0 %\n"
                        "within 10 cm, 2 deg    12.5 %\n"
                        "within 10 cm, 5 deg    37.5 %\n"
                        "precision              75.0 % (1 wrong fixes)\n"
                        "P(right)               mean 87.5 %; 3 fixes of 99 % or more, 2 of them wrong\n"
                        "NEES                   mean 6.50, median 5.25 (95 % band of the mean 4.00 to "
                        "8.00)\n"
                        "ms per image           31.5 (SIFT alone 20.2)\n"));
  // And what is left when the frames are fitted, where that could be done.
  held_out_.figures.insert({{"similarity_scale", 1.0125},
                            {"similarity_median_error_m", 0.01},
                            {"similarity_median_error_deg", 0.125},
                            {"similarity_p90_error_m", 0.02},
                            {"similarity_p90_error_deg", 0.5}});
  EXPECT_THAT(Text(), AllOf(HasSubstr("after a similarity     1.00 cm, 0.125 deg; 90 %: 2.00 cm, 0.500 deg; "
                                      "scale 1.0125\nwithin"),
                            Not(HasSubstr("and a camera offset"))));
  held_out_.figures.insert({{"rig_scale", 1}, {"rig_offset_m", 0.255}, {"rig_offset_deg", 1.255}});
  EXPECT_THAT(Text(),
              HasSubstr("and a camera offset    -, - deg; 90 %: -, - deg; scale 1.0000, offset 25.5 cm, "
                        "1.25 deg\n"));
}

TEST_F(ReportTest, OfNoFixHasDashes) {
  held_out_.images.resize(1);
  held_out_.figures = {{"num_localized", 0}, {"localized_ratio", 0}};
  EXPECT_THAT(Text(), HasSubstr("localized              0 (0.0 %)\n"
                                "median error           -, - deg\n"
                                "90th percentile        -, - deg\n"));
  EXPECT_THAT(Text(), HasSubstr("precision              - % (- wrong fixes)\n"));
}

TEST_F(ReportTest, TellsLeftOutRunsASparseMapAndAPlanApart) {
  held_out_.images.resize(3);
  held_out_.figures = {{kLeftOutRunsFigure, 2},
                       {"num_by_retrieval", 4},
                       {"all_images_num_by_retrieval", 5},
                       {"all_images_num_localized", 6},
                       {"all_images_localized_ratio", 0.625},
                       {"all_images_precision_ratio", 0.5},
                       {"plan_images_free_ratio", 0.75},
                       {"plan_fixes_free_ratio", 0.25},
                       {"num_scan_fixes", 9},
                       {"num_image_and_scan_fixes", 8},
                       {"scan_first_agrees_ratio", 0.125},
                       {"scan_any_agrees_ratio", 0.375}};
  held_out_.plan_verdict = "fits";
  held_out_.why_none = "too short";
  EXPECT_THAT(Text(),
              AllOf(HasSubstr("left-out images        3, in 2 runs of the survey, in maps without them\n"),
                    HasSubstr("with all images        6 (62.5 %), precision 50.0 %\n"
                              "by retrieval           4, with all images 5\n"),
                    HasSubstr("self-test              none: too short\n"
                              "floor plan             fits\n"
                              "survey in its rooms    75.0 % of the images\n"
                              "fixes in its rooms     25.0 %\n"
                              "scans located          9, 8 of images with a fix\n"
                              "scans like images      12.5 % (any of their poses 37.5 %)\n")));
  const nlohmann::json json = Json();
  EXPECT_EQ(json["no_self_test"], "too short");
  EXPECT_EQ(json["floor_plan"], "fits");
  EXPECT_EQ(json["num_scan_fixes"], 9);
}

TEST_F(ReportTest, OfAnotherPlaceCountsFalseFixesAndThoseThatSeemCertain) {
  foreign_ = CheckMapReport{.images = {FixOf("a.png", 0.99), FixOf("b.png", 0.9899), HeldOutResult{}}};
  foreign_->images[2].localization.reason = NoFix::kTooFewMatches;
  foreign_->images[2].localization.probability = 1;
  foreign_->figures = {{"num_localized", 2}};
  EXPECT_THAT(Text(),
              HasSubstr("other places           3 images, 2 false fixes (1 of P(right) 99 % or more)\n"));
  const nlohmann::json json = Json();
  EXPECT_EQ(json["num_foreign"], 3);
  EXPECT_EQ(json["num_false_fixes"], 2);
  ASSERT_EQ(json["foreign_images"].size(), 3U);
  EXPECT_FALSE(json["foreign_images"][0].contains("error_m"));
}

TEST_F(ReportTest, HasOfEachImageItsFixAndItsErrorOrWhyThereIsNone) {
  held_out_.images = {FixOf("fix.png", 0.9), HeldOutResult{.name = "none.png"},
                      HeldOutResult{.name = "rejected.png", .rejected = "no such file"}};
  held_out_.images[1].localization.reason = NoFix::kTooFewMatches;
  held_out_.images[1].localization.message = "3 matches";
  options_.gross_error_m = 0.49;
  held_out_.mean_total_ms = 5;
  const nlohmann::json images = Json()["images"];
  ASSERT_EQ(images.size(), 3U);
  const nlohmann::json& fix = images[0];
  EXPECT_EQ(fix["name"], "fix.png");
  EXPECT_EQ(fix["station"], 7);
  EXPECT_EQ(fix["region"], 3);
  EXPECT_EQ(fix["probability"], 0.9);
  EXPECT_EQ(fix["num_inliers"], 40);
  EXPECT_EQ(fix["error_m"], 0.5);
  EXPECT_EQ(fix["is_gross_error"], true);
  EXPECT_EQ(fix["total_ms"], 30);
  EXPECT_FALSE(fix.contains("message"));
  for (const auto& [key, y, heading] :
       {std::tuple("floor", 2.0, 90.0), std::tuple("true_floor", 2.5, 80.0)}) {
    ASSERT_EQ(fix[key].size(), 3U);
    EXPECT_NEAR(fix[key][0].get<double>(), 1, 1e-9);
    EXPECT_NEAR(fix[key][1].get<double>(), y, 1e-9);
    EXPECT_NEAR(fix[key][2].get<double>(), heading, 1e-9);
  }
  EXPECT_EQ(images[1]["message"], "3 matches");
  for (const char* key : {"region", "floor", "error_m", "rejected", "station", "true_floor"})
    EXPECT_FALSE(images[1].contains(key)) << key;
  EXPECT_EQ(images[2]["rejected"], "no such file");
  EXPECT_FALSE(images[2].contains("reason"));
  EXPECT_EQ(Json()["mean_total_ms"], 5);
  EXPECT_FALSE(Json(false).contains("mean_total_ms"));
  EXPECT_FALSE(Json(false)["images"][0].contains("total_ms"));
  held_out_.images[0].station.reset();
  EXPECT_TRUE(Json()["images"][0]["station"].is_null());
}

TEST_F(ReportTest, ListsTenRegionsTheWorstFirst) {
  held_out_.images.resize(1);
  for (int region = 0; region < 10; ++region)
    held_out_.regions.push_back({region, 10 + region, 5, 0, RegionSelfTest::Errors{0.02, 0.25, 0.04, 0.5}});
  EXPECT_THAT(Text(), Not(HasSubstr("better")));
  held_out_.regions.push_back({kOutsideRegions, 4, 4, 2, RegionSelfTest::Errors{0.02, 0.25, 0.04, 0.5}});
  held_out_.regions.push_back({10, 4, 4, 0, RegionSelfTest::Errors{0.02, 0.25, 0.04, 0.5}});
  // Half of the fixes outside are wrong, as half of region 0's images have none: the more images, the worse.
  const std::string text = Text();
  EXPECT_THAT(text,
              HasSubstr("by region, worst first images localized precision        median error     90th "
                        "percentile\n"
                        "  region 9                 19    26.3 %   100.0 %  2.00 cm, 0.250 deg  4.00 cm, "
                        "0.500 deg\n"));
  EXPECT_THAT(text, HasSubstr("  ... and 2 better ones\n"));
  EXPECT_LT(text.find("region 1 "), text.find("region 0 "));
  EXPECT_THAT(text, Not(HasSubstr("outside")));
}

TEST_F(ReportTest, ARegionWithoutAFixHasNoPrecision) {
  const std::string text = SelfTestRegionsText({{2, 3, 0, 0, {}}}, 1, {});
  EXPECT_THAT(text,
              HasSubstr("  region 2                  3     0.0 %         -                   -              "
                        "     -\n"));
  EXPECT_THAT(text, Not(HasSubstr("better")));
  const nlohmann::ordered_json json =
      SelfTestRegionsJson({{2, 3, 0, 0, {}}, {4, 4, 4, 1, RegionSelfTest::Errors{0.02, 0.25, 0.04, 0.5}}});
  EXPECT_TRUE(json[0]["precision_ratio"].is_null());
  EXPECT_EQ(json[1]["precision_ratio"], 0.75);
}

}  // namespace
}  // namespace cairn::check_map
