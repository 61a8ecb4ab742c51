#include "stages/decompose_views/formats/dxf_plan.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/text.h"
#include "core/geometry/pose.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace cairn::decompose_views {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using Vec2 = Eigen::Vector2d;

// Groups as text, from "0 LINE 8 WALL 10 0.0": a code and a value after the other.
std::string Groups(const std::string& words) {
  std::string text;
  for (const std::string& word : SplitWords(words)) text += word + "\n";
  return text;
}

std::string Line(double x0, double y0, double x1, double y1, const std::string& layer = "WALL") {
  return fmt::format(" 0 LINE 8 {} 10 {} 20 {} 30 0.0 11 {} 21 {} 31 0.0", layer, x0, y0, x1, y1);
}

std::string Drawing(const std::string& entities, const std::string& blocks = "",
                    const std::string& header = "", const std::string& tables = "") {
  return Groups("0 SECTION 2 HEADER 9 $ACADVER 1 AC1015 " + header + " 0 ENDSEC 0 SECTION 2 TABLES " +
                tables + " 0 ENDSEC 0 SECTION 2 BLOCKS " + blocks + " 0 ENDSEC 0 SECTION 2 ENTITIES " +
                entities + " 0 ENDSEC 0 SECTION 2 OBJECTS 0 DICTIONARY 5 C 0 ENDSEC 0 EOF");
}

InputPlan Read(const std::string& text, const ReadPlanOptions& options = {.units = "m"}) {
  auto plan = ParsePlan(text, "plan.dxf", options);
  EXPECT_TRUE(plan.ok()) << plan.error().message;
  return plan.ok() ? *plan : InputPlan{};
}

Error ErrorOfDrawing(const std::string& text, const ReadPlanOptions& options = {}) {
  const auto plan = ParsePlan(text, "plan.dxf", options);
  EXPECT_FALSE(plan.ok());
  if (plan.ok()) return {};
  EXPECT_THAT(plan.error().message, HasSubstr("plan.dxf: "));
  return plan.error();
}

// "x0,y0,x1,y1" of each wall, to a micrometre.
std::vector<std::string> Texts(const InputPlan& plan) {
  std::vector<std::string> texts;
  const auto rounded = [](double metres) { return std::round(1e6 * metres) / 1e6 + 0.0; };
  for (const InputSegment& wall : plan.segments) {
    texts.push_back(fmt::format("{},{},{},{}", rounded(wall.start.x()), rounded(wall.start.y()),
                                rounded(wall.end.x()), rounded(wall.end.y())));
  }
  return texts;
}

TEST(DxfPlan, ReadsLinesWithTheirLineInTheFile) {
  const InputPlan plan = Read(Drawing(Line(0, 1.5, 4, 1.5) + Line(4, 1.5, 4, -2)));
  EXPECT_FALSE(plan.closed());
  EXPECT_THAT(Texts(plan), ElementsAre("0,1.5,4,1.5", "4,1.5,4,-2"));
  const std::string text = Drawing(Line(0, 1.5, 4, 1.5));
  const std::vector<std::string_view> lines = SplitLines(text);
  EXPECT_EQ(lines.at(plan.segments[0].line - 1), "LINE");
  EXPECT_EQ(plan.segments[1].line, plan.segments[0].line + 16);
}

TEST(DxfPlan, BlanksCarriageReturnsAndCommentsDoNotMatter) {
  const std::string plain = "999\nmade by hand\n" + Drawing(Line(0, 1.5, 4, 1.5));
  std::string text;
  for (const std::string_view line : SplitLines(plain)) text += "   " + std::string(line) + " \r\n";
  EXPECT_THAT(Texts(Read(text)), ElementsAre("0,1.5,4,1.5"));
}

