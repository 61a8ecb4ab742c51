#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/features/features.h"

namespace faiss {
struct Index;
struct IndexIVF;
}  // namespace faiss

namespace cairn {

// Two usual ways with faiss, both over one flat k-means of `num_words` centres.
class FaissPeer {
 public:
  FaissPeer();
  ~FaissPeer();

  // Words: k-means of at most `num_training` descriptors, drawn at random by faiss.  `is_graph`: words of
  // descriptors are found by a navigable small-world graph over the centres (approximate) instead of by
  // comparing all.
  void Train(const DescriptorMatrix& training, int num_words, int num_iterations, bool is_graph);
  std::vector<int64_t> Words(const DescriptorMatrix& descriptors) const;

  // Inverted file over the descriptors themselves (8 bits a value), with `document` as their id.
  void Add(const DescriptorMatrix& descriptors, int64_t document);
  // Votes: every descriptor votes for the documents of its `num_neighbours` nearest ones.
  std::vector<int> Vote(const DescriptorMatrix& descriptors, int num_documents, int num_neighbours,
                        int num_probes) const;

 private:
  std::unique_ptr<faiss::Index> quantizer_;
  std::unique_ptr<faiss::IndexIVF> inverted_file_;
};

void SetFaissThreads(int num_threads);

}  // namespace cairn
