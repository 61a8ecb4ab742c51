#include "stages/reconstruct/globally/image_ways.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "stages/reconstruct/globally/pair_lengths.h"

namespace cairn::reconstruct {
namespace {

constexpr double kNoiseRad = 0.0005, kViewRad = 0.6, kViewM = 6;

// A camera that drives ahead through a cloud of points, and pairs of what near images share.
struct CloudDrive {
  std::vector<Pose> cams_from_world;
  std::vector<std::vector<Eigen::Vector3d>> bearings;  // per image and point; zero: not seen
  std::vector<ViewPair> pairs;
  std::vector<std::pair<int, int>> steps;

  std::vector<Eigen::Quaterniond> Rotations() const {
    std::vector<Eigen::Quaterniond> rotations;
    for (const Pose& pose : cams_from_world) rotations.push_back(pose.rotation);
    return rotations;
  }
  Eigen::Vector3d Center(int image) const { return cams_from_world[image].Center(); }
};

void AddPairs(int max_distance, CloudDrive* drive) {
  const int num_images = static_cast<int>(drive->cams_from_world.size());
  for (int i = 0; i < num_images; ++i) {
    for (int k = i + 1; k < num_images && k <= i + max_distance; ++k) {
      ViewPair pair{.image1 = i,
                    .image2 = k,
                    .cam2_from_cam1 = drive->cams_from_world[k] * drive->cams_from_world[i].Inverse(),
                    .alternatives = {},
                    .matches = {}};
      const double length = pair.cam2_from_cam1.translation.norm();
      // Of a turn on the spot, noise.
      pair.cam2_from_cam1.translation = length > 1e-6
                                            ? Eigen::Vector3d(pair.cam2_from_cam1.translation / length)
                                            : Eigen::Vector3d::UnitX();
      for (size_t p = 0; p < drive->bearings[i].size(); ++p) {
        if (!drive->bearings[i][p].isZero() && !drive->bearings[k][p].isZero())
          pair.matches.push_back({static_cast<KeypointIdx>(p), static_cast<KeypointIdx>(p)});
      }
      if (!pair.matches.empty()) drive->pairs.push_back(std::move(pair));
    }
    if (i > 0) drive->steps.emplace_back(i - 1, i);
  }
}

// Twelve steps of 0.1 m along x, a turn of 45 degrees on the spot in five images, twelve steps of 0.3 m
// ahead: only what is seen from before and behind the turn tells that these are longer.
CloudDrive DriveThroughCloud() {
  Random random(2);
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 4000; ++p)
    points.emplace_back(random.Uniform(-5, 9), random.Uniform(-5, 9), random.Uniform(-1.5, 1.5));
  CloudDrive drive;
  Eigen::Vector3d center(0, 0, 0);
  double heading = 0;
  const auto add = [&] {
    Eigen::Matrix3d rotation;
    rotation.row(2) = Eigen::Vector3d(std::cos(heading), std::sin(heading), 0);
    rotation.row(1) = -Eigen::Vector3d::UnitZ();
    rotation.row(0) = Eigen::Vector3d(rotation.row(1)).cross(Eigen::Vector3d(rotation.row(2)));
    const Pose pose{Eigen::Quaterniond(rotation), -(rotation * center)};
    std::vector<Eigen::Vector3d>& bearings = drive.bearings.emplace_back();
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3d seen = pose * point;
      const bool is_shown = seen.norm() < kViewM && seen.z() > std::cos(kViewRad) * seen.norm();
      const Eigen::Vector3d noise(random.Normal(0, kNoiseRad), random.Normal(0, kNoiseRad), 0);
      bearings.emplace_back(is_shown ? Eigen::Vector3d((seen.normalized() + noise).normalized())
                                     : Eigen::Vector3d::Zero());
    }
    drive.cams_from_world.push_back(pose);
  };
  add();
  for (int i = 0; i < 12; ++i) center.x() += 0.1, add();
  for (int i = 0; i < 5; ++i) heading += EIGEN_PI / 20, add();
  for (int i = 0; i < 12; ++i)
    center += 0.3 * Eigen::Vector3d(std::cos(heading), std::sin(heading), 0), add();
  AddPairs(6, &drive);
  return drive;
}

BearingOf BearingsOf(const CloudDrive& drive) {
  return [&drive](int image, KeypointIdx keypoint) -> std::optional<Eigen::Vector3d> {
    if (drive.bearings[image][keypoint].isZero()) return std::nullopt;
    return drive.bearings[image][keypoint];
  };
}

