#include "stages/match_features/two_views/guided_match.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/geometry/relative_pose.h"
#include "core/geometry/two_view_error.h"
#include "tests/match_features/two_view_scene.h"

namespace cairn::match_features {
namespace {

constexpr double kMaxError = 2.0 / 500;

// A scene whose points look alike in groups of three: blind matching fails the ratio test on all of them.
TwoViewScene RepeatedStructure(int num_points) {
  TwoViewScene scene = MakeTwoViewScene({.num_points = num_points});
  scene.descriptors1.resize(num_points, kSiftDescriptorDim);
  scene.descriptors2.resize(num_points, kSiftDescriptorDim);
  for (int i = 0; i < num_points; ++i) {
    FillDescriptor(i / 3, &scene.descriptors1, i);
    FillDescriptor(i / 3, &scene.descriptors2, i);
  }
  return scene;
}

Eigen::Matrix3d TrueEssential(const TwoViewScene& scene) {
  return EssentialMatrix(scene.cam2_from_world * scene.cam1_from_world.Inverse());
}

std::vector<Match> Guide(const TwoViewScene& scene, const Eigen::Matrix3d& M,
                         const std::vector<Match>& inliers) {
  return GuideByEpipolarLines({&scene.keypoints1, &scene.bearings1, &scene.descriptors1},
                              {&scene.keypoints2, &scene.bearings2, &scene.descriptors2}, M, kMaxError,
                              inliers, {});
}

// Brute force over all pairs of keypoints: best two of both sides among the candidates.
template <typename IsCandidate>
std::vector<Match> GuideByBruteForce(const TwoViewScene& scene, const std::vector<Match>& inliers,
                                     IsCandidate is_candidate) {
  const GuidedMatchOptions options;
  std::vector<Match> matches = inliers;
  const auto dot = [&](int i, int j) {
    return scene.descriptors1.row(i).cast<int>().dot(scene.descriptors2.row(j).cast<int>());
  };
  const auto angle = [](int d) { return std::acos(std::min(1.0, d / 262144.0)); };
  const auto is_best = [&](int i, int j) {
    const double own = angle(dot(i, j));
    if (own > options.max_angle_rad) return false;
    for (size_t k = 0; k < scene.bearings2.size(); ++k) {
      if (static_cast<int>(k) != j && is_candidate(i, k) && own > options.max_ratio * angle(dot(i, k)))
        return false;
    }
    for (size_t k = 0; k < scene.bearings1.size(); ++k) {
      if (static_cast<int>(k) != i && is_candidate(k, j) && own > options.max_ratio * angle(dot(k, j)))
        return false;
    }
    return true;
  };
  for (uint32_t i = 0; i < scene.bearings1.size(); ++i) {
    for (uint32_t j = 0; j < scene.bearings2.size(); ++j) {
      const bool is_taken = std::any_of(inliers.begin(), inliers.end(),
                                        [&](const Match& m) { return m.idx1 == i || m.idx2 == j; });
      if (!is_taken && is_candidate(i, j) && is_best(i, j)) matches.push_back({i, j});
    }
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

TEST(GuidedMatch, FindsRepeatedStructureThatTheRatioTestRefuses) {
  const TwoViewScene scene = RepeatedStructure(90);
  const std::vector<Match> inliers(scene.matches.begin(), scene.matches.begin() + 10);
  const std::vector<Match> matches = Guide(scene, TrueEssential(scene), inliers);
  int num_true = 0;
  for (const Match& match : matches) num_true += match.idx1 == match.idx2 ? 1 : 0;
  EXPECT_GE(num_true, 75);  // two look-alikes share an epipolar line now and then
  EXPECT_GE(num_true, static_cast<int>(matches.size()) - 2);
  EXPECT_TRUE(std::is_sorted(matches.begin(), matches.end()));
}

TEST(GuidedMatch, AgreesWithBruteForceOverAllPairs) {
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    TwoViewScene scene = RepeatedStructure(150);
    Random random(seed);
    // Epipoles inside and outside of the images: forward and sideways motion.
    const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.2 * random.Uniform(), Eigen::Vector3d::UnitX())),
                    Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 0.2), seed % 2 ? 3.0 : 0.1)};
    const Eigen::Matrix3d E = EssentialMatrix(pose);
    scene.cam2_from_world = pose;
    for (int i = 0; i < 150; ++i) {
      const Eigen::Vector3d point = scene.bearings1[i] * random.Uniform(1, 8);
      scene.bearings2[i] = (pose * point).normalized();
    }
    std::vector<Match> inliers;
    for (uint32_t i = 0; i < 150; i += 15) inliers.push_back({i, i});
    const Eigen::Vector3d t = pose.translation.normalized();
    const auto is_candidate = [&](int i, int j) {
      if (!(SquaredSampsonError(E, scene.bearings1[i], scene.bearings2[j]) <= kMaxError * kMaxError))
        return false;
      // Same side of the baseline, except at the epipole, where sides lose their meaning.
      const Eigen::Vector3d n1 = t.cross(pose.rotation * scene.bearings1[i]),
                            n2 = t.cross(scene.bearings2[j]);
      return n1.dot(n2) > 0 || std::min(n1.norm(), n2.norm()) < 2 * kMaxError;
    };
    EXPECT_EQ(Guide(scene, E, inliers), GuideByBruteForce(scene, inliers, is_candidate)) << "seed " << seed;
  }
}

