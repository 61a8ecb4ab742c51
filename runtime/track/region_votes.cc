#include "runtime/track/region_votes.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <utility>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/work/work_budget.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"

namespace cairn {

OptionTable DescribeOptions(VoteOptions* o) {
  return {
      {.name = "min_num_votes",
       .value = &o->min_num_votes,
       .help = "visible landmarks that make any region a candidate when lost",
       .min = 1},
      {.name = "min_vote_ratio",
       .value = &o->min_vote_ratio,
       .help = "part of a region's landmarks that one survey image shows that makes a smaller region one",
       .min = 1e-3,
       .max = 1},
      {.name = "max_num_voted_regions",
       .value = &o->max_num_voted_regions,
       .help = "most candidate regions whose landmarks are matched when lost",
       .min = 1},
      {.name = "localize_when_lost",
       .value = &o->localize_when_lost,
       .help = "localize an image that the votes do not place for sure as if it were the first"},
  };
}

Result<int> MostInView(const Map& map, RegionIdx region, WorkBudget* work) {
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, LandmarksOfRegions(map, std::span(&region, 1), work));
  std::set<int32_t> image_blocks;
  for (const LandmarkIdx landmark : landmarks) {
    CAIRN_ASSIGN_OR_RETURN(const auto block,
                           map.Landmarks(map.directory().OrdinalOf(BlockKind::kLandmarks, landmark)));
    image_blocks.insert(block->image_blocks.begin(), block->image_blocks.end());
  }
  int most = 0;
  for (const int32_t ordinal : image_blocks) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (const MapImage& image : block->images) {
      if (!Spend(work, Work::kListed, image.landmarks.size() + landmarks.size())) return most;
      most = std::max(most, NumShared(image.landmarks, landmarks));
    }
  }
  return most;
}

Result<Vote> VoteForRegions(const Map& map, std::span<const LandmarkIdx> seen, const VoteOptions& options,
                            WorkBudget* work) {
  CAIRN_ASSIGN_OR_RETURN(const auto votes, VotesForRegions(map, seen, work));
  Vote vote;
  if (votes.empty()) {
    vote.message = fmt::format("none of the {} landmarks in view belongs to a region", seen.size());
    return vote;
  }
  for (const auto& [region, num_votes] : votes) {
    if (num_votes < kLeastVotes) {
      if (vote.message.empty())
        vote.message = fmt::format("region {} has {} of its landmarks in view, at least {} are needed",
                                   region, num_votes, kLeastVotes);
      break;
    }
    int num_needed = std::max(kLeastVotes, options.min_num_votes);
    if (num_votes < num_needed) {
      CAIRN_ASSIGN_OR_RETURN(const int in_view, MostInView(map, region, work));
      const int of_these = static_cast<int>(std::ceil(options.min_vote_ratio * in_view));
      num_needed = std::max(kLeastVotes, std::min(options.min_num_votes, of_these));
    }
    // [Sala06 §III] regions with "at least k votes" are candidates, those with most first
    if (num_votes >= num_needed) {
      vote.regions.push_back(region);
    } else if (vote.message.empty()) {
      vote.message = fmt::format("region {} has {} of its landmarks in view, at least {} are needed", region,
                                 num_votes, num_needed);
    }
    if (static_cast<int>(vote.regions.size()) == options.max_num_voted_regions) break;
  }
  if (!vote.regions.empty()) vote.message.clear();
  return vote;
}

}  // namespace cairn
