#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "core/base/pooled.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"

namespace cairn {

// A survey image that may show what the query shows.
struct Candidate {
  int32_t image = 0;  // index of the image in the map
  double score = 0;
};
PooledVector<int32_t> ImagesOf(std::span<const Candidate> candidates);

// All of these: errors as Map::Landmarks, a damaged block.  `work`: counts what they take; null: nothing
// does.

// Survey images most like the query [Mariottini11 §IV], best first: by the vocabulary's words, or, in
// a map without one, by the landmarks nearest to the query's descriptors, each a word of its own.
Result<PooledVector<Candidate>> RetrieveByWords(const Map& map, const Query& query,
                                                const RetrieveOptions& options);
// Survey images taken near the prior (in the map's own frame), nearest first; score 1 / (1 + distance in m).
Result<PooledVector<Candidate>> RetrieveByPrior(const Map& map, const PosePrior& prior,
                                                const RetrieveOptions& options, WorkBudget* work = nullptr);

// A survey image near a pose.
struct NearView {
  int32_t image = 0;            // index of the image in the map
  double squared_distance = 0;  // (metres / radius_m)^2 + (degrees / radius_deg)^2
};
// The survey images nearest to a pose of the map's own frame, nearest first, at most so many.
// REQUIRES: radius_m, radius_deg > 0, max_num >= 1
Result<PooledVector<NearView>> NearestViews(const Map& map, const Pose& cam_from_world, double radius_m,
                                            double radius_deg, int max_num, WorkBudget* work = nullptr);

// The survey image nearest to a fix or, where it is ambiguous, to the best of its poses.
// REQUIRES: it has a pose; the map has images
Result<int32_t> ImageNearFix(const Map& map, const Localization& found);

// Regions of the candidates' stations, those with the largest sum of scores first, at most max_num_regions.
Result<PooledVector<RegionIdx>> RegionsOfCandidates(const Map& map, std::span<const Candidate> candidates,
                                                    const RetrieveOptions& options);

// For every region the number of these landmarks (each once) that it has, most first, ties to the smaller
// index; regions without any are left out.  Errors: as Map::Landmarks.
struct RegionVotes {
  RegionIdx region = -1;
  int num_votes = 0;
};
Result<PooledVector<RegionVotes>> VotesForRegions(const Map& map, std::span<const LandmarkIdx> landmarks,
                                                  WorkBudget* work = nullptr);

// The region that has most of these landmarks, the smaller index on a tie; -1 for none.
Result<RegionIdx> RegionWithMost(const Map& map, std::span<const LandmarkIdx> landmarks,
                                 WorkBudget* work = nullptr);

// Landmarks of regions, of images, ascending, each once; of images of the first that have no more than
// max_num together, or of the first one.
constexpr int64_t kAnyNum = std::numeric_limits<int64_t>::max();
Result<PooledVector<LandmarkIdx>> LandmarksOfRegions(const Map& map, std::span<const RegionIdx> regions,
                                                     WorkBudget* work = nullptr);
Result<PooledVector<LandmarkIdx>> LandmarksOfImages(const Map& map, std::span<const int32_t> images,
                                                    int64_t max_num = kAnyNum, WorkBudget* work = nullptr);

// Distance from a place (in the map's own frame) to the nearest survey camera, metres; infinite
// without images.
Result<double> DistanceFromSurvey(const Map& map, const Eigen::Vector3d& center, WorkBudget* work = nullptr);

}  // namespace cairn
