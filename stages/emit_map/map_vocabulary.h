#pragma once

#include <vector>

#include "core/blocks/map_rows.h"
#include "core/vocabulary/vocabulary_tree.h"

namespace cairn::emit_map {

// `tree` cut down to what a map needs [Mariottini11 §IV: the tree]: a node with few landmarks below it
// becomes a word, branches without any are left out, so that the depth follows the size of the map.  Inverted
// files are those of the landmarks: for each word, the images that see landmarks of it, and how many.
// Differs from the source, whose files hold every feature of an image: features that are not landmarks cannot
// lead to a fix.  `landmarks_per_word`: a node with at most this many is not split.  `is_document`:
// per image.
Vocabulary CutVocabulary(const Vocabulary& tree, const DescriptorMatrix& landmark_descriptors,
                         const std::vector<MapImage>& images, const std::vector<char>& is_document,
                         double landmarks_per_word);

// `vocabulary` restricted to the images that are documents of the map [Mariottini11 §IV], with its inverted
// files unchanged.
Vocabulary SurveyVocabulary(const Vocabulary& vocabulary, const std::vector<MapImage>& images,
                            const std::vector<char>& is_document);

}  // namespace cairn::emit_map
