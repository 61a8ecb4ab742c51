#pragma once

#include <vector>

#include "core/options.h"
#include "core/pose.h"
#include "runtime/map.h"

namespace cairn {

struct RetrieveOptions {
  // Most candidate images.  REQUIRES: >= 1
  int max_num_candidates = 20;
  // Candidates score at least this part of the best one's score [Mariottini11: a percentage of the maximum,
  // not given]. REQUIRES: in [0, 1]
  double min_score_ratio = 0.3;
  // Most regions whose landmarks are matched first.  REQUIRES: >= 1
  int max_num_regions = 12;
  // With a prior: survey images within this distance and angle of it (beyond 3 of its standard deviations)
  // are candidates.  REQUIRES: >= 0
  double prior_distance_m = 3;
  double prior_angle_deg = 45;
};
OptionTable DescribeOptions(RetrieveOptions* options);

// Where the camera is believed to be: in the frame in which poses are reported.
struct PosePrior {
  Pose cam_from_world;
  double sigma_m = 1;     // of its place, per axis
  double sigma_deg = 10;  // of its rotation
};

// A survey image that may show what the query shows.
struct Candidate {
  int32_t image = 0;  // index into rows().images
  double score = 0;
};

// Survey images most like the query [Mariottini11, On line 1], best first.
std::vector<Candidate> RetrieveByWords(const Map& map, const DescriptorMatrix& descriptors,
                                       const RetrieveOptions& options);
// Survey images taken near the prior (in the map's own frame), nearest first; score 1 / (1 + distance in m).
std::vector<Candidate> RetrieveByPrior(const Map& map, const PosePrior& prior,
                                       const RetrieveOptions& options);

// Regions of the candidates' stations, those with the largest sum of scores first, at most max_num_regions.
std::vector<RegionIdx> RegionsOfCandidates(const Map& map, const std::vector<Candidate>& candidates,
                                           const RetrieveOptions& options);

// Landmarks of regions, of images, ascending, each once.
std::vector<LandmarkIdx> LandmarksOfRegions(const Map& map, const std::vector<RegionIdx>& regions);
std::vector<LandmarkIdx> LandmarksOfImages(const Map& map, const std::vector<int32_t>& images);

}  // namespace cairn
