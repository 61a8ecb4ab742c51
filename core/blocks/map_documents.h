#pragma once

#include <vector>

#include "core/blocks/map_rows.h"

namespace cairn {

// Whether each image is one that retrieval finds, by `documents`.  REQUIRES: images of the nodes exist
std::vector<char> DocumentImages(const MapRows& rows);

// Fills the empty inverted files of a map's tree: which of the images, where they are documents, sees how
// many of a word's landmarks.
void AddDocuments(const DescriptorMatrix& landmark_descriptors, const std::vector<MapImage>& images,
                  const std::vector<char>& is_document, Vocabulary* tree);

// The map with all images as documents.
MapRows WithAllDocuments(MapRows rows);

}  // namespace cairn
