#include "stages/check_map/plan_agreement.h"

#include <cmath>

#include "core/base/parallel.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/planar_pose.h"
#include "runtime/beams/scan_locator.h"

namespace cairn::check_map {
namespace {

// The camera's pose on the floor that follows from the laser's.
FloorPose CameraOf(const PlanarPose& laser, const CheckMapOptions& options) {
  const double heading_rad = laser.heading_rad - RadFromDeg(options.scan_heading_deg);
  const Eigen::Vector2d to_laser(options.scan_x_m, options.scan_y_m);
  return {laser.position - Eigen::Rotation2Dd(heading_rad) * to_laser, DegFromRad(heading_rad)};
}

bool Agree(const FloorPose& a, const FloorPose& b, const CheckMapOptions& options) {
  return (a.position - b.position).norm() <= options.gross_error_m &&
         AngleBetweenDeg(a.heading_deg, b.heading_deg) <= options.gross_error_deg;
}

}  // namespace

Status CompareWithPlan(const MapRows& rows, const std::vector<HeldOutResult>& images,
                       const std::vector<ScanView>& scans, const CheckMapOptions& options, int num_threads,
                       Progress& progress, std::map<std::string, double>* figures) {
  if (!scans.empty() && scans.size() != images.size()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} scans for {} held-out images; scan i is to be taken with image i", scans.size(),
                     images.size());
  }
  std::vector<std::optional<FloorPose>> fixes(images.size());
  int num_fixes = 0, num_free = 0;
  for (size_t i = 0; i < images.size(); ++i) {
    if (!images[i].has_fix()) continue;
    fixes[i] =
        FloorPoseOf(rows.camera_from_given * images[i].localization.cam_from_world, rows.floor_from_world);
    ++num_fixes;
    num_free += rows.views.plan.Contains(fixes[i]->position) ? 1 : 0;
  }
  if (num_fixes > 0) (*figures)["plan_fixes_free_ratio"] = static_cast<double>(num_free) / num_fixes;
  if (scans.empty()) return Ok();

  struct Outcome {
    bool found = false, first = false, any = false;
  };
  std::vector<Outcome> outcomes(scans.size());
  CAIRN_ASSIGN_OR_RETURN(const ScanLocator scan_locator, ScanLocator::Make(rows.views, {}));
  progress.Begin("locating scans", static_cast<int64_t>(scans.size()), "scans");
  ParallelFor(static_cast<int64_t>(scans.size()), num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const auto result = scan_locator.Locate(scans[i]);
    if (result.ok()) {
      for (size_t k = 0; k < result->hypotheses.size(); ++k) {
        outcomes[i].found = true;
        const FloorPose camera = CameraOf(result->hypotheses[k].pose, options);
        if (!fixes[i] || !Agree(camera, *fixes[i], options)) continue;
        outcomes[i].any = true;
        outcomes[i].first = outcomes[i].first || k == 0;
      }
    }
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "locating scans was stopped");
  int num_scan_fixes = 0, num_both = 0, num_first = 0, num_any = 0;
  for (size_t i = 0; i < scans.size(); ++i) {
    num_scan_fixes += outcomes[i].found ? 1 : 0;
    num_both += outcomes[i].found && fixes[i] ? 1 : 0;
    num_first += outcomes[i].first ? 1 : 0;
    num_any += outcomes[i].any ? 1 : 0;
  }
  (*figures)["num_scan_fixes"] = num_scan_fixes;
  (*figures)["num_image_and_scan_fixes"] = num_both;
  if (num_both == 0) return Ok();
  (*figures)["scan_first_agrees_ratio"] = static_cast<double>(num_first) / num_both;
  (*figures)["scan_any_agrees_ratio"] = static_cast<double>(num_any) / num_both;
  return Ok();
}

}  // namespace cairn::check_map
