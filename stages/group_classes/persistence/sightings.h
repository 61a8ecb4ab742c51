#pragma once

#include <vector>

#include "core/world/feature_class.h"
#include "stages/group_classes/persistence/surroundings.h"

namespace cairn::group_classes {

// How readily one image would see one class if it were there: `visibility` is the share of images taken from
// near where this one was, in other sessions that know the class, that saw it.
struct ExpectedView {
  int image = 0;         // index into Classes::images
  float visibility = 0;  // in [0, 1]
  bool seen = false;
};

// Per class, ascending by image: the images of all sessions that could have seen it, and those that did.
//
// A class could be seen where it lies inside of the image, not farther than twice as far as it was ever seen,
// and not behind what the image itself sees there.  The share is a kernel regression over viewpoints:
// neighbours weigh by the angle between both at the class (kernel of 10 degrees) and
// the ratio of their distances (a kernel of sqrt(2)).  So walls, furniture and the descriptor's range need no
// model of their own: where a wall hides the class from here it also hid it from nearby.  Where the sessions
// that know the class were never near, nothing is expected.
//
// Images that show landmarks alone are expected to see nothing but what they do.  Pure; the same for any
// number of threads.  O(classes x images near their viewpoints).
using ClassViews = std::vector<ExpectedView>;
std::vector<ClassViews> FindExpectedViews(const Classes& classes, const ImageSessions& images,
                                          int num_threads);

}  // namespace cairn::group_classes
