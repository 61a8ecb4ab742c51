#include "runtime/localize/retrieve.h"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

void SortUnique(std::vector<LandmarkIdx>* landmarks) {
  std::sort(landmarks->begin(), landmarks->end());
  landmarks->erase(std::unique(landmarks->begin(), landmarks->end()), landmarks->end());
}

// From a place to the box of a block's camera centres, metres.
double BoxDistance(const BlockEntry& entry, const Eigen::Vector3d& center) {
  return entry.centers.cast<double>().exteriorDistance(center);
}

}  // namespace

OptionTable DescribeOptions(RetrieveOptions* o) {
  return {
      {.name = "max_num_candidates",
       .value = &o->max_num_candidates,
       .help = "most survey images to consider",
       .min = 1},
      {.name = "min_score_ratio",
       .value = &o->min_score_ratio,
       .help = "lowest score of a candidate, as part of the best one's",
       .min = 0,
       .max = 1},
      {.name = "max_word_angle_rad",
       .value = &o->max_word_angle_rad,
       .help =
           "without a vocabulary: largest angle of a descriptor and the landmark that is its word, radians",
       .min = 1e-3},
      {.name = "max_word_ratio",
       .value = &o->max_word_ratio,
       .help =
           "without a vocabulary: largest ratio of that angle to the angle to the second nearest landmark",
       .min = 1e-3,
       .max = 1},
      {.name = "max_num_regions",
       .value = &o->max_num_regions,
       .help = "most regions whose landmarks are matched first",
       .min = 1},
      {.name = "prior_distance_m",
       .value = &o->prior_distance_m,
       .help = "with a prior: largest distance of a candidate image from it, m",
       .min = 0},
      {.name = "prior_angle_deg",
       .value = &o->prior_angle_deg,
       .help = "with a prior: largest angle between a candidate image and it, degrees",
       .min = 0,
       .max = 180},
  };
}

Result<std::vector<Candidate>> RetrieveByPrior(const Map& map, const PosePrior& prior,
                                               const RetrieveOptions& options) {
  const Pose cam_from_world = map.head().camera_from_given * prior.cam_from_world;
  const double max_distance = options.prior_distance_m + 3 * prior.sigma_m;
  const double max_angle = options.prior_angle_deg + 3 * prior.sigma_deg;
  std::vector<Candidate> candidates;
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    if (BoxDistance(map.directory().Entry(BlockKind::kImages, ordinal), cam_from_world.Center()) >
        max_distance)
      continue;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (size_t i = 0; i < block->images.size(); ++i) {
      const Pose& survey = block->images[i].cam_from_world;
      const double distance = CenterErrorM(survey, cam_from_world);
      if (distance > max_distance || RotationErrorDeg(survey, cam_from_world) > max_angle) continue;
      candidates.push_back({block->first + static_cast<int32_t>(i), 1 / (1 + distance)});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::pair(-a.score, a.image) < std::pair(-b.score, b.image);
  });
  if (candidates.size() > static_cast<size_t>(options.max_num_candidates))
    candidates.resize(options.max_num_candidates);
  return candidates;
}

Result<std::vector<RegionIdx>> RegionsOfCandidates(const Map& map, const std::vector<Candidate>& candidates,
                                                   const RetrieveOptions& options) {
  std::map<RegionIdx, double> votes;
  for (const Candidate& candidate : candidates) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(candidate.image));
    if (image->station < 0) continue;
    CAIRN_ASSIGN_OR_RETURN(const auto stations,
                           map.Stations(map.directory().OrdinalOf(BlockKind::kStations, image->station)));
    for (const RegionIdx region : stations->regions[image->station - stations->first])
      votes[region] += candidate.score;
  }
  std::vector<std::pair<double, RegionIdx>> order;
  for (const auto& [region, vote] : votes) order.emplace_back(-vote, region);
  std::sort(order.begin(), order.end());
  std::vector<RegionIdx> regions;
  for (const auto& [vote, region] : order) {
    if (static_cast<int>(regions.size()) == options.max_num_regions) break;
    regions.push_back(region);
  }
  return regions;
}

Result<std::vector<LandmarkIdx>> LandmarksOfRegions(const Map& map, const std::vector<RegionIdx>& regions) {
  std::vector<LandmarkIdx> landmarks;
  for (const RegionIdx region : regions) {
    CAIRN_ASSIGN_OR_RETURN(const auto of_regions,
                           map.Regions(map.directory().OrdinalOf(BlockKind::kRegions, region)));
    for (const int32_t ordinal : of_regions->landmark_blocks[region - of_regions->first]) {
      CAIRN_ASSIGN_OR_RETURN(const auto block, map.Landmarks(ordinal));
      const auto found =
          std::lower_bound(block->regions.begin(), block->regions.end(), region,
                           [](const auto& list, RegionIdx value) { return list.first < value; });
      if (found == block->regions.end() || found->first != region) continue;
      landmarks.insert(landmarks.end(), found->second.begin(), found->second.end());
    }
  }
  SortUnique(&landmarks);
  return landmarks;
}

Result<std::vector<LandmarkIdx>> LandmarksOfImages(const Map& map, const std::vector<int32_t>& images) {
  std::vector<LandmarkIdx> landmarks;
  for (const int32_t image : images) {
    CAIRN_ASSIGN_OR_RETURN(const auto row, map.Image(image));
    landmarks.insert(landmarks.end(), row->landmarks.begin(), row->landmarks.end());
  }
  SortUnique(&landmarks);
  return landmarks;
}

Result<double> DistanceFromSurvey(const Map& map, const Eigen::Vector3d& center) {
  std::vector<std::pair<double, int64_t>> order;  // at least so far, block
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    order.emplace_back(BoxDistance(map.directory().Entry(BlockKind::kImages, ordinal), center), ordinal);
  }
  std::sort(order.begin(), order.end());
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [least, ordinal] : order) {
    if (least >= nearest) break;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (const MapImage& image : block->images) {
      nearest = std::min(nearest, (image.cam_from_world.Center() - center).norm());
    }
  }
  return nearest;
}

}  // namespace cairn
