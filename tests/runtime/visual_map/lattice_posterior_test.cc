#include "runtime/visual_map/lattice_posterior.h"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/camera/camera_turn.h"
#include "core/geometry/pose.h"
#include "runtime/visual_map/visual_estimate.h"
#include "tests/runtime/visual_map/surveyed_room.h"

namespace cairn {
namespace {

TEST(KlDivergence, IsTheSourcesSumAndNotSymmetric) {
  const std::array<double, 2> p = {0.5, 0.5}, q = {0.25, 0.75};
  // sum of p log(p / q)
  EXPECT_NEAR(KlDivergence(p, q, 0), 0.5 * std::log(2) + 0.5 * std::log(2.0 / 3), 1e-15);
  EXPECT_NEAR(KlDivergence(q, p, 0), 0.25 * std::log(0.5) + 0.75 * std::log(1.5), 1e-15);
  EXPECT_GT(KlDivergence(p, q, 0), KlDivergence(q, p, 0) + 0.01);
  EXPECT_EQ(KlDivergence(p, p, 0), 0);
}

TEST(KlDivergence, MixesTheUniformDistributionIntoBoth) {
  const std::array<double, 4> p = {1, 0, 0, 0}, q = {0, 1, 0, 0};
  // With 0.2 of it the entries are 0.85 and 0.05.
  EXPECT_NEAR(KlDivergence(p, q, 0.2), 0.85 * std::log(17) - 0.05 * std::log(17), 1e-12);
  EXPECT_NEAR(KlDivergence(p, q, 1), 0, 1e-15);
  EXPECT_EQ(KlDivergence(p, q, 0), std::numeric_limits<double>::infinity());
  // What p does not have adds nothing.
  const std::array<double, 4> half = {0.5, 0.5, 0, 0};
  EXPECT_NEAR(KlDivergence(p, half, 0), std::log(2), 1e-15);
  EXPECT_EQ(KlDivergence(half, p, 0), std::numeric_limits<double>::infinity());
}

size_t NearestPlace(const Eigen::Vector2d& at) {
  const std::vector<Eigen::Vector2d>& places = Clean().visual->places();
  return std::min_element(places.begin(), places.end(),
                          [&](const auto& a, const auto& b) { return (a - at).norm() < (b - at).norm(); }) -
         places.begin();
}

TEST(LikeliestPlace, OfEqualOnesTheNearestToTheirMiddle) {
  const VisualMap& map = *Clean().visual;
  std::vector<double> at_place(map.places().size(), 0.001);
  EXPECT_EQ(map.places()[LikeliestPlace(map, at_place)], Eigen::Vector2d(2.5, 2));  // the middle of all
  at_place[0] = at_place[2] = at_place[1] = 0.1;  // side by side in the first row
  EXPECT_EQ(LikeliestPlace(map, at_place), 1);
  at_place[5] = 0.1 * (1 + 1e-6);
  EXPECT_EQ(LikeliestPlace(map, at_place), 5);
  at_place[1] = 0.1 * (1 + 1e-6) * (1 + 1e-12);  // rounding makes no place likelier: a tie of 1 and 5
  EXPECT_EQ(LikeliestPlace(map, at_place), 1);
}

TEST(PosteriorOnLattice, EveryImageHasOneEvenWithoutAMatch) {
  const VisualMap& map = *Clean().visual;
  const auto none = PosteriorOnLattice(map, {});
  ASSERT_TRUE(none.ok());
  EXPECT_EQ(none->num_matches, 0);
  for (const double share : none->at_place)
    EXPECT_NEAR(share, 1.0 / static_cast<double>(map.places().size()), 1e-12);

  // One landmark says something, too: EstimateVisualPose gives up (kTooFewMatches).
  auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.5, 2}, 0));
  seen.resize(1);
  const auto one = PosteriorOnLattice(map, seen);
  ASSERT_TRUE(one.ok());
  EXPECT_EQ(one->num_matches, 1);
  EXPECT_NEAR(std::accumulate(one->at_place.begin(), one->at_place.end(), 0.0), 1, 1e-9);
  EXPECT_GT(one->at_place[NearestPlace({2.5, 2})], 1.5 / static_cast<double>(map.places().size()));
  EXPECT_EQ(EstimateVisualPose(map, seen)->flag, VisualFlag::kTooFewMatches);
}

TEST(PosteriorOnLattice, HasNoElsewhereAndNothingOfFlags) {
  auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt({2.25, 1.75}, 0));
  const size_t truth = NearestPlace({2.25, 1.75});
  VisualEstimateOptions options;
  options.min_num_agreeing = 1000;
  const auto flagged = EstimateVisualPose(*Clean().visual, seen, options);
  ASSERT_TRUE(flagged.ok());
  ASSERT_EQ(flagged->flag, VisualFlag::kDisagree);
  EXPECT_LT(flagged->at_place[truth], 0.55);  // half of it is uniform
  const auto posterior = PosteriorOnLattice(*Clean().visual, seen, options);
  ASSERT_TRUE(posterior.ok());
  EXPECT_GT(posterior->at_place[truth], 0.99);
  EXPECT_EQ(LikeliestPlace(*Clean().visual, posterior->at_place), static_cast<int32_t>(truth));
  options.elsewhere_ratio = 0.99;
  EXPECT_EQ(PosteriorOnLattice(*Clean().visual, seen, options)->at_place, posterior->at_place);
}

