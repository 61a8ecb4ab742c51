#include "core/vocabulary/grow_vocabulary.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/vocabulary/split_node.h"

namespace cairn {
namespace {

// First stream of the seed that nodes use, one each.
constexpr uint64_t kFirstNodeStream = 1;

// Depth at which branching^depth words hold nearest to `descriptors_per_word` descriptors.
int DepthFromCount(int64_t num_descriptors, const GrowVocabularyOptions& options) {
  const double num_words = static_cast<double>(num_descriptors) / options.descriptors_per_word;
  const double levels = std::log(std::max(1.0, num_words)) / std::log(static_cast<double>(options.branching));
  return std::clamp(static_cast<int>(std::lround(levels)), 1, 8);
}

// Grows the tree level by level; nodes of a level in parallel, or the descriptors of a node where there are
// few nodes.
Status GrowTree(const DescriptorMatrix& training, const GrowVocabularyOptions& options, uint64_t seed,
                int num_threads, Progress& progress, Vocabulary* vocabulary) {
  std::vector<std::vector<int32_t>> level(1);  // members of the nodes of the current level
  level[0].resize(training.rows());
  std::iota(level[0].begin(), level[0].end(), 0);
  const DescriptorSpace space = vocabulary->kind.space();
  std::vector<DescriptorRow> centres(1, DescriptorRow::Zero(space.num_values));
  vocabulary->nodes.resize(1);
  size_t first_node = 0;  // of the level
  progress.Begin("training vocabulary", training.rows() * vocabulary->depth, "descriptors");
  // [Mariottini11 §IV] hierarchical k-means, L levels of at most k children
  for (int depth = 0; depth < vocabulary->depth; ++depth) {
    std::vector<std::vector<NodeChild>> children(level.size());
    const bool parallel_nodes = static_cast<int>(level.size()) >= 4 * NumThreads(num_threads);
    ParallelFor(static_cast<int64_t>(level.size()), parallel_nodes ? num_threads : 1, [&](int64_t i) {
      const int64_t num_members = static_cast<int64_t>(level[i].size());
      if (!progress.Cancelled() && (depth == 0 || num_members >= options.min_num_descriptors_to_split)) {
        children[i] = SplitNode(training, space, level[i], options.branching, options.max_num_iterations,
                                MixSeed(seed, kFirstNodeStream + first_node + static_cast<uint64_t>(i)),
                                parallel_nodes ? 1 : num_threads);
      }
      progress.Advance(num_members);
    });
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "training the vocabulary was stopped");
    std::vector<std::vector<int32_t>> next_level;
    for (size_t i = 0; i < level.size(); ++i) {
      vocabulary->nodes[first_node + i].num_children = static_cast<int32_t>(children[i].size());
      for (NodeChild& child : children[i]) {
        centres.push_back(child.centre);
        next_level.push_back(std::move(child.members));
      }
    }
    first_node += level.size();
    level = std::move(next_level);
    vocabulary->nodes.resize(centres.size());
  }
  progress.End();
  vocabulary->centres.resize(static_cast<Eigen::Index>(centres.size()), space.num_values);
  for (size_t i = 0; i < centres.size(); ++i) vocabulary->centres.row(i) = centres[i];
  return NumberVocabularyNodes(vocabulary);
}

}  // namespace

Result<Vocabulary> GrowVocabulary(const DescriptorMatrix& training, const DescriptorKind& kind,
                                  int64_t num_descriptors, const GrowVocabularyOptions& options,
                                  uint64_t seed, int num_threads, Progress& progress) {
  Vocabulary vocabulary;
  vocabulary.kind = kind;
  vocabulary.branching = options.branching;
  vocabulary.depth = options.depth > 0 ? options.depth : DepthFromCount(num_descriptors, options);
  CAIRN_RETURN_IF_ERROR(GrowTree(training, options, seed, num_threads, progress, &vocabulary));
  return vocabulary;
}

}  // namespace cairn
