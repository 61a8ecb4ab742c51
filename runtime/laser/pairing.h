#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/plan/floor_plan.h"
#include "runtime/laser/interpretation_tree.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// What a pairing of one segment with a label says about the pose [Simsarian96 §2.3]: its heading, radians,
// and a line of places, metres, as the segment may be any portion of the wall.
struct Pairing {
  bool possible = false;
  double heading = 0;
  Eigen::Vector2d from = Eigen::Vector2d::Zero(),
                  to = Eigen::Vector2d::Zero();  // places of the robot: a line
};
Pairing MakePairing(const FloorPlan& plan, const ScanSegment& segment, LabelIdx label,
                    double length_tolerance_m);

// Distance of the places of two pairings, metres.
double LineToLine(const Pairing& a, const Pairing& b);
// Whether a pairing's line of places comes within `reach` of a box.
bool Touches(const Eigen::AlignedBox2f& box, const Pairing& pairing, double reach);

// Most null matches that an interpretation of this many segments may have.
int MaxNumNulls(size_t num_segments, const InterpretationTreeOptions& options);

// All pairings of segments with labels, and how far two that are both true may differ: by what the options
// and the fits allow.
class PairingTable {
 public:
  // All arguments outlive this.  O(segments * labels)
  PairingTable(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
               const InterpretationTreeOptions& options);

  const Pairing& Of(int segment, LabelIdx label) const {
    return pairings_[static_cast<size_t>(segment) * plan_.num_labels() + label];
  }

  // Direction of a label, of length 1.
  const Eigen::Vector2d& Along(LabelIdx label) const { return along_[label]; }

  // Tolerance of heading from the fit of one segment, radians.
  double AngleTolerance(int segment) const { return angle_tolerance_[segment]; }
  // Tolerance of places from the fit of one segment, metres.
  double PlaceTolerance(int segment) const { return place_tolerance_[segment]; }
  // Tolerances between the pairings of two segments; the second includes how far walls may stand from where
  // the plan says.
  double AngleTolerance(int a, int b) const;
  double LoosePlaceTolerance(int a, int b) const;
  // Tolerance of the ends of a pairing's places along the wall, from the fit and from how far the wall may
  // stand from the plan.
  double EndTolerance(int segment) const { return end_tolerance_[segment]; }
  // Whether two pairings can both be true.
  bool Agree(int a, LabelIdx label_a, int b, LabelIdx label_b) const;

  // Appends the labels whose pairings with a segment are possible and have a heading within `tolerance_rad`.
  void LabelsWithHeading(int segment, double heading, double tolerance_rad,
                         std::vector<LabelIdx>* labels) const;

 private:
  const FloorPlan& plan_;
  const std::vector<ScanSegment>& segments_;
  const InterpretationTreeOptions& options_;
  std::vector<Pairing> pairings_;
  std::vector<Eigen::Vector2d> along_;
  std::vector<std::pair<double, LabelIdx>> by_angle_;  // of the label, radians in [-pi, pi]
  std::vector<double> angle_tolerance_, place_tolerance_, loose_place_tolerance_, end_tolerance_;
};

}  // namespace cairn
