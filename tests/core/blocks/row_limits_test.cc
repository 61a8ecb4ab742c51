// Rows of a map at the limits of what they may be and beyond, and what is counted of them.
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_documents.h"
#include "core/blocks/map_rows.h"
#include "core/blocks/node_poses.h"
#include "core/capture/sessions.h"
#include "tests/core/map/full_rows.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string RowsRefusal(const std::function<void(MapRows&)>& change) {
  static const MapRows valid = FullRows();
  MapRows rows = valid;
  change(rows);
  const Status status = CheckMapRows(rows);
  return status.ok() ? "" : status.error().message;
}

TEST(RowLimits, RotationsAreOfLengthOneUpToAMillionth) {
  for (const double factor : {1 - 9e-7, 1 + 9e-7}) {
    EXPECT_EQ(RowsRefusal([&](MapRows& r) { r.floor_from_world.rotation.coeffs() *= factor; }), "");
    EXPECT_EQ(RowsRefusal([&](MapRows& r) { r.images[1].cam_from_world.rotation.coeffs() *= factor; }), "");
  }
  for (const double factor : {1 - 1.1e-6, 1 + 1.1e-6}) {
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.floor_from_world.rotation.coeffs() *= factor; }),
                HasSubstr("a frame"));
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.camera_from_given.rotation.coeffs() *= factor; }),
                HasSubstr("a frame"));
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.images[1].cam_from_world.rotation.coeffs() *= factor; }),
                HasSubstr("pose"));
  }
}

TEST(RowLimits, NumbersOfTheHeadAreInRange) {
  for (const double good : {0.0, 1.0})
    EXPECT_EQ(RowsRefusal([&](MapRows& r) { r.keypoint_correlation = good; }), "");
  for (const double bad : {-1e-9, 1 + 1e-9, std::nan("")})
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.keypoint_correlation = bad; }),
                HasSubstr("correlation of keypoints"));
  EXPECT_EQ(RowsRefusal([](MapRows& r) { r.covariance_scale = 0; }), "");
  EXPECT_THAT(RowsRefusal([](MapRows& r) { r.covariance_scale = 0.05; }), HasSubstr("scale of covariances"));
  EXPECT_THAT(RowsRefusal([](MapRows& r) { r.covariance_scale = std::nan(""); }),
              HasSubstr("scale of covariances"));
  const auto sessions = [](size_t num) {
    return RowsRefusal([&](MapRows& r) {
      r.findings.changes.clear();
      r.sessions.clear();
      for (size_t i = 0; i < num; ++i) r.sessions.push_back("s" + std::to_string(i));
    });
  };
  EXPECT_EQ(sessions(kMaxNumSessions), "");
  EXPECT_THAT(sessions(kMaxNumSessions + 1), HasSubstr("sessions, at most "));
  EXPECT_THAT(RowsRefusal([](MapRows& r) {
                r.sessions = {"a", "b", "b"};
              }),
              HasSubstr("session 'b' is listed twice"));
}

// Each camera, from the first to the last one.
TEST(RowLimits, CamerasHaveTheParametersOfTheirModel) {
  for (size_t i = 0; i < FullRows().cameras.size(); ++i)
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.cameras[i].params.pop_back(); }),
                HasSubstr(fmt::format("camera {}", FullRows().cameras[i].camera_id)));
}

// Each station, from the first to the last one.
TEST(RowLimits, StationsStandAtFinitePlaces) {
  for (size_t i = 0; i < FullRows().stations.size(); ++i) {
    const std::string refusal = fmt::format("station {}: its place is not finite", i);
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.stations[i].position.x() = std::nan(""); }),
                HasSubstr(refusal));
    EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.stations[i].heading_deg = HUGE_VAL; }), HasSubstr(refusal));
  }
}

// As many as the regions that there are, or none; no station may be left uncovered, or any number.
TEST(RowLimits, LowerBoundsAreOfRegionsThatThereAre) {
  const auto refusal = [](std::optional<int> lower_bound, int uncovered_limit) {
    return RowsRefusal([&](MapRows& r) {
      r.lower_bound = lower_bound;
      r.uncovered_limit = uncovered_limit;
    });
  };
  const auto num_regions = static_cast<int>(FullRows().regions.size());
  for (const int uncovered_limit : {0, 1, 1'000'000}) {
    for (const std::optional<int> lower_bound :
         {std::optional<int>(), std::optional(0), std::optional(num_regions)})
      EXPECT_EQ(refusal(lower_bound, uncovered_limit), "");
    EXPECT_THAT(refusal(num_regions + 1, uncovered_limit), HasSubstr("with a lower bound of"));
    EXPECT_THAT(refusal(-1, uncovered_limit), HasSubstr("with a lower bound of -1"));
  }
  EXPECT_THAT(refusal({}, -1), HasSubstr("-1 stations uncovered"));
}

