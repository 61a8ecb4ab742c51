#include "core/vocabulary/rerank_places.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/random.h"
#include "tests/option_limits.h"

namespace cairn::build_vocabulary {
namespace {

Camera SceneCamera() {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {320, 320, 320, 240};
  return camera;
}

// 300 things at random in a room of 8 x 3 x 8 m, each with a look of its own.
class Room {
 public:
  explicit Room(uint64_t seed) {
    Random random(seed);
    descriptors_.resize(kNumPoints, kSiftDescriptorDim);
    for (int i = 0; i < kNumPoints; ++i) {
      points_.emplace_back(random.Uniform(-4, 4), random.Uniform(-1.5, 1.5), random.Uniform(2, 8));
      Eigen::Matrix<double, 1, kSiftDescriptorDim> values;
      for (int d = 0; d < kSiftDescriptorDim; ++d)
        values[d] = random.Uniform() < 0.3 ? std::abs(random.Normal(0, 1)) : 0;
      values *= 500 / values.norm();
      for (int d = 0; d < kSiftDescriptorDim; ++d)
        descriptors_(i, d) = static_cast<uint8_t>(std::min(255.0, values[d]));
    }
  }

  // What a camera at (x, z) that looks along +z sees; pixels off by noise_px.
  Features See(double x, double z, double noise_px = 0.3) const {
    Random random(3);
    Features features;
    std::vector<int> seen;
    for (int i = 0; i < kNumPoints; ++i) {
      const Eigen::Vector3d point = points_[i] - Eigen::Vector3d(x, 0, z);
      if (point.z() < 0.5) continue;
      const auto pixel = ImageFromCamera(SceneCamera(), point);
      if (!pixel || pixel->x() < 0 || pixel->x() > 640 || pixel->y() < 0 || pixel->y() > 480) continue;
      seen.push_back(i);
      features.keypoints.push_back({static_cast<float>(pixel->x() + random.Normal(0, noise_px)),
                                    static_cast<float>(pixel->y() + random.Normal(0, noise_px)), 2, 0});
    }
    features.descriptors.resize(static_cast<Eigen::Index>(seen.size()), kSiftDescriptorDim);
    for (size_t row = 0; row < seen.size(); ++row)
      features.descriptors.row(static_cast<Eigen::Index>(row)) = descriptors_.row(seen[row]);
    return features;
  }
  PlaceView View(double x, double z) const { return MakePlaceView(See(x, z), SceneCamera()); }

 private:
  static constexpr int kNumPoints = 300;
  std::vector<Eigen::Vector3d> points_;
  DescriptorMatrix descriptors_;
};

std::vector<int> Order(const std::vector<RerankedPlace>& places) {
  std::vector<int> order;
  for (const RerankedPlace& place : places) order.push_back(place.candidate);
  return order;
}

std::vector<RerankedPlace> Rerank(const PlaceView& query, const std::vector<PlaceView>& views,
                                  const RerankOptions& options = {}, int num_threads = 1) {
  std::vector<const PlaceView*> candidates;
  for (const PlaceView& view : views) candidates.push_back(&view);
  const auto places = RerankPlaces(query, candidates, options, num_threads);
  EXPECT_TRUE(places.ok());
  return *places;
}

TEST(RerankPlaces, PutsTheNearestViewOfTheSameThingsFirst) {
  const Room room(1);
  // Farther back sees more: given first, as words would.  All from 1.2 m, 0.6 m, 0.2 m behind the query.
  const auto places = Rerank(room.View(0, 1), {room.View(0, -0.2), room.View(0, 0.4), room.View(0, 0.8)});
  EXPECT_EQ(Order(places), (std::vector<int>{2, 1, 0}));
  EXPECT_LT(places[0].baseline_ratio, places[1].baseline_ratio);
  EXPECT_LT(places[1].baseline_ratio, places[2].baseline_ratio);
}

TEST(RerankPlaces, MeasuresTheBaselineInDistancesOfWhatIsSeen) {
  // A metre to the left of things whose median distance is known.
  const Room room(1);
  const PlaceView query = room.View(0, 0);
  const auto place = VerifyPlace(query, room.View(-1, 0), {});
  ASSERT_TRUE(place.is_verified());
  // Things fill 2 to 8 m along the axis, those of both views lie 5 m or a little more away.
  EXPECT_GT(place.baseline_ratio, 1 / 6.5);
  EXPECT_LT(place.baseline_ratio, 1 / 4.5);
  // From the same place, and turned nowhere: none.
  EXPECT_LT(VerifyPlace(query, room.View(0, 0), {}).baseline_ratio, 0.02);
}

TEST(RerankPlaces, ScoresTheSameImageOneAlsoTurned) {
  // There is no essential matrix without a baseline.
  const Room room(1);
  PlaceView turned = room.View(0, 0);
  for (int i = 0; i < 2; ++i) {
    const RerankedPlace place = VerifyPlace(room.View(0, 0), turned, {});
    ASSERT_TRUE(place.is_verified());
    EXPECT_EQ(place.num_inliers, static_cast<int>(turned.bearings.size()));
    EXPECT_EQ(place.baseline_ratio, 0);
    EXPECT_NEAR(place.score, 1, 1e-12);
    for (Eigen::Vector3d& bearing : turned.bearings)
      bearing = Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitY()) * bearing;
  }
}

// Of a camera that moved sideways, epipolar lines are level.
TEST(RerankPlaces, CountsWhatLiesOnItsEpipolarLine) {
  const Room room(1);
  const PlaceView query = room.View(0, 0);
  PlaceView aside = room.View(-1, 0);
  const int num_all = VerifyPlace(query, aside, {}).num_inliers;
  ASSERT_GT(num_all, 60);
  for (size_t i = 0; i < aside.bearings.size(); i += 4)
    aside.bearings[i] = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) * aside.bearings[i];
  const int num_left = VerifyPlace(query, aside, {}).num_inliers;
  EXPECT_LT(num_left, 0.85 * num_all);
  EXPECT_GT(num_left, 0.65 * num_all);
}

