#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/capture/capture.h"
#include "core/images/image_file.h"
#include "runtime/c_api/cairn.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

using nlohmann::json;
using testing::HasSubstr;

std::vector<json> JsonLines(const std::string& text) {
  std::vector<json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(json::parse(line));
  return lines;
}

// One small survey, compiled with its visual map and without.
class VisualMapRun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("visual_map_test");
    WriteTinyRecipe(*folder_ / "visual.toml", "visual_map = true\n");
    const ProgramRun compiled =
        RunShell("cd " + folder_->string() + " && cairn compile visual.toml -o visual.cairn");
    ASSERT_EQ(compiled.exit_code, 0) << compiled.err;
    const Result<Capture> capture = ReadCapture(*folder_ / "visual.build/capture");
    ASSERT_TRUE(capture.ok());
    for (const CaptureImage& query : capture->queries) images_ += " " + capture->ImagePath(query);
  }
  static void TearDownTestSuite() { delete folder_; }

  static ProgramRun Localize(const std::string& arguments) {
    return RunShell("cd " + folder_->string() + " && cairn localize " + arguments);
  }

  static inline TemporaryFolder* folder_ = nullptr;
  static inline std::string images_;
};

TEST_F(VisualMapRun, TwoEstimatorsThatShareNothingAgree) {
  const ProgramRun run = Localize("visual.cairn" + images_ + " --estimator both -o both.txt");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  int num_agreeing = 0;
  const std::vector<json> answers = JsonLines(run.out);
  ASSERT_EQ(answers.size(), 6u);
  for (const json& answer : answers) {
    const bool both = answer["fix"].get<bool>() && answer["visual_map"]["fix"].get<bool>();
    EXPECT_EQ(answer.contains("disagreement"), both);
    if (!both) continue;
    EXPECT_LT(answer["disagreement"]["mahalanobis"].get<double>(), 4) << answer.dump(1);
    ++num_agreeing;
  }
  EXPECT_GE(num_agreeing, 2);
}

