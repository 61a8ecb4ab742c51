#pragma once

#include <cstdint>
#include <functional>

namespace cairn {

// Number of threads that `requested` means: itself if positive, otherwise all cores that the process may use.
int NumThreads(int requested);

// Calls body(i) for every i in [0, num_items), on up to `num_threads` threads (NumThreads() of it); items are
// handed out in ascending order, one at a time.  The body writes to slots of its own item only, so that
// results do not depend on the number of threads.  An exception from a body is rethrown here, after all
// have stopped.
void ParallelFor(int64_t num_items, int num_threads, const std::function<void(int64_t)>& body);
// The same for items of which many are worth a call: body(begin, end) for runs of `run_length`, the last one
// may be shorter.  REQUIRES: run_length >= 1
void ParallelForRuns(int64_t num_items, int64_t run_length, int num_threads,
                     const std::function<void(int64_t, int64_t)>& body);

}  // namespace cairn