TEST(RowLimits, ModelsHaveKernelsThatThereAre) {
  const auto refusal = [](KernelShape shape) {
    return RowsRefusal([&](MapRows& r) { r.visual_map.landmarks[0][0].shape = shape; });
  };
  for (const int length : {0, kNumKernelLengths - 1}) {
    for (const int noise : {0, kNumKernelNoises - 1}) EXPECT_EQ(refusal({length, noise}), "");
    for (const int noise : {-1, int{kNumKernelNoises}})
      EXPECT_THAT(refusal({length, noise}),
                  HasSubstr(fmt::format("there is no kernel {}, {}", length, noise)));
  }
  for (const int length : {-1, int{kNumKernelLengths}})
    EXPECT_THAT(refusal({length, 0}), HasSubstr(fmt::format("there is no kernel {}, 0", length)));
}

// Cameras 3 and 9 of the map, as the capture states them.
TEST(RowLimits, StatedCamerasAreCamerasOfTheMapInOrder) {
  const auto refusal = [](const std::function<void(MapRows&)>& change) {
    return RowsRefusal([&](MapRows& r) {
      r.stated_cameras = r.cameras;
      for (Camera& camera : r.stated_cameras) camera.params[0] += 1;
      change(r);
    });
  };
  EXPECT_EQ(refusal([](MapRows&) {}), "");
  EXPECT_THAT(refusal([](MapRows& r) { r.stated_cameras[1].width += 1; }),
              HasSubstr("stated camera 9 is out of order, or no camera"));
  EXPECT_THAT(refusal([](MapRows& r) { r.stated_cameras[0].height += 1; }), HasSubstr("stated camera 3"));
  EXPECT_THAT(refusal([](MapRows& r) { r.stated_cameras[0].camera_id = 4; }), HasSubstr("stated camera 4"));
  EXPECT_THAT(refusal([](MapRows& r) { std::swap(r.stated_cameras[0], r.stated_cameras[1]); }),
              HasSubstr("stated camera 3"));
  EXPECT_THAT(refusal([](MapRows& r) { r.stated_cameras[1] = r.stated_cameras[0]; }),
              HasSubstr("stated camera 3"));
  EXPECT_THAT(refusal([](MapRows& r) { r.stated_cameras[1].params.clear(); }), HasSubstr("camera 9"));
}

TEST(RowLimits, PlacesAreWithin200KilometresOnEveryAxis) {
  const double beyond = 2e5 + 1e-3;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      EXPECT_EQ(RowsRefusal([&](MapRows& r) { r.landmarks[1].position[axis] = sign * 2e5; }), "");
      EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.landmarks[1].position[axis] = sign * beyond; }),
                  HasSubstr("landmark 1 lies more"));
      EXPECT_EQ(RowsRefusal([&](MapRows& r) { r.images[1].cam_from_world.translation[axis] = sign * 2e5; }),
                "");
      EXPECT_THAT(
          RowsRefusal([&](MapRows& r) { r.images[1].cam_from_world.translation[axis] = sign * beyond; }),
          HasSubstr("pose"));
      if (axis < 2)
        EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.stations[1].position[axis] = sign * beyond; }),
                    HasSubstr("station 1"));
    }
  }
  EXPECT_EQ(RowsRefusal([](MapRows& r) { r.landmarks[1].scale_m = 2e5; }), "");
  EXPECT_THAT(RowsRefusal([&](MapRows& r) { r.landmarks[1].scale_m = beyond; }),
              HasSubstr("landmark 1 lies more"));
  EXPECT_EQ(RowsRefusal([](MapRows& r) { r.landmarks[1].covariance.setZero(); }), "");
}

TEST(RowLimits, DescriptorsAreOfTheMapsKind) {
  EXPECT_THAT(RowsRefusal([](MapRows& r) { r.descriptors.conservativeResize(2, kSiftDescriptorDim); }),
              HasSubstr("3 landmarks, but 2 descriptors"));
  EXPECT_THAT(RowsRefusal([](MapRows& r) { r.descriptors = DescriptorMatrix::Zero(3, 64); }),
              HasSubstr("descriptors of 64 values, expected 128"));
  EXPECT_THAT(RowsRefusal([](MapRows& r) {
                r.vocabulary.centres = DescriptorMatrix::Zero(r.vocabulary.centres.rows(), 64);
              }),
              HasSubstr("words of descriptors of the kind"));
  EXPECT_THAT(RowsRefusal([](MapRows& r) { r.vocabulary.kind = {.type = DescriptorType::kFloat}; }),
              HasSubstr("words of descriptors"));
  EXPECT_EQ(RowsRefusal([](MapRows& r) { r.descriptor_code = TransformCode(); }), "");
  EXPECT_THAT(RowsRefusal([](MapRows& r) {
                r.vocabulary = {};
                r.descriptor_kind = {.type = DescriptorType::kFloat};
                r.descriptor_code = TransformCode();
              }),
              HasSubstr("a code of SIFT's descriptors"));
}

