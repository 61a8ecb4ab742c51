// The parts of the search for interpretations, each against trying all.
#include <algorithm>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/laser/candidate_regions.h"
#include "runtime/laser/pairing.h"
#include "runtime/laser/place_support.h"
#include "runtime/laser/view_order.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/scans/simulated_scan.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
using testing::ElementsAre;

FloorPlan PlanOfWalls(std::vector<PlanWall> walls) {
  FloorPlan plan;
  plan.walls = std::move(walls);
  return plan;
}

// A wall of 4 m, of which 2 m are seen from 2 m off: the robot is on the 2 m above the wall's first half.
TEST(MakePairing, LeavesTheRobotOnALine) {
  const FloorPlan plan = PlanOfWalls({{{0, 0}, {4, 0}}});
  const Pairing upright = MakePairing(plan, {{-1, -2}, {1, -2}}, 0, 0.1);
  EXPECT_TRUE(upright.possible);
  EXPECT_NEAR(upright.heading, 0, 1e-12);
  EXPECT_LT((upright.from - Vec2(1, 2)).norm(), 1e-12);
  EXPECT_LT((upright.to - Vec2(3, 2)).norm(), 1e-12);
  // Turned by a right angle it sees the wall on its right.
  const Pairing turned = MakePairing(plan, {{-2, 1}, {-2, -1}}, 0, 0.1);
  EXPECT_NEAR(turned.heading, std::numbers::pi / 2, 1e-12);
  EXPECT_LT((turned.from - Vec2(1, 2)).norm(), 1e-12);
  EXPECT_LT((turned.to - Vec2(3, 2)).norm(), 1e-12);
  // From the other side.
  EXPECT_LT((MakePairing(plan, {{-1, -2}, {1, -2}}, 1, 0.1).from - Vec2(3, -2)).norm(), 1e-12);
  // What is longer than the wall lies about its middle, if it is not much longer.
  const Pairing longer = MakePairing(plan, {{-1.04, -2}, {3.04, -2}}, 0, 0.1);
  EXPECT_TRUE(longer.possible);
  EXPECT_LT((longer.from - Vec2(1, 2)).norm(), 1e-12);
  EXPECT_EQ(longer.from, longer.to);
  EXPECT_FALSE(MakePairing(plan, {{-1.04, -2}, {3.04, -2}}, 0, 0.07).possible);
  EXPECT_TRUE(MakePairing(plan, {{-1, -2}, {3, -2}}, 0, 0).possible);
}

Pairing RandomLine(Random* random) {
  Pairing pairing;
  for (Vec2* end : {&pairing.from, &pairing.to}) {
    const double x = random->Uniform(0, 4), y = random->Uniform(0, 4);
    *end = {x, y};
  }
  // Some along the axes, some that are points.
  const double kind = random->Uniform();
  if (kind < 0.2) pairing.to.y() = pairing.from.y();
  if (kind > 0.1 && kind < 0.3) pairing.to.x() = pairing.from.x();
  return pairing;
}

TEST(LineToLine, IsTheLeastDistanceOfTheirPoints) {
  Random random(1);
  int num_crossing = 0;
  for (int i = 0; i < 500; ++i) {
    const Pairing a = RandomLine(&random), b = RandomLine(&random);
    double least = 100;
    for (int k = 0; k <= 200; ++k)
      least = std::min(least, PointToSegment(a.from + k / 200.0 * (a.to - a.from), b.from, b.to));
    const double found = LineToLine(a, b);
    EXPECT_LE(found, least + 1e-9);
    EXPECT_GE(found, least - 0.02);
    EXPECT_NEAR(LineToLine(b, a), found, 1e-12);
    num_crossing += found == 0 ? 1 : 0;
  }
  EXPECT_GT(num_crossing, 50);
  EXPECT_LT(num_crossing, 300);
  EXPECT_EQ(LineToLine({true, 0, {0, 0}, {1, 0}}, {true, 0, {0.5, -0.5}, {0.5, 0.5}}), 0);
}

