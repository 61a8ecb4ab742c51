#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"
#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

// A flat of two rooms with a door, as a file of wall segments.
class FloorPlan : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteFileAtomically(Path("plan.txt"),
                                    "0,0,6,0\n6,0,6,4\n6,4,0,4\n0,4,0,0\n3.5,0,3.5,1.5\n3.5,2.5,3.5,4\n")
                    .ok());
  }
  std::string Path(const std::string& name) const { return folder_ / name; }
  ProgramRun Run(const std::string& arguments) const {
    return RunShell("cd " + folder_.string() + " && cairn " + arguments);
  }

  TemporaryFolder folder_{"floor_plan_test"};
};

TEST_F(FloorPlan, AScanIsLocatedInItAndPathsAreFound) {
  const ProgramRun made = Run("plan decompose plan.txt -o views.db --svg views.svg");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("regions"));
  EXPECT_THAT(*ReadFile(Path("views.svg")), HasSubstr("</svg>"));

  // From (1, 1), heading +x: the left room's three outer walls and the lower part of the inner one.
  ASSERT_TRUE(
      WriteFileAtomically(Path("scan.txt"), "-1,-1,2.5,-1\n2.5,-1,2.5,0.5\n2.5,3,-1,3\n-1,3,-1,-1\n").ok());
  const ProgramRun located = Run("plan locate views.db scan.txt --svg scan.svg");
  ASSERT_EQ(located.exit_code, 0) << located.err;
  const json found = json::parse(located.out);
  ASSERT_FALSE(found["solutions"].empty());
  EXPECT_NEAR(found["solutions"][0]["x"].get<double>(), 1, 0.01);
  EXPECT_NEAR(found["solutions"][0]["y"].get<double>(), 1, 0.01);
  EXPECT_NEAR(found["solutions"][0]["heading_deg"].get<double>(), 0, 0.5);
  EXPECT_TRUE(found["solutions"][0]["determined"].get<bool>());
  EXPECT_GT(found["solutions"][0]["probability"].get<double>(), 0.9);
  EXPECT_THAT(*ReadFile(Path("scan.svg")), HasSubstr("id=\"beams\""));
  // A log is located by all threads, with the same lines for any number of them.
  std::string log;
  for (int scan = 0; scan < 40; ++scan) {
    log += "FLASER 60";
    for (int i = 0; i < 60; ++i) log += fmt::format(" {}", 0.9 + 0.02 * ((i * 7 + scan) % 13));
    log += " 0 0 0 0 0 0 1 host 1\n";
  }
  ASSERT_TRUE(WriteFileAtomically(Path("many.log"), log).ok());
  const ProgramRun one = Run("plan locate views.db many.log --threads 1"),
                   two = Run("plan locate views.db many.log --threads 2");
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_EQ(std::count(one.out.begin(), one.out.end(), '\n'), 40);
  EXPECT_EQ(one.out, two.out);

  const ProgramRun path = Run("plan path views.db --from 1,1 --to 5,1");
  ASSERT_EQ(path.exit_code, 0) << path.err;
  EXPECT_GT(json::parse(path.out)["length_m"].get<double>(), 4);
  const ProgramRun few = Run("plan path views.db --from 0.5,0.5 --to 5,0.5 --kind min-link --svg few.svg");
  ASSERT_EQ(few.exit_code, 0) << few.err;
  EXPECT_EQ(json::parse(few.out)["links"], 2);
  EXPECT_EQ(json::parse(few.out)["fewest_links"], 2);
  EXPECT_EQ(json::parse(few.out)["is_optimal"], true);
  EXPECT_THAT(*ReadFile(Path("few.svg")), HasSubstr("no path has fewer links"));
  // From one room: the other is seen through the door, but not its corners; around the flat nobody looks.
  const ProgramRun search = Run("plan path views.db --from 1,1 --kind search --svg search.svg");
  ASSERT_EQ(search.exit_code, 0) << search.err;
  const json searched = json::parse(search.out);
  EXPECT_EQ(searched["places"].size(), 2u);
  EXPECT_EQ(searched["fewest_places"], 2);
  EXPECT_NEAR(searched["domain_area_m2"].get<double>(), 8 * 6, 1e-6);
  EXPECT_NEAR(searched["visible_area_m2"].get<double>(), 24, 1e-3);
  EXPECT_NEAR(searched["seen_area_m2"].get<double>(), 24, 1e-3);
  ASSERT_EQ(searched["unseen"].size(), 1u);
  EXPECT_NEAR(searched["unseen"][0]["area_m2"].get<double>(), 24, 1e-3);
  EXPECT_NEAR(searched["unseen_area_m2"].get<double>(), 24, 1e-3);
  EXPECT_THAT(search.err, HasSubstr("24.0 of 48.0 m2 cannot be seen from where the robot gets to"));
  EXPECT_THAT(*ReadFile(Path("search.svg")), HasSubstr("id=\"areas\""));
  const ProgramRun apart = Run("plan tell-apart views.db --a 1,2,0 --b 5,2,180 --svg apart.svg");
  ASSERT_EQ(apart.exit_code, 0) << apart.err;
  EXPECT_GT(json::parse(apart.out)["case"].get<int>(), 0);
  EXPECT_EQ(json::parse(apart.out)["outcome"], "found");
}

