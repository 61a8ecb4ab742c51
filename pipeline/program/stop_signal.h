#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace cairn::pipeline {

// From now on SIGINT and SIGTERM ask for a stop.  What comes within a second of the first is the same request
// (timeout(1) signals a process and then its group); a later one ends the process at once.
void CatchStopSignals();
bool StopRequested();

// Makes a command that checks Progress::Cancelled too rarely still end within a second: calls `end`, which
// must not return, 0.7 s after a stop was requested, unless the object is destroyed before.
class StopDeadline {
 public:
  explicit StopDeadline(std::function<void()> end);
  ~StopDeadline();
  StopDeadline(const StopDeadline&) = delete;
  StopDeadline& operator=(const StopDeadline&) = delete;

 private:
  void Watch();
  std::function<void()> end_;
  std::mutex mutex_;
  std::condition_variable over_;
  bool is_over_ = false;
  std::thread watcher_;
};

// For a command that started other programs and ends when they have: they have deadlines of their own.
void LiftStopDeadline();

}  // namespace cairn::pipeline
