#pragma once

#include <vector>

#include "core/world/feature_class.h"

namespace cairn::group_classes {

// Neighbours are seen from the same side, within this cosine: a wall's other side is another surface.
inline constexpr double kMinSideCosine = 0.2;

// Per image of a survey.
struct ImageSessions {
  std::vector<int> session;  // -1: of none; it is not counted
  // Its features are landmarks of an earlier map: what it does not show may have been there.  Empty: none
  // are.
  std::vector<char> shows_landmarks_only;
};

// Where the classes of a survey lie, and what its images see, as persistence.h and changes.h need it.
struct Surroundings {
  std::vector<Eigen::Vector3d>
      sides;  // from which each class is seen: the mean direction to its images, a unit vector
  double typical_distance = 1;  // from which classes are seen, on the median
  // Of each image: the classes that it sees, as part of what its session's images see on the median; at
  // most 1.
  std::vector<double> sight_ratio;
};

Surroundings SurroundingsOf(const Classes& classes, const ImageSessions& images);

}  // namespace cairn::group_classes