TEST(PosteriorOnLattice, BadInputIsAnError) {
  EXPECT_EQ(PosteriorOnLattice(*Clean().visual, {{160, {1, 1, 1}}}).error().code,
            ErrorCode::kInvalidArgument);
  VisualEstimateOptions options;
  options.outlier_ratio = 0;
  EXPECT_FALSE(PosteriorOnLattice(*Clean().visual, {}, options).ok());
}

// The survey's map, but it does not know how far a turn moves the image: then cameras hardly turn, which
// keeps brute force short.
std::shared_ptr<const VisualMap> WithoutFocal() {
  VisualMapData data = Clean().room.rows.visual_map;
  data.focal_px = 0;
  VisualSurvey survey{.places = Clean().visual->places(),
                      .width_px = VisualRoom::kWidthPx,
                      .height_px = VisualRoom::kHeightPx};
  for (const MapImage& image : Clean().room.rows.images)
    survey.images.push_back(image.cam_from_world.Center().head<2>());
  return *VisualMap::Make(data, survey);
}

// p(x | z) from its definition (visual_estimate.h) alone: for each place and heading the sum over points of
// the place's square and over turns to the left of the product over matches of (1 - o) N + o U, over o U.
// REQUIRES: cameras that neither tilt nor rise
std::vector<double> BruteForcePosterior(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                                        const VisualEstimateOptions& options) {
  constexpr int kNumPoints = 9, kNumTurns = 121;
  const double space = 6.0 * map.image_width_px() * map.image_height_px();  // px^2 octaves of a wrong match
  const double max_left = RadFromDeg(options.heading_margin_deg);
  std::vector<double> posterior(map.places().size(), 0);
  for (size_t place = 0; place < map.places().size(); ++place) {
    for (int32_t heading = 0; heading < static_cast<int32_t>(map.headings_deg().size()); ++heading) {
      for (int point = 0; point < kNumPoints * kNumPoints; ++point) {
        const Eigen::Vector2d at =
            map.places()[place] +
            map.spacing_m() * Eigen::Vector2d((point % kNumPoints + 0.5) / kNumPoints - 0.5,
                                              (point / kNumPoints + 0.5) / kNumPoints - 0.5);
        std::vector<std::tuple<Eigen::Vector3d, Eigen::Vector3d, Eigen::Vector3d>> terms;
        for (const SeenLandmark& match : seen) {
          for (const VisualMap::Model& model : map.ModelsOf(match.landmark)) {
            const bool extends = std::any_of(
                model.extent.begin(), model.extent.end(),
                [&](const VisualMap::AtPlace& each) { return each.place == static_cast<int32_t>(place); });
            if (model.heading != heading || !extends) continue;
            Eigen::Vector3d own = match.seen, sigma(options.visual_sigma_px, options.visual_sigma_px,
                                                    options.visual_sigma_octaves);
            own.head<2>() -= map.middle_px();
            terms.emplace_back(own, model.interpolation.Predict(at).seen,
                               map.Variance(model, map.places()[place]) + Eigen::Vector3d(sigma.cwiseAbs2()));
          }
        }
        for (int turn = 0; turn < kNumTurns; ++turn) {
          const double left = max_left * (2.0 * turn / (kNumTurns - 1) - 1);
          double product = 1;
          for (const auto& [own, predicted, variance] : terms) {
            const auto shown = TurnedSight(predicted, CameraTurn(left), map.focal_px());
            if (!shown) continue;
            const Eigen::Vector3d error = *shown - own;
            const double normal = std::exp(-0.5 * (error.array().square() / variance.array()).sum()) /
                                  std::sqrt(std::pow(2 * std::numbers::pi, 3) * variance.prod());
            product *= 1 + (1 - options.outlier_ratio) / options.outlier_ratio * normal * space;
          }
          posterior[place] += product;
        }
      }
    }
  }
  const double sum = std::accumulate(posterior.begin(), posterior.end(), 0.0);
  for (double& share : posterior) share /= sum;
  return posterior;
}

