#include "core/base/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace cairn {

int NumThreads(int requested) {
  if (requested > 0) return requested;
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof(allowed), &allowed) == 0) return std::max(1, CPU_COUNT(&allowed));
  return std::max(1u, std::thread::hardware_concurrency());
}

void ParallelFor(int64_t num_items, int num_threads, const std::function<void(int64_t)>& body) {
  const int64_t num_workers = std::min<int64_t>(NumThreads(num_threads), num_items);
  if (num_workers <= 1) {
    for (int64_t i = 0; i < num_items; ++i) body(i);
    return;
  }
  std::atomic<int64_t> next{0};
  std::exception_ptr first_exception;
  std::mutex exception_mutex;
  // Threads take memory, their stacks, before any work does: who gets it must not depend on time.
  std::atomic<bool> all_begun{false};
  auto work = [&] {
    all_begun.wait(false);
    for (int64_t i; (i = next.fetch_add(1)) < num_items;) {
      try {
        body(i);
      } catch (...) {
        std::lock_guard<std::mutex> lock(exception_mutex);
        if (!first_exception) first_exception = std::current_exception();
        next = num_items;
      }
    }
  };
  std::vector<std::thread> workers;
  workers.reserve(num_workers - 1);
  try {
    for (int64_t w = 1; w < num_workers; ++w) workers.emplace_back(work);
  } catch (const std::exception&) {  // no memory or no room for more threads: fewer do as well
  }
  all_begun = true;
  all_begun.notify_all();
  work();
  for (std::thread& worker : workers) worker.join();
  if (first_exception) std::rethrow_exception(first_exception);
}

void ParallelForRuns(int64_t num_items, int64_t run_length, int num_threads,
                     const std::function<void(int64_t, int64_t)>& body) {
  ParallelFor((num_items + run_length - 1) / run_length, num_threads,
              [&](int64_t run) { body(run * run_length, std::min(num_items, (run + 1) * run_length)); });
}

}  // namespace cairn
