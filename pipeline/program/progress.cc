#include "pipeline/program/progress.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>

#include <nlohmann/json.hpp>

namespace cairn::pipeline {
namespace {

constexpr double kSecondsBetweenUpdates = 0.1;
constexpr int kBarWidth = 24;

std::string DurationText(double seconds) {
  const auto whole = static_cast<int64_t>(std::lround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{}:{:02} min", whole / 60, whole % 60);
  return fmt::format("{}:{:02} h", whole / 3600, whole / 60 % 60);
}

// What the three styles share: counting without a lock, and drawing seldom and under one.
class Display : public Progress {
 public:
  explicit Display(ProgressOutput output) : output_(std::move(output)) {}

  void Begin(std::string_view task, int64_t total, std::string_view unit) final {
    const std::lock_guard lock(mutex_);
    task_ = task;
    unit_ = unit;
    total_ = total;
    done_ = 0;
    begin_seconds_ = output_.seconds();
    next_update_ = begin_seconds_ + kSecondsBetweenUpdates;
    ShowBegin();
  }

  void Advance(int64_t num_items) final {
    done_ += num_items;
    if (output_.seconds() < next_update_) return;
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return;  // another thread is drawing
    next_update_ = output_.seconds() + kSecondsBetweenUpdates;
    ShowAdvance();
  }

  void End() final {
    const std::lock_guard lock(mutex_);
    ShowEnd();
  }

  bool Cancelled() const final { return output_.cancelled && output_.cancelled(); }

 protected:
  virtual void ShowBegin() = 0;
  virtual void ShowAdvance() = 0;
  virtual void ShowEnd() = 0;

  void Write(const std::string& text) const { output_.write(text); }
  const std::string& task() const { return task_; }
  const std::string& unit() const { return unit_; }
  int64_t total() const { return total_; }
  int64_t done() const { return done_; }
  double Seconds() const { return output_.seconds() - begin_seconds_; }
  double Fraction() const {
    return total_ > 0 ? std::clamp(static_cast<double>(done_) / static_cast<double>(total_), 0.0, 1.0) : 1.0;
  }
  double Rate() const { return static_cast<double>(done_) / std::max(Seconds(), 1e-3); }
  std::string RateText() const {
    return Rate() < 10 ? fmt::format("{:.1f} {}/s", Rate(), unit_)
                       : fmt::format("{:.0f} {}/s", Rate(), unit_);
  }
  std::string TimeLeftText() const {
    return done_ > 0
               ? DurationText(static_cast<double>(std::max<int64_t>(total_ - done_, 0)) / Rate()) + " left"
               : "";
  }

 private:
  ProgressOutput output_;
  std::mutex mutex_;
  std::string task_, unit_;
  int64_t total_ = 0;
  std::atomic<int64_t> done_ = 0;
  double begin_seconds_ = 0;
  std::atomic<double> next_update_ = 0;
};

class Bar final : public Display {
 public:
  using Display::Display;

 private:
  void ShowBegin() override { ShowAdvance(); }
  void ShowAdvance() override {
    const int filled = static_cast<int>(Fraction() * kBarWidth);
    Write(fmt::format("\r\x1b[K{} [{}{}] {:3.0f} %  {}/{} {}  {}  {}", task(), std::string(filled, '='),
                      std::string(kBarWidth - filled, ' '), 100 * Fraction(), done(), total(), unit(),
                      RateText(), TimeLeftText()));
  }
  void ShowEnd() override {
    Write(fmt::format("\r\x1b[K{}: {} {} in {} ({})\n", task(), done(), unit(), DurationText(Seconds()),
                      RateText()));
  }
};

class Lines final : public Display {
 public:
  using Display::Display;

 private:
  void ShowBegin() override {
    next_tenth_ = 1;
    Write(fmt::format("{}: {} {}\n", task(), total(), unit()));
  }
  void ShowAdvance() override {
    const int tenth = static_cast<int>(Fraction() * 10);
    if (tenth < next_tenth_ || tenth >= 10) return;  // the last line is End's
    next_tenth_ = tenth + 1;
    Write(fmt::format("{}: {} %, {}, {}\n", task(), tenth * 10, RateText(), TimeLeftText()));
  }
  void ShowEnd() override {
    Write(fmt::format("{}: {} {} in {} ({})\n", task(), done(), unit(), DurationText(Seconds()), RateText()));
  }

  int next_tenth_ = 1;
};

class JsonLines final : public Display {
 public:
  using Display::Display;

 private:
  void ShowBegin() override {
    Write(nlohmann::ordered_json{{"event", "begin"}, {"task", task()}, {"total", total()}, {"unit", unit()}}
              .dump() +
          "\n");
  }
  void ShowAdvance() override { ShowCount("advance"); }
  void ShowEnd() override { ShowCount("end"); }
  void ShowCount(const char* event) const {
    const double milliseconds = std::round(Seconds() * 1000);
    Write(nlohmann::ordered_json{{"event", event},
                                 {"task", task()},
                                 {"done", done()},
                                 {"total", total()},
                                 {"seconds", milliseconds / 1000}}
              .dump() +
          "\n");
  }
};

class Silence final : public Display {
 public:
  using Display::Display;

 private:
  void ShowBegin() override {}
  void ShowAdvance() override {}
  void ShowEnd() override {}
};

}  // namespace

Result<ProgressStyle> ParseProgressStyle(const std::string& text, bool is_terminal) {
  if (text == "auto") return is_terminal ? ProgressStyle::kBar : ProgressStyle::kLines;
  if (text == "bar") return ProgressStyle::kBar;
  if (text == "lines") return ProgressStyle::kLines;
  if (text == "json") return ProgressStyle::kJson;
  if (text == "none") return ProgressStyle::kNone;
  return MakeError(ErrorCode::kInvalidArgument, "--progress={}: must be one of auto, bar, lines, json, none",
                   text);
}

std::unique_ptr<Progress> MakeProgress(ProgressStyle style, ProgressOutput output) {
  switch (style) {
    case ProgressStyle::kBar:
      return std::make_unique<Bar>(std::move(output));
    case ProgressStyle::kLines:
      return std::make_unique<Lines>(std::move(output));
    case ProgressStyle::kJson:
      return std::make_unique<JsonLines>(std::move(output));
    case ProgressStyle::kNone:
      break;
  }
  return std::make_unique<Silence>(std::move(output));
}

}  // namespace cairn::pipeline
