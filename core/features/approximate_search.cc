#include "core/features/approximate_search.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/flann.hpp>

#include "core/features/descriptor_distance.h"

namespace cairn {
namespace {

// COLMAP's.
constexpr int kNumTrees = 4, kNumChecks = 128;
// OpenCV's for binary descriptors (tutorial of feature matching): tables, bits of a key, bits that may
// differ.
constexpr int kNumTables = 12, kNumKeyBits = 20, kNumProbes = 2;
// Offered for each query: with the distances of FLANN those of the best two may be in another order.
constexpr int kNumOffered = 4;
constexpr uint64_t kSeed = 1;
// Descriptors that the exact search compares one with, in both directions, in the time that the other takes
// for a query among as many.
constexpr int64_t kNumExactAsFast = 300000;
// LshTable::getKey() reads so many bytes at once, of the last descriptor beyond its end.
constexpr size_t kNumBytesBeyond = 8;

// Trees and tables are drawn with OpenCV's generator of the thread, which has the same state afterwards.
class SameRandomNumbers {
 public:
  SameRandomNumbers() : before_(cv::theRNG()) { cv::theRNG() = cv::RNG(kSeed); }
  SameRandomNumbers(const SameRandomNumbers&) = delete;
  SameRandomNumbers& operator=(const SameRandomNumbers&) = delete;
  ~SameRandomNumbers() { cv::theRNG() = before_; }

 private:
  cv::RNG before_;
};

cvflann::Matrix<uint8_t> MatrixOf(const uint8_t* values, int64_t num_rows, int64_t num_values) {
  return {const_cast<uint8_t*>(values), static_cast<size_t>(num_rows), static_cast<size_t>(num_values)};
}

std::string PaddedBits(const DescriptorMatrix& descriptors) {
  return BitsOfDescriptors(descriptors).append(kNumBytesBeyond, '\0');
}

const uint8_t* BytesOf(const std::string& bits) { return reinterpret_cast<const uint8_t*>(bits.data()); }

}  // namespace

// What is searched, as FLANN has it.
class ApproximateIndex::Search {
 public:
  Search(DescriptorMatrix descriptors, const DescriptorSpace& space)
      : descriptors_(std::move(descriptors)), space_(space) {
    const SameRandomNumbers same;
    const int64_t num_rows = descriptors_.rows();
    if (space.measure == DescriptorMeasure::kHamming) {
      bits_ = PaddedBits(descriptors_);
      tables_ = std::make_unique<Tables>(MatrixOf(BytesOf(bits_), num_rows, space.num_values / 8),
                                         cvflann::LshIndexParams(kNumTables, kNumKeyBits, kNumProbes));
      tables_->buildIndex();
    } else {
      trees_ = std::make_unique<Trees>(MatrixOf(descriptors_.data(), num_rows, space.num_values),
                                       cvflann::KDTreeIndexParams(kNumTrees));
      trees_->buildIndex();
    }
  }

  const DescriptorMatrix& descriptors() const { return descriptors_; }
  const DescriptorSpace& space() const { return space_; }

  void FindBestTwo(const DescriptorMatrix& queries, PooledVector<BestTwo>* best) const {
    best->assign(queries.rows(), {});
    const std::string bits = tables_ ? PaddedBits(queries) : std::string();
    const int64_t num_bytes = tables_ ? space_.num_values / 8 : space_.num_values;
    const uint8_t* values = tables_ ? BytesOf(bits) : queries.data();
    const cvflann::SearchParams params(kNumChecks);
    std::vector<int32_t> offered;
    std::array<int32_t, kNumOffered> dots = {};
    for (int64_t i = 0; i < queries.rows(); ++i) {
      uint8_t* query = const_cast<uint8_t*>(values + i * num_bytes);
      offered = tables_ ? Nearest(*tables_, query, params) : Nearest(*trees_, query, params);
      if (offered.size() < 2) continue;
      DescriptorDots(queries.data() + i * space_.num_values, descriptors_, offered, space_, dots.data());
      // In the order of their indices: of equal ones the first is the best.
      for (size_t k = 0; k < offered.size(); ++k) {
        if (space_.is_sift() || dots[k] > 0) (*best)[i].Offer(offered[k], dots[k]);
      }
    }
  }

