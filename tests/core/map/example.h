#pragma once

#include "core/plan/views.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/appearance.h"
#include "core/world/decomposition.h"
#include "core/world/feature_class.h"
#include "core/world/visual_map.h"
#include "core/world/world.h"

namespace cairn {

// Three stations in a row, an image at each, four classes (ids 10 to 13) on the wall ahead; images 1, 2 and 4
// have poses, image 3 is a document of the vocabulary without one.
//
//   class     10 11 12 13
//   image 1    x  x             station 0
//   image 2    x  x  x  x       station 1      regions: 0 = {stations 1, 2; classes 12, 13}
//   image 4          x  x       station 2               1 = {stations 0, 1; classes 10, 12}
struct EmitExample {
  Classes classes;
  World world;
  Decomposition decomposition;
  Vocabulary vocabulary;
  // A path 1 - 2 - 4 with image 3 at its end; image 2 is kept.
  Appearance appearance;
};

inline EmitExample MakeEmitExample() {
  EmitExample example;
  Camera camera;
  camera.camera_id = 3;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 200;
  camera.height = 100;
  camera.params = {100, 100, 50};
  example.classes.cameras = {camera};
  for (const ImageId image_id : {1u, 2u, 4u}) {
    SurveyImage image;
    image.image_id = image_id;
    image.name = "image" + std::to_string(image_id) + ".png";
    image.camera_id = 3;
    image.cam_from_world.translation = {-1.0 * image_id, 0, 0};
    example.classes.images.push_back(image);
  }
  const std::vector<std::vector<ImageId>> seen_in = {{1, 2}, {1, 2}, {2, 4}, {2, 4}};
  for (int i = 0; i < 4; ++i) {
    FeatureClass feature_class;
    feature_class.class_id = 10 + i;
    feature_class.position = {i + 0.12344, 0.5, 2};
    feature_class.covariance = Eigen::Vector3d(1e-4, 2e-4, 3e-4).asDiagonal();
    feature_class.descriptor.setConstant(static_cast<uint8_t>(10 * i));
    for (const ImageId image_id : seen_in[i]) {
      feature_class.observations.push_back({image_id, 0, Keypoint{50, 50, 3, 0}});
    }
    example.classes.classes.push_back(feature_class);
  }
  example.world.positions = {{1, 0}, {2, 0}, {4, 0}};
  example.world.headings_deg = {90, 90, 90};
  example.world.edges = {{0, 1}, {1, 2}};
  example.world.areas = {{0, 1}, {1, 2}, {1, 2}};
  example.world.class_ids = {10, 12, 13};
  example.world.station_images = {{1}, {2}, {4}};
  example.decomposition.algorithm = "b2";
  example.decomposition.lower_bound = 2;
  example.decomposition.uncovered_limit = 1;
  example.decomposition.k = 2;
  example.decomposition.regions = {{.features = {1, 2}, .stations = {1, 2}},
                                   {.features = {0, 1}, .stations = {0, 1}}};
  example.decomposition.uncovered = {2};

  for (const ImageId image_id : {1u, 2u, 3u, 4u}) example.appearance.nodes.push_back({.images = {image_id}});
  example.appearance.nodes[1].role = NodeRole::kDominating;
  example.appearance.graph = AppearanceGraph(4, {{0, 1, 20}, {1, 3, 30}, {2, 3, 40}});
  example.appearance.lower_bounds = {1};
  for (int i = 0; i < 4; ++i) example.appearance.nodes[i].entropy = 0.25 * (i + 1);
  example.appearance.confusable = {{0, 2, 0.75}, {0, 3, 0.5}};

  Vocabulary& vocabulary = example.vocabulary;
  vocabulary.branching = 2;
  vocabulary.depth = 1;
  vocabulary.nodes.resize(3);
  vocabulary.nodes[0].num_children = 2;
  vocabulary.centres = DescriptorMatrix::Zero(3, kSiftDescriptorDim);
  vocabulary.centres(1, 0) = 255;
  vocabulary.centres(2, 1) = 255;
  (void)NumberVocabularyNodes(&vocabulary);
  vocabulary.document_ids = {1, 2, 3, 4};
  vocabulary.inverted_files = {{{0, 2}, {2, 5}}, {{2, 1}, {3, 1}}};
  WeightVocabulary(&vocabulary);
  return example;
}

// A room of 2 x 1 m as a plan of four walls, in two regions; the right one does not see the right wall.
//
//   3-----2-----5
//   |  0  |  1  |
//   0-----1-----4
inline Views MakeExampleViews() {
  Views views;
  FloorPlan& plan = views.plan;
  plan.grid_m = 0.01;
  plan.origin = {-1, 0.5};
  plan.closed = true;
  plan.high = {200, 100};
  plan.vertices = {{0, 0}, {200, 0}, {200, 100}, {0, 100}};
  for (int32_t i = 0; i < 4; ++i) {
    plan.pieces.push_back({i, (i + 1) % 4, i});
    plan.walls.push_back({plan.Metres(plan.vertices[i]), plan.Metres(plan.vertices[(i + 1) % 4])});
  }
  views.vertices = {{0, 0}, {100, 0}, {100, 100}, {0, 100}, {200, 0}, {200, 100}};
  views.face_vertices = {0, 1, 2, 3, 1, 4, 5, 2};
  views.face_offsets = {0, 4, 8};
  views.parents = {-1, 0};
  views.toggled_labels = {0, 2, 4, 6, 2};
  views.toggle_offsets = {0, 4, 5};
  views.index = {{4, 6, 6, 2, 2}, {3, 5, 5, 1.5F, 2}};
  views.links = {{0, 1, 1, 2}};
  return views;
}

// Models of the first and the last of three landmarks, of sights in three images.
inline VisualMapData MakeExampleVisualMap() {
  VisualMapData visual_map;
  visual_map.camera_id = 3;
  visual_map.focal_px = 321.5F;
  visual_map.errors = {0.01F, 0.02F, 1.5F, 0.06F};
  visual_map.headings_deg = {0, 90, 180.25};
  visual_map.landmarks.resize(3);
  HeadingModel model{.heading = 0, .shape = {2, 3}, .sigma = {0.5, 0.25, 0.125}};
  for (int32_t image = 0; image < 3; ++image)
    model.sights.push_back({image, {100.125F + image, 50, 1.5F - 0.25F * image}});
  visual_map.landmarks[0] = {model};
  model.heading = 2;
  model.predicts_badly = true;
  visual_map.landmarks[2] = {visual_map.landmarks[0][0], model};
  const Status status = RoundAsStored(&visual_map);
  return status.ok() ? visual_map : VisualMapData();
}

}  // namespace cairn