TEST(DxfPlan, PolylinesOfBothKindsAreReadOpenAndClosed) {
  const std::string light = " 0 LWPOLYLINE 8 A 90 3 70 {} 43 0.0 10 0 20 0 10 3 20 0 10 3 20 2";
  EXPECT_THAT(Texts(Read(Drawing(fmt::format(fmt::runtime(light), 0)))), ElementsAre("0,0,3,0", "3,0,3,2"));
  EXPECT_THAT(Texts(Read(Drawing(fmt::format(fmt::runtime(light), 1)))),
              ElementsAre("0,0,3,0", "3,0,3,2", "3,2,0,0"));
  const std::string vertices =
      " 0 VERTEX 8 A 10 0 20 0 0 VERTEX 8 A 10 3 20 0 0 VERTEX 8 A 10 3 20 2 0 SEQEND 8 A";
  EXPECT_THAT(Texts(Read(Drawing(" 0 POLYLINE 8 A 66 1 70 0 10 0 20 0" + vertices))),
              ElementsAre("0,0,3,0", "3,0,3,2"));
  EXPECT_THAT(Texts(Read(Drawing(" 0 POLYLINE 8 A 66 1 70 1 10 0 20 0" + vertices))),
              ElementsAre("0,0,3,0", "3,0,3,2", "3,2,0,0"));
}

TEST(DxfPlan, ACircleIsAPolygonWithinTheTolerance) {
  const InputPlan plan = Read(Drawing(" 0 CIRCLE 8 A 10 5 20 1 40 1"));
  // 2 pi / (2 acos(1 - 0.01)) = 22.2
  ASSERT_EQ(plan.segments.size(), 23u);
  for (const InputSegment& chord : plan.segments) {
    EXPECT_NEAR((chord.start - Vec2(5, 1)).norm(), 1, 1e-12);
    EXPECT_GE((0.5 * (chord.start + chord.end) - Vec2(5, 1)).norm(), 0.99);
  }
  EXPECT_EQ(plan.segments.front().start, plan.segments.back().end);
  EXPECT_GT(Read(Drawing(" 0 CIRCLE 8 A 10 5 20 1 40 1"), {.units = "m", .curve_tolerance_m = 0.001})
                .segments.size(),
            60u);
  // In millimetres it is the same circle.
  EXPECT_EQ(Read(Drawing(" 0 CIRCLE 8 A 10 5000 20 1000 40 1000"), {.units = "mm"}).segments.size(), 23u);
}

TEST(DxfPlan, AnArcGoesCounterClockwise) {
  // From 270 over 0 to 90 degrees: the right half.
  const InputPlan plan = Read(Drawing(" 0 ARC 8 A 10 0 20 0 40 2 50 270 51 90"));
  ASSERT_GT(plan.segments.size(), 4u);
  EXPECT_LT((plan.segments.front().start - Vec2(0, -2)).norm(), 1e-9);
  EXPECT_LT((plan.segments.back().end - Vec2(0, 2)).norm(), 1e-9);
  for (const InputSegment& chord : plan.segments) EXPECT_GT(chord.start.x() + chord.end.x(), 0);
}

TEST(DxfPlan, ABulgeIsAnArcToTheRightOfItsChord) {
  // A bulge of 1 is a half circle, counter-clockwise: from (0, 0) by (1, -1) to (2, 0).
  for (const char* entity :
       {" 0 LWPOLYLINE 8 A 90 2 70 0 10 0 20 0 42 1 10 2 20 0",
        " 0 POLYLINE 8 A 66 1 0 VERTEX 8 A 10 0 20 0 42 1 0 VERTEX 8 A 10 2 20 0 0 SEQEND 8 A"}) {
    const InputPlan plan = Read(Drawing(entity));
    ASSERT_GT(plan.segments.size(), 4u);
    EXPECT_EQ(plan.segments.front().start, Vec2(0, 0));
    EXPECT_EQ(plan.segments.back().end, Vec2(2, 0));
    for (const InputSegment& chord : plan.segments) {
      EXPECT_NEAR((chord.end - Vec2(1, 0)).norm(), 1, 1e-9);
      EXPECT_LT(chord.start.y() + chord.end.y(), 0);
    }
  }
}

//   block ARM, base (1, 0): a line (1, 0) - (2, 0)
const char kArm[] = " 0 BLOCK 8 0 2 ARM 70 0 10 1 20 0 0 LINE 8 0 10 1 20 0 11 2 21 0 0 ENDBLK 8 0";

