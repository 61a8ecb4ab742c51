#include "stages/group_classes/adjust/blocks.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/random.h"
#include "core/structure/points.h"
#include "stages/group_classes/adjust/parts.h"
#include "stages/group_classes/tracks/choose_tracks.h"

namespace cairn::group_classes {

std::vector<std::vector<int32_t>> BlocksOfRound(const PosedImages& posed, int round, int most) {
  if (round == 0) {
    std::vector<std::vector<int32_t>> runs((posed.num_images() + most - 1) / most);
    const std::vector<int> begins = BeginsOfParts(posed.num_images(), static_cast<int>(runs.size()));
    for (size_t r = 0; r < runs.size(); ++r) {
      runs[r].resize(begins[r + 1] - begins[r]);
      std::iota(runs[r].begin(), runs[r].end(), begins[r]);
    }
    return runs;
  }
  std::vector<Eigen::Vector3d> centers;
  for (const Pose& pose : posed.poses) centers.push_back(pose.Center());
  std::vector<int32_t> images(centers.size());
  std::iota(images.begin(), images.end(), 0);
  Random random(MixSeed(0, round));
  return DividePoints(centers, std::move(images), most, &random);
}

std::vector<std::vector<int64_t>> TracksOfBlocks(const std::vector<Track>& tracks,
                                                 const std::vector<std::vector<int32_t>>& blocks,
                                                 int num_images) {
  std::vector<int32_t> block_of(num_images, -1);
  for (size_t b = 0; b < blocks.size(); ++b) {
    for (const int32_t image : blocks[b]) block_of[image] = static_cast<int32_t>(b);
  }
  std::vector<std::vector<int64_t>> of_blocks(blocks.size());
  for (size_t t = 0; t < tracks.size(); ++t) {
    for (const TrackElement& element : tracks[t]) {
      const int32_t block = block_of[element.image_idx];
      if (block < 0) continue;
      std::vector<int64_t>& of_block = of_blocks[block];
      if (of_block.empty() || of_block.back() != static_cast<int64_t>(t))
        of_block.push_back(static_cast<int64_t>(t));
    }
  }
  return of_blocks;
}

SurveyBlock CutOutBlock(const MatchedFeatures& matched, const PosedImages& posed,
                        const std::vector<Track>& tracks, const std::vector<int64_t>& tracks_of_block,
                        const std::vector<int32_t>& images, int num_known,
                        const TriangulateOptions& triangulate, int num_keypoints, int num_threads) {
  std::vector<Track> seen;
  seen.reserve(tracks_of_block.size());
  for (const int64_t t : tracks_of_block) {
    const auto is_unknown = [&](const TrackElement& element) { return element.image_idx >= num_known; };
    seen.emplace_back(tracks[t].begin(), std::find_if(tracks[t].begin(), tracks[t].end(), is_unknown));
  }
  std::vector<Triangulation> triangulations =
      TriangulateTracks(matched, seen, posed, triangulate, num_threads);
  std::vector<char> is_of_block(posed.num_images(), 0), is_used(posed.num_images(), 0);
  for (const int32_t i : images) {
    is_of_block[i] = 1;
    for (int beside = std::max(0, i - 1); beside <= std::min(num_known - 1, i + 1); ++beside)
      is_used[beside] = 1;
  }
  SurveyBlock block;
  for (const size_t t : ChooseTracks(seen, triangulations, is_of_block, num_keypoints)) {
    Track& track = block.tracks.emplace_back();
    for (const int i : Spread(triangulations[t].inliers)) {
      track.push_back(seen[t][i]);
      is_used[seen[t][i].image_idx] = 1;
    }
    Triangulation& triangulation = block.triangulations.emplace_back(std::move(triangulations[t]));
    triangulation.inliers.resize(track.size());
    std::iota(triangulation.inliers.begin(), triangulation.inliers.end(), 0);
  }
  std::vector<int> own_idx(posed.num_images(), -1);
  for (int i = 0; i < posed.num_images(); ++i) {
    if (is_used[i] == 0) continue;
    own_idx[i] = static_cast<int>(block.images.size());
    block.images.push_back(i);
    block.is_fixed.push_back(is_of_block[i] == 0 ? 1 : 0);
  }
  for (Track& track : block.tracks) {
    for (TrackElement& element : track) element.image_idx = own_idx[element.image_idx];
  }
  return block;
}

}  // namespace cairn::group_classes
