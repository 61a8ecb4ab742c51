#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "core/text.h"

namespace cairn {

// Whether the words are triples of numbers (X Y POINT3D_ID of keypoints), as the second line of an image
// holds them in images.txt; it may be empty.
inline bool IsPointsLine(const std::vector<std::string>& words) {
  double value = 0;
  return words.size() % 3 == 0 && std::all_of(words.begin(), words.end(), [&](const std::string& word) {
           return ParseNumber(word, &value);
         });
}

}  // namespace cairn
