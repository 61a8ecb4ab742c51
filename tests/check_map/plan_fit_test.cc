#include "stages/check_map/plan_fit.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "runtime/laser/interpretation_tree.h"
#include "runtime/scans/beam.h"
#include "stages/check_map/plan_agreement.h"

namespace cairn::check_map {
namespace {

using testing::HasSubstr;
using Vec2 = Eigen::Vector2d;

// A closed room as a plan of one region; it need not be view-invariant here.
Views RoomViews(const std::vector<Vec2>& corners) {
  Views views;
  FloorPlan& plan = views.plan;
  plan.grid_m = 0.001;
  plan.closed = true;
  const auto count = static_cast<int32_t>(corners.size());
  for (int32_t i = 0; i < count; ++i) {
    plan.vertices.push_back({std::lround(corners[i].x() * 1000), std::lround(corners[i].y() * 1000)});
    plan.pieces.push_back({i, (i + 1) % count, i});
    plan.walls.push_back({corners[i], corners[(i + 1) % count]});
    views.face_vertices.push_back(i);
    views.toggled_labels.push_back(2 * i);
    plan.high.x = std::max(plan.high.x, plan.vertices[i].x);
    plan.high.y = std::max(plan.high.y, plan.vertices[i].y);
  }
  views.vertices = plan.vertices;
  views.face_offsets = {0, count};
  views.parents = {-1};
  views.toggle_offsets = {0, count};
  views.index.resize(1);
  views.index[0].num_labels = count;
  for (const PlanWall& wall : plan.walls) views.index[0].wall_length_m += static_cast<float>(wall.Length());
  return views;
}

//  8 +--------+
//    |        |       an L of 10 x 8 m: no motion takes it to itself
//  4 |        +----+
//  0 +-------------+
//    0        6    10
const std::vector<Vec2> kCorners = {{0, 0}, {10, 0}, {10, 4}, {6, 4}, {6, 8}, {0, 8}};

// Landmarks on the walls with 2 cm noise, some of furniture, some of the ceiling; images where all walls
// are seen.
MapRows SurveyOfRoom() {
  Random random(5);
  MapRows rows;
  const auto add = [&](const Vec2& place, double height) {
    rows.landmarks.emplace_back().position = {place.x(), place.y(), height};
  };
  for (int i = 0; i < 600; ++i) {
    const size_t wall = random.UniformInt(0, kCorners.size() - 1);
    const Vec2 along = kCorners[(wall + 1) % kCorners.size()] - kCorners[wall];
    const Vec2 noise(random.Normal(0, 0.02), random.Normal(0, 0.02));
    add(kCorners[wall] + random.Uniform() * along + noise, random.Uniform(0.8, 2));
  }
  for (int i = 0; i < 200; ++i)
    add({random.Uniform(0.5, 5.5), random.Uniform(0.5, 7.5)}, random.Uniform(0.8, 2));
  for (int i = 0; i < 300; ++i) add({random.Uniform(0, 6), random.Uniform(0, 8)}, 3);
  for (int i = 0; i < 20; ++i) {
    MapImage& image = rows.images.emplace_back();
    image.image_id = i + 1;
    // Upright, looking along +y of the floor.
    image.cam_from_world.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX()));
    const Eigen::Vector3d center(random.Uniform(1, 5), random.Uniform(2.5, 3.5), 1.4);
    image.cam_from_world.translation = -(image.cam_from_world.rotation * center);
  }
  rows.views = RoomViews(kCorners);
  return rows;
}

// The plan drawn elsewhere: turned about (4, 4), then shifted.
Views Moved(double turn_deg, const Vec2& shift) {
  std::vector<Vec2> corners;
  for (const Vec2& corner : kCorners)
    corners.push_back(Eigen::Rotation2Dd(RadFromDeg(turn_deg)) * (corner - Vec2(4, 4)) + Vec2(4, 4) + shift);
  return RoomViews(corners);
}

