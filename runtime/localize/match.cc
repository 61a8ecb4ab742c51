#include "runtime/localize/match.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/blocks/map_blocks.h"
#include "core/features/descriptor_matcher.h"

namespace cairn {

OptionTable DescribeOptions(MatchOptions* o) {
  return {
      {.name = "max_ratio",
       .value = &o->max_ratio,
       .help = "largest ratio of best to second-best descriptor angle, both ways",
       .min = 1e-3,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->max_angle_rad,
       .help = "largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "guided_radius_px",
       .value = &o->guided_radius_px,
       .help = "a landmark is looked for this near to its projection, px",
       .min = 0.1},
      {.name = "guided_radius_sigmas",
       .value = &o->guided_radius_sigmas,
       .help = "plus this many standard deviations of its own position, projected",
       .min = 0},
      {.name = "guided_max_angle_rad",
       .value = &o->guided_max_angle_rad,
       .help = "guided matching: largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "guided_max_scale_ratio",
       .value = &o->guided_max_scale_ratio,
       .help = "largest ratio of a keypoint's scale to the predicted one, either way",
       .min = 1},
      {.name = "guided_num_images",
       .value = &o->guided_num_images,
       .help = "survey images whose landmarks are looked for; 0: no guided matching",
       .min = 0},
      {.name = "guided_max_num_rounds",
       .value = &o->guided_max_num_rounds,
       .help = "most rounds of guided matching, each at the pose that the one before refined",
       .min = 1},
  };
}

std::vector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                           const MatchOptions& options) {
  const DescriptorMatcherOptions matcher_options{
      .max_ratio = options.max_ratio, .max_angle_rad = options.max_angle_rad, .mutual = true};
  std::vector<Correspondence> correspondences;
  for (const Match& match : MatchDescriptors(query.packed, landmarks.packed, matcher_options)) {
    if (query.rays[match.idx1]) correspondences.push_back({match.idx1, landmarks.idx[match.idx2]});
  }
  return correspondences;
}

Result<std::vector<LandmarkIdx>> CovisibleLandmarks(const Map& map, const std::vector<LandmarkIdx>& seen,
                                                    const MatchOptions& options) {
  std::set<int32_t> image_blocks;  // those that a landmark's block names
  int64_t ordinal = -1;
  for (const LandmarkIdx landmark : seen) {
    const int64_t next = map.directory().OrdinalOf(BlockKind::kLandmarks, landmark);
    if (next == ordinal) continue;
    ordinal = next;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Landmarks(ordinal));
    image_blocks.insert(block->image_blocks.begin(), block->image_blocks.end());
  }
  std::vector<std::pair<int, int32_t>> order;
  for (const int32_t image_block : image_blocks) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(image_block));
    for (size_t i = 0; i < block->images.size(); ++i) {
      const int num_shared = NumShared(block->images[i].landmarks, seen);
      if (num_shared > 0) order.emplace_back(-num_shared, block->first + static_cast<int32_t>(i));
    }
  }
  std::sort(order.begin(), order.end());
  std::vector<LandmarkIdx> landmarks = seen;
  for (size_t i = 0; i < order.size() && static_cast<int>(i) < options.guided_num_images; ++i) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(order[i].second));
    landmarks.insert(landmarks.end(), image->landmarks.begin(), image->landmarks.end());
  }
  std::sort(landmarks.begin(), landmarks.end());
  landmarks.erase(std::unique(landmarks.begin(), landmarks.end()), landmarks.end());
  return landmarks;
}

}  // namespace cairn
