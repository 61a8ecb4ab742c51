#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/options/options.h"
#include "runtime/map/map.h"

namespace cairn {

class WorkBudget;  // core/work/work_budget.h

// Which regions a lost robot may be in [Sala06 §III]: the landmarks that it sees vote for the regions that
// have them, and "regions with at least k votes are candidates".  The source's camera sees all around, and
// all k.  Here a camera sees a part of a region's landmarks, and a query misses some of those: a region is a
// candidate with
//   max(2, min(min_num_votes, min_vote_ratio m))   votes, rounded up,
// where m is the most of its landmarks that any one image of the survey shows: what can be in view at once.
// One landmark votes for nothing: any wrong match is one.  Landmarks of several candidates count together,
// and it is the pose that says whether they suffice.
struct VoteOptions {
  // Votes that are enough for any region, however many landmarks it has [Sala06 §III: k].  REQUIRES: >= 1
  int min_num_votes = 7;
  // Part of the landmarks that can be in view at once that is enough for a smaller region.  REQUIRES: in
  // (0, 1]
  double min_vote_ratio = 0.2;
  // Most candidate regions whose landmarks are matched.  REQUIRES: >= 1
  int max_num_voted_regions = 6;
  // And localize an image that the votes do not place for sure as if it were the first; the better fix
  // counts. false: by the votes alone.
  bool localize_when_lost = true;
};
OptionTable DescribeOptions(VoteOptions* options);

// Fewest votes of a candidate.
inline constexpr int kLeastVotes = 2;

// The most landmarks of a region that any one image of the survey shows.  O(images that see them).  Errors:
// as Map::Images.
Result<int> MostInView(const Map& map, RegionIdx region, WorkBudget* work = nullptr);

// The candidates.
struct Vote {
  std::vector<RegionIdx> regions;  // most votes first
  std::string message;             // without candidates: what was found and needed
};
// Errors: as MostInView.
Result<Vote> VoteForRegions(const Map& map, std::span<const LandmarkIdx> seen, const VoteOptions& options,
                            WorkBudget* work = nullptr);

}  // namespace cairn