TEST(Touches, IsWhereAPointOfTheLineIsInTheWidenedBox) {
  Random random(2);
  int num_touching = 0;
  for (int i = 0; i < 500; ++i) {
    const Pairing line = RandomLine(&random);
    const auto x = static_cast<float>(random.Uniform(0, 3)), y = static_cast<float>(random.Uniform(0, 3));
    const Eigen::AlignedBox2f box(Eigen::Vector2f(x, y), Eigen::Vector2f(x + 0.7F, y + 0.3F));
    const double reach = random.Uniform(0, 0.5);
    double least = 100;  // of what a point lies out of the box
    for (int k = 0; k <= 400; ++k) {
      const Vec2 point = line.from + k / 400.0 * (line.to - line.from);
      const Vec2 low = box.min().cast<double>(), high = box.max().cast<double>();
      least = std::min(least, (low - point).cwiseMax(point - high).maxCoeff());
    }
    if (std::abs(least - reach) < 0.01) continue;
    EXPECT_EQ(Touches(box, line, reach), least < reach) << i;
    num_touching += least < reach ? 1 : 0;
  }
  EXPECT_GT(num_touching, 100);
  EXPECT_LT(num_touching, 400);
}

TEST(MaxNumNulls, IsTheShareRoundedDown) {
  EXPECT_EQ(MaxNumNulls(7, {.max_null_ratio = 0.3}), 2);
  EXPECT_EQ(MaxNumNulls(7, {.max_null_ratio = 0.14}), 0);
  EXPECT_EQ(MaxNumNulls(8, {.max_null_ratio = 0.25}), 2);
}

// A segment whose middle is 3 m along it and 4 m beside the robot.
TEST(PairingTable, TolerancesAreThoseOfTheFits) {
  const FloorPlan plan = PlanOfWalls({{{0, 0}, {40, 0}}});
  const double wall_rad = 0.0075;
  const InterpretationTreeOptions options{.angle_tolerance_deg = 1,
                                          .position_tolerance_m = 0.15,
                                          .num_sigmas = 2,
                                          .sigma_wall_m = 0.12,
                                          .sigma_wall_deg = DegFromRad(wall_rad)};
  const std::vector<ScanSegment> segments = {{{4, -1}, {4, 7}, 0.01, 0.04, 10},
                                             {{4, -3}, {4, -1}, 0.0, 0.02, 10}};
  const PairingTable table(plan, segments, options);
  EXPECT_NEAR(table.AngleTolerance(0), 0.02, 1e-12);
  // 0.04 m, and 0.01 rad on 3 m.
  EXPECT_NEAR(table.PlaceTolerance(0), 2 * 0.05, 1e-12);
  EXPECT_NEAR(table.PlaceTolerance(1), 2 * 0.02, 1e-12);
  EXPECT_NEAR(table.AngleTolerance(0, 1), 0.02 + RadFromDeg(1), 1e-12);
  EXPECT_NEAR(table.AngleTolerance(0, 0), std::hypot(0.02, 0.02) + RadFromDeg(1), 1e-12);
  const double loose0 = 2 * std::hypot(0.05, 0.12, 3 * wall_rad),
               loose1 = 2 * std::hypot(0.02, 0.12, 2 * wall_rad);
  EXPECT_NEAR(table.LoosePlaceTolerance(0, 1), loose0 + loose1 + 0.3, 1e-12);
  EXPECT_NEAR(table.EndTolerance(0), 2 * 4 * 0.0125, 1e-12);
  EXPECT_NEAR(table.EndTolerance(1), 2 * 4 * wall_rad, 1e-12);
  EXPECT_EQ(table.Along(0), Vec2(1, 0));
  EXPECT_EQ(table.Along(1), Vec2(-1, 0));
  EXPECT_TRUE(table.Of(0, 1).possible);
}

// A corner, all of which is seen: the pairings agree where they give the robot one place and heading.
TEST(PairingTable, PairingsAgreeWithinWhatTheirFitsAllow) {
  const FloorPlan plan = PlanOfWalls({{{0, 0}, {4, 0}}, {{4, 0}, {4, 3}}});
  const auto agree = [&](double off_m, double turn_deg, double sigma_m) {
    const Eigen::Rotation2Dd turn(RadFromDeg(turn_deg));
    const std::vector<ScanSegment> segments = {
        {{-2, -1}, {2, -1}, 0, 0.75 * sigma_m, 10},
        {turn * Vec2(2 + off_m, -1), turn * Vec2(2 + off_m, 2), 0, sigma_m, 10}};
    const InterpretationTreeOptions options{
        .angle_tolerance_deg = 2, .position_tolerance_m = 0.1, .num_sigmas = 2};
    return PairingTable(plan, segments, options).Agree(0, 0, 1, 2);
  };
  EXPECT_TRUE(agree(0, 0, 0));
  EXPECT_TRUE(agree(0.099, 0, 0));
  EXPECT_FALSE(agree(0.101, 0, 0));
  EXPECT_TRUE(agree(-0.099, 1.99, 0));
  EXPECT_FALSE(agree(-0.101, 0, 0));
  EXPECT_FALSE(agree(0, 2.01, 0));
  EXPECT_FALSE(agree(0, -2.01, 0));
  // Twice 3 and 4 cm at right angles are 10 cm more.
  EXPECT_TRUE(agree(0.199, 0, 0.04));
  EXPECT_FALSE(agree(0.201, 0, 0.04));
}

