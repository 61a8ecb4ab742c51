#pragma once

#include <pybind11/pybind11.h>

namespace cairn {

// cairn.Atlas, cairn.AtlasLocalizer, and its cairn.AtlasAnswer of cairn.AtlasPlace.
void BindAtlases(pybind11::module_& module);

}  // namespace cairn
