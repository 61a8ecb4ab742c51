#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace cairn {

// The pieces that localization is made of, counted as it goes on.
enum class Work {
  kWholePixel,      // of an image of which all features are sought (ExtractSift)
  kUndoubledPixel,  // SiftScales::kAll
  kCoarsePixel,     // SiftScales::kCoarse
  kFinePixel,       // SiftScales::kFine
  kShrunkPixel,     // of an image that is made smaller before
  kFeature,         // an orientation and a descriptor
  kRay,             // of a feature, and its descriptor in the order in which it is matched
  kWord,            // a feature's word in the vocabulary
  kPosting,         // a survey image that has it; and each, whether it has or not
  kImage,           // the pose of a survey image
  kDescriptorPair,  // a feature held against a landmark
  kLandmark,        // a landmark taken from the map
  kListed,          // a landmark in the list of an image or a region
  kAttempt,         // at a fix among some landmarks
  kSample,          // three points or two, and their poses
  kScore,           // a match at such a pose
  kRefine,          // a match in a step of refinement
  kProject,         // a landmark put into the image
  kNear,            // a feature near there held against it
  kMatchPair,       // of two matches, whether one would pass for the other
  kNum
};

// How much work an answer may take.  What a piece takes is a constant, measured on one core
// (bench/runtime/work.cc): the same image gives the same answer on every computer, however busy it is.
class WorkBudget {
 public:
  WorkBudget() = default;  // any amount
  // So many milliseconds of that core; 0: any amount; less, or no number: none at all.
  explicit WorkBudget(double ms);

  // Whether there is room for so many pieces, which count then; if not, it is spent from now on: what asks
  // for them leaves them undone, and with it all that needs them.
  bool Spend(Work work, int64_t num);
  // What it was spent on.
  int64_t num(Work work) const { return nums_[static_cast<size_t>(work)]; }
  bool is_spent() const { return is_spent_ || gave_up_; }
  // From now on it is spent, beyond a share, too.
  void GiveUp() { gave_up_ = true; }
  bool is_limited() const { return limit_ps_ != kUnlimited; }
  double spent_ms() const { return 1e-9 * static_cast<double>(spent_ps_); }
  double total_ms() const { return 1e-9 * static_cast<double>(total_ps_); }
  int64_t left_ps() const { return limit_ps_ - spent_ps_; }
  static int64_t PicosecondsOf(Work work);

  // As long as it lives, of a budget or null, no more than this part of what was left before may be spent;
  // what was spent of it alone is not spent afterwards.
  class Share {
   public:
    Share(WorkBudget* budget, double part);
    ~Share();
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;

   private:
    WorkBudget* budget_;
    int64_t limit_ps_ = 0;
    bool was_spent_ = false;
  };

 private:
  static constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

  int64_t total_ps_ = kUnlimited;
  int64_t limit_ps_ = kUnlimited;  // of the share
  int64_t spent_ps_ = 0;
  bool is_spent_ = false;
  bool gave_up_ = false;
  std::array<int64_t, static_cast<size_t>(Work::kNum)> nums_{};
};

// Null: not counted.
inline bool Spend(WorkBudget* budget, Work work, size_t num) {
  return budget == nullptr || budget->Spend(work, static_cast<int64_t>(num));
}
inline bool IsSpent(const WorkBudget* budget) { return budget != nullptr && budget->is_spent(); }
// How many pieces that take so much each this part of what is left is enough for.
int64_t NumAffordable(const WorkBudget* budget, int64_t picoseconds, double part);

}  // namespace cairn