std::vector<Way> Find(const CloudDrive& drive, const std::vector<ImageMotion>& motions = {},
                      int num_threads = 2, bool weigh_by_matches = false) {
  return WaysBy(drive.Rotations(), drive.pairs, motions, drive.steps, BearingsOf(drive), kNoiseRad,
                weigh_by_matches, num_threads);
}

double LengthOf(const std::vector<Eigen::Vector3d>& centers, int from, int to) {
  return (centers[to] - centers[from]).norm();
}

TEST(DepthsOf, AreThoseOfWhereTheLinesMeet) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  // The second camera is 2 to the right.
  const Pose cam2_from_cam1{turn, turn * Eigen::Vector3d(-2, 0, 0)};
  ViewPair pair{
      .image1 = 4, .image2 = 7, .cam2_from_cam1 = cam2_from_cam1, .alternatives = {}, .matches = {}};
  pair.cam2_from_cam1.translation.normalize();
  std::vector<Eigen::Vector3d> bearings1, bearings2;
  const auto add = [&](const Eigen::Vector3d& point, KeypointIdx idx1, KeypointIdx idx2) {
    bearings1.push_back(point.normalized());
    bearings2.push_back((cam2_from_cam1 * point).normalized());
    pair.matches.push_back({idx1, idx2});
  };
  for (KeypointIdx i = 0; i < 12; ++i) add({0, 0, 4.0 + i}, 20 - i, 100 + i);
  add({0, 0, -4}, 90, 90);    // no ray goes backwards
  add({0, 0, 4000}, 91, 91);  // nearly the same direction
  bearings1[12] = -bearings1[12];
  const PairDepths depths = DepthsOf(pair, bearings1, bearings2, 0.001);
  EXPECT_EQ(depths.image1, 4);
  EXPECT_EQ(depths.image2, 7);
  ASSERT_EQ(depths.from1.size(), 12u);
  ASSERT_EQ(depths.from2.size(), 12u);
  // In lengths of the way, in the order of the keypoints.
  EXPECT_EQ(depths.from1[0].keypoint_idx, 9u);
  EXPECT_NEAR(depths.from1[0].log_depth, std::log(15 / 2.0), 1e-9);
  EXPECT_EQ(depths.from1[11].keypoint_idx, 20u);
  EXPECT_NEAR(depths.from1[11].log_depth, std::log(4 / 2.0), 1e-9);
  EXPECT_EQ(depths.from2[0].keypoint_idx, 100u);
  EXPECT_NEAR(depths.from2[0].log_depth, std::log(std::sqrt(20.0) / 2), 1e-9);
  // Of an angle of sigma / 0.3 the logarithm is as sure as that.
  bearings1.resize(12), bearings2.resize(12), pair.matches.resize(12);
  const double least_angle = std::atan(2.0 / 15);
  EXPECT_EQ(DepthsOf(pair, bearings1, bearings2, 0.299 * std::sin(least_angle)).from1.size(), 12u);
  // One fewer is too few.
  EXPECT_TRUE(DepthsOf(pair, bearings1, bearings2, 0.301 * std::sin(least_angle)).from1.empty());
  EXPECT_TRUE(DepthsOf(pair, bearings1, bearings2, 0.301 * std::sin(least_angle)).from2.empty());
}

// Two images' depths of twelve points, `log_ratio` apart.
PairDepths DepthsAt(int image1, int image2, double log1, double log2) {
  PairDepths depths{.image1 = image1, .image2 = image2, .from1 = {}, .from2 = {}};
  for (KeypointIdx k = 0; k < 12; ++k) {
    depths.from1.push_back({k, log1 + 0.1 * k});
    depths.from2.push_back({k, log2 + 0.1 * k});
  }
  return depths;
}

// Points three units away are 3 lengths of a pair of one unit away, and 1.5 of one of two.
TEST(PairLengths, FollowFromWhatTwoPairsSeeFromOneImage) {
  const double far = std::log(3);
  const std::vector<PairDepths> pairs = {DepthsAt(0, 1, far, far),
                                         DepthsAt(1, 2, far - std::log(2), far - std::log(2)),
                                         DepthsAt(3, 2, far - std::log(5), far - std::log(5))};
  const std::vector<double> lengths = PairLengths(4, pairs, {{0, std::log(0.5), 0.01}});
  ASSERT_EQ(lengths.size(), 3u);
  EXPECT_NEAR(lengths[0], 0.5, 1e-3);
  EXPECT_NEAR(lengths[1], 1, 1e-3);
  EXPECT_NEAR(lengths[2], 2.5, 3e-3);
}

