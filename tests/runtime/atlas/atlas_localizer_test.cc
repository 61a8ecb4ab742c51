#include "runtime/atlas/atlas_localizer.h"

#include <algorithm>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/atlas/code_index.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/landmark_set.h"
#include "tests/runtime/atlas/three_rooms.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

using AtlasLocalizerTest = ThreeRoomsTest;

AtlasAnswer Answer(const std::shared_ptr<const Atlas>& atlas, const Features& features, const Camera& camera,
                   const AtlasLocalizerOptions& options = {}) {
  const auto answer =
      AtlasLocalizer(atlas, {}, options).LocalizeFeatures(features, camera.width, camera.height, camera);
  EXPECT_TRUE(answer.ok()) << answer.error().message;
  double sum = answer->elsewhere;
  for (const AtlasHypothesis& hypothesis : answer->hypotheses) sum += hypothesis.probability;
  EXPECT_NEAR(sum, 1, 1e-9);
  return *answer;
}

TEST_F(AtlasLocalizerTest, FindsTheRoomAndThePlace) {
  const auto atlas = Open(Rows());
  size_t num_maps_tried = 0;
  Random random(1);
  for (int i = 0; i < 30; ++i) {
    const int room = i % kNumRooms;
    const Pose truth = RandomPose(random);
    const Features seen = See(room, truth, i);
    const AtlasAnswer answer = Answer(atlas, seen, Room(room).camera);
    ASSERT_THAT(answer.hypotheses, SizeIs(1)) << i;
    EXPECT_EQ(answer.hypotheses[0].map, room);
    EXPECT_GT(answer.hypotheses[0].probability, 0.9);
    EXPECT_LT(CenterErrorM(answer.hypotheses[0].found.cam_from_world, truth), 0.05);
    EXPECT_EQ(answer.maps_tried[0], room);
    num_maps_tried += answer.maps_tried.size();
    // What that map says alone.
    const auto alone = *Localizer(*atlas->OpenMap(room)).LocalizeFeatures(seen, Room(room).camera);
    EXPECT_EQ(alone.cam_from_world.translation, answer.hypotheses[0].found.cam_from_world.translation);
    EXPECT_NEAR(answer.hypotheses[0].probability, alone.probability, 1e-9);
  }
  // Others only where a fix is not sure, or they seem to have one of few features.
  EXPECT_LT(num_maps_tried, 60u);
}

TEST_F(AtlasLocalizerTest, AnImageOfAnotherBuildingIsOfNoMap) {
  const auto atlas = Open(Rows());
  const SyntheticRoom other = MakeUnmappedRoom(99, 1600);
  Random random(2), again(2);
  for (int i = 0; i < 20; ++i) {
    const AtlasAnswer answer = Answer(atlas, RenderFeatures(other, RandomPose(random), {}, i), other.camera);
    EXPECT_THAT(answer.hypotheses, IsEmpty());
    EXPECT_EQ(answer.elsewhere, 1);
    EXPECT_FALSE(answer.best_failure.has_fix());
    ASSERT_FALSE(answer.maps_tried.empty());
    Localizer first(*atlas->OpenMap(answer.maps_tried[0]));
    const Localization alone =
        *first.LocalizeFeatures(RenderFeatures(other, RandomPose(again), {}, i), other.camera);
    EXPECT_EQ(answer.best_failure.message, alone.message) << "of the map with most evidence";
  }
}

TEST_F(AtlasLocalizerTest, AnImageWithoutFeaturesIsOfNoMap) {
  Features none;
  none.descriptors.resize(0, kSiftDescriptorDim);
  const AtlasAnswer answer = Answer(Open(Rows()), none, Room(0).camera);
  EXPECT_THAT(answer.hypotheses, IsEmpty());
  EXPECT_THAT(answer.maps_tried, IsEmpty());
  EXPECT_EQ(answer.best_failure.reason, NoFix::kNoCandidates);
}

// Room 1 again, under another name, elsewhere in the world: another floor that looks the same.
AtlasRows WithTwin(AtlasRows rows, const MapRows& twin_rows, const std::string& path) {
  EXPECT_TRUE(WriteMapRows(twin_rows, path).ok());
  AtlasMap twin = rows.maps[1];
  twin.name = twin_rows.name;
  twin.file = std::filesystem::path(path).filename();
  twin.fingerprint = FingerprintOf(MapFile::Open(path, {})->seal().root);
  rows.maps.push_back(std::move(twin));
  return rows;
}

