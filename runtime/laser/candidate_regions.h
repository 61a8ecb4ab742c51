#pragma once

#include <utility>
#include <vector>

#include "runtime/laser/pairing.h"
#include "runtime/laser/view_search_index.h"

namespace cairn {

// Which of a plan's regions a scan may have been taken in: the index functions of [Simsarian96 §2.3].
class CandidateRegions {
 public:
  // All arguments outlive this.
  CandidateRegions(const ViewSearchIndex& index, const std::vector<ScanSegment>& segments,
                   const InterpretationTreeOptions& options);

  // Regions that see enough walls: number (a) and length (b) of all, number by length, and the spread of
  // their directions.  Each with the difference between the length visible in it and the observed one
  // (logarithm of the ratio), by region.
  std::vector<std::pair<double, FaceIdx>> Find() const;

  // Those of `candidates` that see a label and can contain the robot if a segment belongs to the label: some
  // of the pairing's places lie in the region's box, and with its heading the directions of all segments are
  // those of the region's labels.
  FaceSet Seeing(const FaceSet& candidates, const PairingTable& table, int segment, LabelIdx label) const;
  // Those that see both labels and come within `reach` of a place, with the heading of a pose.
  FaceSet SeeingBoth(const FaceSet& candidates, LabelIdx a, LabelIdx b, const PlanarPose& pose,
                     double reach) const;

 private:
  double NumOthers(FaceIdx face) const;
  bool HasDirections(FaceIdx face, double heading) const;

  const ViewSearchIndex& index_;
  const std::vector<ScanSegment>& segments_;
  const InterpretationTreeOptions& options_;
  int max_nulls_ = 0;
  double observed_m_ = 0;
  ViewSearchIndex::Spectrum spectrum_{};  // of the segments
  double blur_ = 0;                       // what tolerances of angle may change in its first harmonic
};

}  // namespace cairn
