#include "stages/decompose_views/formats/occupancy_grid.h"

#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "core/files/file.h"
#include "core/images/image_file.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace cairn::decompose_views {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class OccupancyGridFile : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return folder_ + "/" + name; }
  void Write(const std::string& name, const std::string& text) const {
    ASSERT_TRUE(WriteFileAtomically(Path(name), text).ok());
  }
  // The keys of a map's YAML file, some replaced; "": left out.
  std::string Yaml(const std::map<std::string, std::string>& changed = {}) const {
    std::map<std::string, std::string> keys = {{"image", "map.pgm"},        {"resolution", "0.05"},
                                               {"origin", "[-1, 2.5, 0]"},  {"negate", "0"},
                                               {"occupied_thresh", "0.65"}, {"free_thresh", "0.196"}};
    for (const auto& [key, value] : changed) keys[key] = value;
    std::string text;
    for (const auto& [key, value] : keys) {
      if (!value.empty()) text += key + ": " + value + "\n";
    }
    return text;
  }
  std::vector<int> States(const std::map<std::string, std::string>& changed = {}) const {
    Write("map.yaml", Yaml(changed));
    const auto grid = ReadOccupancyGrid(Path("map.yaml"));
    EXPECT_TRUE(grid.ok()) << grid.error().message;
    if (!grid.ok()) return {};
    return {grid->cells.begin<uint8_t>(), grid->cells.end<uint8_t>()};
  }
  Error ErrorOf(const std::string& yaml) const {
    Write("map.yaml", yaml);
    const auto grid = ReadOccupancyGrid(Path("map.yaml"));
    EXPECT_FALSE(grid.ok()) << yaml;
    return grid.ok() ? Error{} : grid.error();
  }

  const std::string folder_ = testing::TempDir() + "/occupancy_grid_test";
};

constexpr int kFree = static_cast<int>(CellState::kFree), kOccupied = static_cast<int>(CellState::kOccupied),
              kUnknown = static_cast<int>(CellState::kUnknown);

TEST_F(OccupancyGridFile, GreyLevelsAreStatesAndTheLowestRowIsFirst) {
  Write("map.pgm", std::string("P5\n# CREATOR: map_saver 0.050 m/pix\n3 2\n255\n") +
                       std::string("\x00\xcd\xfe\xfe\x59\x5a", 6));
  // 254: 0.004; 205: 0.19608, not below 0.196; 89: 0.6510, above 0.65; 90: 0.647.
  EXPECT_THAT(States(), ElementsAre(kFree, kOccupied, kUnknown, kOccupied, kUnknown, kFree));
  EXPECT_THAT(States({{"mode", "scale"}}),
              ElementsAre(kFree, kOccupied, kUnknown, kOccupied, kUnknown, kFree));
  // Negated, 205 is 0.80 and 89 is 0.349.
  EXPECT_THAT(States({{"negate", "1"}}),
              ElementsAre(kOccupied, kUnknown, kUnknown, kFree, kOccupied, kOccupied));
  // Per cent: 89 and 90 are occupied, 0 is free, others are no per cent.
  EXPECT_THAT(States({{"mode", "raw"}}),
              ElementsAre(kUnknown, kOccupied, kOccupied, kFree, kUnknown, kUnknown));
  const auto grid = ReadOccupancyGrid(Path("map.yaml"));
  ASSERT_TRUE(grid.ok());
  EXPECT_EQ(grid->Metres({2, 1}), Eigen::Vector2d(-0.9, 2.55));
}

TEST_F(OccupancyGridFile, TextAndPngSayTheSame) {
  Write("map.pgm", "P2 2 2 255\n0 254\n205 0\n");
  const std::vector<int> expected = {kUnknown, kOccupied, kOccupied, kFree};
  EXPECT_EQ(States(), expected);
  const cv::Mat image = (cv::Mat_<uint8_t>(2, 2) << 0, 254, 205, 0);
  Write("map.png", *EncodePng(image, "map.png"));
  EXPECT_EQ(States({{"image", "map.png"}}), expected);
  EXPECT_EQ(States({{"image", "\"./map.png\""}}), expected);
}

TEST_F(OccupancyGridFile, ABadYamlFileIsRefusedWithItsLine) {
  Write("map.pgm", "P2 2 2 255\n0 254\n205 0\n");
  const auto message = [&](const std::string& key, const std::string& value) {
    const Error error = ErrorOf(Yaml({{key, value}}));
    EXPECT_THAT(error.message, HasSubstr(Path("map.yaml"))) << key;
    EXPECT_NE(error.code, ErrorCode::kFailed);
    return error.message;
  };
  // Keys stand in the order of the alphabet: free_thresh, image, negate, occupied_thresh, origin, resolution.
  for (const char* resolution : {"0", "-0.05", ".nan", "nan", ".inf", "1e9", "five", "0.05 m", "[0.05]"})
    EXPECT_THAT(message("resolution", resolution), HasSubstr("line 6: resolution")) << resolution;
  for (const char* origin :
       {"[0, 0]", "0", "[0, 0, .nan]", "[0, 1e10, 0]", "[0, 0, 0, 0]", "[[0], 0, 0]", "{x: 1}"})
    EXPECT_THAT(message("origin", origin), HasSubstr("line 5: origin")) << origin;
  for (const char* image : {"/etc/passwd", "../map.pgm", "a/../../map.pgm", "\"\""})
    EXPECT_THAT(message("image", image), HasSubstr("line 2: image")) << image;
  EXPECT_THAT(message("negate", "2"), HasSubstr("line 3: negate"));
  EXPECT_THAT(message("occupied_thresh", "1.5"), HasSubstr("line 4: occupied_thresh"));
  EXPECT_THAT(message("free_thresh", "0.7"), HasSubstr("line 1: free_thresh 0.7 is above"));
  EXPECT_THAT(message("mode", "ternary"), HasSubstr("mode \"ternary\""));
  for (const char* key : {"image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"})
    EXPECT_THAT(message(key, ""), HasSubstr(std::string("no key `") + key)) << key;
}

