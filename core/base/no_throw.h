#pragma once

#include <exception>
#include <type_traits>

#include "core/base/error.h"

namespace cairn {

// Whether it reports a lack of memory: also OpenCV's, and for a new thread.
bool IsOutOfMemory(const std::exception& exception);

// What is caught where this is called, as an error; `what`: what was done.
Error ErrorOfCaught(const char* what);

// Runs `body` (returning Status or Result<T>) at an edge of the library: what a library below it throws, or a
// lack of memory, becomes an error.
template <typename Body>
auto WithoutExceptions(const char* what, Body&& body) -> std::invoke_result_t<Body> {
  try {
    return body();
  } catch (...) {
    return ErrorOfCaught(what);
  }
}

}  // namespace cairn