// A line of a log: a scan in a plan, with noiseless wheels that began elsewhere.
std::string LoggedScan(const std::vector<PlanWall>& walls, const PlanarPose& pose) {
  Random random(1);
  std::string line = "FLASER 180";
  for (const Beam& beam : BeamsAt(walls, pose, 0, &random)) line += fmt::format(" {:.4f}", beam.range_m);
  const PlanarPose wheels{{7 - pose.position.x(), 3 - pose.position.y()},
                          WrapAngle(pose.heading_rad + std::numbers::pi)};
  return line + fmt::format(" {} {} {} {} {} {} 1 host 1\n", pose.position.x(), pose.position.y(),
                            pose.heading_rad, wheels.position.x(), wheels.position.y(), wheels.heading_rad);
}

TEST_F(FloorPlan, ARobotIsFollowedFromAnywhere) {
  ASSERT_EQ(Run("plan decompose plan.txt -o views.db").exit_code, 0);
  const std::vector<PlanWall> walls = {{{0, 0}, {6, 0}}, {{6, 0}, {6, 4}},       {{6, 4}, {0, 4}},
                                       {{0, 4}, {0, 0}}, {{3.5, 0}, {3.5, 1.5}}, {{3.5, 2.5}, {3.5, 4}}};
  std::vector<PlanarPose> way;
  for (const double x : {1.0, 1.6, 2.2, 2.8, 3.4, 4.0}) way.push_back({{x, 2.1}, 0.1});
  std::string log;
  for (const PlanarPose& pose : way) log += LoggedScan(walls, pose);
  ASSERT_TRUE(WriteFileAtomically(Path("way.log"), log).ok());
  const ProgramRun run = Run("plan follow views.db way.log --svg way.svg");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::istringstream lines(run.out);
  std::string line;
  for (size_t i = 0; i < way.size(); ++i) {
    ASSERT_TRUE(std::getline(lines, line));
    const json found = json::parse(line);
    EXPECT_EQ(found["scan"], i);
    EXPECT_EQ(found["beams"], 180);
    double sum = found["elsewhere"].get<double>();
    for (const json& place : found["places"]) sum += place["probability"].get<double>();
    EXPECT_NEAR(sum, 1, 0.01);
    if (i < 2) continue;
    const json& first = found["places"][0];
    EXPECT_NEAR(first["x"].get<double>(), way[i].position.x(), 0.05);
    EXPECT_NEAR(first["y"].get<double>(), way[i].position.y(), 0.05);
    EXPECT_NEAR(first["heading_deg"].get<double>(), DegFromRad(0.1), 1);
    EXPECT_GT(first["probability"].get<double>(), 0.99);
    EXPECT_TRUE(first["determined"].get<bool>());
    EXPECT_EQ(first["covariance"].size(), 9u);
  }
  EXPECT_FALSE(std::getline(lines, line));
  EXPECT_EQ(run.out, Run("plan follow views.db way.log --threads 1").out);
  EXPECT_THAT(*ReadFile(Path("way.svg")), HasSubstr("6 scans"));
  const ProgramRun later = Run("plan follow views.db way.log --start 4");
  EXPECT_EQ(json::parse(later.out.substr(0, later.out.find('\n')))["scan"], 4);
}

