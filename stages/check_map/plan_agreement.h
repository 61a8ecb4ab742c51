#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/plan/views.h"
#include "runtime/scans/read_scans.h"
#include "stages/check_map/check_map.h"

namespace cairn::check_map {

// How the fixes of images and the map's floor plan agree; `scans` is empty, or scans[i] was taken with
// images[i] by a laser at the pose in options.scan_x_m, scan_y_m and scan_heading_deg.  Adds to the figures
//   plan_fixes_free_ratio: fixes that lie in the plan's domain
// and with scans
//   num_scan_fixes: scans that some pose in the plan explains
//   num_image_and_scan_fixes: of these, such whose image has a fix too
//   scan_first_agrees_ratio, scan_any_agrees_ratio: of these, such where the scan's first, or any, pose is
//   that of the image's fix, within gross_error_m and gross_error_deg.
// A place that looks like another has several poses: the first may be the wrong one.  Same figures for any
// number of threads.  Errors: InvalidArgument (not as many scans as images), Cancelled, those of
// ScanLocator::Make.
Status CompareWithPlan(const MapRows& rows, const std::vector<HeldOutResult>& images,
                       const std::vector<ScanView>& scans, const CheckMapOptions& options, int num_threads,
                       Progress& progress, std::map<std::string, double>* figures);

}  // namespace cairn::check_map
