#include "stages/decompose_views/node_segments.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>

#include <geos/geom/CoordinateArraySequence.h>
#include <geos/geom/PrecisionModel.h>
#include <geos/noding/NodedSegmentString.h>
#include <geos/noding/snapround/SnapRoundingNoder.h>
#include <geos/util/GEOSException.h>
#include <geos/util/Interrupt.h>

namespace cairn {
namespace {

using geos::geom::Coordinate;
using geos::noding::NodedSegmentString;
using geos::noding::SegmentString;

// GEOS asks one callback per process.
std::mutex interrupt_mutex;
const Progress* interrupt_progress = nullptr;

void InterruptIfCancelled() {
  if (interrupt_progress != nullptr && interrupt_progress->Cancelled()) geos::util::Interrupt::request();
}

class InterruptScope {
 public:
  explicit InterruptScope(const Progress& progress) : lock_(interrupt_mutex) {
    interrupt_progress = &progress;
    previous_ = geos::util::Interrupt::registerCallback(&InterruptIfCancelled);
  }
  ~InterruptScope() {
    geos::util::Interrupt::registerCallback(previous_);
    geos::util::Interrupt::cancel();
    interrupt_progress = nullptr;
  }

 private:
  std::lock_guard<std::mutex> lock_;
  geos::util::Interrupt::Callback* previous_;
};

// GEOS's vectors of raw pointers, owned.
struct Strings {
  std::vector<SegmentString*> strings;
  ~Strings() {
    for (const SegmentString* string : strings) delete string;
  }
};

GridPoint Rounded(const Coordinate& coordinate) {
  return {std::llround(coordinate.x), std::llround(coordinate.y)};
}

void Collect(const std::vector<SegmentString*>& strings, NodedSegments* result) {
  for (const SegmentString* string : strings) {
    for (size_t i = 0; i < string->size(); ++i) result->vertices.push_back(Rounded(string->getCoordinate(i)));
  }
  std::sort(result->vertices.begin(), result->vertices.end());
  result->vertices.erase(std::unique(result->vertices.begin(), result->vertices.end()),
                         result->vertices.end());
  const auto index = [&](const Coordinate& coordinate) {
    const auto found =
        std::lower_bound(result->vertices.begin(), result->vertices.end(), Rounded(coordinate));
    return static_cast<int32_t>(found - result->vertices.begin());
  };
  for (const SegmentString* string : strings) {
    const TaggedSegment& segment = *static_cast<const TaggedSegment*>(string->getData());
    for (size_t i = 0; i + 1 < string->size(); ++i) {
      result->edges.push_back(
          {index(string->getCoordinate(i)), index(string->getCoordinate(i + 1)), segment.tag});
    }
  }
  std::erase_if(result->edges, [](const NodedEdge& edge) { return edge.start == edge.end; });
  std::sort(result->edges.begin(), result->edges.end(), [](const NodedEdge& a, const NodedEdge& b) {
    return std::tie(a.start, a.end, a.tag) < std::tie(b.start, b.end, b.tag);
  });
}

}  // namespace

Result<NodedSegments> NodeSegments(const std::vector<TaggedSegment>& segments, const Progress& progress) {
  NodedSegments result;
  if (segments.empty()) return result;
  const InterruptScope scope(progress);
  try {
    Strings input, output;
    for (const TaggedSegment& segment : segments) {
      auto points = std::make_unique<geos::geom::CoordinateArraySequence>(2, 2);
      points->setAt(Coordinate(segment.start.x(), segment.start.y()), 0);
      points->setAt(Coordinate(segment.end.x(), segment.end.y()), 1);
      input.strings.push_back(new NodedSegmentString(points.release(), &segment));
    }
    const geos::geom::PrecisionModel grid(1.0);
    geos::noding::snapround::SnapRoundingNoder noder(&grid);
    noder.computeNodes(&input.strings);
    const std::unique_ptr<std::vector<SegmentString*>> noded(noder.getNodedSubstrings());
    output.strings.swap(*noded);
    Collect(output.strings, &result);
    return result;
  } catch (const geos::util::GEOSException& exception) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
    return MakeError(ErrorCode::kFailed, "noding {} segments: {}", segments.size(), exception.what());
  }
}

}  // namespace cairn