TEST(DxfPlan, ABlockIsPlacedScaledAndTurned) {
  EXPECT_THAT(Texts(Read(Drawing(" 0 INSERT 8 A 2 ARM 10 10 20 5", kArm))), ElementsAre("10,5,11,5"));
  EXPECT_THAT(Texts(Read(Drawing(" 0 INSERT 8 A 2 arm 10 10 20 5 41 2 42 2 50 90", kArm))),
              ElementsAre("10,5,10,7"));
  // Mirrored by its scale, and by a normal that points down, which turns x.
  EXPECT_THAT(Texts(Read(Drawing(" 0 INSERT 8 A 2 ARM 10 10 20 5 41 -1", kArm))), ElementsAre("10,5,9,5"));
  EXPECT_THAT(Texts(Read(Drawing(" 0 INSERT 8 A 2 ARM 10 10 20 5 210 0 220 0 230 -1", kArm))),
              ElementsAre("-10,5,-11,5"));
  // Two columns and two rows, along the turned axes.
  EXPECT_THAT(Texts(Read(Drawing(" 0 INSERT 8 A 2 ARM 10 0 20 0 50 90 70 2 71 2 44 10 45 3", kArm))),
              ElementsAre("0,0,0,1", "0,10,0,11", "-3,0,-3,1", "-3,10,-3,11"));
}

TEST(DxfPlan, BlocksStandInBlocks) {
  const std::string two =
      std::string(kArm) +
      " 0 BLOCK 8 0 2 TWO 70 0 10 0 20 0 0 INSERT 8 0 2 ARM 10 0 20 0 0 INSERT 8 0 2 ARM 10 0 20 0 "
      "50 180 0 ENDBLK 8 0";
  EXPECT_THAT(Texts(Read(Drawing(" 0 INSERT 8 A 2 TWO 10 0 20 2 41 3 42 3", two))),
              ElementsAre("0,2,3,2", "0,2,-3,2"));
}

TEST(DxfPlan, LayersAreChosenByName) {
  const std::string entities = Line(0, 0, 1, 0, "A-WALL") + Line(0, 1, 1, 1, "A-WALL-FULL") +
                               Line(0, 2, 1, 2, "Furniture") + " 0 INSERT 8 a-wall 2 ARM 10 0 20 3";
  const std::string text = Drawing(entities, kArm);
  const auto count = [&](const std::string& layers) {
    return Read(text, {.units = "m", .layers = layers}).segments.size();
  };
  EXPECT_EQ(count(""), 4u);
  EXPECT_EQ(count("A-WALL"), 2u);  // with the block's line of layer 0
  EXPECT_EQ(count("a-wall*"), 3u);
  EXPECT_EQ(count("A-WALL, furniture"), 3u);
  const Error none = ErrorOfDrawing(text, {.units = "m", .layers = "WALLS"});
  EXPECT_EQ(none.code, ErrorCode::kNoData);
  EXPECT_THAT(none.message, HasSubstr("A-WALL 2, A-WALL-FULL 1, Furniture 1"));
  EXPECT_THAT(Read(text).notes,
              ElementsAre(HasSubstr("walls by layer: A-WALL 2, A-WALL-FULL 1, Furniture 1")));
}

TEST(DxfPlan, LayersThatAreOffOrFrozenAreLeftOutUnlessNamed) {
  const std::string tables =
      "0 TABLE 2 LAYER 70 3 0 LAYER 2 ON 70 0 62 7 0 LAYER 2 OFF 70 0 62 -7 0 LAYER 2 COLD 70 1 62 7 0 "
      "ENDTAB";
  const std::string text =
      Drawing(Line(0, 0, 1, 0, "ON") + Line(0, 1, 1, 1, "OFF") + Line(0, 2, 1, 2, "COLD"), "", "", tables);
  EXPECT_THAT(Texts(Read(text)), ElementsAre("0,0,1,0"));
  EXPECT_THAT(Read(text).notes, testing::Contains(HasSubstr("off or frozen: COLD 1, OFF 1")));
  EXPECT_THAT(Texts(Read(text, {.units = "m", .layers = "OFF"})), ElementsAre("0,1,1,1"));
}