TEST_F(AtlasLocalizerTest, TwoFloorsThatLookAlikeShareTheProbability) {
  MapRows twin = Room(1).rows;
  twin.name = "room 1 upstairs";
  const auto atlas = Open(WithTwin(Rows(), twin, Path("twin.cairn")));
  Random random(3);
  for (int i = 0; i < 10; ++i) {
    const AtlasAnswer answer = Answer(atlas, See(1, RandomPose(random), i), Room(1).camera);
    ASSERT_THAT(answer.hypotheses, SizeIs(2)) << i;
    EXPECT_NEAR(answer.hypotheses[0].probability, 0.5, 0.01);
    EXPECT_NEAR(answer.hypotheses[1].probability, 0.5, 0.01);
    EXPECT_NE(answer.hypotheses[0].map, answer.hypotheses[1].map);
  }
}

TEST_F(AtlasLocalizerTest, AKnownLookAlikeIsAskedHoweverLittleItsCodesAgree) {
  MapRows twin = Room(1).rows;
  twin.name = "room 1 upstairs";
  AtlasRows rows = WithTwin(Rows(), twin, Path("twin.cairn"));
  rows.maps[3].places = {{1, 2, 3}};  // the atlas tells none of its landmarks
  Random random(4);
  const Pose truth = RandomPose(random);
  const Features seen = See(1, truth, 0);
  const AtlasAnswer unaware = Answer(Open(rows), seen, Room(1).camera);
  ASSERT_THAT(unaware.hypotheses, SizeIs(1));
  // All images of room 1 look like image 0 of its twin.
  for (int32_t image = 0; image < rows.maps[1].num_images; ++image)
    rows.look_alikes.push_back({{1, image}, {3, 0}});
  const auto atlas = Open(rows);
  const AtlasAnswer aware = Answer(atlas, seen, Room(1).camera);
  ASSERT_THAT(aware.hypotheses, SizeIs(2));
  EXPECT_THAT(aware.maps_tried, ElementsAre(1, 3));
  const AtlasAnswer unsure =
      Answer(atlas, seen, Room(1).camera, {.max_num_maps = 10, .sure_probability = 1, .rival_ratio = 1});
  EXPECT_THAT(unsure.maps_tried, testing::UnorderedElementsAre(0, 1, 2, 3)) << "each once";
  EXPECT_NEAR(aware.hypotheses[0].probability, 0.5, 0.01);
  // Both ways.
  EXPECT_THAT(atlas->MapsLike(1, 7), ElementsAre(3));
  EXPECT_THAT(atlas->MapsLike(3, 0), ElementsAre(1));
  EXPECT_THAT(atlas->MapsLike(3, 1), IsEmpty());
}

TEST_F(AtlasLocalizerTest, OnlySoManyMapsAreAsked) {
  AtlasRows rows = Rows();
  // The others have every second of room 0's landmarks, too.
  for (std::vector<uint32_t> place : std::vector(rows.maps[0].places)) {
    for (size_t i = 0; i < place.size(); ++i) place.erase(place.begin() + static_cast<std::ptrdiff_t>(i));
    for (const int other : {1, 2}) rows.maps[other].places.push_back(place);
  }
  const auto atlas = Open(rows);
  Random random(5);
  const Features seen = See(0, RandomPose(random), 0);
  const std::vector<MapScore> ranked = atlas->Rank(seen);
  ASSERT_THAT(ranked, SizeIs(kNumRooms));
  EXPECT_EQ(ranked[0].map, 0);
  for (const MapScore& other : ranked) EXPECT_LE(other.features.size(), ranked[0].features.size());
  const auto tried = [&](const AtlasLocalizerOptions& options) {
    return Answer(atlas, seen, Room(0).camera, options).maps_tried.size();
  };
  // Sure, and the others have some of these features.
  const double shared =
      NumShared(ranked[1].features, ranked[0].features) / static_cast<double>(ranked[0].features.size());
  EXPECT_LT(shared, 1);
  EXPECT_EQ(tried({.sure_probability = 0.9, .rival_ratio = 0.99 * shared}), 3u);
  EXPECT_EQ(tried({.sure_probability = 0.9, .rival_ratio = 1}), 1u);
  EXPECT_EQ(tried({.max_num_maps = 2, .sure_probability = 0.9, .rival_ratio = 0}), 2u);
  // Not sure.
  EXPECT_EQ(tried({.sure_probability = 1, .rival_ratio = 1}), 3u);
}

