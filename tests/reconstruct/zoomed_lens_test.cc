#include "stages/reconstruct/zoomed_lens.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/pooled.h"
#include "core/base/random.h"
#include "core/geometry/relative_pose.h"

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
  // The first stays where it is when the lens zooms.
  std::vector<Eigen::Vector3d> points = {{0, 0, 8}};
  for (int p = 0; p < 200; ++p) {
    const double depth = is_flat ? 8 : random.Uniform(4, 12);
    points.emplace_back(depth * random.Uniform(-0.5, 0.5), depth * random.Uniform(-0.4, 0.4), depth);
  }
  for (int i = 0; i < num_images; ++i) {
    film.images.push_back({static_cast<ImageId>(i + 1), fmt::format("{:02}.jpg", i), 1});
    PooledVector<Keypoint>& keypoints = film.keypoints.emplace_back();
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
  for (PooledVector<Keypoint>& keypoints : film.keypoints) {
    for (size_t k = 0; k < 30; ++k)
      keypoints[k].x += static_cast<float>(7 * (k % 9) * (&keypoints - film.keypoints.data()));
  }
  EXPECT_NE(ZoomedLens(film), "");
}

// Images whose lens has these focal lengths, each a pair with the next `num_next`, by the fundamental matrix
// of a motion that tells them.
MapperInput FilmByFocals(int num_images, int num_next, const std::function<double(int)>& focal_px) {
  MapperInput film;
  film.cameras.emplace(1, GuessCamera(1, 640, 480));
  film.cameras.emplace(2, GuessCamera(2, 640, 480));
  Random random(4);
  const auto to_bearing = [&](int i) {
    Eigen::Matrix3d K;
    K << focal_px(i), 0, 320, 0, focal_px(i), 240, 0, 0, 1;
    return Eigen::Matrix3d(K.inverse());
  };
  for (int i = 0; i < num_images; ++i) {
    film.images.push_back({static_cast<ImageId>(i + 1), fmt::format("{}.jpg", i), 1});
    for (int j = std::max(0, i - num_next); j < i; ++j) {
      const auto direction = [&] {
        return Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1));
      };
      const Pose pose{
          Eigen::Quaterniond(Eigen::AngleAxisd(random.Uniform(0.1, 0.5), direction().normalized())),
          direction()};
      TwoViewGeometry& pair = film.geometries.emplace_back();
      pair.image_id1 = static_cast<ImageId>(j + 1);
      pair.image_id2 = static_cast<ImageId>(i + 1);
      pair.config = TwoViewConfig::kUncalibrated;
      pair.F = to_bearing(i).transpose() * EssentialMatrix(pose) * to_bearing(j);
      pair.inliers.resize(100);
    }
  }
  return film;
}

double ZoomedAtHalf(int i) { return i < 25 ? 500 : 900; }

TEST(ZoomedPart, NamesTheImagesAndTheirFocalLengths) {
  EXPECT_THAT(ZoomedPart(FilmByFocals(50, 2, ZoomedAtHalf)),
              AllOf(HasSubstr("from 0.jpg to 15.jpg about 5"), HasSubstr("from 32.jpg to 47.jpg about 9"),
                    HasSubstr("fixed focal length")));
  // As long on the way from the one to the other as the lens of a phone takes.
  EXPECT_NE(ZoomedPart(FilmByFocals(60, 3, [](int i) { return std::clamp(20.0 * i, 400.0, 800.0); })), "");
}

TEST(ZoomedPart, IsNoneWhereTheFocalLengthStaysOrNearlySo) {
  EXPECT_EQ(ZoomedPart(FilmByFocals(50, 2, [](int) { return 500; })), "");
  EXPECT_EQ(ZoomedPart(FilmByFocals(50, 2, [](int i) { return i < 25 ? 500 : 570; })), "");
  EXPECT_NE(ZoomedPart(FilmByFocals(50, 2, [](int i) { return i < 25 ? 500 : 620; })), "");
  EXPECT_EQ(ZoomedPart({}), "");
}

TEST(ZoomedPart, NeedsPairsThatTell) {
  EXPECT_EQ(ZoomedPart(FilmByFocals(50, 1, ZoomedAtHalf)), "");  // 15 of 16 images
  MapperInput planar = FilmByFocals(50, 2, ZoomedAtHalf);
  for (TwoViewGeometry& pair : planar.geometries) pair.config = TwoViewConfig::kPlanarOrPanoramic;
  EXPECT_EQ(ZoomedPart(planar), "");
  // Fifteen images of the one and as many of the other are no run.
  EXPECT_EQ(ZoomedPart(FilmByFocals(15, 4, ZoomedAtHalf)), "");
}

TEST(ZoomedPart, IsOfOneCamera) {
  MapperInput film = FilmByFocals(50, 2, ZoomedAtHalf);
  for (int i = 25; i < 50; ++i) film.images[i].camera_id = 2;
  EXPECT_EQ(ZoomedPart(film), "");
}

// A camera that goes straight ahead says nothing about its focal length.
TEST(ZoomedPart, IsNoneWhereTheMotionDoesNotTell) {
  MapperInput film = FilmByFocals(50, 2, ZoomedAtHalf);
  for (size_t p = film.geometries.size() / 2; p < film.geometries.size(); ++p)
    film.geometries[p].F = EssentialMatrix({Eigen::Quaterniond::Identity(), {320, 240, 1}});
  EXPECT_EQ(ZoomedPart(film), "");
}

}  // namespace
}  // namespace cairn::reconstruct