TEST(DxfPlan, WhatIsNotInModelSpaceOrNotReadIsLeftOutAndSaid) {
  const InputPlan plan =
      Read(Drawing(Line(0, 0, 1, 0) +
                   " 0 LINE 8 A 67 1 10 0 20 5 11 1 21 5 0 LINE 8 A 60 1 10 0 20 6 11 1 21 6 "
                   "0 SPLINE 8 A 0 TEXT 8 A 1 hello 0 TEXT 8 A 1 you 0 POLYLINE 8 A 70 64 0 VERTEX "
                   "8 A 10 0 20 0 0 SEQEND 0 CIRCLE 8 A 10 0 20 0 40 1 210 1 220 0 230 0"));
  EXPECT_THAT(Texts(plan), ElementsAre("0,0,1,0"));
  EXPECT_THAT(plan.notes, testing::Contains(
                              HasSubstr("1 CIRCLE that lies aslant, 1 POLYLINE of faces, 1 SPLINE, 2 TEXT")));
  EXPECT_EQ(ErrorOfDrawing(Drawing(" 0 TEXT 8 A 1 hello")).code, ErrorCode::kNoData);
}

TEST(DxfPlan, ItsUnitIsThatOfTheFile) {
  const auto length = [](const std::string& header, double number) {
    const InputPlan plan = Read(Drawing(Line(0, 0, number, 0) + Line(0, 0, 0, number), "", header), {});
    return plan.segments.empty() ? 0 : plan.segments[0].end.x();
  };
  EXPECT_DOUBLE_EQ(length("9 $INSUNITS 70 4", 5000), 5);
  EXPECT_DOUBLE_EQ(length("9 $INSUNITS 70 5", 500), 5);
  EXPECT_DOUBLE_EQ(length("9 $INSUNITS 70 6", 5), 5);
  EXPECT_DOUBLE_EQ(length("9 $INSUNITS 70 1", 100), 2.54);
  EXPECT_DOUBLE_EQ(length("9 $INSUNITS 70 2", 10), 3.048);
  EXPECT_DOUBLE_EQ(length("9 $INSUNITS 70 0", 5), 5);
  EXPECT_DOUBLE_EQ(length("", 5), 5);
  // Not stated, and a building in metres cannot be so large.
  const Error large = ErrorOfDrawing(Drawing(Line(0, 0, 5000, 0) + Line(0, 0, 0, 4000)));
  EXPECT_EQ(large.code, ErrorCode::kUnsupported);
  EXPECT_THAT(large.message, HasSubstr("mm: 5 m x 4 m"));
  // It is said to be in millimetres, and is in metres.
  const Error small = ErrorOfDrawing(Drawing(Line(0, 0, 50, 0) + Line(0, 0, 0, 4), "", "9 $INSUNITS 70 4"));
  EXPECT_THAT(small.message, HasSubstr("$INSUNITS = 4"));
  EXPECT_THAT(small.message, HasSubstr("m: 50 m x 4 m"));
  const Error miles = ErrorOfDrawing(Drawing(Line(0, 0, 5, 0), "", "9 $INSUNITS 70 3"));
  EXPECT_EQ(miles.code, ErrorCode::kUnsupported);
  EXPECT_THAT(miles.message, HasSubstr("$INSUNITS is 3"));
}

TEST(DxfPlan, BadFilesAreRefusedWithTheLine) {
  const std::string line = Line(0, 0, 1, 0);
  const auto message = [](const std::string& entities, const std::string& blocks = "") {
    const Error error = ErrorOfDrawing(Drawing(entities, blocks));
    EXPECT_EQ(error.code, ErrorCode::kCorrupt) << entities;
    EXPECT_THAT(error.message, HasSubstr("line ")) << entities;
    return error.message;
  };
  for (const char* number : {"nan", "inf", "1e400", "one", "1,5", "0x10"}) {
    EXPECT_THAT(message(fmt::format(" 0 LINE 8 A 10 {} 20 0 11 1 21 0", number)),
                HasSubstr(fmt::format("\"{}\" is not a finite number (group 10)", number)));
  }
  EXPECT_THAT(message(" 0 LINE 8 A 10 1e12 20 0 11 1 21 0"), HasSubstr("beyond"));
  EXPECT_THAT(message(" 0 LINE 8 A 10 0 20 0 11 1 x 0"), HasSubstr("\"x\" is no group code"));
  EXPECT_THAT(message(" 0 CIRCLE 8 A 10 0 20 0 40 0"), HasSubstr("radius 0"));
  EXPECT_THAT(message(" 0 ARC 8 A 10 0 20 0 40 -1"), HasSubstr("radius -1"));
  EXPECT_THAT(message(" 0 INSERT 8 A 2 GONE 10 0 20 0"), HasSubstr("\"GONE\", which is not there"));
  EXPECT_THAT(message(" 0 POLYLINE 8 A 66 1" + line), HasSubstr("VERTEX or SEQEND"));
  const std::string itself =
      " 0 BLOCK 2 A 10 0 20 0 0 INSERT 2 B 10 0 20 0 0 ENDBLK 0 BLOCK 2 B 10 0 20 0 0 INSERT 2 A "
      "10 1 20 0 0 ENDBLK";
  EXPECT_THAT(message(" 0 INSERT 8 A 2 A 10 0 20 0", itself), HasSubstr("\"A\" is inserted in itself"));
  // Cut anywhere, it is noticed.
  const std::string whole = Drawing(line + line, kArm);
  for (size_t size = 20; size + 2 < whole.size(); size += 7)
    EXPECT_THAT(ErrorOfDrawing(whole.substr(0, size), {.units = "m"}).message, HasSubstr("line ")) << size;
}

