#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "sim/render/options.h"

namespace cairn::simulate {

struct SimulateResult {
  int num_stations = 0;
  int num_images = 0;
  int num_queries = 0;
};

// Renders a survey of a synthetic building and writes it as a capture: images/, cameras.txt, images.txt,
// queries.txt and floor_plan.geojson.  For tests, benchmarks and a first try of the pipeline; it replaces a
// robot with a camera and exact poses [Sala06 §VI-B: surveys a real room in the same way, on a lattice of
// stations with four headings each].  The folder is written beside its place and then exchanged with it:
// readers see the old capture or the whole new one.  Same options, seed and program: same bytes, for any
// number of threads.  Errors: InvalidArgument or NoData (PlanSurvey), Io (names the path), Cancelled.
Result<SimulateResult> SimulateCapture(const sim::SimulateOptions& options, const std::string& path,
                                       uint64_t seed, int num_threads, Progress& progress);

}  // namespace cairn::simulate
