#include "stages/match_features/pairs/earlier_partners.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace cairn::match_features {
namespace {

// The first of every session, the latest session first, then the second of every session, ...
std::vector<int> TakeInTurns(const std::map<int, std::vector<int>>& by_session) {
  std::vector<int> in_turns;
  for (size_t rank = 0, num_before = 1; num_before > 0; ++rank) {
    num_before = 0;
    for (auto session = by_session.rbegin(); session != by_session.rend(); ++session) {
      if (rank >= session->second.size()) continue;
      in_turns.push_back(session->second[rank]);
      ++num_before;
    }
  }
  return in_turns;
}

// The pair's image of the later session first.
std::pair<int, int> LaterFirst(const std::pair<int, int>& pair, const std::vector<int>& session) {
  return session[pair.first] > session[pair.second] ? pair : std::pair(pair.second, pair.first);
}

}  // namespace

EarlierPartners::EarlierPartners(std::vector<int> session_of_image, double ratio)
    : session_(std::move(session_of_image)), ratio_(ratio), partners_(session_.size()) {}

EarlierPartners::Seeds EarlierPartners::SeedsOf(int idx, const std::vector<OverlapPartner>& ranked,
                                                int num_best, int num_spread) const {
  std::vector<int> within;
  std::map<int, std::vector<int>> by_session;
  for (const OverlapPartner& partner : ranked) {
    if (Generation(partner.idx) == Generation(idx)) {
      within.push_back(partner.idx);
    } else if (session_[partner.idx] < session_[idx]) {
      by_session[session_[partner.idx]].push_back(partner.idx);
    }
  }
  return {SeedsAmong(within, num_best, num_spread),
          SeedsAmong(TakeInTurns(by_session), num_best, num_spread)};
}

IndexPairs EarlierPartners::TakeSeeds(const std::vector<Seeds>& seeds) {
  std::vector<std::vector<int>> within, earlier;
  for (const Seeds& of_image : seeds) {
    within.push_back(of_image.within);
    earlier.push_back(of_image.earlier);
  }
  IndexPairs pairs = PairsFromPartners(within);
  const IndexPairs with_earlier = PairsFromPartners(earlier);
  for (const auto& pair : with_earlier) {
    const auto [idx, partner] = LaterFirst(pair, session_);
    Partners& partners = partners_[idx][session_[partner]];
    ++partners.num_chosen;
    ++partners.num_known;
  }
  pairs.insert(pairs.end(), with_earlier.begin(), with_earlier.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

IndexPairs EarlierPartners::Choose(const std::vector<PredictedPair>& predicted) {
  IndexPairs chosen;
  std::vector<std::map<int, std::vector<PredictedPair>>> candidates(session_.size());
  for (const PredictedPair& pair : predicted) {
    const auto [idx, partner] = LaterFirst(pair.idxs, session_);
    if (Generation(idx) == Generation(partner)) {
      chosen.push_back(pair.idxs);
    } else {
      candidates[idx][session_[partner]].push_back(pair);
      ++partners_[idx][session_[partner]].num_known;
    }
  }
  for (int idx = 0; idx < static_cast<int>(candidates.size()); ++idx) {
    if (!candidates[idx].empty()) ChooseOf(idx, &candidates[idx], &chosen);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

void EarlierPartners::ChooseOf(int idx, std::map<int, std::vector<PredictedPair>>* candidates,
                               IndexPairs* chosen) {
  int num_chosen = 0, num_most = 0;
  for (const auto& [session, partners] : partners_[idx]) {
    num_chosen += partners.num_chosen;
    num_most = std::max(num_most, partners.num_known);
  }
  // The best is the last, to be taken from the end.
  for (auto& [session, pairs] : *candidates) {
    std::sort(pairs.begin(), pairs.end(), [](const PredictedPair& a, const PredictedPair& b) {
      return std::tuple(a.num_expected, b.idxs) < std::tuple(b.num_expected, a.idxs);
    });
  }
  const double num_wanted = ratio_ * num_most;
  for (; num_chosen < num_wanted && !candidates->empty(); ++num_chosen) {
    const auto next =
        std::min_element(candidates->begin(), candidates->end(), [&](const auto& a, const auto& b) {
          return std::pair(partners_[idx][a.first].num_chosen, -a.first) <
                 std::pair(partners_[idx][b.first].num_chosen, -b.first);
        });
    ++partners_[idx][next->first].num_chosen;
    chosen->push_back(next->second.back().idxs);
    next->second.pop_back();
    if (next->second.empty()) candidates->erase(next);
  }
}

}  // namespace cairn::match_features
