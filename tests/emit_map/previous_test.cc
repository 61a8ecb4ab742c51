// What a map keeps of an earlier one: stages/emit_map/previous.
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/features/transform_code.h"
#include "stages/emit_map/previous/match_previous.h"
#include "stages/emit_map/previous/settle_rows.h"

namespace cairn::emit_map {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int32_t kNone = kNotBefore;
constexpr size_t kNumClasses = 20, kNumImages = 4;

// Twenty classes on a wall 2 m away, 0.1 m apart, and four images that look at it from 0.1 m apart and see
// all.
Classes WallClasses() {
  Classes classes;
  Camera camera{.camera_id = 3,
                .model = CameraModel::kSimplePinhole,
                .width = 640,
                .height = 480,
                .params = {300, 320, 240}};
  classes.cameras = {camera};
  for (size_t k = 0; k < kNumImages; ++k) {
    SurveyImage image{
        .image_id = static_cast<ImageId>(k + 1), .name = "i" + std::to_string(k), .camera_id = 3};
    image.cam_from_world.translation = {-0.1 * static_cast<double>(k), 0, 0};
    classes.images.push_back(image);
  }
  Random random(5);
  for (size_t i = 0; i < kNumClasses; ++i) {
    FeatureClass feature_class{.class_id = static_cast<ClassId>(100 + i),
                               .position = {0.1 * static_cast<double>(i) - 1, 0.3, 2},
                               .covariance = Eigen::Matrix3d::Identity() * 1e-6};
    for (int value = 0; value < kSiftDescriptorDim; ++value)
      feature_class.descriptor[value] =
          static_cast<uint8_t>(std::min(200.0, 40 * std::abs(random.Normal(0, 1))));
    for (const SurveyImage& image : classes.images) {
      const Eigen::Vector2d pixel = *ImageFromCamera(camera, image.cam_from_world * feature_class.position);
      feature_class.observations.push_back(
          {image.image_id, static_cast<KeypointIdx>(i),
           Keypoint{static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 3, 0}});
    }
    classes.classes.push_back(feature_class);
  }
  return classes;
}

// As EmitMap makes them, before descriptors are quantized: all classes from `first` on, in two regions.
MapRows RowsOf(const Classes& classes, size_t first = 0) {
  MapRows rows;
  rows.cameras = classes.cameras;
  rows.sessions = classes.sessions;
  const size_t num = classes.classes.size() - first;
  rows.descriptors.resize(static_cast<Eigen::Index>(num), kSiftDescriptorDim);
  for (size_t i = 0; i < num; ++i) {
    const FeatureClass& feature_class = classes.classes[first + i];
    rows.landmarks.push_back(
        {feature_class.class_id, feature_class.position, feature_class.covariance, 0.01, 4});
    rows.descriptors.row(static_cast<Eigen::Index>(i)) = feature_class.descriptor;
  }
  for (const SurveyImage& image : classes.images) {
    MapImage row{.image_id = image.image_id,
                 .name = image.name,
                 .camera_id = 3,
                 .cam_from_world = image.cam_from_world};
    for (size_t i = 0; i < num; ++i) row.landmarks.push_back(static_cast<LandmarkIdx>(i));
    rows.images.push_back(row);
  }
  rows.stations = {{.position = {0, 0}, .heading_deg = 90}, {.position = {0.3, 0}, .heading_deg = 90}};
  rows.regions.resize(2);
  for (size_t i = 0; i < num; ++i)
    rows.regions[i < num / 2 ? 0 : 1].landmarks.push_back(static_cast<LandmarkIdx>(i));
  for (size_t k = 0; k < classes.images.size(); ++k)
    rows.appearance.push_back({.images = {static_cast<int32_t>(k)},
                               .is_kept = true,
                               .links = {},
                               .entropy = 0.5,
                               .look_alikes = {}});
  rows.appearance[0].look_alikes = {{1, 0.6}};
  rows.findings.promise = MapPromise{.radius_m = 0.2, .radius_deg = 15};
  for (size_t k = 0; k < classes.images.size(); ++k) {
    const auto image = static_cast<int32_t>(k);
    rows.findings.promise->nodes.push_back({image, image, 0, 0.96, 25, 0.02, 0.99});
  }
  return rows;
}

MapRows Stored(MapRows rows) {
  rows.descriptor_code = QuantizeByTransform(24, &rows.descriptors);
  return rows;
}

class Previous : public testing::Test {
 protected:
  PreviousMatches Matches() {
    Result<PreviousMatches> matches = MatchPrevious(classes_, previous_, "old.cairn");
    EXPECT_TRUE(matches.ok()) << matches.error().message;
    return matches.ok() ? *matches : PreviousMatches();
  }
  Error MatchError() {
    const Result<PreviousMatches> matches = MatchPrevious(classes_, previous_, "old.cairn");
    EXPECT_FALSE(matches.ok());
    return matches.ok() ? Error() : matches.error();
  }
  MapRows Settled() {
    MapRows rows = RowsOf(classes_);
    SettleRows(classes_, previous_, Matches(), &rows);
    return rows;
  }