TEST(RerankPlaces, NeedsAsManyInliersAsItIsTold) {
  const Room room(1);
  const PlaceView view = room.View(0, 0);
  RerankOptions options;
  options.min_num_inliers = VerifyPlace(view, view, options).num_inliers;
  ASSERT_EQ(options.min_num_inliers, static_cast<int>(view.bearings.size()));
  EXPECT_TRUE(VerifyPlace(view, view, options).is_verified());
  ++options.min_num_inliers;
  EXPECT_FALSE(VerifyPlace(view, view, options).is_verified());
}

TEST(RerankPlaces, LeavesWhatIsNotVerifiedAsTheWordsHadIt) {
  const Room room(1), other(2);
  const auto places =
      Rerank(room.View(0, 0), {other.View(0, 0), other.View(0, 1), room.View(0, 0.5), other.View(1, 0)});
  EXPECT_EQ(Order(places), (std::vector<int>{2, 0, 1, 3}));
  EXPECT_TRUE(places[0].is_verified());
  EXPECT_FALSE(places[1].is_verified());
  EXPECT_EQ(places[1].score, 0);
  EXPECT_EQ(places[1].baseline_ratio, -1);
}

TEST(RerankPlaces, LooksAtTheFirstCandidatesOnly) {
  const Room room(1), other(2);
  RerankOptions options;
  options.num_candidates = 1;
  EXPECT_EQ(Order(Rerank(room.View(0, 0), {other.View(0, 0), room.View(0, 0)}, options)),
            (std::vector<int>{0, 1}));
  options.num_candidates = 0;
  EXPECT_FALSE(Rerank(room.View(0, 0), {room.View(0, 0)}, options)[0].is_verified());
}

TEST(RerankPlaces, IsTheSameForAnyNumberOfThreads) {
  const Room room(1);
  std::vector<PlaceView> views;
  for (int i = 0; i < 8; ++i) views.push_back(room.View(0.2 * i - 0.7, 0.3 * (i % 3)));
  const auto one = Rerank(room.View(0, 0), views, {}, 1), many = Rerank(room.View(0, 0), views, {}, 4);
  ASSERT_EQ(Order(one), Order(many));
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].score, many[i].score);
}

TEST(RerankPlaces, TakesBlankImagesAndUndefinedBearings) {
  const Room room(1);
  const PlaceView blank = MakePlaceView({}, SceneCamera());
  EXPECT_FALSE(VerifyPlace(blank, room.View(0, 0), {}).is_verified());
  EXPECT_FALSE(VerifyPlace(room.View(0, 0), blank, {}).is_verified());
  EXPECT_TRUE(Rerank(room.View(0, 0), {}).empty());
  PlaceView undefined = room.View(0, 0);
  for (Eigen::Vector3d& bearing : undefined.bearings) bearing.setConstant(std::nan(""));
  EXPECT_FALSE(VerifyPlace(room.View(0, 0), undefined, {}).is_verified());
  RerankOptions bad;
  bad.min_num_inliers = 5;
  EXPECT_EQ(RerankPlaces(blank, {}, bad, 1).error().code, ErrorCode::kInvalidArgument);
}

TEST(RerankPlaces, OptionsHaveLimits) {
  ExpectLimits<RerankOptions>({{"num_candidates", "0", "-1"},
                               {"max_ratio", "0.001", "0.0009", "1", "1.001"},
                               {"max_angle_rad", "0.001", "0.0009"},
                               {"max_epipolar_error_px", "0.001", "0.0009"},
                               {"min_num_inliers", "6", "5"},
                               {"baseline_ratio", "0.001", "0.0009"},
                               {"max_num_samples", "1", "0"}});
}

}  // namespace
}  // namespace cairn::build_vocabulary
