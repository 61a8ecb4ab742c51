#pragma once

#include <string>
#include <utility>
#include <vector>

#include "runtime/map/map.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {

// A descriptor that is word `word`, and no other, of VisualMemory.
inline DescriptorMatrix DescriptorsOf(const std::vector<WordIdx>& words) {
  DescriptorMatrix descriptors =
      DescriptorMatrix::Zero(static_cast<Eigen::Index>(words.size()), kSiftDescriptorDim);
  for (size_t i = 0; i < words.size(); ++i) descriptors(static_cast<Eigen::Index>(i), words[i]) = 255;
  return descriptors;
}

// A map of images with these words (below 128), a kept node each, linked as said; entropies, if there are
// any, per node.
inline MapRows VisualMemory(const std::vector<std::vector<WordIdx>>& words_of_image,
                            const std::vector<std::pair<int, int>>& links,
                            const std::vector<double>& entropies = {}) {
  MapRows rows;
  Camera camera;
  camera.width = camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  rows.landmarks.resize(1);
  rows.descriptors = DescriptorsOf({0});
  Vocabulary& vocabulary = rows.vocabulary;
  vocabulary.branching = kSiftDescriptorDim;
  vocabulary.depth = 1;
  vocabulary.nodes.resize(1 + kSiftDescriptorDim);
  vocabulary.nodes[0].num_children = kSiftDescriptorDim;
  vocabulary.centres = DescriptorMatrix::Zero(1 + kSiftDescriptorDim, kSiftDescriptorDim);
  for (int i = 0; i < kSiftDescriptorDim; ++i) vocabulary.centres(1 + i, i) = 255;
  EXPECT_TRUE(NumberVocabularyNodes(&vocabulary).ok());
  for (size_t i = 0; i < words_of_image.size(); ++i) {
    rows.images.push_back({.image_id = static_cast<ImageId>(i + 1),
                           .name = "image" + std::to_string(i),
                           .camera_id = 1,
                           .cam_from_world = PoseAt({static_cast<double>(i), 0, 0}, 90)});
    vocabulary.document_ids.push_back(static_cast<ImageId>(i + 1));
    for (const WordIdx word : words_of_image[i])
      vocabulary.inverted_files[word].push_back({static_cast<int32_t>(i), 1});
    rows.appearance.push_back({.images = {static_cast<int32_t>(i)}, .is_kept = true});
    if (!entropies.empty()) rows.appearance.back().entropy = entropies[i];
  }
  for (const auto& [a, b] : links) rows.appearance[a].links.push_back({b, 20});
  WeightVocabulary(&vocabulary);
  return rows;
}

}  // namespace cairn