TEST_F(AtlasLocalizerTest, WithoutACameraEachMapHasItsOwn) {
  const auto atlas = Open(Rows());
  Random random(6);
  const Pose truth = RandomPose(random);
  AtlasLocalizer localizer(atlas);
  const auto answer = localizer.LocalizeFeatures(See(2, truth, 0), 640, 480);
  ASSERT_TRUE(answer.ok()) << answer.error().message;
  ASSERT_THAT(answer->hypotheses, SizeIs(1));
  EXPECT_EQ(answer->hypotheses[0].map, 2);
  const auto wrong_size = localizer.LocalizeFeatures(See(2, truth, 0), 100, 100);
  ASSERT_TRUE(wrong_size.ok()) << wrong_size.error().message;
  EXPECT_THAT(wrong_size->maps_tried, IsEmpty());
  EXPECT_THAT(wrong_size->best_failure.message, HasSubstr("100 x 100"));
  for (const auto& [width, height] : {std::pair(640, 10), {10, 480}, {10, 10}}) {
    const auto wrong_camera = localizer.Localize(cv::Mat::zeros(height, width, CV_8U), Room(0).camera);
    ASSERT_FALSE(wrong_camera.ok());
    EXPECT_EQ(wrong_camera.error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_THAT(localizer.Localize(cv::Mat::zeros(480, 640, CV_8U), Room(0).camera)->hypotheses, IsEmpty());
}

TEST_F(AtlasLocalizerTest, AnotherFileThanTheAtlasWasMadeOfIsRefused) {
  AtlasRows rows = Rows();
  rows.maps[1].file = "rooms_0.cairn";
  const auto exchanged = Open(rows)->OpenMap(1);
  ASSERT_FALSE(exchanged.ok());
  EXPECT_EQ(exchanged.error().code, ErrorCode::kOtherMap);
  EXPECT_THAT(exchanged.error().message, HasSubstr("make the atlas anew"));
  rows.maps[1].file = "nowhere.cairn";
  EXPECT_EQ(Open(rows)->OpenMap(1).error().code, ErrorCode::kNotFound);
}

TEST_F(AtlasLocalizerTest, KeepsTheMapsThatWereAskedForLast) {
  const auto atlas = Open(Rows(), {.max_num_open_maps = 2});
  const auto first = *atlas->OpenMap(0);
  EXPECT_EQ(*atlas->OpenMap(0), first);
  ASSERT_TRUE(atlas->OpenMap(1).ok());
  EXPECT_EQ(*atlas->OpenMap(0), first);
  ASSERT_TRUE(atlas->OpenMap(2).ok());  // in the place of 1
  EXPECT_EQ(*atlas->OpenMap(0), first);
  ASSERT_TRUE(atlas->OpenMap(1).ok());
  ASSERT_TRUE(atlas->OpenMap(2).ok());
  EXPECT_NE(*atlas->OpenMap(0), first);
}

TEST_F(AtlasLocalizerTest, ClosesMapsWhoseLoadedPartsAreTooMuchTogether) {
  int64_t num_bytes_of_first = 0;
  const auto kept_after = [&](int64_t memory_budget_bytes) {
    const auto atlas = Open(Rows(), {.memory_budget_bytes = memory_budget_bytes});
    const auto first = *atlas->OpenMap(0), second = *atlas->OpenMap(1);
    EXPECT_TRUE(first->AllLandmarks().ok() && second->AllLandmarks().ok());
    num_bytes_of_first = first->num_kept_bytes();
    EXPECT_TRUE(atlas->OpenMap(2).ok());
    return std::pair(*atlas->OpenMap(1) == second, *atlas->OpenMap(0) == first);
  };
  EXPECT_EQ(kept_after(AtlasOptions().memory_budget_bytes), std::pair(true, true));
  ASSERT_GT(num_bytes_of_first, 0);
  EXPECT_EQ(kept_after(num_bytes_of_first + num_bytes_of_first / 2), std::pair(true, false));
}

TEST_F(AtlasLocalizerTest, IsTheAtlasThatWasAskedFor) {
  AtlasRows rows = Rows();
  rows.epoch = 3;
  ASSERT_TRUE(WriteFileAtomically(Path("of.atlas"), *EncodeAtlas(std::nullopt, &rows)).ok());
  const auto code = [](const AtlasOptions& options) {
    const auto opened = Atlas::Open(Path("of.atlas"), options);
    return opened.ok() ? std::optional<ErrorCode>() : opened.error().code;
  };
  EXPECT_EQ(code({.name = "rooms", .min_epoch = 3}), std::nullopt);
  EXPECT_EQ(code({.name = "halls"}), ErrorCode::kOtherMap);
  EXPECT_EQ(code({.min_epoch = 4}), ErrorCode::kNotNewer);
  EXPECT_EQ(code({.max_num_open_maps = 0}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({.max_num_open_maps = 1}), std::nullopt);
  EXPECT_EQ(code({.memory_budget_bytes = 0}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({.public_key = MakeKeyPair().public_key}), ErrorCode::kNotSigned);
  const auto atlas = *Atlas::Open(Path("of.atlas"));
  EXPECT_EQ(*atlas->FindMap("room 0"), 0);
  EXPECT_EQ(*atlas->FindMap("room 2"), 2);
  EXPECT_EQ(atlas->FindMap("room 3").error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace cairn
