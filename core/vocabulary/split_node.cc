#include "core/vocabulary/split_node.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/features/descriptor_distance.h"
#include "core/vocabulary/nearest_centre.h"

namespace cairn {
namespace {

constexpr int64_t kChunk = 4096;  // members a task assigns at a time

using Sums = std::vector<int64_t>;
using ChunkSums = std::vector<int32_t>;  // kChunk * 255 fits
using DescriptorRows = Eigen::Ref<const DescriptorMatrix::Matrix>;

// The direction of a sum of so many descriptors, quantised like a descriptor.
DescriptorRow CentreFromSums(const Sums& sums, int64_t num, const DescriptorSpace& space) {
  const Eigen::Map<const Eigen::Matrix<int64_t, 1, Eigen::Dynamic>> sum(
      sums.data(), static_cast<Eigen::Index>(sums.size()));
  return MeanDescriptor(sum.cast<double>(), num, space);
}

// k-means++: each next seed is drawn with a probability proportional to the squared distance from the
// nearest one.
DescriptorMatrix DrawSeeds(const DescriptorRows& members, const DescriptorSpace& space, int num_seeds,
                           uint64_t seed, int num_threads) {
  Random random(seed);
  const int64_t num_members = members.rows();
  std::vector<int32_t> nearest(num_members, INT32_MAX);
  DescriptorMatrix seeds(num_seeds, members.cols());
  int64_t chosen = random.UniformInt(0, num_members - 1);
  for (int k = 0; k < num_seeds; ++k) {
    const uint8_t* seed_descriptor = members.row(chosen).data();
    seeds.row(k) = CentreFromSums(Sums(seed_descriptor, seed_descriptor + members.cols()), 1, space);
    ParallelFor((num_members + kChunk - 1) / kChunk, num_threads, [&](int64_t chunk) {
      const int64_t first = chunk * kChunk;
      LowerSquaredDistances(members.row(first).data(), std::min(kChunk, num_members - first), seed_descriptor,
                            space.num_values, nearest.data() + first);
    });
    const int64_t total = std::accumulate(nearest.begin(), nearest.end(), int64_t{0});
    if (total == 0) return seeds.topRows(k + 1);  // every member equals a seed
    int64_t target = random.UniformInt(0, total - 1);
    for (chosen = 0; target >= nearest[chosen]; ++chosen) target -= nearest[chosen];
  }
  return seeds;
}

// Copies the members side by side in memory, since all rounds run over them.
DescriptorMatrix Gather(const DescriptorMatrix& descriptors, const std::vector<int32_t>& members) {
  DescriptorMatrix gathered(static_cast<Eigen::Index>(members.size()), descriptors.cols());
  for (size_t i = 0; i < members.size(); ++i) {
    gathered.row(static_cast<Eigen::Index>(i)) = descriptors.row(members[i]);
  }
  return gathered;
}

}  // namespace

std::vector<NodeChild> SplitNode(const DescriptorMatrix& descriptors, const DescriptorSpace& space,
                                 const std::vector<int32_t>& members, int branching, int max_num_iterations,
                                 uint64_t seed, int num_threads) {
  const int64_t num_members = static_cast<int64_t>(members.size());
  if (num_members < 2) return {};
  const int num_seeds = static_cast<int>(std::min<int64_t>(branching, num_members));
  DescriptorMatrix copies;
  if (num_members != descriptors.rows()) copies = Gather(descriptors, members);
  const DescriptorRows rows(num_members != descriptors.rows() ? copies : descriptors);
  DescriptorMatrix centres = DrawSeeds(rows, space, num_seeds, seed, num_threads);
  const int num_centres = static_cast<int>(centres.rows());
  const int64_t num_chunks = (num_members + kChunk - 1) / kChunk;
  std::vector<int32_t> nearest(members.size(), -1);
  std::vector<int64_t> counts;
  for (int iteration = 0;; ++iteration) {
    std::vector<std::vector<ChunkSums>> sums(num_chunks);
    std::vector<char> changed(num_chunks, 0);
    ParallelFor(num_chunks, num_threads, [&](int64_t chunk) {
      sums[chunk].assign(num_centres, ChunkSums(space.num_values, 0));
      for (int64_t i = chunk * kChunk; i < std::min(num_members, (chunk + 1) * kChunk); ++i) {
        const uint8_t* descriptor = rows.row(i).data();
        // [Mariottini11 §IV] k-means, one level of it; on directions instead of distances
        const int centre = NearestCentre(centres.data(), num_centres, descriptor, space);
        changed[chunk] |= centre != nearest[i];
        nearest[i] = centre;
        AddDescriptor(descriptor, space.num_values, sums[chunk][centre].data());
      }
    });
    counts.assign(num_centres, 0);
    for (const int32_t centre : nearest) ++counts[centre];
    // The stored centres are those that the last assignment used, as a query will use them.
    if (iteration == max_num_iterations || std::find(changed.begin(), changed.end(), 1) == changed.end())
      break;
    for (int k = 0; k < num_centres; ++k) {
      if (counts[k] == 0) continue;  // keeps its place; pruned if it stays empty
      Sums sum(space.num_values, 0);
      for (const std::vector<ChunkSums>& chunk : sums) {
        for (int i = 0; i < space.num_values; ++i) sum[i] += chunk[k][i];
      }
      centres.row(k) = CentreFromSums(sum, counts[k], space);
    }
  }

  std::vector<int> child_of_centre(num_centres, -1);
  std::vector<NodeChild> children;
  for (int k = 0; k < num_centres; ++k) {
    if (counts[k] == 0) continue;
    child_of_centre[k] = static_cast<int>(children.size());
    children.push_back({centres.row(k), {}});
    children.back().members.reserve(counts[k]);
  }
  if (children.size() < 2) return {};
  for (int64_t i = 0; i < num_members; ++i)
    children[child_of_centre[nearest[i]]].members.push_back(members[i]);
  return children;
}

}  // namespace cairn