TEST(PosteriorOnLattice, IsThatOfBruteForce) {
  const auto map = WithoutFocal();
  VisualEstimateOptions options;
  options.tilt_sigma_deg = 1e-3;
  options.height_sigma_m = 1e-4;
  options.heading_margin_deg = 8;
  options.num_subdivisions = 9;
  options.num_refined_places = 40;
  Random random(11);
  // From sure of a place to a posterior over many of them.  The estimator takes what agrees with a match for
  // normal about its maximum, also beyond the place's square: where that is about as wide as the square, up
  // to 0.19 of the mass lies elsewhere (also with 21 x 21 points and 321 turns here).
  for (const auto& [sigma_px, most] : {std::pair(8.0, 0.12), {12.0, 0.2}, {30.0, 0.02}}) {
    options.visual_sigma_px = sigma_px;
    options.visual_sigma_octaves = 0.05 * sigma_px / 4;
    for (int i = 0; i < 2; ++i) {
      const double truth_y = random.Uniform(1.35, 2.65), truth_x = random.Uniform(1.6, 3.4);
      const Eigen::Vector2d truth(truth_x, truth_y);
      auto seen = Clean().room.SeenLandmarks(VisualRoom::PoseAt(truth, 0));
      while (seen.size() > 6)
        seen.erase(seen.begin() + random.UniformInt(0, static_cast<int>(seen.size()) - 1));
      for (SeenLandmark& match : seen) {
        const double octaves = random.Normal(0, options.visual_sigma_octaves);
        const double y = random.Normal(0, sigma_px), x = random.Normal(0, sigma_px);
        match.seen += Eigen::Vector3d(x, y, octaves);
      }
      const std::vector<double> expected = BruteForcePosterior(*map, seen, options);
      const auto found = PosteriorOnLattice(*map, seen, options);
      ASSERT_TRUE(found.ok());
      double difference = 0;
      for (size_t place = 0; place < expected.size(); ++place)
        difference += 0.5 * std::abs(found->at_place[place] - expected[place]);
      EXPECT_LT(difference, most) << sigma_px << " px at " << truth.transpose();
    }
  }
}

// A survey with half a pixel of noise, and images with more and more of it.
struct NoisyErrors {
  double mean_m = 0, mean_nees = 0, lattice_m = 0, log_of_truth = 0;
  int num_fixes = 0;
};
NoisyErrors LocalizeNoisy(const Surveyed& survey, double noise_px) {
  constexpr int kNumImages = 24;
  VisualEstimateOptions options;
  options.visual_sigma_px = std::max(noise_px, 0.01);
  Random random(12);
  NoisyErrors errors;
  for (int i = 0; i < kNumImages; ++i) {
    const double truth_y = random.Uniform(1.25, 2.75), truth_x = random.Uniform(1.5, 3.5);
    const Eigen::Vector2d truth(truth_x, truth_y);
    const double heading = random.UniformInt(0, 3) * std::numbers::pi / 2;
    auto seen = survey.room.SeenLandmarks(VisualRoom::PoseAt(truth, heading));
    for (SeenLandmark& match : seen) {
      const double y = random.Normal(0, noise_px), x = random.Normal(0, noise_px);
      match.seen += Eigen::Vector3d(x, y, 0);
    }
    const auto pose = EstimateVisualPose(*survey.visual, seen, options);
    const auto lattice = PosteriorOnLattice(*survey.visual, seen, options);
    if (!pose.ok() || !lattice.ok()) continue;
    errors.lattice_m +=
        (survey.visual->places()[LikeliestPlace(*survey.visual, lattice->at_place)] - truth).norm() /
        kNumImages;
    errors.log_of_truth += std::log(lattice->at_place[NearestPlace(truth)] + 1e-12) / kNumImages;
    if (pose->flag != VisualFlag::kNone) continue;
    ++errors.num_fixes;
    Eigen::Vector3d error;
    error << pose->position - truth,
        std::remainder(RadFromDeg(pose->heading_deg) - heading, 2 * std::numbers::pi);
    errors.mean_m += error.head<2>().norm();
    errors.mean_nees += error.dot(pose->covariance.ldlt().solve(error));
  }
  errors.mean_m /= errors.num_fixes;
  errors.mean_nees /= errors.num_fixes;
  return errors;
}

TEST(EstimateVisualPose, NoiseMakesErrorsThatTheCovarianceKnows) {
  const Surveyed survey(0.5);
  NoisyErrors before;
  for (const double noise_px : {0.0, 1.0, 4.0}) {
    const NoisyErrors errors = LocalizeNoisy(survey, noise_px);
    EXPECT_EQ(errors.num_fixes, 24) << noise_px;
    EXPECT_GT(errors.mean_m, before.mean_m);
    // The mean of the squares of three normal numbers' sum is 3; shared errors make covariances wider.
    EXPECT_LT(errors.mean_nees, 4.5) << noise_px;
    // Of a square with sides of 0.25 m the mean distance from the middle is 0.0957 m.
    EXPECT_NEAR(errors.lattice_m, 0.0957, 0.02) << noise_px;
    EXPECT_GT(errors.log_of_truth, -0.7) << noise_px;
    before = errors;
  }
  EXPECT_LT(before.mean_m, 0.05);
}

}  // namespace
}  // namespace cairn
