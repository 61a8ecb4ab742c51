#include "core/work/work_budget.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace cairn {
namespace {

// Picoseconds on one core of an AMD Zen 5, by least squares over what images of three maps took, so that it
// is more than the time of 19 images in 20
// (bench/runtime/work.cc).
constexpr std::array<int64_t, static_cast<size_t>(Work::kNum)> kPicoseconds = {
    45'000,       // kWholePixel
    19'000,       // kUndoubledPixel
    13'000,       // kCoarsePixel
    5'500,        // kFinePixel
    300,          // kShrunkPixel
    3'800'000,    // kFeature
    570'000,      // kRay
    800'000,      // kWord
    18'000,       // kPosting
    180'000,      // kImage
    500,          // kDescriptorPair
    120'000,      // kLandmark
    5'000,        // kListed
    190'000'000,  // kAttempt
    5'000'000,    // kSample
    3'300,        // kScore
    135'000,      // kRefine
    102'000,      // kProject
    32'000,       // kNear
    7'100,        // kMatchPair
};

}  // namespace

WorkBudget::WorkBudget(double ms) {
  constexpr double kMostMs = 1e9;
  if (ms == 0 || ms >= kMostMs) return;
  total_ps_ = limit_ps_ = ms > 0 ? std::llround(1e9 * ms) : 0;
}

bool WorkBudget::Spend(Work work, int64_t num) {
  const int64_t ps = num * PicosecondsOf(work);
  is_spent_ = is_spent_ || ps > limit_ps_ - spent_ps_;
  if (is_spent()) return false;
  spent_ps_ += ps;
  nums_[static_cast<size_t>(work)] += num;
  return true;
}

int64_t WorkBudget::PicosecondsOf(Work work) { return kPicoseconds[static_cast<size_t>(work)]; }

int64_t NumAffordable(const WorkBudget* budget, int64_t picoseconds, double part) {
  if (budget == nullptr || !budget->is_limited()) return std::numeric_limits<int64_t>::max();
  return std::max<int64_t>(0,
                           static_cast<int64_t>(part * static_cast<double>(budget->left_ps())) / picoseconds);
}

WorkBudget::Share::Share(WorkBudget* budget, double part) : budget_(budget) {
  if (budget == nullptr) return;
  limit_ps_ = budget->limit_ps_;
  was_spent_ = budget->is_spent_;
  if (budget->is_limited())
    budget->limit_ps_ =
        budget->spent_ps_ + static_cast<int64_t>(part * static_cast<double>(budget->left_ps()));
}

WorkBudget::Share::~Share() {
  if (budget_ == nullptr || budget_->limit_ps_ == limit_ps_) return;  // of all of it
  budget_->limit_ps_ = limit_ps_;
  budget_->is_spent_ = was_spent_;
}

}  // namespace cairn
