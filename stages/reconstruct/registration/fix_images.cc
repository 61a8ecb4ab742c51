#include "stages/reconstruct/registration/fix_images.h"

#include <algorithm>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/pooled.h"
#include "runtime/localize/estimate.h"

namespace cairn::reconstruct {
namespace {

constexpr size_t kMaxPointsPerKeypoint = 3;

// Points that posed images have at what a keypoint matches: (keypoint, track), as often as images say so.
using Votes = std::map<std::pair<KeypointIdx, int>, int>;

std::vector<Votes> CollectVotes(const PosedInput& posed, const SeenPoints& seen) {
  std::vector<Votes> votes(posed.input.images.size());
  const std::map<ImageId, int> index = IndexOf(posed.input);
  for (const TwoViewGeometry& geometry : posed.input.geometries) {
    const int image1 = index.at(geometry.image_id1), image2 = index.at(geometry.image_id2);
    if (posed.cam_from_world[image1].has_value() == posed.cam_from_world[image2].has_value()) continue;
    const bool is_first_posed = posed.cam_from_world[image1].has_value();
    for (const Match& match : geometry.inliers) {
      const int track =
          is_first_posed ? seen.track_of[image1][match.idx1] : seen.track_of[image2][match.idx2];
      if (track < 0) continue;
      ++votes[is_first_posed ? image2 : image1][{is_first_posed ? match.idx2 : match.idx1, track}];
    }
  }
  return votes;
}

// The tracks of each keypoint, most votes first.
std::vector<std::pair<KeypointIdx, int>> BestTracks(const Votes& votes) {
  std::vector<std::pair<KeypointIdx, int>> best;
  for (auto begin = votes.begin(); begin != votes.end();) {
    std::vector<std::pair<int, int>> tracks;  // (-votes, track)
    auto end = begin;
    for (; end != votes.end() && end->first.first == begin->first.first; ++end)
      tracks.emplace_back(-end->second, end->first.second);
    std::sort(tracks.begin(), tracks.end());
    tracks.resize(std::min(tracks.size(), kMaxPointsPerKeypoint));
    for (const auto& [votes_of, track] : tracks) best.emplace_back(begin->first.first, track);
    begin = end;
  }
  return best;
}

ImageFix FixImage(const PosedInput& posed, const SeenPoints& seen, int image, const Votes& votes,
                  double max_error_px) {
  ImageFix fix{.image = image, .matches = {}, .poses = {}};
  const Camera& camera = posed.CameraOf(image);
  const std::vector<std::pair<KeypointIdx, int>> tracks = BestTracks(votes);
  Features features;
  for (const auto& [keypoint, track] : tracks)
    features.keypoints.push_back(posed.input.keypoints[image][keypoint]);
  features.descriptors =
      DescriptorMatrix::Zero(static_cast<Eigen::Index>(features.keypoints.size()), kSiftDescriptorDim);
  const Query query = MakeQuery(std::move(features), camera, {});
  PooledVector<PoseMeasurement> measurements;
  for (size_t k = 0; k < tracks.size(); ++k) {
    const auto ray = MakePixelRay(camera, posed.PixelOf({image, tracks[k].first}));
    if (!ray || !query.rays[k]) continue;
    const Eigen::Vector3d& position = seen.triangulations[tracks[k].second].position;
    fix.matches.push_back({*ray, position});
    measurements.push_back({position, Eigen::Matrix3d::Zero(), *query.rays[k]});
  }
  const EstimateOptions options{.max_error_px = max_error_px};
  const auto first = EstimatePose(measurements, options, {}, kRansacSeed);
  if (!first) return fix;
  const auto add = [&](const PoseEstimate& estimate) {
    fix.poses.push_back({estimate.cam_from_world, static_cast<int>(estimate.inliers.size())});
  };
  add(*first);
  if (const auto other = EstimateOtherPose(measurements, *first, options, {}, kRansacSeed)) add(*other);
  return fix;
}

}  // namespace

std::vector<ImageFix> FixImages(const PosedInput& posed, const SeenPoints& seen,
                                const std::vector<int>& images, double max_error_px, int num_threads) {
  const std::vector<Votes> votes = CollectVotes(posed, seen);
  std::vector<ImageFix> fixes(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, [&](int64_t i) {
    fixes[i] = FixImage(posed, seen, images[i], votes[images[i]], max_error_px);
  });
  return fixes;
}

}  // namespace cairn::reconstruct
