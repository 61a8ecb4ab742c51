#include "stages/check_map/check_map.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "stages/check_map/report.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn::check_map {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const std::shared_ptr<const Map>& RoomMap() {
  static const auto& map = *new std::shared_ptr<const Map>(*Map::FromRows(MakeSyntheticRoom(1).rows));
  return map;
}

// An image in which there is nothing to find, as a file.
HeldOutImage BlankImage(const std::string& name) {
  // One file per test: they run in parallel.
  const std::string path =
      testing::TempDir() + "/" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
  cv::imwrite(path, cv::Mat(480, 640, CV_8UC1, cv::Scalar(128)));
  return {name, path, RoomMap()->head().cameras.front(), Pose()};
}

Result<CheckMapReport> Check(const std::vector<HeldOutImage>& images, const CheckMapOptions& options = {}) {
  NoProgress progress;
  return CheckMap(RoomMap(), images, options, 2, progress);
}

TEST(CheckMap, ImagesThatCannotBeLocalizedCountAgainstRecallWithTheirReason) {
  HeldOutImage missing = BlankImage("missing.png");
  missing.path += ".nowhere";
  const auto report = Check({BlankImage("blank.png"), missing});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->figures.at("num_held_out"), 2);
  EXPECT_EQ(report->figures.at("num_localized"), 0);
  EXPECT_EQ(report->figures.at("localized_ratio"), 0);
  EXPECT_EQ(report->figures.count("median_error_m"), 0u);  // no fix, no error
  EXPECT_THAT(report->images[1].rejected, HasSubstr("no such file"));
}

TEST(IsGrossError, IsWhatIsFarOffTurnedOrNoNumber) {
  const CheckMapOptions options{.gross_error_m = 0.5, .gross_error_deg = 5};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto is_gross = [&](double error_m, double error_deg) {
    HeldOutResult result;
    result.error_m = error_m;
    result.error_deg = error_deg;
    return IsGrossError(result, options);
  };
  EXPECT_FALSE(is_gross(0.5, 5));
  EXPECT_TRUE(is_gross(0.51, 5));
  EXPECT_TRUE(is_gross(0.5, 5.1));
  EXPECT_TRUE(is_gross(nan, 0));
  EXPECT_TRUE(is_gross(0, nan));
}

TEST(CheckMap, GateNamesTheFigureThatFails) {
  CheckMapOptions options;
  options.min_localized_ratio = 0.5;
  const auto report = Check({BlankImage("blank.png")}, options);
  const Status status = CheckGate(*report, options);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kGate);
  EXPECT_THAT(status.error().message, HasSubstr("localized_ratio"));
  EXPECT_TRUE(CheckGate(*report, CheckMapOptions()).ok());
}

TEST(CheckMap, ReportIsReadableByPeopleAndPrograms) {
  const auto report = Check({BlankImage("quote\".png")});
  const MapRows rows = MakeSyntheticRoom(1).rows;
  const CheckMapOptions options;
  const PrintedReport printed{&rows, 1000000, &*report, nullptr, &options};
  EXPECT_THAT(ReportText(printed), HasSubstr("held-out images        1"));
  EXPECT_THAT(ReportJson(printed, true), HasSubstr("quote\\\".png"));
  EXPECT_THAT(ReportJson(printed, true), HasSubstr("mean_total_ms"));
  EXPECT_THAT(ReportJson(printed, false), Not(HasSubstr("_ms\"")));
}

TEST(CheckMap, TruthInAnotherFrameIsToldAndGivesNoPrecision) {
  auto report = Check({BlankImage("blank.png")});
  const MapRows rows = MakeSyntheticRoom(1).rows;
  const CheckMapOptions options;
  const PrintedReport printed{&rows, 1000000, &*report, nullptr, &options};
  const auto text = [&](double precision, double error_m, double left_m) {
    report->figures["precision_ratio"] = precision;
    report->figures["num_gross_errors"] = 93;
    report->figures["median_error_m"] = error_m;
    report->figures["similarity_p90_error_m"] = left_m;
    return ReportText(printed);
  };
  EXPECT_THAT(text(0, 4, 0.3),
              AllOf(HasSubstr("in another frame than the map"), Not(HasSubstr("wrong fixes"))));
  EXPECT_THAT(text(0, 4, 0.5), HasSubstr("0.0 % (93 wrong fixes)"));  // bent: a similarity does not mend it
  EXPECT_THAT(text(0.6, 4, 0.3), HasSubstr("60.0 % (93 wrong fixes)"));
  report->figures.erase("similarity_p90_error_m");
  EXPECT_THAT(ReportText(printed), HasSubstr("93 wrong fixes"));
}

}  // namespace
}  // namespace cairn::check_map
