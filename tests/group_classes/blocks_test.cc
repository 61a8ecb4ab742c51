#include "stages/group_classes/adjust/blocks.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

// Cameras in a row, 0.3 m apart, that look ahead at points above and between them; image i sees points i to
// i + 3, as its keypoints 0 to 3.
struct Row {
  MatchedFeatures matched;
  PosedImages posed;
  std::vector<Track> tracks;
};

Row MakeRow(int num_images) {
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = camera.height = 1000;
  camera.params = {500, 500, 500};
  Row row;
  row.posed.cameras = {camera};
  row.tracks.resize(num_images + 3);
  for (int i = 0; i < num_images; ++i) {
    Pose pose;
    pose.translation = Eigen::Vector3d(-0.3 * i, 0, 0);
    row.posed.feature_idx.push_back(i);
    row.posed.camera_idx.push_back(0);
    row.posed.stated.push_back(pose);
    row.posed.way_m.push_back(i == 0 ? 0 : 0.3);
    Features features;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d point(0.3 * (i + k) - 0.5, 0.1 * ((i + k) % 3), 2);
      const Eigen::Vector2d pixel = *ImageFromCamera(camera, pose * point);
      features.keypoints.push_back({static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2, 0});
      row.tracks[i + k].push_back({i, static_cast<KeypointIdx>(k)});
    }
    row.matched.features.push_back(std::move(features));
  }
  row.posed.poses = row.posed.stated;
  return row;
}

TEST(Blocks, HaveEveryImageOnceAndOtherBordersInEachRound) {
  const Row row = MakeRow(100);
  std::set<std::vector<std::vector<int32_t>>> rounds;
  EXPECT_THAT(BlocksOfRound(row.posed, 0, 34), ElementsAre(SizeIs(33), SizeIs(33), SizeIs(34)));
  EXPECT_THAT(BlocksOfRound(row.posed, 0, 33), ElementsAre(SizeIs(25), SizeIs(25), SizeIs(25), SizeIs(25)));
  EXPECT_EQ(BlocksOfRound(row.posed, 0, 50).size(), 2u);
  for (int round = 0; round < 3; ++round) {
    const auto blocks = BlocksOfRound(row.posed, round, 30);
    EXPECT_EQ(BlocksOfRound(row.posed, round, 30), blocks);
    std::vector<int32_t> all;
    for (const std::vector<int32_t>& block : blocks) {
      EXPECT_LE(block.size(), 30u);
      EXPECT_EQ(block.back() - block.front() + 1, static_cast<int>(block.size()));  // a piece of the row
      all.insert(all.end(), block.begin(), block.end());
    }
    std::sort(all.begin(), all.end());
    ASSERT_EQ(all.size(), 100u);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(all[i], i);
    rounds.insert(blocks);
  }
  EXPECT_EQ(rounds.size(), 3u);
}

TEST(Blocks, AreOfPosesAsTheyAreByNow) {
  // Stated in a row, found in two heaps.
  Row row = MakeRow(20);
  for (int i = 0; i < 20; ++i) row.posed.poses[i].translation.x() = i % 2 == 0 ? 0.01 * i : 50 + 0.01 * i;
  const std::vector<int32_t> first = BlocksOfRound(row.posed, 1, 12).front();
  const auto is_odd = [](int32_t i) {
    return i % 2 == 1;
  };  // those have the larger x, and the smaller center
  EXPECT_GT(std::count_if(first.begin(), first.end(), is_odd), 7);
  EXPECT_NE(BlocksOfRound(row.posed, 1, 12), BlocksOfRound(MakeRow(20).posed, 1, 12));
}

TEST(Blocks, SeeTheTracksOfTheirImages) {
  const std::vector<Track> tracks = {{{0, 1}, {1, 1}, {3, 1}}, {{2, 2}, {3, 2}}, {{1, 3}, {4, 3}}};
  EXPECT_THAT(TracksOfBlocks(tracks, {{0, 1}, {2, 3}}, 5), ElementsAre(ElementsAre(0, 2), ElementsAre(0, 1)));
  EXPECT_THAT(TracksOfBlocks(tracks, {{4}, {}}, 5), ElementsAre(ElementsAre(2), IsEmpty()));
}

