#include "runtime/localize/place_evidence.h"

#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

// Landmarks 4 m in front of a camera at the origin that looks along +y, at these columns and rows of its
// image of 100 x 100 px, and two survey images.
class EvidenceOfPlaceTest : public testing::Test {
 protected:
  EvidenceOfPlaceTest() {
    query_.camera.model = CameraModel::kSimplePinhole;
    query_.camera.width = query_.camera.height = 100;
    query_.camera.params = {100, 50, 50};
    rows_.cameras = {query_.camera};
    for (const auto& [column, row] : {std::pair(5, 5), {45, 5}, {95, 5}, {5, 95}, {7, 95}, {130, 50}}) {
      rows_.landmarks.push_back({.position = {(column - 50) * 0.04, 4, -(row - 50) * 0.04}});
    }
    rows_.descriptors = DescriptorMatrix::Zero(6, kSiftDescriptorDim);
    AddImage({0, 0, 0}, 90, {0, 1, 2, 3, 5});
  }

  void AddImage(const Eigen::Vector3d& center, double heading_deg, std::vector<LandmarkIdx> seen) {
    rows_.images.push_back({.image_id = static_cast<ImageId>(rows_.images.size() + 1),
                            .camera_id = 1,
                            .cam_from_world = PoseAt(center, heading_deg),
                            .landmarks = std::move(seen)});
  }

  PlaceEvidence Evidence(const std::vector<LandmarkIdx>& found, int num_cells = 10) {
    const auto map = *Map::FromRows(rows_);
    PooledVector<Correspondence> matches;
    for (const LandmarkIdx landmark : found)
      matches.push_back({static_cast<KeypointIdx>(matches.size()), landmark});
    return *EvidenceOfPlace(*map, query_, PoseAt({0, 0, 0}, 90), **map->AllLandmarks(), matches, 17,
                            num_cells);
  }

  Query query_;
  MapRows rows_;
};

TEST_F(EvidenceOfPlaceTest, ExpectsWhatTheSurveyImageThereSeesInTheImage) {
  const PlaceEvidence evidence = Evidence({1, 2, 4});
  EXPECT_DOUBLE_EQ(evidence.num_expected, 4);  // 0 to 3; 5 is beside the image, and 4 is not seen
  EXPECT_EQ(evidence.num_matched, 17);
  EXPECT_EQ(evidence.num_cells_expected, 4);
  EXPECT_EQ(evidence.num_cells_found, 2);  // 4 is found where 3 is expected, but is not expected there
  EXPECT_EQ(Evidence({1, 2, 4}, 2).num_cells_expected, 3);  // 0 and 1 share a quarter
  EXPECT_EQ(Evidence({1, 2, 4}, 2).num_cells_found, 2);
  EXPECT_EQ(Evidence({0, 1}, 1).num_cells_expected, 1);
}

TEST_F(EvidenceOfPlaceTest, NearImagesCountMore) {
  // A tenth of the depth aside, and 15 degrees turned: 2 as the square of the distance.
  AddImage({0.4, 0, 0}, 105, {0, 4});
  const PlaceEvidence evidence = Evidence({0});
  // Weights 1 and 1 / 3: 0 is seen by both, 1 to 3 by the first, 4 by the second.
  EXPECT_NEAR(evidence.num_expected, 1 + 3 * 0.75 + 0.25, 1e-9);
  EXPECT_EQ(evidence.num_cells_expected, 4);
  EXPECT_NEAR(evidence.squared_distance, 0, 1e-12);
  rows_.images.erase(rows_.images.begin());
  EXPECT_NEAR(Evidence({0}).squared_distance, 2, 1e-6);
}

TEST_F(EvidenceOfPlaceTest, OnlyTheNearestImagesCount) {
  for (int i = 0; i < 7; ++i) AddImage({0, 0, 0}, 90, {0, 1, 2, 3, 5});
  const PlaceEvidence before = Evidence({0});
  AddImage({0.01, 0, 0}, 90, {4});  // the ninth
  EXPECT_EQ(Evidence({0}).num_expected, before.num_expected);
  EXPECT_EQ(before.num_expected, 4);
}

TEST_F(EvidenceOfPlaceTest, WhatWasNotLookedForIsNotExpected) {
  // Sizes of 1, 2, 4 and 8 px at 4 m; of the last one it is not known.
  for (const LandmarkIdx landmark : {0, 1, 2, 3, 4})
    rows_.landmarks[landmark].scale_m = 0.04 * (1 << landmark);
  rows_.landmarks[3].scale_m = 0;
  query_.min_scale_px = 2;
  const PlaceEvidence evidence = Evidence({0, 1, 2});
  EXPECT_DOUBLE_EQ(evidence.num_expected, 2);  // 1 and 2
  EXPECT_EQ(evidence.num_cells_expected, 2);
  EXPECT_EQ(evidence.num_cells_found, 2);
  query_.min_scale_px = 2.001;
  EXPECT_DOUBLE_EQ(Evidence({0, 1, 2}).num_expected, 1);
}

