#include "runtime/drive/place_model.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "runtime/localize/measurement.h"
#include "tests/option_limits.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

const SyntheticRoom& ModelRoom() {
  static const SyntheticRoom room = MakeSyntheticRoom(1);
  return room;
}

// Every survey image is a node.
std::shared_ptr<const Map> RoomMap() {
  MapRows rows = ModelRoom().rows;
  for (int32_t i = 0; i < static_cast<int32_t>(rows.images.size()); ++i)
    rows.appearance.push_back({.images = {i}, .is_kept = true});
  return *Map::FromRows(std::move(rows));
}

size_t Best(const std::vector<double>& values) {
  return static_cast<size_t>(std::max_element(values.begin(), values.end()) - values.begin());
}

TEST(PlaceModel, CloserLookFindsTheNearestViewMoreOften) {
  const auto map = RoomMap();
  const PlaceModel model = *PlaceModel::Make(*map);
  Random random(4);
  double by_words = 0, closer = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const Pose truth = RandomPose(random);
    const Query query = MakeQuery(RenderFeatures(ModelRoom(), truth, {}, 50 + trial), ModelRoom().camera,
                                  MeasurementOptions());
    const auto distance = [&](const PlaceScores& places) {
      return CenterErrorM(ModelRoom().rows.images[Best(places.probabilities)].cam_from_world, truth);
    };
    const PlaceScores places = *model.LookCloser(*map, query);
    double sum = 0;
    for (const double p : places.probabilities) sum += p;
    EXPECT_NEAR(sum, 1, 1e-9);
    by_words += distance(model.Look(query.features.descriptors)) / 12;
    closer += distance(places) / 12;
  }
  // The survey's places are 1.5 and 2 m apart: none is more than 1.25 m away.
  EXPECT_LT(closer, by_words);
  EXPECT_LT(closer, 1.25);
}

TEST(PlaceModel, CloserLookKeepsTheWordsWhereNothingIsVerified) {
  const auto map = RoomMap();
  const PlaceModel model = *PlaceModel::Make(*map);
  Features few = RenderFeatures(ModelRoom(), PoseAt({1, 0.5, 1.2}, 20), {.num_outliers = 0}, 3);
  few.keypoints.resize(10);
  few.descriptors.conservativeResize(10, Eigen::NoChange);
  const Query query = MakeQuery(few, ModelRoom().camera, {});
  EXPECT_EQ(model.LookCloser(*map, query)->scores, model.Look(few.descriptors).scores);
  const Query blank = MakeQuery({}, ModelRoom().camera, {});
  const PlaceScores nothing = *model.LookCloser(*map, blank);
  for (const double p : nothing.probabilities) EXPECT_NEAR(p, 1.0 / model.num_nodes(), 1e-12);
  RerankOptions none;
  none.num_candidates = 0;
  EXPECT_EQ(model.LookCloser(*map, query, none)->scores, model.Look(few.descriptors).scores);
  none.baseline_ratio = 0;
  EXPECT_EQ(model.LookCloser(*map, query, none).error().code, ErrorCode::kInvalidArgument);
}

TEST(PlaceModel, ViewsOfImagesShowTheirLandmarks) {
  const auto map = RoomMap();
  const PlaceView view = *ViewOfImage(*map, 5);
  const MapImage& image = ModelRoom().rows.images[5];
  ASSERT_EQ(view.bearings.size(), image.landmarks.size());
  EXPECT_EQ(view.packed.size(), static_cast<int>(image.landmarks.size()));
  const Eigen::Vector3d point = image.cam_from_world * ModelRoom().points[image.landmarks[7]];
  EXPECT_LT((view.bearings[7] - point.normalized()).norm(), 1e-9);
}

TEST(PlaceModel, OptionsHaveTheirRanges) {
  ExpectLimits<PlaceModelOptions>({{"score_exponent", "0.001", "0.0009", "100", "100.001"}});
}

}  // namespace
}  // namespace cairn