TEST(Blocks, AreCutOutWithTheImagesAroundThatSeeTheSame) {
  //  images 4 to 6 of 20 see points 4 to 9, which images 1 to 9 see
  const Row row = MakeRow(20);
  const std::vector<int32_t> images = {4, 5, 6};
  const auto tracks_of = TracksOfBlocks(row.tracks, {images}, 20);
  EXPECT_THAT(tracks_of[0], ElementsAre(4, 5, 6, 7, 8, 9));
  const SurveyBlock block =
      CutOutBlock(row.matched, row.posed, row.tracks, tracks_of[0], images, 20, {}, 100, 1);
  EXPECT_THAT(block.images, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_THAT(block.is_fixed, ElementsAre(1, 1, 1, 0, 0, 0, 1, 1, 1));
  ASSERT_EQ(block.tracks.size(), 6u);
  for (size_t t = 0; t < 6; ++t) {
    const Track& track = block.tracks[t];
    ASSERT_EQ(track.size(), 4u);
    EXPECT_THAT(block.triangulations[t].inliers, ElementsAre(0, 1, 2, 3));
    for (int i = 0; i < 4; ++i) {
      // By the block's numbers: its first image is the survey's second.
      EXPECT_EQ(track[i].image_idx, static_cast<int>(t) + i);
      EXPECT_EQ(track[i].keypoint_idx, static_cast<KeypointIdx>(3 - i));
    }
    const Eigen::Vector3d point(0.3 * static_cast<double>(t + 4) - 0.5,
                                0.1 * static_cast<double>((t + 4) % 3), 2);
    EXPECT_LT((block.triangulations[t].position - point).norm(), 1e-4);
  }
}

TEST(Blocks, KeepTheImagesBeforeAndAfterFromWhichStatedPosesDrift) {
  const Row row = MakeRow(20);
  const auto cut_out = [&](const std::vector<int32_t>& images, int num_known) {
    return CutOutBlock(row.matched, row.posed, row.tracks, {}, images, num_known, {}, 100, 1);
  };
  SurveyBlock block = cut_out({4, 5, 8}, 20);
  EXPECT_THAT(block.images, ElementsAre(3, 4, 5, 6, 7, 8, 9));
  EXPECT_THAT(block.is_fixed, ElementsAre(1, 0, 0, 1, 1, 0, 1));
  EXPECT_THAT(block.tracks, IsEmpty());
  block = cut_out({0, 1, 18, 19}, 20);
  EXPECT_THAT(block.images, ElementsAre(0, 1, 2, 17, 18, 19));
  EXPECT_THAT(block.is_fixed, ElementsAre(0, 0, 1, 1, 0, 0));
  block = cut_out({4, 5}, 6);
  EXPECT_THAT(block.images, ElementsAre(3, 4, 5));
}

TEST(Blocks, SeeNothingOfImagesThatAreNotThere) {
  const Row row = MakeRow(20);
  const std::vector<int32_t> images = {4, 5, 6};
  const auto tracks_of = TracksOfBlocks(row.tracks, {images}, 20);
  const SurveyBlock block =
      CutOutBlock(row.matched, row.posed, row.tracks, tracks_of[0], images, 7, {}, 100, 1);
  EXPECT_THAT(block.images, ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(block.is_fixed, ElementsAre(1, 1, 1, 0, 0, 0));
  // Points 4 to 7; 8 and 9 are seen by two of these and one.
  ASSERT_EQ(block.tracks.size(), 4u);
  EXPECT_EQ(block.tracks[3].size(), 3u);
}

TEST(Blocks, TakeWhatTheirOwnImagesWant) {
  // Images of the block want one keypoint each.
  const Row row = MakeRow(20);
  const std::vector<int32_t> images = {4, 5, 6};
  const auto tracks_of = TracksOfBlocks(row.tracks, {images}, 20);
  const SurveyBlock block =
      CutOutBlock(row.matched, row.posed, row.tracks, tracks_of[0], images, 20, {}, 1, 1);
  // Points 4, which images 1 to 4 see, 5 for image 5 and 6 for image 6.
  EXPECT_EQ(block.tracks.size(), 3u);
  EXPECT_THAT(block.images, ElementsAre(1, 2, 3, 4, 5, 6, 7));
}

}  // namespace
}  // namespace cairn::group_classes