TEST(PairLengths, APairThatSharesTooLittleHasNone) {
  std::vector<PairDepths> pairs = {DepthsAt(0, 1, 1, 1), DepthsAt(1, 2, 1, 1), DepthsAt(2, 3, 1, 1)};
  pairs[2].from1.pop_back();
  pairs.push_back({.image1 = 3, .image2 = 4, .from1 = {}, .from2 = {}});
  const std::vector<double> lengths = PairLengths(5, pairs, {{0, 0, 0.1}});
  EXPECT_NEAR(lengths[1], 1, 1e-3);
  EXPECT_EQ(lengths[2], 0);
  EXPECT_EQ(lengths[3], 0);
}

TEST(ImageWays, TellHowMuchLongerStepsAreBehindATurnOnTheSpot) {
  const CloudDrive drive = DriveThroughCloud();
  const std::vector<Way> found = Find(drive);
  const std::vector<Eigen::Vector3d> centers = CentersAlong(30, found);
  const double scale = LengthOf(centers, 0, 12) / 1.2;
  EXPECT_NEAR(LengthOf(centers, 17, 29) / scale, 3.6, 0.1);
  EXPECT_LT(LengthOf(centers, 12, 17) / scale, 0.01);
  for (int i = 0; i < 30; ++i) EXPECT_LT((centers[i] / scale - drive.Center(i)).norm(), 0.1) << i;
}

TEST(ImageWays, WeighAsMuchAsMatchesIfAsked) {
  const CloudDrive drive = DriveThroughCloud();
  const std::vector<Way> plain = Find(drive), weighed = Find(drive, {}, 2, true);
  ASSERT_EQ(plain.size(), weighed.size());
  for (size_t w = 0; w < drive.pairs.size(); ++w) {
    EXPECT_EQ(plain[w].weight, 1);
    EXPECT_DOUBLE_EQ(weighed[w].weight / weighed[0].weight,
                     static_cast<double>(drive.pairs[w].matches.size()) /
                         static_cast<double>(drive.pairs[0].matches.size()));
    EXPECT_EQ(plain[w].way, weighed[w].way);
  }
}

TEST(ImageWays, MotionsGiveTheUnitAlsoWhereTheyAreMissing) {
  const CloudDrive drive = DriveThroughCloud();
  std::vector<ImageMotion> motions;
  for (int i = 1; i < 8; ++i)
    motions.push_back({i - 1, i, drive.cams_from_world[i] * drive.cams_from_world[i - 1].Inverse()});
  const std::vector<Way> found = Find(drive, motions);
  const std::vector<Eigen::Vector3d> centers = CentersAlong(30, found);
  // A ratio over a turn is known to some per cent, and 3.6 m follow.
  for (int i = 0; i < 30; ++i) EXPECT_LT((centers[i] - drive.Center(i)).norm(), i < 18 ? 0.05 : 0.2) << i;
}

// A motion is known of a pair whichever of its images comes first, and of two that no pair joins.
TEST(ImageWays, MotionsJoinWhatNoPairDoes) {
  CloudDrive drive = DriveThroughCloud();
  std::erase_if(drive.pairs, [](const ViewPair& pair) { return pair.image1 < 20 && pair.image2 >= 20; });
  std::vector<ImageMotion> motions = {
      {19, 20, drive.cams_from_world[20] * drive.cams_from_world[19].Inverse()},
      {21, 20, drive.cams_from_world[20] * drive.cams_from_world[21].Inverse()}};
  const std::vector<Eigen::Vector3d> centers = CentersAlong(30, Find(drive, motions));
  EXPECT_NEAR(LengthOf(centers, 19, 20), 0.3, 0.03);
  EXPECT_NEAR(LengthOf(centers, 21, 29), 2.4, 0.1);
}

TEST(ImageWays, APairThatIsWrongHasLittleSay) {
  CloudDrive drive = DriveThroughCloud();
  for (ViewPair& pair : drive.pairs) {
    if (pair.image1 == 5 && pair.image2 == 9) pair.cam2_from_cam1.translation = Eigen::Vector3d::UnitX();
  }
  const std::vector<Eigen::Vector3d> centers = CentersAlong(30, Find(drive));
  const double scale = LengthOf(centers, 0, 12) / 1.2;
  for (int i = 0; i < 30; ++i) EXPECT_LT((centers[i] / scale - drive.Center(i)).norm(), 0.1) << i;
}

TEST(ImageWays, SameForAnyNumberOfThreads) {
  const CloudDrive drive = DriveThroughCloud();
  const std::vector<Way> one = Find(drive, {}, 1), seven = Find(drive, {}, 7);
  ASSERT_EQ(one.size(), seven.size());
  for (size_t k = 0; k < one.size(); ++k) EXPECT_EQ(one[k].way, seven[k].way);
}

