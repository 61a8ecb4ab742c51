#include "core/packing/packed_landmarks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <type_traits>

#include "core/base/blob.h"
#include "core/packing/map_codes.h"
#include "core/packing/range_coder.h"

namespace cairn {
namespace {

constexpr int64_t kMaxTenthsOfMm = 2'000'000'000;  // 200 km in units of 0.1 mm
constexpr int kNumCells = 4, kNumOrientations = 8;

// Sizes by quarters of an octave: 0, or 1 + number of them from 1 um.
constexpr int kLandmarkSizeBits = 7;

constexpr double kSmallestLandmarkM = 1e-6;
constexpr double kLandmarkSizesPerOctave = 4;

uint8_t PackSize(double metres) {
  if (!(metres > 0)) return 0;
  constexpr double kMost = (1 << kLandmarkSizeBits) - 2;
  const double size = std::round(kLandmarkSizesPerOctave * std::log2(metres / kSmallestLandmarkM));
  return static_cast<uint8_t>(1 + std::clamp(size, 0.0, kMost));
}

double UnpackSize(uint32_t code) {
  return code == 0 ? 0
                   : kSmallestLandmarkM * std::exp2((static_cast<int>(code) - 1) / kLandmarkSizesPerOctave);
}

// A covariance matrix as its Cholesky factor L: the diagonal, which says how exactly a coordinate is known
// given those before, and the others in units of 1/2 of the diagonal entry of their row.
struct PackedCovariance {
  std::array<uint8_t, 3> sizes = {};
  std::array<int32_t, 3> ratios = {};  // L10 / L11, L20 / L22, L21 / L22
};
constexpr double kRatioUnit = 0.5;
constexpr int kMaxRatio = 65536;

PackedCovariance PackCovariance(const Eigen::Matrix3d& covariance) {
  PackedCovariance packed;
  Eigen::Matrix3d factor = Eigen::Matrix3d::Zero(), stored = Eigen::Matrix3d::Zero();
  int next = 0;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < row; ++col) {
      const double rest = covariance(row, col) - factor.row(row).head(col).dot(factor.row(col).head(col));
      factor(row, col) = factor(col, col) > 0 ? rest / factor(col, col) : 0;
    }
    const double rest = covariance(row, row) - factor.row(row).head(row).squaredNorm();
    factor(row, row) = std::sqrt(std::max(0.0, rest));
    // What is expected of this coordinate given those before stays as it is, though these are rounded: the
    // errors of a row do not grow in the next.
    Eigen::RowVector3d slopes = Eigen::RowVector3d::Zero();
    for (int col = row - 1; col >= 0; --col) {
      if (factor(col, col) > 0)
        slopes[col] = (factor(row, col) - slopes.dot(factor.col(col))) / factor(col, col);
    }
    const Eigen::RowVector3d wanted = slopes * stored;
    const double least = wanted.cwiseAbs().maxCoeff() / (kMaxRatio * kRatioUnit / 2);
    packed.sizes[row] = PackSize(std::max(least, factor(row, row)));
    stored(row, row) = UnpackSize(packed.sizes[row]);
    for (int col = 0; col < row; ++col, ++next) {
      const double unit = kRatioUnit * stored(row, row);
      const double ratio = unit > 0 ? wanted[col] / unit : 0;
      packed.ratios[next] =
          static_cast<int32_t>(std::lround(std::clamp<double>(ratio, -kMaxRatio, kMaxRatio)));
      stored(row, col) = packed.ratios[next] * unit;
    }
  }
  return packed;
}

Eigen::Matrix3d UnpackCovariance(const PackedCovariance& packed) {
  Eigen::Matrix3d factor = Eigen::Matrix3d::Zero();
  int next = 0;
  for (int row = 0; row < 3; ++row) {
    factor(row, row) = UnpackSize(packed.sizes[row]);
    for (int col = 0; col < row; ++col, ++next)
      factor(row, col) = packed.ratios[next] * kRatioUnit * factor(row, row);
  }
  return factor * factor.transpose();
}

// log2 of a landmark's unit of length, in 0.1 mm: at most 0.4 of its least standard deviation.
int PositionShift(const PackedCovariance& covariance) {
  const int least = *std::min_element(covariance.sizes.begin(), covariance.sizes.end());
  // 1 um 2^((least - 1) / 4) is 100 um 2^((least - 1) / 4 - 6.64)
  return std::clamp((least - 1) / 4 - 8, 0, 20);
}

int64_t RoundShift(int64_t value, int shift) {
  return shift == 0 ? value : (value + (int64_t{1} << (shift - 1))) >> shift;
}