TEST(PairingTable, LabelsWithAHeadingAreThoseWhoseDirectionsAre) {
  Random random(3);
  std::vector<PlanWall> walls;
  for (int i = 0; i < 40; ++i) {
    const Vec2 along = random.Uniform(0.5, 3) * (Eigen::Rotation2Dd(random.Uniform(-3.2, 3.2)) * Vec2(1, 0));
    walls.push_back({{0, 0}, along});
  }
  walls.push_back({{0, 0}, {-2, 0}});  // at the end of angles
  const FloorPlan plan = PlanOfWalls(walls);
  const std::vector<ScanSegment> segments = {{{1, 1}, {0.2, 1.9}, 0, 0, 10}, {{1, -1}, {1.4, 0.2}, 0, 0, 10}};
  const PairingTable table(plan, segments, {});
  for (int i = 0; i < 300; ++i) {
    const int segment = i % 2;
    const double heading = random.Uniform(-3.2, 3.2), tolerance = i < 280 ? random.Uniform(0, 3.1) : 3.2;
    std::vector<LabelIdx> found = {77}, expected = {77};
    table.LabelsWithHeading(segment, heading, tolerance, &found);
    for (LabelIdx label = 0; label < plan.num_labels(); ++label) {
      const Vec2& along = table.Along(label);
      const double off = WrapAngle(std::atan2(along.y(), along.x()) - segments[segment].Angle() - heading);
      if (std::abs(off) <= tolerance && table.Of(segment, label).possible) expected.push_back(label);
    }
    EXPECT_THAT(found, testing::UnorderedElementsAreArray(expected)) << i;
  }
}

// Along walls of two directions and a slanted one: where a place of the line is near enough to the other
// pairing's line, at its ends, beside it and along it.
TEST(StretchesAlong, IsWhereTheLinesComeCloseEnough) {
  Random random(6);
  int num_inside = 0, num_outside = 0;
  for (int i = 0; i < 40; ++i) {
    std::vector<PlanWall> walls;
    for (const Vec2& along : {Vec2(4, 0), Vec2(0, 3), Vec2(3, 0), Vec2(2, 2), Vec2(5, 0)}) {
      const double x = random.Uniform(0, 5), y = random.Uniform(0, 5);
      walls.push_back({{x, y}, Vec2(x, y) + along});
    }
    const FloorPlan plan = PlanOfWalls(walls);
    const std::vector<ScanSegment> segments = {{{-1, -1}, {1, -1}, 0.01, 0.1, 10},
                                               {{-1, 0.4}, {0.5, 0.4}, 0.01, 0.05, 10},
                                               {{2, -1}, {2, 1}, 0.01, 0.05, 10},
                                               {{2, 1}, {1.4, 1.6}, 0.02, 0.05, 10}};
    const PairingTable table(plan, segments, {});
    for (LabelIdx label = 0; label < plan.num_labels(); ++label) {
      if (!table.Of(0, label).possible) continue;
      const Pairing& first = table.Of(0, label);
      const double length = (first.to - first.from).norm();
      const auto stretches = StretchesAlong(table, 0, label, {1, 2, 3}, [](LabelIdx) { return true; });
      for (int other = 1; other < 4; ++other) {
        const double reach = table.LoosePlaceTolerance(0, other), beyond = table.EndTolerance(0) + reach;
        for (LabelIdx further = 0; further < plan.num_labels(); ++further) {
          const Pairing& second = table.Of(other, further);
          const bool may_be = second.possible && std::abs(WrapAngle(second.heading - first.heading)) <=
                                                     table.AngleTolerance(0, other);
          const Vec2 more = table.EndTolerance(other) * table.Along(further);
          for (double at = -2; at < 6; at += 0.1) {
            const double off =
                PointToSegment(first.from + at * table.Along(label), second.from - more, second.to + more) -
                reach;
            if (std::abs(off) < 1e-6) continue;
            const bool expected = may_be && off < 0 && at >= -beyond && at <= length + beyond;
            const bool found = std::any_of(stretches.begin(), stretches.end(), [&](const PlaceStretch& s) {
              return s.segment == other && s.label == further && s.low <= at && at <= s.high;
            });
            EXPECT_EQ(found, expected) << i << " " << other << " " << at;
            num_inside += expected ? 1 : 0;
            num_outside += may_be && !expected ? 1 : 0;
          }
        }
      }
    }
  }
  EXPECT_GT(num_inside, 500);
  EXPECT_GT(num_outside, 500);
}

