#include "bench/vocabulary/faiss_peer.h"

#include <faiss/Clustering.h>
#include <faiss/IndexFlat.h>
#include <faiss/IndexHNSW.h>
#include <faiss/IndexScalarQuantizer.h>
#include <omp.h>

namespace cairn {
namespace {

using FloatMatrix = Eigen::Matrix<float, Eigen::Dynamic, kSiftDescriptorDim, Eigen::RowMajor>;

FloatMatrix ToFloats(const DescriptorMatrix& descriptors) { return descriptors.cast<float>(); }

}  // namespace

FaissPeer::FaissPeer() = default;
FaissPeer::~FaissPeer() = default;

void SetFaissThreads(int num_threads) { omp_set_num_threads(num_threads); }

void FaissPeer::Train(const DescriptorMatrix& training, int num_words, int num_iterations, bool is_graph) {
  const FloatMatrix floats = ToFloats(training);
  faiss::ClusteringParameters parameters;
  parameters.niter = num_iterations;
  parameters.min_points_per_centroid = 1;
  faiss::Clustering clustering(kSiftDescriptorDim, num_words, parameters);
  faiss::IndexFlatL2 assign(kSiftDescriptorDim);
  clustering.train(floats.rows(), floats.data(), assign);
  if (is_graph) {
    auto graph = std::make_unique<faiss::IndexHNSWFlat>(kSiftDescriptorDim, 32);
    graph->hnsw.efSearch = 32;
    quantizer_ = std::move(graph);
  } else {
    quantizer_ = std::make_unique<faiss::IndexFlatL2>(kSiftDescriptorDim);
  }
  quantizer_->add(num_words, clustering.centroids.data());
  auto inverted_file = std::make_unique<faiss::IndexIVFScalarQuantizer>(
      quantizer_.get(), kSiftDescriptorDim, num_words, faiss::ScalarQuantizer::QT_8bit_direct,
      faiss::METRIC_L2, false);
  inverted_file->train(floats.rows(), floats.data());
  inverted_file_ = std::move(inverted_file);
}

std::vector<int64_t> FaissPeer::Words(const DescriptorMatrix& descriptors) const {
  const FloatMatrix floats = ToFloats(descriptors);
  std::vector<int64_t> words(floats.rows());
  quantizer_->assign(floats.rows(), floats.data(), words.data());
  return words;
}

void FaissPeer::Add(const DescriptorMatrix& descriptors, int64_t document) {
  const FloatMatrix floats = ToFloats(descriptors);
  const std::vector<int64_t> ids(floats.rows(), document);
  inverted_file_->add_with_ids(floats.rows(), floats.data(), ids.data());
}

std::vector<int> FaissPeer::Vote(const DescriptorMatrix& descriptors, int num_documents, int num_neighbours,
                                 int num_probes) const {
  const FloatMatrix floats = ToFloats(descriptors);
  inverted_file_->nprobe = num_probes;
  std::vector<int64_t> documents(floats.rows() * num_neighbours);
  std::vector<float> distances(documents.size());
  inverted_file_->search(floats.rows(), floats.data(), num_neighbours, distances.data(), documents.data());
  std::vector<int> votes(num_documents, 0);
  for (const int64_t document : documents) {
    if (document >= 0) ++votes[document];
  }
  return votes;
}

}  // namespace cairn