// LandmarkModels of everything that is coded per landmark, for either direction.
struct LandmarkModels {
  AdaptiveNumber class_step, num_observations;
  AdaptiveSymbol<kLandmarkSizeBits> scale;
  std::array<AdaptiveSymbol<kLandmarkSizeBits>, 3> sizes;
  std::array<AdaptiveNumber, 3> ratios;
  std::array<AdaptiveNumber, 3> offsets;
  std::array<AdaptiveBit, 6> signs;
  AdaptiveBit is_stored_whole;
  // By coefficient and by how large those around it are, 0 to 2: whether the level is 0, its sign, and
  // whether it is more than 1, 2, ...
  static constexpr int kNumSteps = 14;
  std::array<std::array<std::array<AdaptiveBit, kNumSteps + 2>, 3>, kSiftDescriptorDim> levels;
  AdaptiveNumber large_level;
};

template <typename Coder>
int64_t CodeSigned(Coder& coder, AdaptiveNumber* number, AdaptiveBit* sign, int64_t value) {
  const auto size = static_cast<int64_t>(number->Code(coder, static_cast<uint64_t>(std::abs(value))));
  if (size == 0) return 0;
  return coder.Bit(sign, value < 0) ? -size : size;
}

// Coefficients in the order of their frequencies, so that those around one are mostly known.
std::array<int, kSiftDescriptorDim> CoefficientOrder() {
  std::array<int, kSiftDescriptorDim> order;
  for (int i = 0; i < kSiftDescriptorDim; ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [](int a, int b) { return FrequencyOf(a) < FrequencyOf(b); });
  return order;
}

// How large the levels are that are known around a coefficient: those of one frequency less in y, in x, in
// both and in orientation, and, of a sine, the cosine's, twice.
int SizeAround(const TransformLevels& levels, int coefficient) {
  const int v = coefficient / (kNumCells * kNumOrientations), u = coefficient / kNumOrientations % kNumCells,
            f = coefficient % kNumOrientations;
  const auto size = [&](int back) { return std::abs(levels[coefficient - back]); };
  int sum = 0;
  if (v > 0) sum += size(kNumCells * kNumOrientations);
  if (u > 0) sum += size(kNumOrientations);
  if (v > 0 && u > 0) sum += size(kNumCells * kNumOrientations + kNumOrientations);
  if (f > 2) sum += size(2);
  if (f == 2 || f == 4 || f == 6) sum += 2 * size(1);
  return sum == 0 ? 0 : sum <= 2 ? 1 : 2;
}

// False where a level is too large for a descriptor.
template <typename Coder>
bool CodeLevels(Coder& coder, const std::array<int, kSiftDescriptorDim>& order, int step,
                LandmarkModels* models, TransformLevels* levels) {
  constexpr int64_t kMaxCoefficient = 4096;  // of a descriptor: below 255 sqrt(128)
  for (const int coefficient : order) {
    int16_t& level = (*levels)[coefficient];
    auto& model = models->levels[coefficient][SizeAround(*levels, coefficient)];
    if (!coder.Bit(&model[0], level != 0)) {
      level = 0;
      continue;
    }
    const bool is_negative = coder.Bit(&model[1], level < 0);
    const int64_t given = std::abs(level);
    int64_t size = 1;
    while (size <= LandmarkModels::kNumSteps && coder.Bit(&model[1 + size], given > size)) ++size;
    if (size > LandmarkModels::kNumSteps)
      size += static_cast<int64_t>(models->large_level.Code(coder, static_cast<uint64_t>(given - size)));
    if (size * step > kMaxCoefficient) return false;
    level = static_cast<int16_t>(is_negative ? -size : size);
  }
  return true;
}

// The numbers of a landmark that are coded, besides its descriptor.
struct PackedLandmark {
  int64_t class_id = 0;
  uint64_t num_observations = 0;
  uint32_t scale = 0;
  PackedCovariance covariance;
  std::array<int64_t, 3> position = {};  // in units of 0.1 mm 2^PositionShift
};

PackedLandmark PackLandmark(const MapLandmark& landmark) {
  PackedLandmark packed;
  packed.class_id = landmark.class_id;
  packed.num_observations = static_cast<uint64_t>(landmark.num_observations);
  packed.scale = PackSize(landmark.scale_m);
  packed.covariance = PackCovariance(landmark.covariance);
  const int shift = PositionShift(packed.covariance);
  for (int axis = 0; axis < 3; ++axis)
    packed.position[axis] = std::clamp(RoundShift(EncodeLength(landmark.position[axis]), shift),
                                       -(kMaxTenthsOfMm >> shift), kMaxTenthsOfMm >> shift);
  return packed;
}

