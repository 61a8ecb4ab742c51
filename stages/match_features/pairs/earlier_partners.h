#pragma once

#include <map>
#include <vector>

#include "stages/match_features/pairs/frustum_overlap.h"
#include "stages/match_features/pairs/predict_pairs.h"
#include "stages/match_features/pairs/select_pairs.h"

namespace cairn::match_features {

// Bounds the pairs of images of different sessions: matched with all of all earlier sessions that look at the
// same, each new session would take longer than the one before it.
//
// Sessions are in the order of time.  The first two are matched with each other as one survey is; they are
// generation 0, and each later session is a generation of its own.
//   - Pairs within a generation are not bounded: those of one session or of two are as if nothing was.
//   - An image of a later generation has as many partners in all earlier sessions together as the one of them
//     has for it that has the most, times a ratio.  They are taken from these sessions in turns, from each
//     the best first.  So an image of the first session and one of the last are linked directly, and by way
//     of those between.
//   - No pair depends on images of a later session than its own two: what is known of earlier sessions stays
//     as it is when one is added.
constexpr int GenerationOfSession(int session) { return session < 2 ? 0 : session - 1; }

class EarlierPartners {
 public:
  // The session of each image, and partners in all earlier sessions over those in the one that has the most.
  // REQUIRES: sessions >= 0, ratio >= 0
  EarlierPartners(std::vector<int> session_of_image, double ratio);

  // Images that an image is matched with at first, by the ranks of the overlaps.
  struct Seeds {
    std::vector<int> within;   // its generation
    std::vector<int> earlier;  // sessions
  };
  // SeedsAmong those of an image's generation, and as many again of earlier sessions: the ranks are then
  // those of the sessions in turns, the latest first.
  Seeds SeedsOf(int idx, const std::vector<OverlapPartner>& ranked, int num_best, int num_spread) const;
  // The pairs of the seeds of all images, ascending.  To be called once, before Choose.
  IndexPairs TakeSeeds(const std::vector<Seeds>& seeds);

  // Those of the predicted pairs that are to be matched, ascending.  An image's next partner in an earlier
  // session is in that of which it has the fewest so far, of equal ones the latest, and the one of the most
  // expected matches there, of equal ones that of the smallest index.  Pairs that are not chosen count as
  // what their session has for the image, and are not to be predicted again.
  IndexPairs Choose(const std::vector<PredictedPair>& predicted);

 private:
  struct Partners {
    int num_chosen = 0;
    int num_known = 0;  // chosen or not
  };

  int Generation(int idx) const { return GenerationOfSession(session_[idx]); }
  // Takes part of one image's candidates, by session.
  void ChooseOf(int idx, std::map<int, std::vector<PredictedPair>>* candidates, IndexPairs* chosen);

  std::vector<int> session_;
  double ratio_;
  std::vector<std::map<int, Partners>> partners_;  // of each image, by earlier session
};

}  // namespace cairn::match_features
