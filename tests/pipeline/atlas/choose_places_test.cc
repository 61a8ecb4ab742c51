#include "pipeline/atlas/choose_places.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/atlas/atlas_file.h"

namespace cairn::pipeline {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

// Images of a corridor, each of which shows these landmarks.
MapRows Corridor(const std::vector<std::vector<LandmarkIdx>>& seen, int num_landmarks) {
  MapRows rows;
  for (size_t i = 0; i < seen.size(); ++i)
    rows.images.push_back({.image_id = static_cast<ImageId>(i + 1), .landmarks = seen[i]});
  rows.landmarks.resize(num_landmarks);
  return rows;
}

// Codes of landmarks whose bits are all as far from being others.
std::vector<DescriptorCode> Codes(int num, int16_t margin = 40) {
  std::vector<DescriptorCode> codes(num);
  for (int i = 0; i < num; ++i) {
    codes[i].bits = static_cast<uint32_t>(1000 - i);
    codes[i].margins.fill(margin);
  }
  return codes;
}

TEST(ChoosePlaces, TheLandmarkThatMostImagesShowIsFirst) {
  const MapRows rows = Corridor({{0, 1}, {1, 2}, {1}}, 3);
  EXPECT_EQ(RankLandmarks(rows, Codes(3), {0, 0, 0})[0], 1);
}

TEST(ChoosePlaces, AnImageThatShowsNoneIsNext) {
  // Landmarks 0 and 1 are seen from the first two images, 2 from the last alone: a second one in both adds
  // half of what a first one adds in the last.
  const MapRows rows = Corridor({{0, 1}, {0, 1}, {2}}, 3);
  EXPECT_THAT(RankLandmarks(rows, Codes(3), {0, 0, 0}), ElementsAre(0, 2, 1));
  const MapRows more = Corridor({{0, 1, 2, 3}, {0, 1, 2, 3}, {4}}, 5);
  EXPECT_THAT(RankLandmarks(more, Codes(5), {0, 0, 0, 0, 0}), ElementsAre(0, 4, 1, 2, 3));
}

TEST(ChoosePlaces, WhatOtherMapsHaveTooIsWorthLess) {
  const MapRows rows = Corridor({{0, 1}}, 2);
  EXPECT_THAT(RankLandmarks(rows, Codes(2), {1, 0}), ElementsAre(1, 0));
}

TEST(ChoosePlaces, ACodeThatMayTurnIsWorthLess) {
  const MapRows rows = Corridor({{0, 1}}, 2);
  std::vector<DescriptorCode> codes = Codes(2);
  for (int bit = 0; bit < 4; ++bit) codes[0].margins[bit] = 1;
  EXPECT_THAT(RankLandmarks(rows, codes, {0, 0}), ElementsAre(1, 0));
}

TEST(ChoosePlaces, PlacesFollowTheSurvey) {
  // 64 landmarks, each seen from one image of 64, the last ones from the first images.
  std::vector<std::vector<LandmarkIdx>> seen;
  for (LandmarkIdx i = 63; i >= 0; --i) seen.push_back({i});
  std::vector<LandmarkIdx> all;
  for (LandmarkIdx i = 0; i < 64; ++i) all.push_back(i);
  const auto places = PlacesOf(Corridor(seen, 64), Codes(64), all);
  ASSERT_THAT(places, SizeIs(2));
  ASSERT_THAT(places[0], SizeIs(32));
  ASSERT_THAT(places[1], SizeIs(32));
  EXPECT_EQ(places[0].front(), 1000u - 63);  // landmark 63, of the first image
  EXPECT_EQ(places[0].back(), 1000u - 32);
  EXPECT_EQ(places[1].back(), 1000u);
  EXPECT_TRUE(std::is_sorted(places[0].begin(), places[0].end()));
}

TEST(ChoosePlaces, TwoLandmarksOfOneCodeAreOne) {
  const MapRows rows = Corridor({{0, 1, 2}}, 3);
  std::vector<DescriptorCode> codes = Codes(3);
  codes[2].bits = codes[0].bits;
  EXPECT_THAT(PlacesOf(rows, codes, {0, 1, 2}), ElementsAre(ElementsAre(999u, 1000u)));
}

TEST(ChoosePlaces, AsManyAsTheBytesHold) {
  std::vector<LandmarkIdx> all;
  for (LandmarkIdx i = 0; i < 500; ++i) all.push_back(i);
  const MapRows rows = Corridor({all}, 500);
  std::vector<DescriptorCode> codes = Codes(500);
  for (int i = 0; i < 500; ++i) codes[i].bits = static_cast<uint32_t>(i) * 7919u * 65537u;
  const auto num_codes = [](const std::vector<std::vector<uint32_t>>& places) {
    size_t num = 0;
    for (const auto& place : places) num += place.size();
    return num;
  };
  const auto chosen = ChoosePlaces(rows, codes, all, 300, 1);
  EXPECT_LE(NumBytesOfPlaces(chosen), 300u);
  EXPECT_GT(NumBytesOfPlaces(chosen), 290u);
  EXPECT_EQ(num_codes(ChoosePlaces(rows, codes, all, 1 << 20, 1)), 500u);
  EXPECT_EQ(num_codes(ChoosePlaces(rows, codes, all, 0, 40)), 40u);
  EXPECT_EQ(num_codes(ChoosePlaces(rows, codes, {1, 2}, 0, 40)), 2u);
}

}  // namespace
}  // namespace cairn::pipeline
