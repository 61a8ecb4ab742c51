#include "pipeline/build/build_report.h"

#include <unistd.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using Json = nlohmann::ordered_json;

class BuildReportTest : public testing::Test {
 protected:
  BuildReportTest() : folder_(fs::path(testing::TempDir()) / fmt::format("build_report_{}", getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "options");
    run_ = {.build_dir = folder_.string(),
            .recipe = "r.toml",
            .map = "m.cairn",
            .ran = {"features.db"},
            .seconds = 1.23456};
    Write("features.db.report.json", StageJson("extract_features", 2, 3'000'000));
    Write("map.report.json", StageJson("check_map", 1, 1'000'000));
    Write("options/extract_features.toml", "max_num_features = 300\nmasks = \"\"\n");
  }
  ~BuildReportTest() override { fs::remove_all(folder_); }

  void Write(const std::string& name, const std::string& text) const {
    ASSERT_TRUE(WriteFileAtomically((folder_ / name).string(), text).ok());
  }
  static std::string StageJson(const std::string& stage, double seconds, int64_t peak) {
    return Json{
        {"stage", stage},
        {"seconds", seconds},
        {"peak_memory_bytes", peak},
        {"in", {{"images", 1234567}}},
        {"out", {{"keypoints", 12}}},
        {"taken_over", {{"images", 999}}},
        {"rejected", {{{"what", "images"}, {"reason", "truncated"}, {"count", 2}, {"names", {"a", "b"}}}}}}
        .dump();
  }
  Json Make() const {
    auto report = MakeBuildReport(run_);
    EXPECT_TRUE(report.ok());
    return report.ok() ? *report : Json();
  }

  fs::path folder_;
  BuildRun run_;
};

TEST_F(BuildReportTest, ListsStagesInTheOrderOfTheLineAndSaysWhichRan) {
  const Json report = Make();
  EXPECT_EQ(report["result"], "compiled");
  EXPECT_EQ(report["seconds"], 1.235);
  ASSERT_EQ(report["stages"].size(), 2);
  EXPECT_EQ(report["stages"][0]["stage"], "extract_features");
  EXPECT_EQ(report["stages"][0]["file"], "features.db");
  EXPECT_EQ(report["stages"][0]["state"], "ran");
  EXPECT_EQ(report["stages"][0]["options"].dump(), R"({"masks":"","max_num_features":300})");
  EXPECT_EQ(report["stages"][1]["stage"], "check_map");
  EXPECT_EQ(report["stages"][1]["state"], "up_to_date");
}

TEST_F(BuildReportTest, StagesThatTheLineDoesNotHaveAnyMoreAreLeftOut) {
  Write("poses.report.json", StageJson("reconstruct", 1, 1));
  EXPECT_EQ(Make()["stages"].size(), 2);
  run_.reconstructed = true;
  EXPECT_EQ(Make()["stages"][1]["stage"], "reconstruct");
}

TEST_F(BuildReportTest, AfterAFailureTheRestHasNotRun) {
  run_.error = Error{ErrorCode::kNoData, "nothing left"};
  const Json report = Make();
  EXPECT_EQ(report["result"], "failed");
  EXPECT_EQ(report["error"].dump(), R"({"code":6,"name":"no_data","message":"nothing left"})");
  EXPECT_EQ(report["stages"][1]["state"], "not_run");
}

TEST_F(BuildReportTest, DamagedStageReportIsNamed) {
  Write("map.report.json", "{");
  const auto report = MakeBuildReport(run_);
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(report.error().message, HasSubstr("map.report.json"));
}

TEST_F(BuildReportTest, TableAddsUpShardsAndTakesCountsFromTheWhole) {
  Write("features.0of2.db.report.json", StageJson("extract_features", 10, 9'000'000));
  Write("features.1of2.db.report.json", StageJson("extract_features", 10, 5'000'000));
  EXPECT_EQ(
      BuildReportTable(Make()),
      "stage                seconds    memory  in -> out\n"
      "extract_features       22.00      9 MB  1,234,567 images -> 12 keypoints (999 images taken over)\n"
      "                                        - 2 images: truncated\n"
      "check_map               1.00      1 MB  1,234,567 images -> 12 keypoints (999 images taken over)  [up "
      "to date]\n"
      "                                        - 2 images: truncated\n");
}

TEST_F(BuildReportTest, EachFilmHasARowAndOneThatTheRecipeDoesNotNameHasNone) {
  for (const char* name : {"film-east", "film-north", "film-former"})
    Write(std::string(name) + ".report.json", StageJson("import", 1, 1));
  run_.footage = {"film-east", "film-north"};
  const Json report = Make();
  ASSERT_EQ(report["stages"].size(), 4);
  EXPECT_EQ(report["stages"][0]["file"], "film-east");
  EXPECT_EQ(report["stages"][1]["file"], "film-north");
  const std::string table = BuildReportTable(report);
  const size_t first = table.find("\nimport ");
  ASSERT_NE(first, std::string::npos);
  EXPECT_NE(table.find("\nimport ", first + 1), std::string::npos);
}

}  // namespace
}  // namespace cairn::pipeline
