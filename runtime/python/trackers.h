#pragma once

#include <pybind11/pybind11.h>

namespace cairn {

// cairn.Tracker, cairn.VisualTracker and its cairn.FloorFix.
void BindTrackers(pybind11::module_& module);

}  // namespace cairn