// The flat of SetUp as a ROS map of 5 cm a cell whose corner is at (-0.525, -0.525): walls lie on middles of
// cells.
void WriteRosMap(const std::string& folder, const std::string& name) {
  constexpr int kColumns = 142, kRows = 102, kMargin = 10, kCellsOfMetre = 20;
  std::string cells(kColumns * kRows, '\xfe');
  const auto draw = [&](double x0, double y0, double x1, double y1) {
    const auto cell = [&](double metres) {
      return kMargin + static_cast<int>(std::lround(metres * kCellsOfMetre));
    };
    for (int y = cell(y0); y <= cell(y1); ++y) {
      for (int x = cell(x0); x <= cell(x1); ++x)
        cells[static_cast<size_t>((kRows - 1 - y) * kColumns + x)] = 0;
    }
  };
  draw(0, 0, 6, 0);
  draw(6, 0, 6, 4);
  draw(0, 4, 6, 4);
  draw(0, 0, 0, 4);
  draw(3.5, 0, 3.5, 1.5);
  draw(3.5, 2.5, 3.5, 4);
  ASSERT_TRUE(WriteFileAtomically(folder + "/" + name + ".pgm",
                                  fmt::format("P5\n{} {}\n255\n", kColumns, kRows) + cells)
                  .ok());
  ASSERT_TRUE(WriteFileAtomically(folder + "/" + name + ".yaml",
                                  "image: " + name +
                                      ".pgm\nresolution: 0.05\norigin: [-0.525, -0.525, 0]\nnegate: 0\n"
                                      "occupied_thresh: 0.65\nfree_thresh: 0.196\n")
                  .ok());
}

TEST_F(FloorPlan, ARosMapAndADrawingAreThePlanThatTheyShow) {
  WriteRosMap(folder_.string(), "map");
  const ProgramRun made = Run("plan decompose map.yaml -o map.db --svg map.svg");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("142 x 102 cells of 0.05 m: 6 walls"));
  EXPECT_THAT(*ReadFile(Path("map.svg")), HasSubstr("</svg>"));
  std::string drawing = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n";
  std::istringstream lines(*ReadFile(Path("plan.txt")));
  for (std::string line; std::getline(lines, line);) {
    std::vector<double> metres;
    std::istringstream words(line);
    for (std::string word; std::getline(words, word, ',');) metres.push_back(std::stod(word));
    drawing += fmt::format("0\nLINE\n8\nWALLS\n10\n{}\n20\n{}\n11\n{}\n21\n{}\n", 1000 * metres[0],
                           1000 * metres[1], 1000 * metres[2], 1000 * metres[3]);
  }
  ASSERT_TRUE(WriteFileAtomically(Path("plan.dxf"), drawing + "0\nENDSEC\n0\nEOF\n").ok());
  const ProgramRun drawn = Run("plan decompose plan.dxf -o drawn.db --layers 'WALL*'");
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  EXPECT_THAT(drawn.out, HasSubstr("walls by layer: WALLS 6"));
  ASSERT_TRUE(
      WriteFileAtomically(Path("scan.txt"), "-1,-1,2.5,-1\n2.5,-1,2.5,0.5\n2.5,3,-1,3\n-1,3,-1,-1\n").ok());
  for (const char* views : {"map.db", "drawn.db"}) {
    const ProgramRun located = Run(std::string("plan locate ") + views + " scan.txt");
    ASSERT_EQ(located.exit_code, 0) << located.err;
    const json found = json::parse(located.out)["solutions"][0];
    EXPECT_NEAR(found["x"].get<double>(), 1, 0.02) << views;
    EXPECT_NEAR(found["y"].get<double>(), 1, 0.02) << views;
    EXPECT_NEAR(found["heading_deg"].get<double>(), 0, 0.5) << views;
  }
}

TEST_F(FloorPlan, AlikeAndGivenUpAreTwoAnswers) {
  ASSERT_TRUE(WriteFileAtomically(Path("twins.txt"),
                                  "0,0,3,0\n3,0,3,3\n3,3,0,3\n0,3,0,0\n0,2,2,2\n"
                                  "10,0,13,0\n13,0,13,3\n13,3,10,3\n10,3,10,0\n10,2,12,2\n")
                  .ok());
  ASSERT_EQ(Run("plan decompose twins.txt -o twins.db").exit_code, 0);
  const std::string poses = "plan tell-apart twins.db --a 1,1,0 --b 11,1,0 ";
  const ProgramRun alike = Run(poses);
  EXPECT_EQ(alike.exit_code, 0) << alike.err;
  EXPECT_EQ(json::parse(alike.out)["outcome"], "alike");
  const ProgramRun gave_up = Run(poses + "--max-num-regions 2 --svg apart.svg");
  EXPECT_EQ(gave_up.exit_code, 1);
  EXPECT_EQ(json::parse(gave_up.out)["outcome"], "gave_up");
  EXPECT_THAT(gave_up.err, HasSubstr("--max-num-regions"));
  EXPECT_THAT(*ReadFile(Path("apart.svg")), HasSubstr("gave up after 2 regions"));
}