// False where a number is out of range.
bool UnpackLandmark(const PackedLandmark& packed, MapLandmark* landmark) {
  if (packed.class_id < 0 || packed.class_id > kInvalidClassId ||
      packed.num_observations > static_cast<uint64_t>(std::numeric_limits<int>::max())) {
    return false;
  }
  landmark->class_id = static_cast<ClassId>(packed.class_id);
  landmark->num_observations = static_cast<int>(packed.num_observations);
  landmark->scale_m = UnpackSize(packed.scale);
  landmark->covariance = UnpackCovariance(packed.covariance);
  const int shift = PositionShift(packed.covariance);
  for (int axis = 0; axis < 3; ++axis) {
    const int64_t coordinate = packed.position[axis];
    if (std::abs(coordinate) > kMaxTenthsOfMm >> shift) return false;
    landmark->position[axis] = DecodeLength(coordinate << shift);
  }
  return true;
}

// Everything of a landmark but its descriptor, given the one before and the middle of all, 0.1 mm.
template <typename Coder>
void CodeLandmark(Coder& coder, const std::array<int64_t, 3>& middle, int64_t previous_class_id,
                  LandmarkModels* models, PackedLandmark* packed) {
  const uint64_t step = models->class_step.Code(coder, ZigZag(packed->class_id - previous_class_id));
  packed->class_id = previous_class_id + UnZigZag(step);
  packed->num_observations = models->num_observations.Code(coder, packed->num_observations);
  packed->scale = models->scale.Code(coder, packed->scale);
  PackedCovariance& covariance = packed->covariance;
  for (int i = 0; i < 3; ++i)
    covariance.sizes[i] = static_cast<uint8_t>(models->sizes[i].Code(coder, covariance.sizes[i]));
  for (int i = 0; i < 3; ++i) {
    const int64_t ratio = CodeSigned(coder, &models->ratios[i], &models->signs[i], covariance.ratios[i]);
    covariance.ratios[i] = static_cast<int32_t>(std::clamp<int64_t>(ratio, -kMaxRatio, kMaxRatio));
  }
  const int shift = PositionShift(covariance);
  for (int axis = 0; axis < 3; ++axis) {
    const int64_t from = RoundShift(middle[axis], shift);
    packed->position[axis] = from + CodeSigned(coder, &models->offsets[axis], &models->signs[3 + axis],
                                               packed->position[axis] - from);
  }
}

template <typename Coder>
bool CodeDescriptor(Coder& coder, const std::array<int, kSiftDescriptorDim>& order, const TransformCode& code,
                    LandmarkModels* models, uint8_t* descriptor) {
  constexpr int kBitsPerValue = 8;
  TransformLevels levels = {};
  bool is_exact = true;
  if constexpr (std::is_same_v<Coder, RangeEncoder>) {
    levels = LevelsOf(descriptor, code);
    std::array<uint8_t, kSiftDescriptorDim> stands_for;
    DescriptorOf(levels, code, stands_for.data());
    is_exact = std::equal(stands_for.begin(), stands_for.end(), descriptor);
  }
  if (coder.Bit(&models->is_stored_whole, !is_exact)) {
    for (int i = 0; i < kSiftDescriptorDim; ++i)
      descriptor[i] = static_cast<uint8_t>(coder.Bits(kBitsPerValue, descriptor[i]));
    return true;
  }
  if (!CodeLevels(coder, order, code.step, models, &levels)) return false;
  DescriptorOf(levels, code, descriptor);
  return true;
}

using Middle = std::array<int64_t, 3>;  // 0.1 mm

// The median of what is stored, not of what was given: the same when it is encoded again.  None of none: 0.
Middle MiddleOf(const std::vector<PackedLandmark>& landmarks) {
  Middle middle = {};
  for (int axis = 0; axis < 3 && !landmarks.empty(); ++axis) {
    std::vector<int64_t> coordinates;
    for (const PackedLandmark& packed : landmarks)
      coordinates.push_back(packed.position[axis] << PositionShift(packed.covariance));
    const auto place = coordinates.begin() + static_cast<std::ptrdiff_t>(coordinates.size() / 2);
    std::nth_element(coordinates.begin(), place, coordinates.end());
    middle[axis] = *place;
  }
  return middle;
}

// Codes one landmark after the other, each by what was learnt from those before.
class LandmarksCoder {
 public:
  LandmarksCoder(const TransformCode& code, const Middle& middle) : code_(code), middle_(middle) {}