// Where each number of segments has a stretch over a place, tried at places between all ends.
TEST(PlacesWithSupport, AreThoseOverWhichSoManySegmentsHaveAStretch) {
  Random random(4);
  for (int i = 0; i < 200; ++i) {
    std::vector<PlaceStretch> stretches;
    for (int segment = 0; segment < 5; ++segment) {
      for (int k = 0; k < i % 4; ++k) {
        const auto low = static_cast<double>(random.UniformInt(0, 12)),
                   length = static_cast<double>(random.UniformInt(0, 4));
        stretches.push_back({low, low + length, segment, k});
      }
    }
    const int least = 1 + i % 3;
    const std::vector<SupportedPlaces> places = PlacesWithSupport(stretches, least);
    for (double place = -0.75; place < 17; place += 0.25) {
      std::set<int> over;
      for (const PlaceStretch& stretch : stretches)
        if (stretch.low <= place && place <= stretch.high) over.insert(stretch.segment);
      int most = 0;
      for (const SupportedPlaces& each : places)
        if (each.low <= place && place <= each.high) most = std::max(most, each.num_segments);
      const int expected = static_cast<int>(over.size());
      EXPECT_EQ(most, expected >= least ? expected : 0) << place;
    }
    for (size_t k = 1; k < places.size(); ++k) EXPECT_LE(places[k - 1].high, places[k].low);
  }
}

TEST(BestSupported, TouchesNoneWithMoreSupport) {
  const auto nums = [](const std::vector<SupportedPlaces>& places) {
    std::vector<int> found;
    for (const SupportedPlaces& each : BestSupported(places)) found.push_back(each.num_segments);
    return found;
  };
  EXPECT_THAT(nums({{0, 1, 2}, {1, 2, 3}, {2, 3, 2}}), ElementsAre(3));
  EXPECT_THAT(nums({{0, 1, 2}, {1.5, 2, 3}, {2.5, 3, 2}}), ElementsAre(2, 3, 2)) << "they do not touch";
  EXPECT_THAT(nums({{0, 1, 3}, {1, 2, 2}, {2, 3, 3}}), ElementsAre(3, 3));
  EXPECT_THAT(nums({{0, 1, 2}, {1, 2, 2}}), ElementsAre(2, 2));
  EXPECT_THAT(nums({{0, 1, 3}, {1, 2, 2}}), ElementsAre(3));
  EXPECT_THAT(nums({}), ElementsAre());
}

TEST(StretchesOver, IsTheOneOfEachSegmentWhoseMiddleIsNearest) {
  const std::vector<PlaceStretch> stretches = {{0, 4, 0, 10}, {1, 4, 0, 11}, {2.9, 9, 0, 12},
                                               {3, 3, 2, 13}, {5, 6, 3, 14}, {0, 2.9, 4, 15}};
  const auto labels = [&](double place) {
    std::vector<LabelIdx> found;
    for (const PlaceStretch& each : StretchesOver(stretches, place)) found.push_back(each.label);
    return found;
  };
  EXPECT_THAT(labels(3), ElementsAre(11, 13));
  EXPECT_THAT(labels(2), ElementsAre(10, 15));
  EXPECT_THAT(labels(6), ElementsAre(12, 14));
  EXPECT_THAT(labels(9.5), ElementsAre());
}

