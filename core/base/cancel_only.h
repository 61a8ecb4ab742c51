#pragma once

#include "core/base/progress.h"

namespace cairn {

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
