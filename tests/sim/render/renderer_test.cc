#include "sim/render/renderer.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "core/base/pooled.h"
#include "core/features/descriptor_matcher.h"
#include "core/features/sift.h"
#include "sim/survey/survey.h"

namespace cairn::sim {
namespace {

Building MakeEmptyBuilding(double texel_m) {
  SimulateOptions options;
  options.furniture_ratio = 0;
  options.pillars_per_room = 0;
  options.texel_m = texel_m;
  return *MakeBuilding(options, 0);
}

Camera TestCamera(CameraModel model) {
  Camera camera = MakeCamera(SimulateOptions());
  camera.model = model;
  if (model == CameraModel::kSimpleRadial) camera.params = {320, 320, 240, -0.1};
  return camera;
}

const Room& Corridor(const Building& building) {
  for (const Room& room : building.layout.rooms) {
    if (room.is_corridor) return room;
  }
  return building.layout.rooms.front();
}

// Everything black but the corridor's lower wall, seen from the corridor: white around its black doors.
// Returns one of the doors, as an interval of x.
std::pair<double, double> PaintCorridorWallWhite(Building* building) {
  const int black = static_cast<int>(building->textures.size()), white = black + 1;
  building->textures.emplace_back(cv::Mat(2, 2, CV_8UC1, cv::Scalar(0)));
  building->textures.emplace_back(cv::Mat(2, 2, CV_8UC1, cv::Scalar(200)));
  const double wall_y = Corridor(*building).rect.y0;
  for (Box& box : building->boxes) {
    for (Surface& face : box.faces) face.texture = black;
    if (std::abs(box.max.y() - wall_y) < 1e-9) box.faces[3].texture = white;
  }
  building->floor.texture = building->ceiling.texture = black;
  for (const Wall& wall : building->layout.walls) {
    if (wall.along_x && std::abs(wall.rect.y1 - wall_y) < 1e-9) return wall.doors.front();
  }
  return {};
}

class RendererCorner : public testing::TestWithParam<CameraModel> {};

TEST_P(RendererCorner, LandsAtItsPredictedPixel) {
  //  white  |        | white        The sums of the pixels' values left and above give where the wall ends,
  //  to a
  //  -------+ lintel +------        fraction of a pixel: partly covered pixels are partly white.
  Building building = MakeEmptyBuilding(0.02);
  const auto [door_low, door_high] = PaintCorridorWallWhite(&building);
  const Camera camera = TestCamera(GetParam());
  const Rect& corridor = Corridor(building).rect;
  const double door_height = SimulateOptions().door_height_m;
  // A little off the middle, so that no edge falls on a pixel's border.
  const Eigen::Vector3d centre((door_low + door_high) / 2 + 0.0137, (corridor.y0 + corridor.y1) / 2, 1.9);
  const Pose pose = MakePose(centre, -std::numbers::pi / 2);
  const cv::Mat image = Renderer(building, camera).RenderFloat(pose);

  // Looking along -y, +x is on the left: the edge at door_high is left of that at door_low.
  const auto pixel_of = [&](double x, double z) {
    return *ImageFromCamera(camera, pose * Eigen::Vector3d(x, corridor.y0, z));
  };
  for (const double z : {1.5, 1.7, 1.9}) {
    const Eigen::Vector2d left = pixel_of(door_high, z), right = pixel_of(door_low, z);
    const int row = static_cast<int>(left.y());
    const float white = image.at<float>(row, static_cast<int>(left.x()) - 20);
    ASSERT_GT(white, 100);
    double left_sum = 0, right_sum = 0;
    for (int x = 0; x < 320; ++x) left_sum += image.at<float>(row, x) / white;
    for (int x = 320; x < 640; ++x) right_sum += image.at<float>(row, x) / white;
    // Only where the row is white up to the image's border does the sum count from there.
    EXPECT_NEAR(left_sum, left.x(), 0.25) << z;
    EXPECT_NEAR(640 - right_sum, right.x(), 0.25) << z;
  }
  const Eigen::Vector2d lintel = pixel_of(centre.x(), door_height);
  const int column = static_cast<int>(lintel.x());
  double height = 0;
  const float white = image.at<float>(static_cast<int>(lintel.y()) - 5, column);
  for (int y = static_cast<int>(lintel.y()) - 10; y < 480; ++y) {
    height += image.at<float>(y, column) / white;
  }
  EXPECT_NEAR(static_cast<int>(lintel.y()) - 10 + height, lintel.y(), 0.25);
}
INSTANTIATE_TEST_SUITE_P(Models, RendererCorner,
                         testing::Values(CameraModel::kPinhole, CameraModel::kSimpleRadial));

TEST(Renderer, ShowsTexturesUnmirroredAndUpright) {
  // A picture with a bright quarter at its top left, on every panel.
  Building building = MakeEmptyBuilding(0.02);
  cv::Mat picture(130, 80, CV_8UC1, cv::Scalar(20));
  picture(cv::Rect(0, 0, 40, 65)).setTo(220);
  const int texture = static_cast<int>(building.textures.size());
  building.textures.emplace_back(picture);
  for (Box& box : building.boxes) {
    for (Surface& face : box.faces) face.texture = texture;
  }
  const Renderer renderer(building, TestCamera(CameraModel::kPinhole));
  const Rect& corridor = Corridor(building).rect;
  for (const int heading : {0, 1, 2, 3}) {
    const Eigen::Vector3d centre((corridor.x0 + corridor.x1) / 2, (corridor.y0 + corridor.y1) / 2, 1.3);
    const Pose pose = MakePose(centre, heading * std::numbers::pi / 2);
    // The panel in the middle of the image, by its face's texture coordinates at two points of the wall.
    const std::optional<RayHit> hit = CastRay(building, centre, pose.ViewingDirection());
    ASSERT_TRUE(hit && hit->face >= 0);
    const Surface& surface = building.SurfaceOf(hit->face);
    const Eigen::Vector3d right = pose.rotation.conjugate() * Eigen::Vector3d::UnitX();
    const Eigen::Vector3d point = centre + hit->distance * pose.ViewingDirection();
    const auto u = [&](const Eigen::Vector3d& p) {
      return surface.u_offset + surface.u_scale * p[surface.u_axis];
    };
    const auto v = [&](const Eigen::Vector3d& p) {
      return surface.v_offset + surface.v_scale * p[surface.v_axis];
    };
    EXPECT_NEAR(u(point + 0.1 * right) - u(point), 5, 1e-6) << heading;
    EXPECT_NEAR(v(point - 0.1 * Eigen::Vector3d::UnitZ()) - v(point), 5, 1e-6) << heading;
    EXPECT_NEAR(v({point.x(), point.y(), 2.6}), 0, 1e-6);
    // And the image shows the value that the texture has there.
    const Eigen::Vector3d bright =
        point + (20 - u(point)) * 0.02 * right + (0.65 - 0.02) * Eigen::Vector3d::UnitZ();
    const std::optional<Eigen::Vector2d> pixel = ImageFromCamera(renderer.camera(), pose * bright);
    const cv::Mat image = renderer.Render(pose);
    if (pixel && pixel->x() > 2 && pixel->x() < 638 && pixel->y() > 2 && pixel->y() < 478) {
      EXPECT_GT(image.at<uint8_t>(static_cast<int>(pixel->y()), static_cast<int>(pixel->x())), 140)
          << heading;
    }
  }
}

TEST(Renderer, GivesFeaturesThatMatchWhereTheGeometrySays) {
  SimulateOptions options;
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  const Renderer renderer(building, survey.camera);
  // In the corridor, looking along it, 0.4 m apart and turned by 8 degrees.
  const Rect& corridor = Corridor(building).rect;
  const double y = (corridor.y0 + corridor.y1) / 2;
  const Pose poses[2] = {MakePose({2.0, y, 1.0}, 0), MakePose({2.4, y + 0.1, 1.02}, RadFromDeg(8))};
  Features features[2];
  for (int i = 0; i < 2; ++i) {
    features[i] = *ExtractSift(renderer.Render(poses[i]), SiftOptions());
    EXPECT_GT(features[i].keypoints.size(), 500u);
  }
  int num_right = 0;
  const PooledVector<Match> matches =
      MatchDescriptors(features[0].descriptors, features[1].descriptors, {}, DescriptorMatcherOptions());
  for (const Match& match : matches) {
    const Keypoint &a = features[0].keypoints[match.idx1], &b = features[1].keypoints[match.idx2];
    const Eigen::Vector2d ray = *CameraFromImage(survey.camera, {a.x, a.y});
    const Eigen::Vector3d direction = poses[0].rotation.conjugate() * ray.homogeneous();
    const std::optional<RayHit> hit = CastRay(building, poses[0].Center(), direction);
    if (!hit) continue;
    const std::optional<Eigen::Vector2d> pixel =
        ImageFromCamera(survey.camera, poses[1] * (poses[0].Center() + hit->distance * direction));
    num_right += pixel && (*pixel - Eigen::Vector2d(b.x, b.y)).norm() < 2;
  }
  EXPECT_GT(num_right, 200);
  EXPECT_GT(num_right, 0.85 * static_cast<double>(matches.size()));
}

TEST(Renderer, HasNoHolesAtCorners) {
  // All textures white: a black or dark pixel would be a crack between boxes.
  Building building = MakeEmptyBuilding(0.02);
  for (Texture& texture : building.textures) texture = Texture(cv::Mat(2, 2, CV_8UC1, cv::Scalar(255)));
  const Renderer renderer(building, TestCamera(CameraModel::kPinhole));
  const Rect& corridor = Corridor(building).rect;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d centre(corridor.x0 + 0.5 + 0.7 * i, (corridor.y0 + corridor.y1) / 2, 1.0);
    double least = 0;
    cv::minMaxLoc(renderer.RenderFloat(MakePose(centre, i * 0.5, 0.1, 0.05)), &least);
    EXPECT_GT(least, 255 * 0.5) << i;
  }
}

TEST(Renderer, IsBlackInsideAWall) {
  const Building building = MakeEmptyBuilding(0.02);
  EXPECT_EQ(
      cv::countNonZero(Renderer(building, TestCamera(CameraModel::kPinhole)).Render(MakePose({-5, 0, 1}, 0))),
      0);
}

}  // namespace
}  // namespace cairn::sim