TEST(FaceSet, IsASet) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    std::set<FaceIdx> a, b, both;
    const int most = i % 2 == 0 ? 300 : 5000;
    for (int k = 0; k < 3 + i / 4; ++k) a.insert(static_cast<FaceIdx>(random.UniformInt(0, most)));
    for (int k = 0; k < 120; ++k) b.insert(static_cast<FaceIdx>(random.UniformInt(0, most)));
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::inserter(both, both.end()));
    FaceSet set_a, set_b, expected;
    for (const FaceIdx face : a) set_a.Add(face);
    for (const FaceIdx face : b) set_b.Add(face);
    for (const FaceIdx face : both) expected.Add(face);
    EXPECT_EQ(set_a.Count(), std::ssize(a));
    for (const FaceSet& found : {Intersection(set_a, set_b), Intersection(set_b, set_a)}) {
      ASSERT_EQ(found.words.size(), expected.words.size());
      for (size_t k = 0; k < found.words.size(); ++k) {
        EXPECT_EQ(found.words[k].block, expected.words[k].block);
        EXPECT_EQ(found.words[k].bits, expected.words[k].bits);
      }
    }
    EXPECT_EQ(Intersects(set_a, set_b), !both.empty());
  }
}

struct TwoRooms {
  Views views = decompose_views::Decomposed(
                    "0,0,9,0\n9,0,9,6\n9,6,0,6\n0,6,0,0\n4,0,4,2\n4,3,4,6\n1,1,1.5,1\n1.5,1,1.5,1.6\n"
                    "7.5,1,8.2,1.7\n7,3.5,9,3.5\n2,6,2,5.5\n")
                    .views;
  ViewSearchIndex index{views};
  FaceLocator locator{views};
};

TEST(ViewSearchIndex, KnowsWhatRegionsSee) {
  const TwoRooms rooms;
  const Views& views = rooms.views;
  const int num_labels = views.plan.num_labels();
  std::vector<std::vector<char>> together(num_labels, std::vector<char>(num_labels, 0));
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    const std::vector<LabelIdx> labels = views.LabelSet(face);
    ViewSearchIndex::LengthCounts longer{};
    std::vector<double> angles;
    for (const LabelIdx label : labels) {
      for (const LabelIdx other : labels) together[label][other] = 1;
      const Vec2 along = LabelEnd(views.plan, label) - LabelStart(views.plan, label);
      angles.push_back(std::atan2(along.y(), along.x()));
      for (size_t i = 0; i < longer.size(); ++i)
        longer[i] += along.norm() >= 0.25 * std::pow(2, static_cast<double>(i)) ? 1 : 0;
    }
    EXPECT_EQ(rooms.index.WallsByLength(face), longer);
    const ViewSearchIndex::Spectrum spectrum = DirectionSpectrum(angles);
    for (size_t m = 0; m < spectrum.size(); ++m)
      EXPECT_LT(std::abs(rooms.index.SpectrumOf(face)[m] - spectrum[m]), 1e-4);
    // The box ends at corners of the region.
    Eigen::AlignedBox2d box;
    for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i)
      box.extend(views.plan.Metres(views.vertices[views.face_vertices[i]]));
    EXPECT_LT((rooms.index.BoxOf(face).min().cast<double>() - box.min()).norm(), 1e-5);
    EXPECT_LT((rooms.index.BoxOf(face).max().cast<double>() - box.max()).norm(), 1e-5);
  }
  for (LabelIdx a = 0; a < num_labels; ++a) {
    for (LabelIdx b = 0; b < num_labels; ++b)
      EXPECT_EQ(rooms.index.SeenTogether(a, b), together[a][b] != 0) << a << " " << b;
  }
}

TEST(ViewSearchIndex, BlocksNearABoxHoldAllRegionsThatReachIntoIt) {
  const TwoRooms rooms;
  FaceSet all;
  for (FaceIdx face = 0; face < rooms.views.num_faces(); ++face) all.Add(face);
  ASSERT_GT(all.words.size(), 2U);
  const Eigen::AlignedBox2f corner(Eigen::Vector2f(8.5, 5.5), Eigen::Vector2f(8.9, 5.9));
  const FaceSet near = rooms.index.BlocksNear(corner, all);
  EXPECT_LT(near.words.size(), all.words.size());
  for (FaceIdx face = 0; face < rooms.views.num_faces(); ++face) {
    const FaceSet one{{{face / 64, uint64_t{1} << (face % 64)}}};
    if (rooms.index.BoxOf(face).intersects(corner)) EXPECT_TRUE(Intersects(near, one)) << face;
  }
}

