#pragma once

#include <vector>

#include "core/blocks/map_rows.h"

namespace cairn {

// For each image, whether retrieval finds it, by `documents`.  REQUIRES: images of the nodes exist
std::vector<char> DocumentImages(const MapRows& rows);

// Fills the empty inverted files of a map's tree: for each word, the documents that see landmarks of it, and
// how many.
void AddDocuments(const DescriptorMatrix& landmark_descriptors, const std::vector<MapImage>& images,
                  const std::vector<char>& is_document, Vocabulary* tree);

// The map with all images as documents.
MapRows WithAllDocuments(MapRows rows);

}  // namespace cairn
