#pragma once

#include <exception>
#include <new>
#include <type_traits>

#include "core/base/error.h"

namespace cairn {

// Runs `body` (returning Status or Result<T>) at an edge of the library: what a library below it throws, or a
// lack of memory, becomes an error.
template <typename Body>
auto WithoutExceptions(const char* what, Body&& body) -> std::invoke_result_t<Body> {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return MakeError(ErrorCode::kFailed, "{}: out of memory", what);
  } catch (const std::exception& exception) {
    return MakeError(ErrorCode::kFailed, "{}: {}", what, exception.what());
  } catch (...) {
    return MakeError(ErrorCode::kFailed, "{}: an unknown exception", what);
  }
}

}  // namespace cairn