// Two rooms alike but for a niche around the corner: what locate prints is told apart by where to look next.
TEST_F(FloorPlan, PlacesThatLocatePrintsAreToldApart) {
  const std::string left = "0,0,0,5\n0,5,4,5\n4,5,4,4\n4,4,1,4\n1,4,1,0\n1,0,0,0\n";
  const std::string right =
      "10,0,10,5\n10,5,14,5\n14,5,14,4\n14,4,11,4\n11,4,11,0\n11,0,10,0\n13,4.1,13,4.9\n";
  ASSERT_TRUE(WriteFileAtomically(Path("elbows.txt"), left + right).ok());
  ASSERT_EQ(Run("plan decompose elbows.txt -o elbows.db").exit_code, 0);
  std::vector<PlanWall> walls;
  std::istringstream lines(left);
  for (std::string line; std::getline(lines, line);) {
    PlanWall wall;
    std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf", &wall.start.x(), &wall.start.y(), &wall.end.x(),
                &wall.end.y());
    walls.push_back(wall);
  }
  ASSERT_TRUE(WriteFileAtomically(Path("one.log"), LoggedScan(walls, {{0.5, 0.6}, 1.57})).ok());
  const ProgramRun located = Run("plan locate elbows.db one.log");
  ASSERT_EQ(located.exit_code, 0) << located.err;
  ASSERT_GE(json::parse(located.out)["solutions"].size(), 2u) << located.out;
  ASSERT_TRUE(WriteFileAtomically(Path("places.json"), located.out).ok());
  const ProgramRun next = Run("plan next-look elbows.db places.json --radius-m 0.1 --svg next.svg");
  ASSERT_EQ(next.exit_code, 0) << next.err;
  const json look = json::parse(next.out);
  EXPECT_EQ(look["outcome"], "found");
  EXPECT_GE(look["places"].size(), 2u);
  EXPECT_EQ(look["places"][0]["path"].size(), look["path"].size());
  EXPECT_GE(look["expected_length_m"].get<double>(), 0);
  EXPECT_THAT(*ReadFile(Path("next.svg")), HasSubstr("on average"));
  EXPECT_EQ(next.out, Run("plan next-look elbows.db places.json --radius-m 0.1 --threads 1").out);
  // The last line counts, or that of a scan; lines of follow are as good.
  const std::string one =
      R"({"scan": 7, "places": [{"x": 0.5, "y": 0.5, "heading_deg": 90, "probability": 1}]})";
  ASSERT_TRUE(WriteFileAtomically(Path("both.json"), located.out + one + "\n").ok());
  EXPECT_EQ(json::parse(Run("plan next-look elbows.db both.json").out)["outcome"], "one_place");
  EXPECT_EQ(json::parse(Run("plan next-look elbows.db both.json --scan 7").out)["outcome"], "one_place");
  EXPECT_EQ(json::parse(Run("plan next-look elbows.db both.json --scan 0 --radius-m 0.1").out), look);
  const ProgramRun reach = Run("plan next-look elbows.db places.json --radius-m 0.1 --reach-m 0.6");
  EXPECT_EQ(reach.exit_code, 1);
  EXPECT_THAT(reach.err, HasSubstr("--reach-m"));
}

