#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/progress.h"

namespace cairn {

// Keeps what work said of how far it is; from the task `stop_in` on, the work is cancelled.
class RecordedProgress final : public Progress {
 public:
  struct Task {
    std::string name;
    int64_t total = 0;
    std::string unit;
    int64_t num_done = 0;
    bool has_ended = false;
  };
  explicit RecordedProgress(std::string stop_in = "") : stop_in_(std::move(stop_in)) {}
  void Begin(std::string_view name, int64_t total, std::string_view unit) override {
    const std::lock_guard lock(mutex_);
    tasks.push_back({std::string(name), total, std::string(unit)});
    cancelled_ = cancelled_ || name == stop_in_;
  }
  void Advance(int64_t num_items) override {
    const std::lock_guard lock(mutex_);
    EXPECT_GT(num_items, 0);
    if (!tasks.empty()) tasks.back().num_done += num_items;
  }
  void End() override {
    const std::lock_guard lock(mutex_);
    if (!tasks.empty()) tasks.back().has_ended = true;
  }
  bool Cancelled() const override {
    const std::lock_guard lock(mutex_);
    return cancelled_;
  }

  // Every task was done as far as it was announced, and ended.
  void ExpectAllDone() const {
    EXPECT_FALSE(tasks.empty());
    for (const Task& task : tasks) {
      EXPECT_EQ(task.num_done, task.total) << task.name;
      EXPECT_TRUE(task.has_ended) << task.name;
    }
  }

  std::vector<Task> tasks;

 private:
  mutable std::mutex mutex_;
  std::string stop_in_;
  bool cancelled_ = false;
};

}  // namespace cairn