// A rig's second camera is turned by 15 degrees, for which no survey image is: it sees 1, 2 and 5, and counts
// half as much.
TEST_F(EvidenceOfPlaceTest, CamerasOfARigCountByHowNearTheSurveyIsToThem) {
  std::vector<Query> rig = {query_, query_};
  rig[1].cam_from_rig = PoseAt({0, 0, 0}, 75) * PoseAt({0, 0, 0}, 90).Inverse();
  const auto map = *Map::FromRows(rows_);
  PooledVector<Correspondence> matches = {{.keypoint = 0, .landmark = 0}, {.keypoint = 1, .landmark = 1}};
  for (const int turned : {1, 0}) {
    for (Correspondence& match : matches) match.image = 1 - turned;
    const PlaceEvidence evidence =
        *EvidenceOfPlace(*map, Sighting(std::span<const Query>(rig)), PoseAt({0, 0, 0}, 90),
                         **map->AllLandmarks(), matches, 17, 10);
    EXPECT_NEAR(evidence.squared_distance, 0, 1e-9);
    EXPECT_NEAR(evidence.num_expected, 4 + 0.5 * 3, 1e-6);
    EXPECT_NEAR(evidence.num_cells_expected, 4 + 0.5 * 3, 1e-6);
    EXPECT_NEAR(evidence.num_cells_found, 2, 1e-6);
    std::swap(rig[0], rig[1]);
  }
}

TEST_F(EvidenceOfPlaceTest, WithoutAnythingFoundNothingIsKnown) {
  const PlaceEvidence evidence = Evidence({});
  EXPECT_EQ(evidence.num_expected, 0);
  EXPECT_EQ(evidence.num_cells_expected, 0);
}

TEST(OddsOfPlace, MoreOfWhatIsExpectedIsLikelier) {
  const PlaceEvidence half{
      .num_expected = 60, .num_matched = 30, .num_cells_expected = 20, .num_cells_found = 10};
  PlaceEvidence fewer = half, emptier = half, richer = half;
  fewer.num_matched = 29;
  emptier.num_cells_found = 9;
  richer.num_expected = 61;
  for (const PlaceEvidence& less : {fewer, emptier, richer}) EXPECT_LT(OddsOfPlace(less), OddsOfPlace(half));
  PlaceEvidence twice = half;
  twice.num_expected *= 2;
  twice.num_matched *= 2;
  EXPECT_DOUBLE_EQ(OddsOfPlace(twice), OddsOfPlace(half));                // ratios alone
  EXPECT_NEAR(OddsOfPlace({}), std::exp(2.6) / std::pow(40, 3.4), 1e-9);  // none is half of one, of twenty
  EXPECT_TRUE(std::isfinite(OddsOfPlace({.num_expected = 0, .num_matched = 100000})));
}

TEST(OddsOfPlace, FarFromTheSurveyNothingIsCertain) {
  PlaceEvidence all{.num_expected = 60, .num_matched = 60, .num_cells_expected = 20, .num_cells_found = 20};
  EXPECT_DOUBLE_EQ(OddsOfPlace(all), 3000);
  all.squared_distance = 3;
  EXPECT_DOUBLE_EQ(OddsOfPlace(all), 3000.0 / 8);
  PlaceEvidence little{
      .num_expected = 60, .num_matched = 10, .num_cells_expected = 20, .num_cells_found = 10};
  const double odds = OddsOfPlace(little);
  EXPECT_NEAR(odds, std::exp(2.6 + 8 * 0.5) / std::pow(6, 3.4), 1e-9);
  little.squared_distance = 3;
  EXPECT_EQ(OddsOfPlace(little), odds);  // no more than before
}

TEST(OddsOfPlace, FewThatAreAllFoundAreNotMany) {
  const PlaceEvidence few{.num_expected = 8, .num_matched = 8, .num_cells_expected = 8, .num_cells_found = 4};
  PlaceEvidence twenty = few;
  twenty.num_expected = 20;
  EXPECT_DOUBLE_EQ(OddsOfPlace(few), OddsOfPlace(twenty));
  twenty.num_expected = 21;
  EXPECT_GT(OddsOfPlace(few), OddsOfPlace(twenty));
}

// Measured: the medians of fixes in a map of another floor of the building, and of this one.
TEST(OddsOfPlace, ADoorOfAnotherFloorIsNoPlace) {
  EXPECT_LT(ProbabilityAmong(OddsOfPlace({205, 9, 0.03, 24, 14}), 0), 0.1);
  EXPECT_GT(ProbabilityAmong(OddsOfPlace({176, 145, 0.02, 24, 21}), 0), 0.999);
}

TEST(ProbabilityAmong, SharesOneAmongExclusiveExplanations) {
  EXPECT_DOUBLE_EQ(ProbabilityAmong(1, 0), 0.5);
  EXPECT_DOUBLE_EQ(ProbabilityAmong(9, 0), 0.9);
  EXPECT_DOUBLE_EQ(ProbabilityAmong(9, 10), 0.45);
  EXPECT_DOUBLE_EQ(ProbabilityAmong(0, 3), 0);
}

}  // namespace
}  // namespace cairn