TEST_F(FloorPlan, BadInputHasItsCodeAndLeavesNothing) {
  ASSERT_EQ(Run("plan decompose plan.txt -o views.db").exit_code, 0);
  const auto write = [&](const char* name, const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(Path(name), text).ok());
  };
  write("line.txt", "0,0,1\n");
  write("empty.txt", "");
  write("open.json", "{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[1,0],[1,1],[0,1]]]}");
  write("crossing.json", "{\"type\": \"Polygon\", \"coordinates\": [[[0,0],[2,2],[2,0],[0,2],[0,0]]]}");
  write("degrees.json",
        "{\"type\": \"LineString\", \"coordinates\": [[18.07,59.33],[18.0703,59.33],[18.0703,59.3301]]}");
  write("millimetres.txt", "0,0,6000,0\n6000,0,6000,4000\n6000,4000,0,4000\n");
  write("cut.dxf", "0\nSECTION\n2\nENTITIES\n0\nLINE\n8\nA\n10\n0\n");
  write("nan.dxf", "0\nSECTION\n2\nENTITIES\n0\nLINE\n8\nA\n10\nnan\n0\nENDSEC\n0\nEOF\n");
  write("drawing.dwg", std::string("AC1032\0\0", 8));
  write("list.yaml", "- a\n- b\n");
  write("away.yaml",
        "image: ../a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: "
        "0.65\nfree_thresh: 0.2\n");
  write(
      "zero.yaml",
      "image: a.pgm\nresolution: 0\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n");
  write("huge.yaml",
        "image: huge.pgm\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: "
        "0.2\n");
  write("huge.pgm", "P5\n100000 100000\n255\n");
  write("one.txt", "1,-1,1,1\n");
  write("two.txt", "a.png\n\n");
  write("still.log", "FLASER 4 1 1 1 1 1 1 0 1 1 0 1 h 1\nFLASER 4 1 1 1 1 1 1 0 1 1 0 2 h 2\n");
  const std::string scan_json =
      R"({"angle_min": 0, "angle_increment": 1, "range_max": 9, "ranges": [1, 1, 1, 1]})";
  write("bare.json", scan_json + "\n" + scan_json + "\n");
  const std::string place = R"({"x": 1, "y": 1, "heading_deg": 0, "probability": 0.5})";
  write("place.json", "{\"scan\": 3, \"places\": [" + place + "]}\n");
  write("lame.json",
        "{\"places\": [" + place + R"(, {"x": 1, "y": null, "heading_deg": 0, "probability": 1}]})");
  write("wide.json",
        R"({"places": [{"x": 1, "y": 1, "heading_deg": 0, "probability": 1, "covariance": [1, 2]}]})");
  write("away.json", R"({"places": [{"x": 99, "y": 1, "heading_deg": 0, "probability": 1}]})");
  write("cut.log", "ODOM 1\nFLASER 4 1 1 1 1 1 1 0 1 1 0 1 h 1\n");
  write("scan.txt", "-1,-1,2.5,-1\n2.5,-1,2.5,0.5\n2.5,3,-1,3\n-1,3,-1,-1\n");
  write(
      "twins.txt",
      "0,0,3,0\n3,0,3,3\n3,3,0,3\n0,3,0,0\n0,2,2,2\n10,0,13,0\n13,0,13,3\n13,3,10,3\n10,3,10,0\n10,2,12,2\n");
  ASSERT_EQ(Run("plan decompose twins.txt -o twins.db").exit_code, 0);
  struct Case {
    std::string arguments;
    int exit_code;
    std::string message;
  };
  for (const auto& [arguments, exit_code, message] : {
           Case{"plan decompose line.txt -o out.db", 4, "line 1"},
           Case{"plan decompose empty.txt -o out.db", 6, "no walls"},
           Case{"plan decompose open.json -o out.db", 4, "open"},
           Case{"plan decompose crossing.json -o out.db", 4, "Self-intersection"},
           Case{"plan decompose none.txt -o out.db", 3, "none.txt"},
           Case{"plan decompose degrees.json -o out.db", 5, "EPSG:32634"},
           Case{"plan decompose millimetres.txt -o out.db", 5, "mm: 6 m x 4 m"},
           Case{"plan decompose plan.txt -o out.db --units mm", 5, "as units says"},
           Case{"plan decompose plan.txt -o out.db --layers A", 2, "layers"},
           Case{"plan decompose cut.dxf -o out.db", 4,
                "cut.dxf: a DXF that is cut short: it ends after line 10"},
           Case{"plan decompose nan.dxf -o out.db", 4, "nan.dxf: line 10: \"nan\""},
           Case{"plan decompose drawing.dwg -o out.db", 5, "DWG"},
           Case{"plan decompose list.yaml -o out.db", 4, "list.yaml"},
           Case{"plan decompose none.yaml -o out.db", 3, "none.yaml"},
           Case{"plan decompose away.yaml -o out.db", 2, "away.yaml: line 1: image \"../a.pgm\" leads out"},
           Case{"plan decompose zero.yaml -o out.db", 4, "zero.yaml: line 2: resolution"},
           Case{"plan decompose huge.yaml -o out.db", 5, "huge.pgm: 100000 x 100000 cells"},
           Case{"plan decompose huge.pgm -o out.db", 5, "YAML"},
           Case{"plan decompose plan.txt -o out.db --grid-m 1", 2, "grid_m"},
           Case{"plan locate views.db one.txt --search vir", 6, "at least two"},
           Case{"plan locate plan.txt one.txt", 4, "plan.txt"},
           Case{"plan locate views.db scan.txt --scan -5", 2, "'-5': it has 1 scan(s), numbered 0 to 0"},
           Case{"plan locate views.db scan.txt --scan 1", 2, "1 scan(s)"},
           Case{"plan locate views.db scan.txt --scan nan", 2, "1 scan(s)"},
           Case{"plan locate views.db scan.txt --scan ''", 2, "1 scan(s)"},
           Case{"plan locate views.db scan.txt --scan 0.5", 2, "1 scan(s)"},
           Case{"plan locate views.db scan.txt --scan 99999999999", 2, "1 scan(s)"},
           Case{"plan locate views.db scan.txt --split-m inf", 2, "split_m"},
           Case{"plan locate views.db scan.txt --search vir --max-null-ratio nan", 2, "max_null_ratio"},
           Case{"plan locate views.db scan.txt --max-null-ratio 0.3", 2, "search"},
           Case{"plan follow views.db bare.json", 2, "bare.json has no odometry"},
           Case{"plan follow views.db still.log --start 2", 2,
                "--start 2: it has 2 scan(s), numbered 0 to 1"},
           Case{"plan follow views.db still.log --start -1", 2, "--start -1"},
           Case{"plan follow views.db still.log --laser-in-camera 1,0,0", 2, "name these with --images"},
           Case{"plan follow views.db still.log --images one.txt", 2, "one.txt: 1 lines for 2 scans"},
           Case{"plan follow views.db still.log --images two.txt", 14, "--images are localized in a map"},
           Case{"plan follow views.db still.log --images none.txt", 3, "none.txt"},
           Case{"plan follow views.db still.log --lost-ratio 0", 2, "lost_ratio"},
           Case{"plan follow views.db cut.log", 4, "cut.log: line 1: ODOM with 2 words"},
           Case{"plan path views.db --from 1,1", 2, "--to"},
           Case{"plan path views.db --from 1,1 --to 3.5,1", 6, "does not fit at (3.5, 1): a wall is 0.000 m"},
           Case{"plan path views.db --from 1,1 --to 3.5,1 --radius-m 0", 6, "lies on a wall"},
           Case{"plan path views.db --from nan,1 --to 1,1", 2, "no region"},
           Case{"plan path views.db --from 1,1 --to 5,1 --radius-m nan", 2, "radius_m"},
           Case{"plan path views.db --from 1,1 --to 5,1 --kind search", 2, "leave --to out"},
           Case{"plan path views.db --from 1,1 --to 5,1 --kind min-link --max-num-places 9", 2,
                "--kind search"},
           Case{"plan tell-apart views.db --a 1,2,0 --b 5,2,nan", 2, "--b 5,2,nan: the heading"},
           Case{"plan tell-apart views.db --a 1,2,361 --b 5,2,0", 2, "--a 1,2,361: the heading"},
           Case{"plan tell-apart views.db --a 1,2,0 --b 5,inf,0", 2, "no region"},
           Case{"plan tell-apart views.db --a 1,2,0 --b 5,2,0 --max-num-regions 0", 2, "max_num_regions"},
           Case{"plan tell-apart twins.db --a 1,1,0 --b 11,1,0 --max-num-regions 2", 1, "gave up"},
           Case{"plan next-look views.db scan.txt", 2, "scan.txt:1: no JSON object"},
           Case{"plan next-look views.db empty.txt", 2, "empty.txt: no line"},
           Case{"plan next-look views.db none.json", 3, "none.json"},
           Case{"plan next-look views.db bare.json", 2, "bare.json:2: no list of"},
           Case{"plan next-look views.db place.json --scan 4", 2, "place.json: no line of scan 4"},
           Case{"plan next-look views.db place.json --scan nan", 2, "--scan 'nan'"},
           Case{"plan next-look views.db lame.json", 2, "places[1] lacks one of the numbers"},
           Case{"plan next-look views.db wide.json", 2, "places[0]: its covariance has not 9 numbers"},
           Case{"plan next-look views.db place.json --camera", 14, "--camera needs a map"},
           Case{"plan next-look views.db place.json --laser-in-camera 1,0,0", 2, "say so with --camera"},
           Case{"plan next-look views.db place.json --reach-m nan", 2, "reach_m"},
           Case{"plan next-look views.db away.json", 6, "outside of the plan"},
           Case{"plan path views.db --from 1,1 --to 50,1", 2, "no region"},
       }) {
    const ProgramRun run = Run(arguments);
    EXPECT_EQ(run.exit_code, exit_code) << arguments << "\n" << run.err;
    EXPECT_THAT(run.err, HasSubstr(message)) << arguments;
    EXPECT_FALSE(fs::exists(Path("out.db"))) << arguments;
  }
}