// Along x, one step after the other.
std::vector<Eigen::Vector3d> PlacesAlong(const std::vector<double>& lengths) {
  std::vector<Eigen::Vector3d> places = {Eigen::Vector3d::Zero()};
  for (const double length : lengths) places.emplace_back(places.back().x() + length, 0, 0);
  return places;
}

std::vector<std::pair<int, int>> StepsOf(const std::vector<double>& lengths) {
  std::vector<std::pair<int, int>> steps;
  for (int i = 0; i < std::ssize(lengths); ++i) steps.emplace_back(i, i + 1);
  return steps;
}

TEST(IsTorn, WhereOneStepIsMuchLongerThanMost) {
  // The camera turns on the spot in most of them.
  std::vector<double> lengths = {0, 0, 0, 0.01, 0, 0, 2, 2, 2, 2, 2, 9.9};
  EXPECT_FALSE(IsTorn(PlacesAlong(lengths), StepsOf(lengths)));
  lengths.back() = 10.1;
  EXPECT_TRUE(IsTorn(PlacesAlong(lengths), StepsOf(lengths)));
  EXPECT_FALSE(IsTorn({Eigen::Vector3d::Zero()}, {}));
}

// Twelve images a step apart, of which some are moved aside:
//                  7 8 9
//    0 1 2 ... 5 6       10 11
TEST(IsTornMore, WhereAMoveTearsAPartFromWhatComesBeforeIt) {
  const std::vector<double> lengths(11, 1);
  const auto places = PlacesAlong(lengths);
  const auto steps = StepsOf(lengths);
  const auto moved_by = [&](double way, int first, int last) {
    auto moved = places;
    for (int i = first; i <= last; ++i) moved[i].y() += way;
    return moved;
  };
  EXPECT_FALSE(IsTornMore(places, moved_by(4.8, 7, 9), steps));  // steps of 4.9
  EXPECT_TRUE(IsTornMore(places, moved_by(5, 7, 9), steps));     // of 5.1
  EXPECT_TRUE(IsTornMore(places, moved_by(5, 7, 11), steps));    // one of them
  EXPECT_FALSE(IsTornMore(places, moved_by(5, 0, 11), steps));   // the whole drive
  // What was torn may be mended, moved on, or part of it left behind, but not torn in more places.
  const auto torn = moved_by(8, 7, 11);
  EXPECT_FALSE(IsTornMore(torn, places, steps));
  EXPECT_FALSE(IsTornMore(torn, moved_by(8, 9, 11), steps));
  EXPECT_TRUE(IsTornMore(torn, moved_by(8, 7, 9), steps));
  EXPECT_FALSE(IsTornMore(places, moved_by(5, 7, 9), {}));  // in no order
}

// Images 3 to 5 hang on 2 by a step alone; the others' ways are twice as long as the places have them.
TEST(WithStepsOf, HoldWhatNoWayJoinsInTheUnitOfTheWays) {
  const std::vector<double> lengths = {1, 1, 1.5, 1, 1};
  std::vector<Way> ways;
  for (const int i : {0, 1, 3, 4}) ways.push_back({i, i + 1, {2, 0, 0}, 0.1});
  ways.push_back({2, 3, Eigen::Vector3d::Zero(), 2});  // a step of which nothing is known
  const std::vector<Way> with = WithStepsOf(PlacesAlong(lengths), StepsOf(lengths), ways);
  ASSERT_EQ(with.size(), ways.size() + 5);
  EXPECT_EQ(with[7].from, 2);
  EXPECT_EQ(with[7].to, 3);
  EXPECT_NEAR(with[7].way.x(), 3, 1e-12);
  EXPECT_NEAR(with[7].sigma, 0.1 + 0.3 * 3, 1e-12);
  const std::vector<Eigen::Vector3d> centers = CentersAlong(6, with);
  EXPECT_NEAR(centers[3].x() - centers[2].x(), 3, 0.6);
  EXPECT_NEAR(centers[5].x() - centers[3].x(), 4, 0.1);
}

TEST(WithStepsOf, AreNoneWhereNoWayHasALength) {
  const std::vector<double> lengths = {1, 1};
  const std::vector<Way> ways = {{0, 1, Eigen::Vector3d::Zero(), 0.5}, {1, 2, {1, 0, 0}, 0.1}};
  EXPECT_EQ(WithStepsOf(PlacesAlong({0, 0}), StepsOf(lengths), ways).size(), 2u);
  EXPECT_EQ(WithStepsOf(PlacesAlong(lengths), StepsOf(lengths), {ways[0]}).size(), 1u);
  EXPECT_EQ(WithStepsOf(PlacesAlong(lengths), StepsOf(lengths), ways).size(), 4u);
}

}  // namespace
}  // namespace cairn::reconstruct