TEST(DxfPlan, BlocksThatMultiplyAreRefusedSoon) {
  // Each has the one before twice: 2^30 of the first.
  std::string blocks = kArm, empty = " 0 BLOCK 2 E0 10 0 20 0 0 ENDBLK";
  std::string before = "ARM";
  for (int i = 1; i <= 30; ++i) {
    blocks += fmt::format(" 0 BLOCK 2 B{} 10 0 20 0 0 INSERT 2 {} 10 0 20 0 0 INSERT 2 {} 10 1 20 0 0 ENDBLK",
                          i, before, before);
    empty +=
        fmt::format(" 0 BLOCK 2 E{} 10 0 20 0 0 INSERT 2 E{} 10 0 20 0 0 INSERT 2 E{} 10 1 20 0 0 ENDBLK", i,
                    i - 1, i - 1);
    before = fmt::format("B{}", i);
  }
  const Error walls = ErrorOfDrawing(Drawing(" 0 INSERT 8 A 2 B30 10 0 20 0", blocks));
  EXPECT_EQ(walls.code, ErrorCode::kUnsupported);
  EXPECT_THAT(walls.message, HasSubstr("more than 200000 walls"));
  const Error entities = ErrorOfDrawing(Drawing(" 0 INSERT 8 A 2 E30 10 0 20 0", empty));
  EXPECT_EQ(entities.code, ErrorCode::kUnsupported);
  EXPECT_THAT(entities.message, HasSubstr("more than 2000000 entities"));
  EXPECT_EQ(ErrorOfDrawing(Drawing(" 0 INSERT 8 A 2 E0 10 0 20 0 70 2000000000 71 2000000000", empty)).code,
            ErrorCode::kUnsupported);
  EXPECT_EQ(
      ErrorOfDrawing(Drawing(" 0 CIRCLE 8 A 10 0 20 0 40 1e8"), {.units = "m", .curve_tolerance_m = 1e-4})
          .code,
      ErrorCode::kUnsupported);
  std::string deep = kArm;
  for (int i = 1; i <= 40; ++i)
    deep += fmt::format(" 0 BLOCK 2 D{} 10 0 20 0 0 INSERT 2 {} 10 0 20 0 0 ENDBLK", i,
                        i == 1 ? std::string("ARM") : fmt::format("D{}", i - 1));
  EXPECT_THAT(ErrorOfDrawing(Drawing(" 0 INSERT 8 A 2 D40 10 0 20 0", deep)).message,
              HasSubstr("more than 32 deep"));
}

TEST(DxfPlan, OtherKindsOfDrawingAreNamed) {
  EXPECT_THAT(ErrorOfDrawing(std::string("AutoCAD Binary DXF\r\n\x1a\0", 22)).message,
              HasSubstr("binary DXF"));
  EXPECT_THAT(ErrorOfDrawing(std::string("AC1032\0\0", 8)).message, HasSubstr("DWG"));
  EXPECT_THAT(ErrorOfDrawing("%PDF-1.7\n").message, HasSubstr("PDF"));
  EXPECT_THAT(ErrorOfDrawing("ISO-10303-21;\n").message, HasSubstr("IFC"));
}

}  // namespace
}  // namespace cairn::decompose_views
