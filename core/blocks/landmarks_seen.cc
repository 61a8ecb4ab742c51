#include "core/blocks/landmarks_seen.h"

#include <algorithm>

namespace cairn {

std::vector<int> LandmarksSeenAt(const MapRows& rows) {
  return LandmarksSeenAt(rows, std::vector<char>(rows.landmarks.size(), 1));
}

std::vector<int> LandmarksSeenAt(const MapRows& rows, const std::vector<char>& counts) {
  std::vector<std::vector<LandmarkIdx>> seen(rows.stations.size());
  for (const MapImage& image : rows.images) {
    if (image.station < 0) continue;
    for (const LandmarkIdx landmark : image.landmarks) {
      if (counts[landmark] != 0) seen[image.station].push_back(landmark);
    }
  }
  std::vector<int> numbers;
  for (std::vector<LandmarkIdx>& at_station : seen) {
    std::sort(at_station.begin(), at_station.end());
    numbers.push_back(
        static_cast<int>(std::unique(at_station.begin(), at_station.end()) - at_station.begin()));
  }
  return numbers;
}

}  // namespace cairn