TEST(PlanFit, TheRightPlanFits) {
  const auto fit = FitPlan(SurveyOfRoom(), {});
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  EXPECT_TRUE(fit->fits) << PlanVerdict(*fit);
  EXPECT_EQ(fit->num_landmarks, 800);  // not those of the ceiling
  EXPECT_GT(fit->num_on_walls, 590);
  EXPECT_LT(fit->median_wall_distance_m, 0.05);
  EXPECT_EQ(fit->num_images_free, 20);
}

TEST(PlanFit, AMovedPlanIsNoticedAndTheMotionFound) {
  for (const auto& [turn_deg, shift] :
       {std::pair(0.0, Vec2(1, 0)), std::pair(0.0, Vec2(-0.6, 0.8)), std::pair(5.0, Vec2(0, 0)),
        std::pair(-5.0, Vec2(0.5, 0.5)), std::pair(0.0, Vec2(0.3, 0)), std::pair(2.0, Vec2(0, 0)),
        std::pair(6.0, Vec2(1.3, -1.4))}) {
    MapRows rows = SurveyOfRoom();
    rows.views = Moved(turn_deg, shift);
    const auto fit = FitPlan(rows, {});
    ASSERT_TRUE(fit.ok()) << fit.error().message;
    EXPECT_FALSE(fit->fits) << turn_deg << " " << shift.transpose();
    EXPECT_NEAR(fit->turn_deg, -turn_deg, 0.3);
    EXPECT_GT(fit->num_on_walls_moved, 560);
    // What is proposed brings every corner back.
    for (size_t i = 0; i < kCorners.size(); ++i) {
      const Vec2 back =
          Eigen::Rotation2Dd(RadFromDeg(fit->turn_deg)) * (rows.views.plan.walls[i].start - fit->center) +
          fit->center + fit->shift;
      EXPECT_LT((back - kCorners[i]).norm(), 0.06) << turn_deg << " " << shift.transpose();
    }
    EXPECT_THAT(PlanVerdict(*fit), HasSubstr("does not fit"));
  }
}

TEST(PlanFit, ThePlanOfAnotherPlaceFitsNowhere) {
  MapRows rows = SurveyOfRoom();
  rows.views = RoomViews({{-40, -40}, {60, -40}, {60, 60}, {-40, 60}});
  const auto fit = FitPlan(rows, {});
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  EXPECT_FALSE(fit->fits);
  EXPECT_THAT(PlanVerdict(*fit), HasSubstr("no motion helps"));
}

