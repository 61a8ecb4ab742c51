#pragma once

#include <pybind11/pybind11.h>

namespace cairn {

// cairn.Plan, cairn.Scan, cairn.PlanPlace, cairn.ScanLocator and its cairn.LocatedScan, cairn.PlanTracker,
// cairn.read_scans.
void BindPlans(pybind11::module_& module);

}  // namespace cairn
