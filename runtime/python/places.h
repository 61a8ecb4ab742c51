#pragma once

#include <pybind11/pybind11.h>

namespace cairn {

// cairn.Route, cairn.PlaceModel and its cairn.PlaceScores, cairn.StartHypotheses of cairn.StartHypothesis,
// cairn.PlaceBelief.
void BindPlaces(pybind11::module_& module);

}  // namespace cairn
