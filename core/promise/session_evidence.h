#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/world/feature_class.h"

namespace cairn {

// How much the images of one session tell of what those of another see.  The same things have other features
// in another light, with another exposure or camera, and what a session saw may be gone in the next.  The
// images of one session tell all of each other; so do images of no session.
class SessionEvidence {
 public:
  // Before it has learnt, every session tells all of every other.  `classes` must outlive it.
  explicit SessionEvidence(const Classes& classes);

  bool HasSeveral() const { return num_sessions_ > 1; }
  // Of the image at this position in Classes::images; -1: of none.
  int SessionOf(int32_t image) const { return session_of_[image]; }
  // The probability that class `i` was there when this image was taken, which does not see it [ClassAge].
  double There(size_t i, int32_t image) const;

  // An image of a session that looks at a class, and whether it sees it.
  struct Look {
    int session = 0;
    bool sees = false;
  };
  // Counts two images that look at a class from near viewpoints.
  void Count(Look a, Look b, double weight);
  // From what was counted.  With r the correlation of one image seeing a class and the other seeing it,
  // r^2 / (1 - r^2), the variance that one explains of the other to what it does not, says how much it tells;
  // the weight is that as part of what images of one session tell each other.  Sessions of which little was
  // counted agree as any two do.
  void Learn();
  // How much a look of session `t` weighs for an image of session `s`, in [0, 1].
  double Weight(int s, int t) const { return s < 0 || t < 0 || weights_.empty() ? 1 : weights_[Pair(s, t)]; }

 private:
  // Weights of pairs of looks: both see the class, the earlier session's alone, the later's, none.
  struct Agreement {
    double both = 0, earlier = 0, later = 0, none = 0;
    void Add(const Agreement& other, double factor);
    double Total() const { return both + earlier + later + none; }
    double Told() const;  // r^2 / (1 - r^2)
  };
  size_t Pair(int s, int t) const { return static_cast<size_t>(s) * num_sessions_ + t; }

  const Classes& classes_;
  size_t num_sessions_;
  std::vector<int> session_of_;    // per image
  std::vector<Agreement> counts_;  // of pairs s <= t
  std::vector<double> weights_;    // of all pairs; empty: nothing was learnt
};

}  // namespace cairn