TEST(RowLimits, ImagesSeeAtMost262144Landmarks) {
  const auto sees = [](int num) {
    return RowsRefusal([&](MapRows& r) {
      r.visual_map = {};
      r.landmarks.resize(num);
      r.descriptors = DescriptorMatrix::Zero(num, kSiftDescriptorDim);
      r.images[0].landmarks.resize(num);
      for (int i = 0; i < num; ++i) r.images[0].landmarks[i] = i;
    });
  };
  EXPECT_EQ(sees(1 << 18), "");
  EXPECT_THAT(sees((1 << 18) + 1), HasSubstr("262145 landmarks, at most 262144 are stored"));
}

TEST(RowLimits, PlansHaveWallsAndVerticesByUse) {
  EXPECT_THAT(RowsRefusal([](MapRows& r) { r.views.plan.walls.clear(); }),
              HasSubstr("2 regions of a floor plan without walls"));
  EXPECT_THAT(RowsRefusal([](MapRows& r) {
                std::swap(r.views.vertices[0], r.views.vertices[1]);
                for (int32_t& vertex : r.views.face_vertices)
                  vertex = vertex == 0 ? 1 : vertex == 1 ? 0 : vertex;
                r.views.links[0].start = 0;
              }),
              HasSubstr("vertices are not numbered as regions name them"));
}

// Images 0 and 1 stand at station 0 and see 0, 1 and 1, 2; image 2 at station 2; the last at none.
TEST(RowLimits, LandmarksAreCountedOncePerStation) {
  MapRows rows;
  rows.stations.resize(3);
  rows.landmarks.resize(4);
  rows.images.resize(4);
  rows.images[0].station = rows.images[1].station = 0;
  rows.images[2].station = 2;
  rows.images[0].landmarks = {0, 1};
  rows.images[1].landmarks = {1, 2};
  rows.images[2].landmarks = {3};
  rows.images[3].landmarks = {0, 1, 2, 3};
  EXPECT_THAT(LandmarksSeenAt(rows), ElementsAre(3, 0, 1));
  EXPECT_THAT(LandmarksSeenAt(rows, {0, 1, 1, 0}), ElementsAre(2, 0, 0));
}

TEST(RowLimits, TriedImagesAreCalledByHowTheyWereChosen) {
  MapHead head;
  EXPECT_EQ(TriedWord(head), "held-out");
  head.self_test[kLeftOutRunsFigure] = 0;
  EXPECT_EQ(TriedWord(head), "left-out");
}

// Node 1 is kept: its images 1 and 3 are documents, in which words are counted by the landmarks that are
// seen.
TEST(MapDocuments, AreTheImagesOfKeptNodes) {
  MapRows rows = FullRows();
  rows.images.resize(4, rows.images[0]);
  for (size_t i = 0; i < 4; ++i) rows.images[i].image_id = static_cast<ImageId>(i + 10);
  rows.appearance = {{.images = {0}}, {.images = {1, 3}, .is_kept = true}, {.images = {2}}};
  rows.documents = "kept";
  EXPECT_THAT(DocumentImages(rows), ElementsAre(0, 1, 0, 1));
  rows.documents = "all";
  EXPECT_THAT(DocumentImages(rows), ElementsAre(1, 1, 1, 1));
}

