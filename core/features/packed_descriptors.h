#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/base/pooled.h"
#include "core/features/features.h"

namespace cairn {

struct BestTwoKernel;

// Instruction sets that have a kernel for dot products of descriptors.
enum class MatchKernel { kPortable, kAvx2, kAvxVnni, kAvx512Vnni, kAmx, kNeonDot };
inline constexpr std::array kMatchKernels = {MatchKernel::kPortable, MatchKernel::kAvx2,
                                             MatchKernel::kAvxVnni,  MatchKernel::kAvx512Vnni,
                                             MatchKernel::kAmx,      MatchKernel::kNeonDot};
// "portable", "avx2", "avx_vnni", "avx512_vnni", "amx", "neon_dot".
std::string_view NameOf(MatchKernel kernel);
// Whether this program contains it and this processor can run it.  Of kAmx the process asks Linux for the
// registers of tiles, which it then keeps: signal stacks of its threads (sigaltstack) need 8 KiB more.
bool IsKernelSupported(MatchKernel kernel);
// The fastest one that is supported.
MatchKernel FastestKernel();

// Words that vector loads find aligned, in whole cache lines.
class AlignedWords {
 public:
  // New words are zero.
  void Resize(int64_t num_words) { lines_.resize((num_words + 15) / 16); }
  uint32_t* data() { return lines_.empty() ? nullptr : lines_.front().words; }
  const uint32_t* data() const { return lines_.empty() ? nullptr : lines_.front().words; }
  int64_t num_bytes() const { return static_cast<int64_t>(PooledSize(lines_.capacity() * sizeof(Line))); }

 private:
  struct alignas(64) Line {
    uint32_t words[16];
  };
  PooledVector<Line> lines_;
};

// Descriptors in the layout of core/features/best_two_kernel.h, those of SIFT with their values in an order
// that mixes its cells and directions: 16-bit sums of the products of neighbours are then exact for nearly
// all RootSIFT descriptors.
struct DescriptorBlock {
  PooledVector<int32_t> idx;  // of each descriptor in its image, ascending
  AlignedWords words;
  AlignedWords bias;
  AlignedWords terms;  // the space's offset times the sum of values; none of SIFT's
  int num_groups = 0;
  int64_t max_squared_norm = 0;  // about the offset
};

// The descriptors of one image (any 8-bit values) in the layout of a kernel: packed once, matched with many
// others of the same space.  Immutable, may be shared between threads.
class PackedDescriptors {
 public:
  PackedDescriptors() = default;
  // REQUIRES: IsKernelSupported(kernel); descriptors of space.num_values columns, or no rows
  explicit PackedDescriptors(const DescriptorMatrix& descriptors, const DescriptorSpace& space = {},
                             MatchKernel kernel = FastestKernel());

  // Number of descriptors.
  int size() const { return static_cast<int>(small_.idx.size() + other_.idx.size()); }
  MatchKernel kernel() const { return kernel_; }
  const DescriptorSpace& space() const { return space_; }
  // Memory that it holds, bytes.
  int64_t num_bytes() const;
  // Upper limit of the bytes that `num_descriptors` packed descriptors of so many values take, for any
  // kernel: for memory budgets.
  static int64_t NumBytes(int64_t num_descriptors, int num_values) {
    const int64_t padded = (num_values + 3) / 4 * 4;
    const int64_t asked = (padded + 32) * num_descriptors + 128 * padded;
    constexpr int64_t kNumVectors = 8;
    return asked + asked / 8 + kNumVectors * static_cast<int64_t>(PooledSize(0));
  }

  // Those that the kernel for small values may take (none if there is no such kernel), and the others.
  const DescriptorBlock& small() const { return small_; }
  const DescriptorBlock& other() const { return other_; }

 private:
  MatchKernel kernel_ = MatchKernel::kPortable;
  DescriptorSpace space_;
  DescriptorBlock small_;
  DescriptorBlock other_;
};

// Words of four values that a packed descriptor has.
inline int NumChunks(const DescriptorSpace& space) { return (space.num_values + 3) / 4; }

// The kernel for any values, and the one for small values (null where the first is as fast).
const BestTwoKernel& KernelForAll(MatchKernel kernel);
const BestTwoKernel* KernelForSmall(MatchKernel kernel);

}  // namespace cairn
