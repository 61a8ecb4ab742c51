#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/pooled.h"

namespace cairn {

// A keypoint.  Position in COLMAP's pixels (first pixel's centre at (0.5, 0.5)); scale = sigma in pixels
// of the image; orientation in radians, as COLMAP stores it.  Scale 0: what found it measures neither.
struct Keypoint {
  float x = 0;
  float y = 0;
  float scale = 0;
  float orientation = 0;
};

inline constexpr int kSiftDescriptorDim = 128;  // values of a SIFT descriptor
inline constexpr int kMinDescriptorDim = 32;
inline constexpr int kMaxDescriptorDim = 1024;

// One descriptor per row, of 8-bit values; DescriptorKind says what they mean.  A matrix of Eigen's in memory
// that is used again (core/base/pooled.h).
class DescriptorMatrix
    : public Eigen::Map<Eigen::Matrix<uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> {
 public:
  using Matrix = Eigen::Matrix<uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  DescriptorMatrix() : Map(nullptr, 0, 0) {}
  // Of any values.
  DescriptorMatrix(Eigen::Index rows, Eigen::Index cols) : DescriptorMatrix() { resize(rows, cols); }
  DescriptorMatrix(const DescriptorMatrix& other) : Map(nullptr, 0, 0), values_(other.values_) {
    Show(other.rows(), other.cols());
  }
  DescriptorMatrix(DescriptorMatrix&& other) noexcept : DescriptorMatrix() { swap(other); }
  template <typename Derived>
  DescriptorMatrix(const Eigen::DenseBase<Derived>& other)  // NOLINT: as Eigen's
      : DescriptorMatrix(other.rows(), other.cols()) {
    Map::operator=(other.derived());
  }
  DescriptorMatrix& operator=(const DescriptorMatrix& other) {
    values_ = other.values_;
    Show(other.rows(), other.cols());
    return *this;
  }
  DescriptorMatrix& operator=(DescriptorMatrix&& other) noexcept {
    swap(other);
    return *this;
  }
  template <typename Derived>
  DescriptorMatrix& operator=(const Eigen::DenseBase<Derived>& other) {
    DescriptorMatrix copy(other);
    swap(copy);
    return *this;
  }
  ~DescriptorMatrix() = default;

  void swap(DescriptorMatrix& other) noexcept {
    values_.swap(other.values_);
    const Eigen::Index num_rows = rows(), num_cols = cols();
    Show(other.rows(), other.cols());
    other.Show(num_rows, num_cols);
  }
  // What the values are then is not said.
  void resize(Eigen::Index rows, Eigen::Index cols) {
    values_.resize(static_cast<size_t>(rows * cols));
    Show(rows, cols);
  }
  // Rows that there were are kept.  REQUIRES: as many columns, or no rows before
  void conservativeResize(Eigen::Index rows, Eigen::Index cols) { resize(rows, cols); }
  void conservativeResize(Eigen::Index rows, Eigen::NoChange_t /*cols*/) { resize(rows, cols()); }

  int64_t num_bytes() const { return static_cast<int64_t>(PooledSize(values_.capacity())); }

  static auto Zero(Eigen::Index rows, Eigen::Index cols) { return Matrix::Zero(rows, cols); }
  static auto Constant(Eigen::Index rows, Eigen::Index cols, uint8_t value) {
    return Matrix::Constant(rows, cols, value);
  }

 private:
  // As Eigen's pages have it for a map to other memory.
  void Show(Eigen::Index rows, Eigen::Index cols) {
    new (static_cast<Map*>(this)) Map(values_.data(), rows, cols);
  }

  PooledVector<uint8_t> values_;
};
using DescriptorRow = Eigen::Matrix<uint8_t, 1, Eigen::Dynamic>;

// How descriptors are compared.  All are vectors of 8-bit values less an offset, and the nearest of a
// descriptor is the one at the smallest angle.  How near that is says a measure of its own for each type, all
// on the scale of the angles of SIFT: pi / 2 and more stands for unlike ones, and one set of limits and
// ratios serves for all.
enum class DescriptorMeasure {
  kAngle,    // the angle itself
  kHamming,  // of bits, of which h of n differ (the angle is arc cos (1 - 2 h / n)): pi h / n
  kDense,    // the angle to the fourth, pi / 2 at 0.75 rad: DescriptorType::kDense says why
};
struct DescriptorSpace {
  int num_values = kSiftDescriptorDim;
  int offset = 0;  // the value that stands for 0
  DescriptorMeasure measure = DescriptorMeasure::kAngle;
  double squared_norm = 512.0 * 512.0;  // of every vector, up to rounding