TEST(MapDocuments, HaveTheWordsOfTheLandmarksThatTheySee) {
  MapRows rows;
  rows.vocabulary.branching = 2;
  rows.vocabulary.depth = 1;
  rows.vocabulary.nodes.resize(3);
  rows.vocabulary.nodes[0].num_children = 2;
  rows.vocabulary.centres = DescriptorMatrix::Zero(3, kSiftDescriptorDim);
  rows.vocabulary.centres(1, 0) = 255;
  rows.vocabulary.centres(2, 1) = 255;
  ASSERT_TRUE(NumberVocabularyNodes(&rows.vocabulary).ok());
  rows.vocabulary.inverted_files.resize(2);
  // Landmarks 0 and 2 are of word 0, landmark 1 of word 1.
  rows.descriptors = DescriptorMatrix::Zero(3, kSiftDescriptorDim);
  rows.descriptors(0, 0) = rows.descriptors(2, 0) = 200;
  rows.descriptors(1, 1) = 200;
  rows.images.resize(3);
  for (size_t i = 0; i < 3; ++i) rows.images[i].image_id = static_cast<ImageId>(i + 10);
  rows.images[0].landmarks = {0, 1, 2};
  rows.images[1].landmarks = {1};
  rows.images[2].landmarks = {2};
  Vocabulary some = rows.vocabulary;
  AddDocuments(rows.descriptors, rows.images, {1, 0, 1}, &some);
  EXPECT_THAT(some.document_ids, ElementsAre(10, 12));
  EXPECT_THAT(some.inverted_files[0], ElementsAre(Posting{0, 2}, Posting{1, 1}));
  EXPECT_THAT(some.inverted_files[1], ElementsAre(Posting{0, 1}));
  rows.documents = "kept";
  rows.vocabulary = some;
  const MapRows all = WithAllDocuments(rows);
  EXPECT_EQ(all.documents, "all");
  EXPECT_THAT(all.vocabulary.document_ids, ElementsAre(10, 11, 12));
  EXPECT_THAT(all.vocabulary.inverted_files[0], ElementsAre(Posting{0, 2}, Posting{2, 1}));
  EXPECT_THAT(all.vocabulary.inverted_files[1], ElementsAre(Posting{0, 1}, Posting{1, 1}));
  rows.vocabulary = {};
  EXPECT_TRUE(WithAllDocuments(rows).vocabulary.document_ids.empty());
}

// Nodes 0; 1 to 2 between images 0 and 1, which a turn of 90 degrees about z lies between; 3 between 0 and
// 2; 4.
TEST(NodePoses, NodesOfTheSameTwoImagesShareTheTurnEvenly) {
  MapRows rows;
  rows.images.resize(3);
  rows.images[1].cam_from_world.rotation = Eigen::AngleAxisd(std::acos(-1) / 2, Eigen::Vector3d::UnitZ());
  rows.images[2].cam_from_world.rotation = Eigen::AngleAxisd(-std::acos(-1) / 2, Eigen::Vector3d::UnitZ());
  rows.findings.promise = MapPromise{.nodes = {{0, 0}, {0, 0}, {0, 1}, {0, 1}, {0, 2}, {2, 2}}};
  const std::vector<Pose> poses = NodePoses(rows);
  ASSERT_EQ(poses.size(), 6u);
  const double expected_deg[] = {0, 0, 30, 60, -45, -90};
  for (size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Quaterniond expected(
        Eigen::AngleAxisd(expected_deg[i] * std::acos(-1) / 180, Eigen::Vector3d::UnitZ()));
    EXPECT_LT(poses[i].rotation.angularDistance(expected), 1e-6) << i;
  }
  // Of equally near ones the first.
  const std::optional<NearestNode> nearest =
      FindNearestNode(MapPromise{.radius_m = 1, .radius_deg = 10}, poses, rows.images[0].cam_from_world);
  ASSERT_TRUE(nearest);
  EXPECT_EQ(nearest->node, 0u);
  EXPECT_NEAR(nearest->squared_distance, 0, 1e-12);
  EXPECT_EQ(FindNearestNode(MapPromise{.radius_m = 1, .radius_deg = 10}, poses, rows.images[2].cam_from_world)
                ->node,
            5u);
  EXPECT_FALSE(FindNearestNode(MapPromise{}, {}, rows.images[0].cam_from_world));
}

TEST(LookAlikes, StandAtBothNodesAscending) {
  std::vector<std::vector<MapAppearanceNode::LookAlike>> nodes = {{{1, 0.5}, {2, 0.25}}, {}, {{3, 1}}, {}};
  CompleteLookAlikes(&nodes);
  using List = std::vector<MapAppearanceNode::LookAlike>;
  EXPECT_EQ(nodes[0], (List{{1, 0.5}, {2, 0.25}}));
  EXPECT_EQ(nodes[1], (List{{0, 0.5}}));
  EXPECT_EQ(nodes[2], (List{{0, 0.25}, {3, 1}}));
  EXPECT_EQ(nodes[3], (List{{2, 1}}));
}

