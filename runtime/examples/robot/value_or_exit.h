#ifndef VALUE_OR_EXIT_H_
#define VALUE_OR_EXIT_H_

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "core/base/error.h"

// Ends the program after an error; a robot does better.
template <typename T>
T ValueOrExit(cairn::Result<T> result) {
  if (!result.ok()) std::fprintf(stderr, "%s\n", result.error().message.c_str()), std::exit(1);
  return std::move(result).value();
}

#endif  // VALUE_OR_EXIT_H_
