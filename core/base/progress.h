#pragma once

#include <cstdint>
#include <string_view>

namespace cairn {

// Where long work reports how far it is.  A stage calls Begin, Advance from any thread, End; what is shown (a
// bar, lines, JSON, nothing) is the caller's choice.  Cancelled() is asked between items: true means
// "stop soon".
class Progress {
 public:
  virtual ~Progress() = default;
  // `total` items of `task` follow; `unit` names one of them in the plural ("images", "pairs").
  virtual void Begin(std::string_view task, int64_t total, std::string_view unit) = 0;
  virtual void Advance(int64_t num_items = 1) = 0;
  virtual void End() = 0;
  virtual bool Cancelled() const { return false; }
};

// Shows nothing.
class NoProgress final : public Progress {
 public:
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t) override {}
  void End() override {}
};

// For work that is a part of other work: shows nothing, and is cancelled with it.
class CancelOnly final : public Progress {
 public:
  explicit CancelOnly(const Progress& whole) : whole_(whole) {}
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t) override {}
  void End() override {}
  bool Cancelled() const override { return whole_.Cancelled(); }

 private:
  const Progress& whole_;
};

}  // namespace cairn