TEST(GuidedMatch, MatchesChangeScaleAndOrientationAsTheInliersDo) {
  TwoViewScene scene = RepeatedStructure(90);
  for (Keypoint& keypoint : scene.keypoints2) {  // nearer, and the camera rolled
    keypoint.scale *= 3;
    keypoint.orientation += 2.8F;
  }
  const std::vector<Match> inliers(scene.matches.begin(), scene.matches.begin() + 10);
  const std::vector<Match> all = Guide(scene, TrueEssential(scene), inliers);
  EXPECT_GE(all.size(), 75u);
  scene.keypoints2[all[20].idx2].scale *= 1.6F;
  scene.keypoints2[all[30].idx2].scale /= 1.6F;
  scene.keypoints2[all[40].idx2].orientation += 0.6F;
  scene.keypoints2[all[50].idx2].orientation -= 0.6F;
  scene.keypoints2[all[60].idx2].orientation += 6.3F;  // a whole turn
  std::vector<Match> expected = all;
  for (const int i : {50, 40, 30, 20}) expected.erase(expected.begin() + i);
  EXPECT_EQ(Guide(scene, TrueEssential(scene), inliers), expected);
}

TEST(GuidedMatch, SignAndScaleOfTheMatrixDoNotMatter) {
  const TwoViewScene scene = RepeatedStructure(90);
  const std::vector<Match> inliers(scene.matches.begin(), scene.matches.begin() + 10);
  const Eigen::Matrix3d E = TrueEssential(scene);
  EXPECT_EQ(Guide(scene, E, inliers), Guide(scene, -3 * E, inliers));
}

TEST(GuidedMatch, HomographyAgreesWithBruteForce) {
  TwoViewScene scene = RepeatedStructure(150);
  const Eigen::Matrix3d H = Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.6, 0.8, 0)).toRotationMatrix();
  for (int i = 0; i < 150; ++i) scene.bearings2[i] = H * scene.bearings1[i];
  const std::vector<Match> inliers(scene.matches.begin(), scene.matches.begin() + 5);
  const auto is_candidate = [&](int i, int j) {
    return SquaredTransferError(H, scene.bearings1[i], scene.bearings2[j]) <= kMaxError * kMaxError;
  };
  const std::vector<Match> matches = GuideByHomography(
      {&scene.keypoints1, &scene.bearings1, &scene.descriptors1},
      {&scene.keypoints2, &scene.bearings2, &scene.descriptors2}, H, kMaxError, inliers, {});
  EXPECT_EQ(matches, GuideByBruteForce(scene, inliers, is_candidate));
  EXPECT_GE(matches.size(), 140u);
}

TEST(GuidedMatch, KeypointsWithoutBearingAreNoCandidates) {
  TwoViewScene scene = RepeatedStructure(30);
  const std::vector<Match> inliers(scene.matches.begin(), scene.matches.begin() + 5);
  for (int i = 10; i < 20; ++i)
    scene.bearings2[i] = scene.bearings1[i] =
        Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  for (const Match& match : Guide(scene, TrueEssential(scene), inliers)) {
    EXPECT_TRUE(match.idx1 < 10 || match.idx1 >= 20);
    EXPECT_TRUE(match.idx2 < 10 || match.idx2 >= 20);
  }
}

TEST(GuidedMatch, KeepsInliersAndOneMatchPerKeypoint) {
  const TwoViewScene scene = RepeatedStructure(90);
  const std::vector<Match> inliers(scene.matches.begin(), scene.matches.begin() + 10);
  const std::vector<Match> matches = Guide(scene, TrueEssential(scene), inliers);
  EXPECT_TRUE(std::includes(matches.begin(), matches.end(), inliers.begin(), inliers.end()));
  std::vector<int> uses1(90), uses2(90);
  for (const Match& match : matches) {
    EXPECT_EQ(++uses1[match.idx1], 1);
    EXPECT_EQ(++uses2[match.idx2], 1);
  }
}

TEST(VerifyPair, GuidedMatchingAddsMatchesOfTheModelOnly) {
  const TwoViewScene scene = RepeatedStructure(120);
  const std::vector<Match> putative(scene.matches.begin(), scene.matches.begin() + 30);
  ViewForVerification view1 = scene.View1(scene.cam1_from_world), view2 = scene.View2(scene.cam2_from_world);
  const size_t num_blind = VerifyPair(view1, view2, putative, {}).inliers.size();
  view1.descriptors = &scene.descriptors1;
  view2.descriptors = &scene.descriptors2;
  const TwoViewGeometry guided = VerifyPair(view1, view2, putative, {});
  EXPECT_LE(num_blind, 30u);
  EXPECT_GE(guided.inliers.size(), 100u);
  for (const Match& match : guided.inliers) {
    EXPECT_LE(
        std::sqrt(SquaredSampsonError(guided.E, scene.bearings1[match.idx1], scene.bearings2[match.idx2])),
        kMaxError * (1 + 1e-9));
  }
}

}  // namespace
}  // namespace cairn::match_features