TEST(PlanFit, TooLittleIsNoCheck) {
  MapRows rows = SurveyOfRoom();
  rows.landmarks.resize(20);
  EXPECT_EQ(FitPlan(rows, {}).error().code, ErrorCode::kNoData);
  rows = SurveyOfRoom();
  rows.views = {};
  EXPECT_EQ(FitPlan(rows, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(FitPlan(SurveyOfRoom(), {.plan_wall_distance_m = -1}).error().code, ErrorCode::kInvalidArgument);
}

TEST(PlanFit, FiguresAndVerdictSayWhatWasFound) {
  PlanFit fit{.num_landmarks = 200,
              .num_on_walls = 50,
              .median_wall_distance_m = 0.25,
              .num_on_walls_moved = 180,
              .center = {1, 2},
              .shift = {3, -4},
              .turn_deg = 1.5,
              .num_images = 8,
              .num_images_free = 6};
  std::map<std::string, double> figures;
  AddPlanFigures(fit, &figures);
  EXPECT_EQ(figures, (std::map<std::string, double>{{"plan_num_landmarks", 200},
                                                    {"plan_on_walls_ratio", 0.25},
                                                    {"plan_on_walls_ratio_moved", 0.9},
                                                    {"plan_median_wall_distance_m", 0.25},
                                                    {"plan_shift_m", 5},
                                                    {"plan_turn_deg", 1.5},
                                                    {"plan_images_free_ratio", 0.75},
                                                    {"plan_fits", 0}}));
  EXPECT_EQ(PlanVerdict(fit),
            "does not fit: 25 % of 200 landmarks lie on its walls, but 90 % if it were turned by 1.50 deg "
            "about (1.00, 2.00), then shifted by (3.00, -4.00) m");
  fit.turn_deg = 0;
  EXPECT_THAT(PlanVerdict(fit), HasSubstr("turned by 0.00 deg"));
  fit.shift = {0, 0};
  EXPECT_EQ(PlanVerdict(fit), "does not fit, and no motion helps: 25 % of 200 landmarks lie on its walls");
  fit.fits = true;
  EXPECT_EQ(PlanVerdict(fit), "fits: 25 % of 200 landmarks lie on its walls");
  AddPlanFigures({}, &figures);  // of nothing there are no parts
  EXPECT_EQ(figures.at("plan_on_walls_ratio"), 0);
}

TEST(PlanGate, APlanThatDoesNotFitIsRefusedWhereAsked) {
  CheckMapReport report;
  MapRows rows = SurveyOfRoom();
  rows.views = Moved(0, {1, 0});
  AddPlanFigures(*FitPlan(rows, {}), &report.figures);
  EXPECT_TRUE(CheckGate(report, {}).ok());
  CheckMapOptions asked;
  asked.plan_must_fit = true;
  EXPECT_EQ(CheckGate(report, asked).error().code, ErrorCode::kGate);
  rows.views = Moved(0, {0, 0});
  AddPlanFigures(*FitPlan(rows, {}), &report.figures);
  EXPECT_TRUE(CheckGate(report, asked).ok());
}

// The walls as a laser at a pose sees them, at its own place in the camera's frame.
ScanView Scan(const PlanarPose& laser) {
  std::vector<ScanSegment> segments;
  for (size_t i = 0; i < kCorners.size(); ++i) {
    segments.push_back({laser.RobotFromFloor(kCorners[i]),
                        laser.RobotFromFloor(kCorners[(i + 1) % kCorners.size()]), 1e-4, 1e-3, 50});
  }
  return {segments, BeamsTo(segments), {}};
}

TEST(PlanAgreement, ImagesAndScansOfOnePoseAgreeAndOthersDoNot) {
  MapRows rows = SurveyOfRoom();
  // The capture states poses of another frame than the camera's.
  rows.camera_from_given = {
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 3).normalized())), {0.2, 0.1, -0.3}};
  std::vector<HeldOutResult> images(2);
  std::vector<ScanView> scans;
  CheckMapOptions options;
  options.scan_x_m = 0.3;
  options.scan_heading_deg = 90;
  for (size_t i = 0; i < images.size(); ++i) {
    images[i].localization.reason = NoFix::kNone;
    images[i].localization.cam_from_world = rows.camera_from_given.Inverse() * rows.images[i].cam_from_world;
    const Eigen::Vector3d center = rows.images[i].cam_from_world.Center();
    // Ahead of the camera, which heads +y; the second one's image is 2 m off.
    const Vec2 off(0, i == 1 ? 2 : 0);
    scans.push_back(Scan({center.head<2>() + Vec2(0, 0.3) - off, std::numbers::pi}));
  }
  NoProgress progress;
  std::map<std::string, double> figures;
  ASSERT_TRUE(CompareWithPlan(rows, images, scans, options, 2, progress, &figures).ok());
  EXPECT_EQ(figures["plan_fixes_free_ratio"], 1);
  EXPECT_EQ(figures["num_scan_fixes"], 2);
  EXPECT_EQ(figures["num_image_and_scan_fixes"], 2);
  EXPECT_EQ(figures["scan_first_agrees_ratio"], 0.5);
  EXPECT_EQ(figures["scan_any_agrees_ratio"], 0.5);

  images[1].localization.cam_from_world.translation.x() += 100;
  ASSERT_TRUE(CompareWithPlan(rows, images, {}, options, 1, progress, &figures).ok());
  EXPECT_EQ(figures["plan_fixes_free_ratio"], 0.5);
  scans.pop_back();
  EXPECT_EQ(CompareWithPlan(rows, images, scans, options, 1, progress, &figures).error().code,
            ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn::check_map
