#include "stages/reconstruct/zoomed_lens.h"

#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/random.h"

namespace cairn::reconstruct {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kFocalPx = 600, kNoisePx = 0.3;

// Where image `i` shows a point, pixels from the middle of a picture of 640 x 480.
using Shown = std::function<Eigen::Vector2d(int i, const Eigen::Vector3d& point)>;

Eigen::Vector2d Projected(double focal_px, const Eigen::Vector3d& point) {
  return focal_px * point.head<2>() / point.z();
}

// Images of 200 points 4 to 12 m in front of the first one, or on a wall at 8 m; each is a pair with the
// next.
MapperInput FilmOf(int num_images, bool is_flat, const Shown& shown) {
  MapperInput film;
  film.cameras.emplace(1, GuessCamera(1, 640, 480));
  film.cameras.emplace(2, GuessCamera(2, 640, 480));
  Random random(5);
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 200; ++p) {
    const double depth = is_flat ? 8 : random.Uniform(4, 12);
    points.emplace_back(depth * random.Uniform(-0.5, 0.5), depth * random.Uniform(-0.4, 0.4), depth);
  }
  for (int i = 0; i < num_images; ++i) {
    film.images.push_back({static_cast<ImageId>(i + 1), fmt::format("{:02}.jpg", i), 1});
    std::vector<Keypoint>& keypoints = film.keypoints.emplace_back();
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector2d pixel = Eigen::Vector2d(320, 240) + shown(i, point);
      keypoints.push_back({.x = static_cast<float>(pixel.x() + random.Normal(0, kNoisePx)),
                           .y = static_cast<float>(pixel.y() + random.Normal(0, kNoisePx))});
    }
    if (i == 0) continue;
    TwoViewGeometry& pair = film.geometries.emplace_back();
    pair.image_id1 = static_cast<ImageId>(i);
    pair.image_id2 = static_cast<ImageId>(i + 1);
    for (KeypointIdx k = 0; k < points.size(); ++k) pair.inliers.push_back({k, k});
  }
  return film;
}

Eigen::Vector2d Zoom(int i, const Eigen::Vector3d& point) {
  return Projected(kFocalPx * std::pow(1.1, i), point);
}
Eigen::Vector2d Forward(int i, const Eigen::Vector3d& point) {
  return Projected(kFocalPx, point - Eigen::Vector3d(0, 0, 0.3 * i));
}

TEST(ZoomedLens, IsToldOfAFilmThatOnlyZooms) {
  EXPECT_THAT(
      ZoomedLens(FilmOf(8, false, Zoom)),
      AllOf(HasSubstr("7 of the 7 pairs"), HasSubstr("the lens zoomed"), HasSubstr("fixed focal length")));
  // In and out again.
  EXPECT_NE(ZoomedLens(FilmOf(8, false, [](int i, const auto& point) { return Zoom(i % 2, point); })), "");
}

TEST(ZoomedLens, IsToldThoughTheHandShakes) {
  const auto shaken = [](int i, const Eigen::Vector3d& point) -> Eigen::Vector2d {
    const double roll = 0.01 * (i % 3);
    return Eigen::Rotation2Dd(roll) * Zoom(i, point) + Eigen::Vector2d(6.0 * (i % 2), 4.0 * (i % 3));
  };
  EXPECT_NE(ZoomedLens(FilmOf(8, false, shaken)), "");
}

TEST(ZoomedLens, IsNotFoundWhereTheCameraMoves) {
  EXPECT_EQ(ZoomedLens(FilmOf(8, false, Forward)), "");
  const auto sideways = [](int i, const Eigen::Vector3d& point) {
    return Projected(kFocalPx, point - Eigen::Vector3d(0.2 * i, 0, 0));
  };
  EXPECT_EQ(ZoomedLens(FilmOf(8, false, sideways)), "");
  EXPECT_EQ(ZoomedLens(FilmOf(8, true, sideways)), "");  // past a flat wall
  // Past a wall and nearer to it: the picture grows about a place far from its middle.
  const auto aslant = [](int i, const Eigen::Vector3d& point) {
    return Projected(kFocalPx, point - Eigen::Vector3d(0.3 * i, 0, 0.3 * i));
  };
  EXPECT_EQ(ZoomedLens(FilmOf(8, true, aslant)), "");
  // On the spot.
  const auto turning = [](int i, const Eigen::Vector3d& point) -> Eigen::Vector2d {
    return Projected(kFocalPx, Eigen::AngleAxisd(-0.05 * i, Eigen::Vector3d::UnitY()) * point);
  };
  EXPECT_EQ(ZoomedLens(FilmOf(8, false, turning)), "");
}

// Towards a flat wall a picture grows as by a zoom.
TEST(ZoomedLens, LooksLikeAWayStraightAtAWall) {
  EXPECT_THAT(ZoomedLens(FilmOf(8, true, Forward)), HasSubstr("straight at a flat wall"));
}

TEST(ZoomedLens, IsNotFoundInPicturesThatAreTheSame) {
  EXPECT_EQ(ZoomedLens(FilmOf(8, false, [](int, const auto& point) { return Zoom(0, point); })), "");
  EXPECT_EQ(ZoomedLens({}), "");
}

// A rest between zooms counts for neither.
TEST(ZoomedLens, NeedsFourInFiveOfThePairsThatMove) {
  const auto zooms_then = [](int num_zooms, double step_m) {
    return [=](int i, const Eigen::Vector3d& point) {
      const double way_m = step_m * std::max(0, i - num_zooms);
      return Zoom(std::min(i, num_zooms), point - Eigen::Vector3d(way_m, 0, 0));
    };
  };
  EXPECT_NE(ZoomedLens(FilmOf(11, false, zooms_then(8, 0.2))), "");  // 8 of 10
  EXPECT_EQ(ZoomedLens(FilmOf(11, false, zooms_then(7, 0.2))), "");  // 7 of 10
  EXPECT_NE(ZoomedLens(FilmOf(11, false, zooms_then(3, 0))), "");    // 3 of 3
  EXPECT_EQ(ZoomedLens(FilmOf(11, false, zooms_then(2, 0))), "");    // 2 of 2
}

// Photographs whose EXIF states each focal length have a camera for each.
TEST(ZoomedLens, IsNoneBetweenTwoCameras) {
  MapperInput film = FilmOf(8, false, Zoom);
  for (size_t i = 0; i < film.images.size(); i += 2) film.images[i].camera_id = 2;
  EXPECT_EQ(ZoomedLens(film), "");
}

TEST(ZoomedLens, IsToldDespiteMatchesThatAreWrong) {
  MapperInput film = FilmOf(8, false, Zoom);
  for (std::vector<Keypoint>& keypoints : film.keypoints) {
    for (size_t k = 0; k < 30; ++k)
      keypoints[k].x += static_cast<float>(7 * (k % 9) * (&keypoints - film.keypoints.data()));
  }
  EXPECT_NE(ZoomedLens(film), "");
}

}  // namespace
}  // namespace cairn::reconstruct