// The building's plan, 1 m off.
std::string ShiftedPlan(const std::string& text) {
  json plan = json::parse(text);
  for (json& feature : plan["features"]) {
    json& geometry = feature["geometry"];
    const bool is_multi = geometry["type"] == "MultiPolygon";
    json polygons = is_multi ? geometry["coordinates"] : json::array({geometry["coordinates"]});
    for (json& polygon : polygons) {
      for (json& ring : polygon) {
        for (json& point : ring) point[0] = point[0].get<double>() + 1;
      }
    }
    geometry["coordinates"] = is_multi ? polygons : polygons[0];
  }
  return plan.dump();
}

TEST_F(FloorPlan, AMapHasItAndIsCheckedAgainstIt) {
  WriteTinyRecipe(Path("tiny.toml"));
  ReplaceInFile(Path("tiny.toml"), "[simulate]\n", "[simulate]\nfloor_plan = \"floor_plan.geojson\"\n");
  const ProgramRun views = Run("compile tiny.toml -o tiny.cairn --until decompose-views --progress lines");
  ASSERT_EQ(views.exit_code, 0) << views.err;
  EXPECT_THAT(views.err, Not(HasSubstr("features.db")));
  const ProgramRun compiled = Run("compile tiny.toml -o tiny.cairn --progress lines");
  ASSERT_EQ(compiled.exit_code, 0) << compiled.err;
  EXPECT_THAT(compiled.err, Not(HasSubstr("views.db")));
  EXPECT_THAT(Run("compile tiny.toml -o tiny.cairn").out, HasSubstr("up to date"));
  const json inspected = json::parse(Run("inspect tiny.cairn --json").out);
  EXPECT_GT(inspected["num_plan_walls"], 20);
  EXPECT_EQ(inspected["num_view_regions"], 0);  // derived where they are needed
  EXPECT_EQ(inspected["self_test"]["plan_fits"], 1);
  EXPECT_EQ(inspected["self_test"]["plan_images_free_ratio"], 1);
  EXPECT_THAT(inspected["stage_options"]["decompose_views"].get<std::string>(), HasSubstr("snap_m"));
  EXPECT_THAT(Run("check tiny.cairn").out, HasSubstr("floor plan             fits"));

  // A map and views.db say the same of a scan: the walls of a corner.
  ASSERT_TRUE(WriteFileAtomically(Path("scan.txt"), "1,-0.2,1,0.4\n0.6,1,-0.2,1\n").ok());
  const ProgramRun in_map = Run("plan locate tiny.cairn scan.txt");
  ASSERT_EQ(in_map.exit_code, 0) << in_map.err;
  json in_views = json::parse(Run("plan locate tiny.build/views.db scan.txt").out);
  ASSERT_FALSE(in_views["solutions"].empty());
  const auto without_regions = [&] {
    json copy = in_views;
    for (json& solution : copy["solutions"]) solution.erase("region");
    return copy;
  };
  EXPECT_EQ(json::parse(in_map.out), without_regions());
  EXPECT_EQ(json::parse(Run("plan locate tiny.cairn scan.txt --search vir").out),
            json::parse(Run("plan locate tiny.build/views.db scan.txt --search vir").out));
  EXPECT_EQ(Run("plan follow tiny.cairn scan.txt --search vir").out,
            Run("plan follow tiny.build/views.db scan.txt --search vir").out);
  EXPECT_EQ(
      json::parse(Run("plan locate tiny.cairn scan.txt --search standard").out)["solutions"].size(),
      json::parse(Run("plan locate tiny.build/views.db scan.txt --search standard").out)["solutions"].size());
  const std::string way = " --from 1,1 --to 2,1 --kind min-link --radius-m 0";
  const ProgramRun path = Run("plan path tiny.cairn" + way);
  EXPECT_EQ(path.exit_code, 0) << path.err;
  EXPECT_EQ(path.out, Run("plan path tiny.build/views.db" + way).out);

  // What a robot's camera sees counts as its scans do: here these say nothing.
  std::vector<std::string> names;
  for (const auto& image : fs::directory_iterator(Path("tiny.build/capture/images")))
    names.push_back(image.path().filename());
  ASSERT_FALSE(names.empty());
  const std::string name = *std::min_element(names.begin(), names.end());
  ASSERT_TRUE(WriteFileAtomically(Path("images.txt"), "tiny.build/capture/images/" + name + "\n\n").ok());
  ASSERT_TRUE(WriteFileAtomically(Path("blind.log"),
                                  "FLASER 2 0 0 1 1 0 2 1 0 1 h 1\n"
                                  "FLASER 2 0 0 2 1 0 2.5 1 0 2 h 2\n")
                  .ok());
  const ProgramRun followed =
      Run("plan follow tiny.cairn blind.log --images images.txt --laser-in-camera 0.2,0,90");
  ASSERT_EQ(followed.exit_code, 0) << followed.err;
  const size_t end = followed.out.find('\n');
  const json first = json::parse(followed.out.substr(0, end)),
             second = json::parse(followed.out.substr(end + 1));
  EXPECT_EQ(first["image"], "fix");
  EXPECT_THAT(first["reason"].get<std::string>(), HasSubstr("at least three"));
  EXPECT_GT(first["places"][0]["probability"].get<double>(), 0.9);
  EXPECT_FALSE(second.contains("image"));
  const auto at = [](const json& line, const char* axis) { return line["places"][0][axis].get<double>(); };
  EXPECT_NEAR(std::hypot(at(second, "x") - at(first, "x"), at(second, "y") - at(first, "y")), 0.5, 1e-6);

  // A plan that is off is noticed, and only what depends on it is done again.
  const std::string plan = *ReadFile(Path("tiny.build/capture/floor_plan.geojson"));
  ASSERT_TRUE(WriteFileAtomically(Path("tiny.build/capture/moved.geojson"), ShiftedPlan(plan)).ok());
  ReplaceInFile(Path("tiny.toml"), "floor_plan.geojson", "moved.geojson");
  const ProgramRun moved = Run("compile tiny.toml -o tiny.cairn --progress lines");
  EXPECT_EQ(moved.exit_code, 0) << moved.err;
  EXPECT_THAT(moved.err, HasSubstr("the floor plan does not fit"));
  EXPECT_THAT(moved.err, HasSubstr("views.db: options/floor_plan changed"));
  EXPECT_THAT(moved.err, Not(HasSubstr("regions.db")));
  const json off = json::parse(Run("inspect tiny.cairn --json").out)["self_test"];
  EXPECT_EQ(off["plan_fits"], 0);
  EXPECT_NEAR(off["plan_shift_m"].get<double>(), 1, 0.1);
  std::ofstream(Path("tiny.toml"), std::ios::app) << "[gate]\nplan_must_fit = true\n";
  const ProgramRun refused = Run("compile tiny.toml -o tiny.cairn");
  EXPECT_EQ(refused.exit_code, static_cast<int>(ErrorCode::kGate)) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("does not fit the landmarks"));

  // Of a ROS map, its image counts too.
  WriteRosMap(folder_.string(), "site");
  ASSERT_TRUE(WriteFileAtomically(
                  Path("ros.toml"),
                  "name = \"ros\"\n[[capture]]\npath = \"tiny.build/capture\"\nfloor_plan = \"site.yaml\"\n")
                  .ok());
  const std::string until = "compile ros.toml -o ros.cairn --until decompose-views --progress lines";
  const ProgramRun ros = Run(until);
  ASSERT_EQ(ros.exit_code, 0) << ros.err;
  EXPECT_THAT(Run(until).err, Not(HasSubstr("views.db")));
  std::string image = *ReadFile(Path("site.pgm"));
  std::fill(image.end() - 142 * 40, image.end() - 142 * 30, '\0');
  ASSERT_TRUE(WriteFileAtomically(Path("site.pgm"), image).ok());
  EXPECT_THAT(Run(until).err, HasSubstr("views.db"));

  // Without one, the map is as small as before.
  ReplaceInFile(Path("tiny.toml"), "floor_plan = \"moved.geojson\"\n", "");
  ASSERT_EQ(Run("compile tiny.toml -o tiny.cairn").exit_code, 0);
  EXPECT_EQ(json::parse(Run("inspect tiny.cairn --json").out)["num_view_regions"], 0);
  EXPECT_EQ(Run("plan locate tiny.cairn scan.txt").exit_code, static_cast<int>(ErrorCode::kNotFound));
  const ProgramRun without = Run("compile tiny.toml -o tiny.cairn --until decompose_views");
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.err, HasSubstr("floor_plan = "));
}

}  // namespace
}  // namespace cairn
