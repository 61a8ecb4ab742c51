#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/plan/views.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// Segments by the direction in which they are seen, counter-clockwise.
std::vector<int> SegmentsInOrder(const std::vector<ScanSegment>& segments);

// A label per segment, by the segments' indices.
using OrderedLabels = std::vector<LabelIdx>;

// The strongest index function: from all places of a region its walls are seen in the same circular order, so
// where every visible wall has one segment, the segments' order is that of the walls, begun anywhere.
// Returns the ways to give each segment a label of its own in that order, such that `fits(segment, label)` is
// true of each and all headings that follow (label's direction less the segment's) agree within
// `tolerance_rad` of the first's.
//
// `order`: SegmentsInOrder.  A wall that is seen through several windows may have its segment in any of them.
// Nothing if the region's order is not usable: it does not show all of its labels, or there are too many
// ways.  O(k log k + k^2) for k labels, except for walls seen through several windows.
std::optional<std::vector<OrderedLabels>> LabelsInOrder(const Views& views, FaceIdx face,
                                                        const std::vector<ScanSegment>& segments,
                                                        const std::vector<int>& order, double tolerance_rad,
                                                        const std::function<bool(int, LabelIdx)>& fits);

}  // namespace cairn