// What a block takes in memory grows by what is put into it.
TEST(BlockMemory, GrowsByWhatABlockHolds) {
  LandmarkBlock landmarks;
  landmarks.descriptors = DescriptorMatrix::Zero(3, kSiftDescriptorDim);
  const int64_t none = NumBytes(landmarks);
  EXPECT_EQ(none, static_cast<int64_t>(sizeof(LandmarkBlock)) + landmarks.descriptors.num_bytes());
  landmarks.landmarks.resize(3);
  landmarks.image_blocks = {1, 2};
  EXPECT_EQ(NumBytes(landmarks) - none, static_cast<int64_t>(3 * sizeof(MapLandmark)) + 8);
  const int64_t without = NumBytes(landmarks);
  landmarks.regions = {{0, {1, 2, 3}}, {1, {4}}};
  EXPECT_EQ(NumBytes(landmarks) - without, 2 * static_cast<int64_t>(sizeof(landmarks.regions[0])) + 4 * 4);

  ImageBlock images;
  EXPECT_EQ(NumBytes(images), static_cast<int64_t>(sizeof(ImageBlock)));
  images.images.resize(2);
  images.images[0].name.reserve(100);
  images.images[1].landmarks.reserve(50);
  EXPECT_EQ(NumBytes(images), static_cast<int64_t>(sizeof(ImageBlock) + 2 * sizeof(MapImage) +
                                                   images.images[0].name.capacity() +
                                                   images.images[1].name.capacity() + 50 * 4));
  StationBlock stations;
  stations.stations.resize(2);
  stations.neighbours = {{}, {1, 2, 3}};
  stations.regions = {{4, 5}, {}};
  const auto list = static_cast<int64_t>(sizeof(std::vector<int32_t>));
  EXPECT_EQ(NumBytes(stations), 2 * static_cast<int64_t>(sizeof(MapStation)) + 4 * list + 12 + 8);
  RegionBlock regions;
  regions.landmark_blocks = {{1}, {2, 3}};
  EXPECT_EQ(NumBytes(regions), 2 * list + 12);
  EXPECT_EQ(NumBytes(std::vector<float>(5)), 20);

  WordBlock words;
  words.bytes = std::string(100, 'x');
  words.begins.reserve(7);
  EXPECT_EQ(NumBytes(words), static_cast<int64_t>(sizeof(WordBlock) + words.bytes.capacity()) + 28);
  Vocabulary vocabulary;
  vocabulary.nodes.resize(3);
  vocabulary.centres = DescriptorMatrix::Zero(3, 64);
  vocabulary.inverted_files = {{{1, 1}, {2, 1}}};
  EXPECT_EQ(NumBytes(vocabulary), 3 * static_cast<int64_t>(sizeof(VocabularyNode)) + 3 * 64 + list + 16);

  AppearanceBlock nodes;
  nodes.nodes = {{.images = {1, 2}, .links = {{1, 5}, {2, 5}, {3, 5}}}, {.images = {3}}};
  EXPECT_EQ(NumBytes(nodes),
            static_cast<int64_t>(sizeof(AppearanceBlock) + 2 * sizeof(MapAppearanceNode)) + 12 + 24);
  AmbiguityBlock ambiguity;
  ambiguity.nodes = {{0.5, {{1, 0.5}, {2, 0.5}}}, {}};
  EXPECT_EQ(NumBytes(ambiguity),
            static_cast<int64_t>(sizeof(AmbiguityBlock) + 2 * sizeof(AmbiguityBlock::Node)) + 32);
  FloorPlan plan;
  plan.vertices.resize(4);
  plan.pieces.resize(5);
  plan.walls.resize(6);
  EXPECT_EQ(NumBytes(plan), static_cast<int64_t>(sizeof(FloorPlan) + 4 * sizeof(GridPoint) +
                                                 5 * sizeof(PlanPiece) + 6 * sizeof(PlanWall)));
  ViewBlock views;
  views.vertices.resize(3);
  views.regions.resize(2);
  views.regions[0].corners = {0, 1, 2};
  views.regions[0].toggled = {4, 5};
  views.regions[1].links.resize(2);
  EXPECT_EQ(NumBytes(views), static_cast<int64_t>(sizeof(ViewBlock) + 3 * sizeof(GridPoint) +
                                                  2 * sizeof(ViewBlock::Region) + 2 * sizeof(ViewLink)) +
                                 20);
  VisualBlock visual;
  visual.part.landmarks = {{{}, {}}, {{}}};
  visual.part.landmarks[1][0].sights.resize(4);
  EXPECT_EQ(NumBytes(visual),
            static_cast<int64_t>(sizeof(VisualBlock) + 3 * sizeof(HeadingModel) + 4 * sizeof(LandmarkSight)));
}

}  // namespace
}  // namespace cairn