 private:
  using Trees = cvflann::KDTreeIndex<cvflann::L2<uint8_t>>;
  using Tables = cvflann::LshIndex<cvflann::Hamming<uint8_t>>;

  template <typename Index>
  static std::vector<int32_t> Nearest(Index& index, uint8_t* query, const cvflann::SearchParams& params) {
    using Distance = typename Index::DistanceType;
    // Tables offer a descriptor more than once.
    cvflann::KNNUniqueResultSet<Distance> nearest(kNumOffered);
    index.findNeighbors(nearest, query, params);
    std::array<int, kNumOffered> found = {};
    std::array<Distance, kNumOffered> distances = {};
    found.fill(-1);
    nearest.copy(found.data(), distances.data(), kNumOffered);
    std::vector<int32_t> idxs(found.begin(), std::find(found.begin(), found.end(), -1));
    std::sort(idxs.begin(), idxs.end());
    return idxs;
  }

  const DescriptorMatrix descriptors_;
  const DescriptorSpace space_;
  std::string bits_;  // of binary descriptors, eight a byte
  std::unique_ptr<Trees> trees_;
  std::unique_ptr<Tables> tables_;
};

ApproximateIndex::ApproximateIndex(DescriptorMatrix descriptors, const DescriptorSpace& space)
    : search_(std::make_unique<Search>(std::move(descriptors), space)) {}
ApproximateIndex::ApproximateIndex(ApproximateIndex&&) noexcept = default;
ApproximateIndex& ApproximateIndex::operator=(ApproximateIndex&&) noexcept = default;
ApproximateIndex::~ApproximateIndex() = default;

const DescriptorMatrix& ApproximateIndex::descriptors() const { return search_->descriptors(); }
const DescriptorSpace& ApproximateIndex::space() const { return search_->space(); }

void ApproximateIndex::FindBestTwo(const DescriptorMatrix& queries, PooledVector<BestTwo>* best) const {
  search_->FindBestTwo(queries, best);
}

int64_t ApproximateIndex::NumBytes(int64_t num_descriptors, const DescriptorSpace& space) {
  // A node of a k-d tree takes 32 bytes, there are two for each descriptor; what is in a table 90, with its
  // bucket, and a bucket for every key where there are many.
  constexpr int64_t kTreeBytes = int64_t{2} * 32 * kNumTrees, kTableBytes = int64_t{90} * kNumTables;
  constexpr int64_t kNumKeys = int64_t{1} << kNumKeyBits, kBucketBytes = 24 * kNumKeys * kNumTables;
  const int64_t hashed = num_descriptors * (space.num_values / 8 + kTableBytes) + kNumKeys / 8 * kNumTables +
                         (num_descriptors > kNumKeys / 2 ? kBucketBytes : 0);
  const int64_t searched =
      space.measure == DescriptorMeasure::kHamming ? hashed : num_descriptors * kTreeBytes;
  return num_descriptors * space.num_values + searched;
}

bool IsApproximateFaster(int64_t size1, int64_t size2, const DescriptorSpace& space) {
  return space.measure != DescriptorMeasure::kHamming && size1 * size2 > kNumExactAsFast * (size1 + size2);
}

PooledVector<Match> MatchApproximately(const ApproximateIndex& index1, const ApproximateIndex& index2,
                                       const DescriptorMatcherOptions& options) {
  PooledVector<BestTwo> rows, columns;
  index2.FindBestTwo(index1.descriptors(), &rows);
  index1.FindBestTwo(index2.descriptors(), &columns);
  return SelectMatches(rows, columns, index1.space(), options);
}

}  // namespace cairn