  MapRows previous_ = Stored(RowsOf(WallClasses()));
  Classes classes_ = WallClasses();
};

TEST_F(Previous, LandmarksAreFoundAmongClassesByPlaceAndLook) {
  // Numbers, and the order, are others in each compilation.
  std::reverse(classes_.classes.begin(), classes_.classes.end());
  for (size_t i = 0; i < kNumClasses; ++i) classes_.classes[i].class_id = static_cast<ClassId>(i);
  const PreviousMatches matches = Matches();
  EXPECT_THAT(matches.row_of_image, ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(matches.NumMatched(), kNumClasses);
  for (size_t i = 0; i < kNumClasses; ++i)
    EXPECT_EQ(matches.landmark_of_class[i], static_cast<int32_t>(kNumClasses - 1 - i));
  EXPECT_THAT(matches.holds, Each(1));
}

TEST_F(Previous, AClassElsewhereInTheImageOrOfAnotherLookIsNew) {
  for (Observation& observation : classes_.classes[4].observations) observation.keypoint.x += 6.5F;
  for (Observation& observation : classes_.classes[5].observations) observation.keypoint.y -= 5.5F;
  classes_.classes[6].descriptor = classes_.classes[7].descriptor;
  const PreviousMatches matches = Matches();
  EXPECT_EQ(matches.landmark_of_class[4], kNone);
  EXPECT_EQ(matches.landmark_of_class[5], 5);
  EXPECT_EQ(matches.landmark_of_class[6], kNone);
  EXPECT_EQ(matches.NumMatched(), kNumClasses - 2);
}

TEST_F(Previous, OfTwoClassesAtOnePlaceTheOneThatMoreImagesSeeIsIt) {
  classes_.classes.push_back(classes_.classes[3]);
  classes_.classes.back().class_id = 900;
  classes_.classes.back().observations.pop_back();
  EXPECT_EQ(Matches().landmark_of_class[3], 3);
  EXPECT_EQ(Matches().landmark_of_class.back(), kNone);
  // Of as many, the one that looks more like it.
  std::swap(classes_.classes[3].descriptor[0], classes_.classes[3].descriptor[1]);
  classes_.classes[3].descriptor[2] ^= 32;
  classes_.classes[3].observations.pop_back();
  EXPECT_EQ(Matches().landmark_of_class[3], kNone);
  EXPECT_EQ(Matches().landmark_of_class.back(), 3);
}

TEST_F(Previous, ImagesKeepTheirNamesWhenASecondSurveyComes) {
  classes_.sessions = {"bldg", "new"};
  for (SurveyImage& image : classes_.images) image.name = "bldg/" + image.name;
  SurveyImage added = classes_.images[0];
  added.image_id = 9;
  added.name = "new/i0";
  classes_.images.push_back(added);
  EXPECT_THAT(Matches().row_of_image, ElementsAre(0, 1, 2, 3, kNone));
  // In a map of sessions they have them already.
  previous_.sessions = {"bldg"};
  EXPECT_THAT(MatchError().message, HasSubstr("none of its 4 images (such as i0)"));
  for (MapImage& image : previous_.images) image.name = "bldg/" + image.name;
  EXPECT_THAT(Matches().row_of_image, ElementsAre(0, 1, 2, 3, kNone));
}

TEST_F(Previous, WhatMovedOrLooksOtherwiseDoesNotHold) {
  const auto holds = [&] { return static_cast<int>(Matches().holds[8]); };
  // Deviations of 1 mm per axis, of both: 4 times the root of 6 mm^2 are 9.8 mm.
  classes_.classes[8].position.z() += 0.0097;
  EXPECT_EQ(holds(), 1);
  classes_.classes[8].position.z() += 0.0002;
  EXPECT_EQ(holds(), 0);
  classes_.classes[8].position.z() = 2;
  EXPECT_EQ(holds(), 1);
  // Levels lose about 70; 100 values that are 6 more are 60 away, and at a right angle to that.
  DescriptorMatrix stored = classes_.classes[8].descriptor;
  QuantizeByCode(*previous_.descriptor_code, &stored);
  previous_.descriptors.row(8) = stored;
  for (int value = 0; value < 100; ++value)
    previous_.descriptors(8, value) =
        static_cast<uint8_t>(previous_.descriptors(8, value) + (value % 2 == 0 ? 4 : 0));
  EXPECT_EQ(holds(), 1);
  for (int value = 0; value < 100; ++value)
    previous_.descriptors(8, value) = static_cast<uint8_t>(previous_.descriptors(8, value) + 14);
  EXPECT_EQ(holds(), 0);
}

TEST_F(Previous, MapsOfAnotherSurveyOrFrameAreRefused) {
  MapRows moved = previous_;
  for (MapLandmark& landmark : moved.landmarks) landmark.position.x() += 0.05;
  for (MapImage& image : moved.images) image.cam_from_world.translation.x() -= 0.05;
  std::swap(moved, previous_);
  EXPECT_EQ(MatchError().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(MatchError().message, HasSubstr("the frames of the two differ"));
  std::swap(moved, previous_);
  for (SurveyImage& image : classes_.images) image.name += ".jpg";
  EXPECT_THAT(MatchError().message,
              HasSubstr("old.cairn: none of its 4 images (such as i0) is among the 4 of"));
  previous_.images.clear();
  EXPECT_THAT(MatchError().message, HasSubstr("none of its 0 images (such as none)"));
  previous_ = Stored(RowsOf(WallClasses()));
  classes_ = WallClasses();
  previous_.descriptors.setConstant(255);
  EXPECT_THAT(MatchError().message, HasSubstr("none of its 20 landmarks is among the 20 classes"));
}

TEST_F(Previous, WhatHoldsStaysAsItIsAndInItsOrder) {
  for (FeatureClass& feature_class : classes_.classes) {
    feature_class.position.x() += 1e-4;
    feature_class.descriptor[1] ^= 8;
  }
  classes_.classes[2].position.x() += 0.02;
  std::reverse(classes_.classes.begin(), classes_.classes.end());
  const MapRows rows = Settled();
  EXPECT_EQ(rows.descriptor_code, previous_.descriptor_code);
  for (size_t i = 0; i < kNumClasses; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const bool holds = i != 2;
    EXPECT_EQ(rows.landmarks[i].position == previous_.landmarks[i].position, holds) << i;
    EXPECT_EQ(rows.landmarks[i].class_id, 100 + i) << "that of its class, so far";
    EXPECT_TRUE(!holds || rows.descriptors.row(row) == previous_.descriptors.row(row)) << i;
    DescriptorMatrix again = rows.descriptors.row(row);
    QuantizeByCode(*rows.descriptor_code, &again);
    EXPECT_EQ(again.row(0), rows.descriptors.row(row)) << "in levels of the earlier map's code";
  }
}

TEST_F(Previous, NewLandmarksStandBehindTheLastOfTheirRegion) {
  previous_ = Stored(RowsOf(WallClasses(), 10));  // landmarks 0 .. 9 are classes 10 .. 19
  // Of the classes before, 0 and 1 are of a region with landmarks of the earlier map, the others of none.
  MapRows rows = RowsOf(classes_);
  rows.regions[0].landmarks = {0, 1, 10, 11, 14};
  rows.regions[1].landmarks = {12, 13, 14, 15, 16, 17, 18, 19};
  for (MapImage& image : rows.images) image.landmarks = {0, 2, 14, 19};
  SettleRows(classes_, previous_, Matches(), &rows);
  std::vector<ClassId> order;
  for (const MapLandmark& landmark : rows.landmarks) order.push_back(landmark.class_id);
  EXPECT_THAT(order, ElementsAre(110, 111, 112, 113, 114, 100, 101, 115, 116, 117, 118, 119, 102, 103, 104,
                                 105, 106, 107, 108, 109));
  EXPECT_THAT(rows.regions[0].landmarks, ElementsAre(0, 1, 4, 5, 6));
  EXPECT_THAT(rows.regions[1].landmarks, ElementsAre(2, 3, 4, 7, 8, 9, 10, 11));
  EXPECT_THAT(rows.images[0].landmarks, ElementsAre(4, 5, 11, 12));
}

TEST_F(Previous, ClassIdsStayAndNewOnesWereNeverGiven) {
  previous_ = Stored(RowsOf(WallClasses(), 10));
  for (MapLandmark& landmark : previous_.landmarks) landmark.class_id += 1000;
  MapRows rows = RowsOf(classes_);
  const PreviousMatches matches = Matches();
  SettleRows(classes_, previous_, matches, &rows);
  KeepClassIds(classes_, previous_, matches, &rows);
  std::set<ClassId> ids;
  for (size_t i = 0; i < kNumClasses; ++i) {
    ids.insert(rows.landmarks[i].class_id);
    for (const MapLandmark& before : previous_.landmarks) {
      EXPECT_EQ(before.position == rows.landmarks[i].position, rows.landmarks[i].class_id == before.class_id);
    }
  }
  EXPECT_EQ(ids.size(), kNumClasses);
  EXPECT_EQ(*ids.begin(), 1110U);
  EXPECT_EQ(*ids.rbegin(), 1129U);
}

TEST_F(Previous, ImagesKeepTheirPosesWhileLandmarksHardlyMoveInThem) {
  // 1 cm at 2 m is 1.5 px, 3 cm are 4.5.
  classes_.images[0].cam_from_world.translation.x() += 0.01;
  classes_.images[1].cam_from_world.translation.x() += 0.03;
  const MapRows rows = Settled();
  EXPECT_EQ(rows.images[0].cam_from_world.translation, previous_.images[0].cam_from_world.translation);
  EXPECT_EQ(rows.images[1].cam_from_world.translation, classes_.images[1].cam_from_world.translation);
}

TEST_F(Previous, StationsAndTheFloorStay) {
  MapRows rows = RowsOf(classes_);
  // A hundredth of 2 m, and a little more.
  rows.stations = {{.position = {0.019, 0}, .heading_deg = 90.5},
                   {.position = {0.3, 0.022}, .heading_deg = 90},
                   {.position = {0.001, 0}, .heading_deg = 90},
                   {.position = {0.3, 0}, .heading_deg = 95}};
  rows.floor_from_world.translation = {0, 0.004, 0};
  SettleRows(classes_, previous_, Matches(), &rows);
  EXPECT_EQ(rows.floor_from_world.translation, previous_.floor_from_world.translation);
  EXPECT_EQ(rows.stations[0].position, Eigen::Vector2d(0, 0)) << "the nearest that is left";
  EXPECT_EQ(rows.stations[0].heading_deg, 90);
  EXPECT_EQ(rows.stations[1].position, Eigen::Vector2d(0.3, 0));
  EXPECT_EQ(rows.stations[2].position, Eigen::Vector2d(0.001, -0.004)) << "taken already";
  EXPECT_EQ(rows.stations[3].heading_deg, 95);
  rows = RowsOf(classes_);
  rows.floor_from_world.translation = {0, 0.05, 0};
  SettleRows(classes_, previous_, Matches(), &rows);
  EXPECT_EQ(rows.floor_from_world.translation.y(), 0.05);
}

TEST_F(Previous, FiguresStayWhereTheyHardlyDiffer) {
  MapRows rows = RowsOf(classes_);
  rows.appearance[0].entropy = 0.525;
  rows.appearance[1].entropy = 0.535;
  rows.appearance[0].look_alikes = {{1, 0.62}, {2, 0.62}};
  rows.findings.promise->radius_m = 0.205;
  auto& nodes = rows.findings.promise->nodes;
  nodes[0].probability = 0.945;
  nodes[0].region = 1;
  nodes[1].probability = 0.935;
  nodes[2].num_matches = 26.5;
  nodes[3].sigma_m = 0.0215;
  nodes.push_back({0, 0, 0, 0.95, 25, 0.02, 0.99});  // a second of image 0, of which there was one
  SettleRows(classes_, previous_, Matches(), &rows);
  EXPECT_EQ(rows.appearance[0].entropy, 0.5);
  EXPECT_EQ(rows.appearance[1].entropy, 0.535);
  EXPECT_EQ(rows.appearance[0].look_alikes[0].score, 0.6);
  EXPECT_EQ(rows.appearance[0].look_alikes[1].score, 0.62);
  EXPECT_EQ(rows.findings.promise->radius_m, 0.2);
  EXPECT_EQ(nodes[0].probability, 0.96);
  EXPECT_EQ(nodes[0].region, 1);
  EXPECT_EQ(nodes[1].probability, 0.935);
  EXPECT_EQ(nodes[2].num_matches, 26.5);
  EXPECT_EQ(nodes[3].sigma_m, 0.0215);
  EXPECT_EQ(nodes[4].probability, 0.95);
}

TEST_F(Previous, NumbersOfWhatWasDroppedStayWhereTheyHardlyDiffer) {
  MapRows rows = RowsOf(classes_);
  rows.stations.push_back({.position = {9, 9}, .heading_deg = 90});
  previous_.findings.drops = {{1, "s", "feature", "a", "", 300, {100, 10}},
                              {2, "s", "feature", "b", "", 9, {5, 4}}};
  rows.findings.drops = {{1, "s", "feature", "a", "", 310, {105, 13, 7}},
                         {2, "s", "feature", "b", "", 3, {3, 1, 0}},
                         {3, "s", "feature", "c", "", 2, {2, 0, 0}}};
  SettleDrops(previous_, &rows);
  EXPECT_THAT(rows.findings.drops[0].at_stations, ElementsAre(100, 10, 7));
  EXPECT_EQ(rows.findings.drops[0].num_dropped, 310);
  EXPECT_THAT(rows.findings.drops[1].at_stations, ElementsAre(3, 1, 0)) << "no more than in all";
  EXPECT_THAT(rows.findings.drops[2].at_stations, ElementsAre(2, 0, 0));
  // Beyond a twentieth, and three.
  rows.findings.drops[0].at_stations = {106, 14, 7};
  SettleDrops(previous_, &rows);
  EXPECT_THAT(rows.findings.drops[0].at_stations, ElementsAre(106, 14, 7));
}

}  // namespace
}  // namespace cairn::emit_map
