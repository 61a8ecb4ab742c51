#pragma once

#include <pybind11/pybind11.h>

namespace cairn {

// Servo, and its commands.
void BindServos(pybind11::module_& module);

}  // namespace cairn
