#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/capture/capture.h"
#include "core/geometry/floor_pose.h"
#include "stages/link_appearance/link_appearance.h"

namespace cairn::link_appearance {

// Where the nodes' images were taken on the floor, by the capture's poses: the mean place, and the heading
// where a node is one image.  Up is the mean of the cameras' up.  Nothing for nodes without poses.
std::vector<std::optional<FloorPose>> NodePlaces(const Appearance& appearance,
                                                 const std::vector<DatabaseImage>& images,
                                                 const Capture& capture);

// The name of each node's first image.
std::vector<std::string> NodeNames(const Appearance& appearance, const std::vector<DatabaseImage>& images);

// A picture of the graph as SVG.  With places (one per node, metres): a top view with pale links, each
// dropped node's best link to a kept node thin, links among kept nodes bold, kept nodes full, others hollow,
// nodes that restore cycles square; nodes at one place are moved apart along their headings.  Without: the
// connectivity matrix [Booij06 Fig. 8], a row and a column per node in the order of `names`, numbers in them
// by value, a dot where two nodes are linked, darker for more inliers, kept nodes marked along the sides and
// their links coloured.  Same input, same bytes.
std::string DrawAppearance(const Appearance& appearance, const std::vector<std::string>& names,
                           const std::vector<std::optional<FloorPose>>& places);

}  // namespace cairn::link_appearance
