#include "pipeline/program/stop_signal.h"

#include <time.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <exception>
#include <utility>

namespace cairn::pipeline {
namespace {

constexpr int64_t kSameRequestMs = 1000;
constexpr int64_t kDeadlineMs = 700;
constexpr std::chrono::milliseconds kBetweenLooks{50};

std::atomic<bool> stop_requested = false;
std::atomic<int64_t> stop_requested_ms = 0;  // of the monotonic clock
std::atomic<bool> has_deadline = true;
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int64_t>::is_always_lock_free,
              "the signal handler must not lock");

int64_t NowMs() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{1000} * now.tv_sec + now.tv_nsec / 1000000;
}

void RequestStop(int signal) {
  const int64_t now_ms = NowMs();
  if (!stop_requested) {
    stop_requested_ms = now_ms;
    stop_requested = true;
  } else if (now_ms - stop_requested_ms > kSameRequestMs) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}

}  // namespace

void CatchStopSignals() {
  stop_requested = false;
  has_deadline = true;
  struct sigaction action = {};
  action.sa_handler = RequestStop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool StopRequested() { return stop_requested; }

void LiftStopDeadline() { has_deadline = false; }

StopDeadline::StopDeadline(std::function<void()> end) : end_(std::move(end)) {
  // Signals go to threads that may be waiting for other programs: not to the watcher.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, &before);
  try {
    watcher_ = std::thread([this] { Watch(); });
  } catch (const std::exception&) {  // no room for a thread: then the command alone looks for requests
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

StopDeadline::~StopDeadline() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  over_.notify_all();
  if (watcher_.joinable()) watcher_.join();
}

void StopDeadline::Watch() {
  std::unique_lock lock(mutex_);
  while (!over_.wait_for(lock, kBetweenLooks, [this] { return is_over_; })) {
    if (stop_requested && has_deadline && NowMs() - stop_requested_ms >= kDeadlineMs) end_();
  }
}

}  // namespace cairn::pipeline