TEST_F(VisualMapRun, CApiGivesTheProgramsPlaceOnTheFloor) {
  const ProgramRun run = Localize("visual.cairn" + images_ + " --estimator visual-map");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  cairn_map* map = nullptr;
  cairn_localizer* localizer = nullptr;
  ASSERT_EQ(cairn_map_open((*folder_ / "visual.cairn").c_str(), nullptr, &map), CAIRN_OK)
      << cairn_last_error();
  ASSERT_EQ(cairn_localizer_create(map, &localizer), CAIRN_OK);
  int num_fixes = 0;
  for (const json& answer : JsonLines(run.out)) {
    const Result<cv::Mat> grey = ReadGreyImage(answer["image"]);
    ASSERT_TRUE(grey.ok());
    cairn_image image = CAIRN_IMAGE_INIT;
    image.pixels = grey->data;
    image.width = grey->cols;
    image.height = grey->rows;
    image.stride = grey->step;
    cairn_floor_fix fix = CAIRN_FLOOR_FIX_INIT;
    ASSERT_EQ(cairn_localize_on_floor(localizer, &image, nullptr, &fix), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(fix.num_matches, answer["num_matches"]);
    EXPECT_EQ(fix.num_agreeing, answer["num_agreeing"]);
    ASSERT_EQ(fix.has_fix == 1, answer["fix"].get<bool>());
    if (fix.has_fix == 0) {
      EXPECT_EQ(fix.message, answer["message"]);
      continue;
    }
    ++num_fixes;
    EXPECT_EQ(json({fix.position_m[0], fix.position_m[1]}), answer["floor_m"]);
    EXPECT_EQ(json(fix.heading_deg), answer["heading_deg"]);
    // Rows here, columns there: they differ in the last bits.
    for (int i = 0; i < 9; ++i) EXPECT_EQ(fix.covariance[i], answer["covariance"][i % 3 * 3 + i / 3]);
  }
  EXPECT_GE(num_fixes, 2);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

TEST_F(VisualMapRun, EachEstimatorAnswersInItsOwnWay) {
  const ProgramRun both = Localize("visual.cairn" + images_ + " --estimator both");
  const ProgramRun visual = Localize("visual.cairn" + images_ + " --estimator visual-map");
  const ProgramRun pnp = Localize("visual.cairn" + images_ + " --estimator pnp");
  ASSERT_EQ(visual.exit_code, 0) << visual.err;
  ASSERT_EQ(pnp.exit_code, 0) << pnp.err;
  const std::vector<json> of_both = JsonLines(both.out), of_visual = JsonLines(visual.out),
                          of_pnp = JsonLines(pnp.out);
  ASSERT_EQ(of_visual.size(), of_both.size());
  ASSERT_EQ(of_pnp.size(), of_both.size());
  for (size_t i = 0; i < of_both.size(); ++i) {
    EXPECT_EQ(of_visual[i]["floor_m"], of_both[i]["visual_map"]["floor_m"]);
    EXPECT_LT(std::abs(of_visual[i]["higher_m"].get<double>()), 0.3);  // held out images differ by 3 cm
    EXPECT_EQ(of_visual[i]["covariance"].size(), 9u);
    EXPECT_FALSE(of_visual[i].contains("center_m"));
    EXPECT_EQ(of_pnp[i].value("center_m", json()), of_both[i].value("center_m", json()));
    EXPECT_FALSE(of_pnp[i].contains("visual_map"));
    if (!of_visual[i]["fix"].get<bool>()) {
      EXPECT_FALSE(of_visual[i]["message"].get<std::string>().empty());
    }
  }
}

TEST_F(VisualMapRun, SequencesAreFollowedOnTheFloor) {
  const ProgramRun one_by_one = Localize("visual.cairn" + images_ + " --estimator visual-map");
  const ProgramRun both = Localize("visual.cairn" + images_ + " --estimator both --sequence");
  ASSERT_EQ(both.exit_code, 0) << both.err;
  const std::vector<json> alone = JsonLines(one_by_one.out), followed = JsonLines(both.out);
  ASSERT_EQ(followed.size(), alone.size());
  int num_fixes = 0;
  for (size_t i = 0; i < alone.size(); ++i) {
    EXPECT_FALSE(alone[i].contains("scope"));
    const json& on_floor = followed[i]["visual_map"];
    const std::string scope = on_floor["scope"];
    EXPECT_TRUE(scope == "track" || scope == "votes" || scope == "all") << scope;
    EXPECT_EQ(on_floor["regions"].empty(), scope == "all");
    if (!alone[i]["fix"].get<bool>() || !on_floor["fix"].get<bool>()) continue;
    ++num_fixes;
    const std::vector<double> a = alone[i]["floor_m"], b = on_floor["floor_m"];
    EXPECT_LT(std::hypot(a[0] - b[0], a[1] - b[1]), 0.3) << on_floor.dump(1);
  }
  EXPECT_GE(num_fixes, 2);
  const ProgramRun again = Localize("visual.cairn" + images_ + " --estimator both --sequence --threads 3");
  EXPECT_EQ(again.out, both.out);
}

TEST_F(VisualMapRun, OdometryHasALineForEachImage) {
  const std::string image = images_.substr(0, images_.find(' ', 1));
  const auto run = [&](const std::string& odometry, int num_images) {
    std::ofstream(*folder_ / "wheels.txt") << odometry;
    std::string arguments = "visual.cairn --estimator visual-map --sequence --odometry wheels.txt";
    for (int i = 0; i < num_images; ++i) arguments += image;
    return Localize(arguments);
  };
  const ProgramRun stands = run("0 0 0 # stands\n\n0 0 0\n0 0 0\n", 3);
  ASSERT_EQ(stands.exit_code, 0) << stands.err;
  const std::vector<json> answers = JsonLines(stands.out);
  EXPECT_LE(answers[2]["entropy"], answers[0]["entropy"]);
  // The belief goes where the wheels say, beyond what unknown motion would allow.
  const ProgramRun drives = run("0 0 0\n100 0 0\n", 2);
  ASSERT_EQ(drives.exit_code, 0) << drives.err;
  EXPECT_NE(JsonLines(drives.out)[1]["scope"], "track");
  const ProgramRun short_one = run("0 0 0\n", 2);
  EXPECT_EQ(short_one.exit_code, 2);
  EXPECT_THAT(short_one.err, HasSubstr("lines for 1 images, and none for image 2"));
  const ProgramRun long_one = run("0 0 0\n0 0 0\n", 1);
  EXPECT_EQ(long_one.exit_code, 2);
  EXPECT_THAT(long_one.err, HasSubstr("lines for 2 images, and there were 1"));
  for (const char* bad : {"0 0\n", "0 0 0 0\n", "0 0 nan\n", "0 0 x\n"}) {
    const ProgramRun refused = run(std::string("# wheels\n") + bad, 1);
    EXPECT_EQ(refused.exit_code, 4) << bad;
    EXPECT_THAT(refused.err, HasSubstr("wheels.txt:2: '")) << bad;
  }
  EXPECT_EQ(Localize("visual.cairn --estimator visual-map --sequence --odometry none.txt" + image).exit_code,
            3);
}

TEST_F(VisualMapRun, WhatCannotBeDoneIsRefused) {
  const std::string build = "visual.build/";
  const ProgramRun plain =
      RunShell("cd " + folder_->string() + " && cairn stage emit-map --classes " + build +
               "classes.db --world " + build + "world.db --regions " + build + "regions.db --vocabulary " +
               build + "vocabulary.db --name plain --landmarks regions -o plain.cairn");
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  for (const char* estimator : {"visual-map", "both"}) {
    const ProgramRun run = Localize("plain.cairn" + images_ + " --estimator " + estimator);
    EXPECT_NE(run.exit_code, 0);
    EXPECT_THAT(run.err, HasSubstr("visual_map = true"));
    EXPECT_THAT(Localize("plain.cairn" + images_ + " --sequence --estimator " + estimator).err,
                HasSubstr("visual_map = true"));
  }
  const ProgramRun poses = Localize("visual.cairn" + images_ + " --estimator visual-map -o poses.txt");
  EXPECT_NE(poses.exit_code, 0);
  EXPECT_THAT(poses.err, HasSubstr("--estimator both"));
  EXPECT_EQ(Localize("visual.cairn" + images_ + " --estimator dice").exit_code, 2);
}

}  // namespace
}  // namespace cairn