  void Encode(PackedLandmark landmark, const DescriptorMatrix& descriptors, size_t row, RangeEncoder* coder) {
    CodeLandmark(*coder, middle_, class_id_, models_.get(), &landmark);
    class_id_ = landmark.class_id;
    std::array<uint8_t, kSiftDescriptorDim> descriptor;
    std::copy_n(descriptors.data() + row * kSiftDescriptorDim, kSiftDescriptorDim, descriptor.begin());
    CodeDescriptor(*coder, order_, code_, models_.get(), descriptor.data());
  }

  // False where the bytes are not those of so many landmarks.
  bool DecodeAll(std::string_view bytes, size_t num, std::vector<MapLandmark>* landmarks,
                 DescriptorMatrix* descriptors) {
    landmarks->assign(num, {});
    *descriptors = DescriptorMatrix::Zero(static_cast<Eigen::Index>(num), kSiftDescriptorDim);
    RangeDecoder coder(bytes);
    for (size_t i = 0; i < num && coder.ok(); ++i) {
      PackedLandmark packed;
      CodeLandmark(coder, middle_, class_id_, models_.get(), &packed);
      class_id_ = packed.class_id;
      if (!UnpackLandmark(packed, &(*landmarks)[i])) return false;
      if (!CodeDescriptor(coder, order_, code_, models_.get(), descriptors->data() + i * kSiftDescriptorDim))
        return false;
    }
    return coder.Finished();
  }

 private:
  TransformCode code_;
  Middle middle_;
  int64_t class_id_ = 0;
  std::unique_ptr<LandmarkModels> models_ = std::make_unique<LandmarkModels>();
  std::array<int, kSiftDescriptorDim> order_ = CoefficientOrder();
};

std::vector<PackedLandmark> PackEach(const std::vector<MapLandmark>& landmarks, size_t num) {
  std::vector<PackedLandmark> all;
  for (size_t i = 0; i < std::min(num, landmarks.size()); ++i) all.push_back(PackLandmark(landmarks[i]));
  return all;
}

// A coder that knows these landmarks.
LandmarksCoder CoderAfter(const PackedLandmarks& known) {
  const std::vector<PackedLandmark> all = PackEach(known.landmarks, kMaxNumKnownLandmarks);
  LandmarksCoder landmarks(known.code, MiddleOf(all));
  RangeEncoder unread;
  for (size_t i = 0; i < all.size(); ++i) landmarks.Encode(all[i], known.descriptors, i, &unread);
  return landmarks;
}

}  // namespace

std::string PackLandmarks(const PackedLandmarks& block) {
  const std::vector<PackedLandmark> all = PackEach(block.landmarks, block.landmarks.size());
  const Middle middle = MiddleOf(all);
  BlobWriter writer;
  writer.UInt8(static_cast<uint8_t>(block.code.step));
  writer.Bytes(block.code.mean.data(), block.code.mean.size());
  for (const int64_t coordinate : middle) writer.UInt32(static_cast<uint32_t>(coordinate));
  RangeEncoder coder;
  LandmarksCoder landmarks(block.code, middle);
  for (size_t i = 0; i < all.size(); ++i) landmarks.Encode(all[i], block.descriptors, i, &coder);
  writer.Bytes(coder.Take());
  return writer.Take();
}

bool UnpackLandmarks(std::string_view bytes, size_t num_landmarks, PackedLandmarks* block) {
  BlobReader reader(bytes);
  TransformCode code{.step = reader.UInt8()};
  const std::string_view mean = reader.Bytes(code.mean.size());
  std::copy(mean.begin(), mean.end(), code.mean.begin());
  Middle middle;
  for (int64_t& coordinate : middle) coordinate = static_cast<int32_t>(reader.UInt32());
  if (!reader.ok() || code.step < 1) return false;
  block->code = code;
  return LandmarksCoder(code, middle)
      .DecodeAll(reader.Bytes(reader.num_left()), num_landmarks, &block->landmarks, &block->descriptors);
}

std::string PackMoreLandmarks(const PackedLandmarks& known, const PackedLandmarks& more) {
  LandmarksCoder landmarks = CoderAfter(known);
  RangeEncoder coder;
  for (size_t i = 0; i < more.landmarks.size(); ++i)
    landmarks.Encode(PackLandmark(more.landmarks[i]), more.descriptors, i, &coder);
  return coder.Take();
}

bool UnpackMoreLandmarks(const PackedLandmarks& known, std::string_view bytes, size_t num_landmarks,
                         PackedLandmarks* more) {
  more->code = known.code;
  return CoderAfter(known).DecodeAll(bytes, num_landmarks, &more->landmarks, &more->descriptors);
}

}  // namespace cairn