  // RootSIFT's, which has kernels of its own: no other has no offset.
  bool is_sift() const { return offset == 0 && num_values == kSiftDescriptorDim; }
  friend bool operator==(const DescriptorSpace&, const DescriptorSpace&) = default;
};

// The values are not stored: what is (DescriptorKind) is text.
enum class DescriptorType {
  // RootSIFT, quantised like COLMAP's: round(512 sqrt(v / |v|_1)), at most 255.
  kSift,
  // Values of any detector that are compared by their angle: DescriptorsFromFloats.
  kFloat,
  // Values of a net that describes all of an image, from which some places are taken: those beside a place
  // look like it, so that the second best says little about the best.
  kDense,
  // Bits, each 0 or twice the offset.
  kBinary,
};

// What the descriptors of an image, a survey or a map are: those of different kinds cannot be compared.
struct DescriptorKind {
  DescriptorType type = DescriptorType::kSift;
  int num_values = kSiftDescriptorDim;  // bits of a binary descriptor
  std::string extractor;  // what made them, in a word ("xfeat", "orb"); empty: not known, or SIFT

  DescriptorSpace space() const;
  bool is_sift() const { return type == DescriptorType::kSift; }
  friend bool operator==(const DescriptorKind&, const DescriptorKind&) = default;
};

// Descriptors of floating-point values, one per row, of any length, in 8 bits about 128: 32 for the root mean
// square of a row, and no value farther than 127 (what is more is cut off, and the rest made longer, as Lowe
// does it with SIFT ["Distinctive image features from scale-invariant keypoints", IJCV 2004, section 6.1]).
// The cosine of the angle between two changes by less than 0.01.  A row of zeros becomes one of 128.
// Errors: InvalidArgument (a value that is not finite; a number of columns that is not kind's).
using FloatDescriptors = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
Result<DescriptorMatrix> DescriptorsFromFloats(const FloatDescriptors& values, const DescriptorKind& kind);

// Descriptors of bits, eight a byte, the lowest bit of a byte first: row i of `bytes` begins at
// i * num_bytes.  A bit takes a byte then: products of bytes are what processors are fast at.
// REQUIRES: 8 * num_bytes == kind.num_values
DescriptorMatrix DescriptorsFromBits(const uint8_t* bytes, int64_t num_rows, int64_t num_bytes,
                                     const DescriptorKind& kind);
// Descriptors of bytes as they come from an extractor: SIFT's 128, or the bits of a binary kind.
// Errors: InvalidArgument (another number of bytes; a kind of floating-point values).
Result<DescriptorMatrix> DescriptorsFromBytes(const uint8_t* bytes, int64_t num_rows, int64_t num_bytes,
                                              const DescriptorKind& kind);
// Makes the means of binary descriptors binary: a bit is what most of them have, 0 where as many have 1.
void RoundToBits(const DescriptorKind& kind, DescriptorMatrix* descriptors);
// And back: of each descriptor the bits, as they came.
std::string BitsOfDescriptors(const DescriptorMatrix& descriptors);

// "sift"; "float 64 xfeat", "binary 256": type, values, and the extractor where it is known.
std::string ToString(const DescriptorKind& kind);
// Errors: Corrupt (another text, or fewer than kMinDescriptorDim or more than kMaxDescriptorDim values).
Result<DescriptorKind> ParseDescriptorKind(std::string_view text);

// Whether descriptors of the one may be compared with those of the other: an extractor that is not known may
// be any.  Errors: InvalidArgument, in words: what `what` has, and what is expected.
Status CheckSameKind(const DescriptorKind& found, const DescriptorKind& expected, std::string_view what);

// The features of one image, row i of `descriptors` belonging to keypoint i.
struct Features {
  PooledVector<Keypoint> keypoints;
  DescriptorMatrix descriptors = DescriptorMatrix(0, kSiftDescriptorDim);
  DescriptorKind kind;
};

// A pair of keypoint indices, of the first and of the second image (or of a query and a landmark).
struct Match {
  uint32_t idx1 = 0;
  uint32_t idx2 = 0;
  friend bool operator==(const Match&, const Match&) = default;
  friend auto operator<=>(const Match&, const Match&) = default;
};

}  // namespace cairn
