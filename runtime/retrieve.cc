#include "runtime/retrieve.h"

#include <algorithm>
#include <map>
#include <utility>

namespace cairn {
namespace {

void SortUnique(std::vector<LandmarkIdx>* landmarks) {
  std::sort(landmarks->begin(), landmarks->end());
  landmarks->erase(std::unique(landmarks->begin(), landmarks->end()), landmarks->end());
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
       .help = "least score of a candidate, as part of the best one's",
       .min = 0,
       .max = 1},
      {.name = "max_num_regions",
       .value = &o->max_num_regions,
       .help = "most regions whose landmarks are matched first",
       .min = 1},
      {.name = "prior_distance_m",
       .value = &o->prior_distance_m,
       .help = "survey images this near to a prior are candidates, m",
       .min = 0},
      {.name = "prior_angle_deg",
       .value = &o->prior_angle_deg,
       .help = "and those that look this nearly the same way, degrees",
       .min = 0,
       .max = 180},
  };
}

std::vector<Candidate> RetrieveByWords(const Map& map, const DescriptorMatrix& descriptors,
                                       const RetrieveOptions& options) {
  std::vector<Candidate> candidates;
  for (const ScoredDocument& scored :
       QueryVocabulary(map.rows().vocabulary, descriptors, options.max_num_candidates)) {
    if (!candidates.empty() && scored.score < options.min_score_ratio * candidates[0].score) break;
    candidates.push_back({map.ImageOfDocument(scored.document), scored.score});
  }
  return candidates;
}

std::vector<Candidate> RetrieveByPrior(const Map& map, const PosePrior& prior,
                                       const RetrieveOptions& options) {
  const Pose cam_from_world = map.rows().camera_from_given * prior.cam_from_world;
  const double max_distance = options.prior_distance_m + 3 * prior.sigma_m;
  const double max_angle = options.prior_angle_deg + 3 * prior.sigma_deg;
  std::vector<Candidate> candidates;
  for (size_t i = 0; i < map.rows().images.size(); ++i) {
    const Pose& survey = map.rows().images[i].cam_from_world;
    const double distance = CenterErrorM(survey, cam_from_world);
    if (distance > max_distance || RotationErrorDeg(survey, cam_from_world) > max_angle) continue;
    candidates.push_back({static_cast<int32_t>(i), 1 / (1 + distance)});
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::pair(-a.score, a.image) < std::pair(-b.score, b.image);
  });
  if (candidates.size() > static_cast<size_t>(options.max_num_candidates))
    candidates.resize(options.max_num_candidates);
  return candidates;
}

std::vector<RegionIdx> RegionsOfCandidates(const Map& map, const std::vector<Candidate>& candidates,
                                           const RetrieveOptions& options) {
  std::map<RegionIdx, double> votes;
  for (const Candidate& candidate : candidates) {
    const StationIdx station = map.rows().images[candidate.image].station;
    if (station < 0) continue;
    for (const RegionIdx region : map.RegionsOfStation(station)) votes[region] += candidate.score;
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

std::vector<LandmarkIdx> LandmarksOfRegions(const Map& map, const std::vector<RegionIdx>& regions) {
  std::vector<LandmarkIdx> landmarks;
  for (const RegionIdx region : regions) {
    const std::vector<LandmarkIdx>& of_region = map.rows().regions[region].landmarks;
    landmarks.insert(landmarks.end(), of_region.begin(), of_region.end());
  }
  SortUnique(&landmarks);
  return landmarks;
}

std::vector<LandmarkIdx> LandmarksOfImages(const Map& map, const std::vector<int32_t>& images) {
  std::vector<LandmarkIdx> landmarks;
  for (const int32_t image : images) {
    const std::vector<LandmarkIdx>& of_image = map.rows().images[image].landmarks;
    landmarks.insert(landmarks.end(), of_image.begin(), of_image.end());
  }
  SortUnique(&landmarks);
  return landmarks;
}

}  // namespace cairn