TEST_F(OccupancyGridFile, OtherFilesAreRefused) {
  Write("map.pgm", "P2 2 2 255\n0 254\n205 0\n");
  for (const char* text : {"", "just words", "- a\n- list\n", "a: [1,\n", "image: {a: b}\n", "\x01\x02"}) {
    const Error error = ErrorOf(text);
    EXPECT_EQ(error.code, ErrorCode::kCorrupt) << text;
    EXPECT_THAT(error.message, HasSubstr(Path("map.yaml")));
  }
  EXPECT_EQ(ErrorOf(std::string(2 << 20, ' ')).code, ErrorCode::kCorrupt);
  EXPECT_EQ(ReadOccupancyGrid(Path("none.yaml")).error().code, ErrorCode::kNotFound);
  const Error missing = ErrorOf(Yaml({{"image", "none.pgm"}}));
  EXPECT_EQ(missing.code, ErrorCode::kNotFound);
  EXPECT_THAT(missing.message, HasSubstr("none.pgm"));
}

TEST_F(OccupancyGridFile, ABadImageIsRefusedBeforeItIsRead) {
  const auto error_of = [&](const std::string& bytes) {
    Write("map.pgm", bytes);
    const Error error = ErrorOf(Yaml());
    EXPECT_THAT(error.message, HasSubstr(Path("map.pgm")));
    return error;
  };
  EXPECT_EQ(error_of("").code, ErrorCode::kEmptyFile);
  EXPECT_EQ(error_of("P5\n").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P5\n#").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P5 2 2 255\nabc").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P2 2 2 255\n0 0 0").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P5 0 2 255\n").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P5 -2 2 255\n").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P5 99999999999999999999 2 255\n").code, ErrorCode::kCorrupt);
  EXPECT_EQ(error_of("P5 2 2 65535\nabcdabcd").code, ErrorCode::kUnsupported);
  EXPECT_EQ(error_of("P6 2 2 255\nabcdabcdabcd").code, ErrorCode::kUnsupported);
  EXPECT_EQ(error_of("\xff\xd8\xff").code, ErrorCode::kUnsupported);
  EXPECT_THAT(error_of("P5 100000 100000 255\n").message, HasSubstr("100000 x 100000 cells; at most"));
  const cv::Mat image = cv::Mat::zeros(2, 2, CV_8U);
  std::string png = *EncodePng(image, "map.png");
  std::string large = png;
  large.replace(16, 8, std::string("\x00\x01\x86\xa0\x00\x01\x86\xa0", 8));  // 100,000 x 100,000
  EXPECT_THAT(error_of(large).message, HasSubstr("100000 x 100000 cells; at most"));
  std::string clear = png;
  clear[25] = 6;  // colours and transparency
  EXPECT_THAT(error_of(clear).message, HasSubstr("transparency"));
  EXPECT_EQ(error_of(png.substr(0, png.size() - 12)).code, ErrorCode::kCorrupt);
}

TEST_F(OccupancyGridFile, ItIsAPlanByItsName) {
  std::string cells(40 * 30, '\xfe');
  for (int i = 5; i < 35; ++i)
    cells[static_cast<size_t>(40 * 10 + i)] = 0;  // row 10 from above: 19 from below
  Write("map.pgm", "P5\n40 30\n255\n" + cells);
  Write("map.yaml", Yaml());
  const auto plan = ReadPlan(Path("map.yaml"));
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  EXPECT_FALSE(plan->closed());
  ASSERT_EQ(plan->segments.size(), 1u);
  EXPECT_NEAR(plan->segments[0].start.y(), 2.5 + 0.05 * 19.5, 1e-9);
  EXPECT_NEAR((plan->segments[0].end - plan->segments[0].start).norm(), 0.05 * 29, 1e-9);
  EXPECT_THAT(OtherFilesOfPlan(Path("map.yaml")), ElementsAre(Path("map.pgm")));
  EXPECT_THAT(OtherFilesOfPlan(Path("map.pgm")), ElementsAre());
  EXPECT_THAT(OtherFilesOfPlan(Path("none.yaml")), ElementsAre());
  const auto image = ReadPlan(Path("map.pgm"));
  ASSERT_FALSE(image.ok());
  EXPECT_THAT(image.error().message, HasSubstr("YAML"));
  EXPECT_THAT(ReadPlan(Path("map.yaml"), {.units = "mm"}).error().message, HasSubstr("units"));
  EXPECT_THAT(ReadPlan(Path("map.yaml"), {.layers = "A"}).error().message, HasSubstr("layers"));
}

}  // namespace
}  // namespace cairn::decompose_views