// The region in which a scan was taken is among the candidates, as it is among those that see its walls.
TEST(CandidateRegions, HoldTheRegionOfAScan) {
  const TwoRooms rooms;
  const InterpretationTreeOptions options{
      .angle_tolerance_deg = 0.01, .position_tolerance_m = 1e-3, .length_tolerance_m = 1e-3};
  int64_t num_found = 0, num_seeing = 0, num_both = 0, num_pairs = 0;
  int tried = 0;
  for (int seed = 0; seed < 60; ++seed) {
    Random random(seed);
    const auto pose = RandomPose(rooms.views, rooms.locator, 0.1, &random);
    const FaceIdx face = rooms.locator.Find(pose->position);
    const auto segments = SimulateScan(rooms.views, face, *pose, {}, &random);
    if (segments.size() < 3) continue;
    ++tried;
    const CandidateRegions candidates(rooms.index, segments, options);
    FaceSet found;
    double observed = 0;
    for (const ScanSegment& segment : segments) observed += segment.Length();
    bool is_listed = false;
    for (const auto& [off, candidate] : candidates.Find()) {
      found.Add(candidate);
      is_listed = is_listed || candidate == face;
      EXPECT_EQ(rooms.views.index[candidate].num_labels, std::ssize(segments));
      EXPECT_NEAR(off, std::abs(std::log(rooms.views.index[candidate].visible_length_m / observed)), 1e-6);
    }
    EXPECT_TRUE(is_listed) << seed;
    num_found += found.Count();
    const FaceSet own{{{face / 64, uint64_t{1} << (face % 64)}}};
    const PairingTable table(rooms.views.plan, segments, options);
    const auto label_of = [&](int i) {
      for (const LabelIdx label : rooms.views.LabelSet(face)) {
        const Vec2 from = LabelStart(rooms.views.plan, label), to = LabelEnd(rooms.views.plan, label);
        if (PointToSegment(pose->FloorFromRobot(segments[i].start), from, to) < 1e-6 &&
            PointToSegment(pose->FloorFromRobot(segments[i].end), from, to) < 1e-6)
          return label;
      }
      return LabelIdx{-1};
    };
    const LabelIdx a = label_of(0), b = label_of(1);
    ASSERT_GE(std::min(a, b), 0);
    FaceSet all;
    for (FaceIdx each = 0; each < rooms.views.num_faces(); ++each) all.Add(each);
    const FaceSet seeing = candidates.Seeing(all, table, 0, a);
    EXPECT_TRUE(Intersects(seeing, own)) << seed;
    EXPECT_EQ(Intersection(seeing, rooms.index.FacesOf(a)).Count(), seeing.Count());
    const FaceSet both = candidates.SeeingBoth(all, a, b, *pose, 0.01);
    EXPECT_TRUE(Intersects(both, own)) << seed;
    EXPECT_EQ(Intersection(both, rooms.index.FacesOf(b)).Count(), both.Count());
    for (FaceIdx each = 0; each < rooms.views.num_faces(); ++each) {
      const FaceSet one{{{each / 64, uint64_t{1} << (each % 64)}}};
      if (!Intersects(both, one)) continue;
      EXPECT_LT(rooms.index.BoxOf(each).exteriorDistance(pose->position.cast<float>()), 0.0142);
    }
    // Those of a heading that is another one are none of them.
    EXPECT_FALSE(
        Intersects(candidates.SeeingBoth(all, a, b, {pose->position, pose->heading_rad + 0.6}, 0.01), own));
    num_seeing += seeing.Count();
    num_both += both.Count();
    num_pairs += Intersection(rooms.index.FacesOf(a), rooms.index.FacesOf(b)).Count();
  }
  EXPECT_GT(tried, 20);
  EXPECT_LT(num_found, tried * rooms.views.num_faces() / 10);
  EXPECT_LT(num_seeing, tried * rooms.views.num_faces() / 4);
  EXPECT_LT(num_both, num_pairs / 10);
}

TEST(SegmentsInOrder, AreThoseOfTheirDirections) {
  const auto at = [](double degree, double distance) {
    const Vec2 middle = distance * (Eigen::Rotation2Dd(RadFromDeg(degree)) * Vec2(1, 0));
    return ScanSegment{middle - Vec2(0.1, 0), middle + Vec2(0.1, 0)};
  };
  EXPECT_THAT(SegmentsInOrder({at(10, 3), at(170, 1), at(-170, 5), at(-20, 2), at(90, 1)}),
              ElementsAre(2, 3, 0, 4, 1));
  EXPECT_THAT(SegmentsInOrder({at(10, 3), at(10, 3), at(5, 3)}), ElementsAre(2, 0, 1));
}

}  // namespace
}  // namespace cairn
