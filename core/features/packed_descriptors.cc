#include "core/features/packed_descriptors.h"

#include <algorithm>

#if defined(__x86_64__)
#include <cpuid.h>
#include <sys/syscall.h>
#include <unistd.h>
#elif defined(__aarch64__)
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

#include "core/features/best_two_kernel.h"

namespace cairn {
namespace {

static_assert(4 * kNumSiftChunks == kSiftDescriptorDim);
static_assert(4 * kMaxChunks >= kMaxDescriptorDim);
constexpr int kNumSubsets = 8;   // sets of values whose products are summed in one 16-bit lane
constexpr int kSubsetSize = 16;  // in pairs that one instruction multiplies and adds

// Which value of a descriptor is k-th of a subset.  SIFT's values are 4 x 4 cells of 8 directions.  A subset
// has one value of each cell, every direction twice; a pair is of cells far apart.
constexpr int DimOf(int subset, int k) {
  const int half = k % 2, cell = k / 2;
  const int x = (cell % 4 + 2 * half) % 4, y = cell / 4 + 2 * half;
  const int direction = (subset + 6 * x + 5 * y) % 8;
  return (4 * y + x) * 8 + direction;
}

// Values in packed order: word `chunk` of a descriptor holds a pair of each of two subsets.
constexpr std::array<int, kSiftDescriptorDim> PackedOrder() {
  std::array<int, kSiftDescriptorDim> order{};
  for (int i = 0; i < kSiftDescriptorDim; ++i) {
    const int chunk = i / 4, pair = i % 4 / 2;
    const int subset = chunk / kBestTwoPartialChunks * 2 + pair;
    order[i] = DimOf(subset, chunk % kBestTwoPartialChunks * 2 + i % 2);
  }
  return order;
}
constexpr std::array<int, kSiftDescriptorDim> kPackedOrder = PackedOrder();

using SiftValues = std::array<uint8_t, kSiftDescriptorDim>;
using PackedValues = std::array<uint8_t, kMaxDescriptorDim>;  // the first four for each chunk

SiftValues Reorder(const uint8_t* values) {
  SiftValues reordered;
  for (int i = 0; i < kSiftDescriptorDim; ++i) reordered[i] = values[kPackedOrder[i]];
  return reordered;
}

// Whether the kernels for small values are exact for this descriptor and any other one that passes this test.
// By Cauchy and Schwarz it suffices to bound the norms of what is multiplied: of pairs, one of them less the
// row offset of 64 in signed 8 bits (signed 16-bit sums), and of subsets (unsigned 16-bit sums).
bool FitsIn16Bits(const SiftValues& values) {
  std::array<int, kNumSubsets> subset_norms{};
  for (int i = 0; i < kSiftDescriptorDim; i += 2) {
    const int a = values[i], b = values[i + 1];
    const int norm = a * a + b * b;
    if (a > 191 || b > 191 || norm > 32767 || (a - 64) * (a - 64) + (b - 64) * (b - 64) > 32767) return false;
    subset_norms[i / 4 / kBestTwoPartialChunks * 2 + i % 4 / 2] += norm;
  }
  return *std::max_element(subset_norms.begin(), subset_norms.end()) <= 65535;
}

// Compensates for the row offset in each subset's sum, where it also subtracts 2^15.  `values` in packed
// order.
void SetPartialBias(const PackedValues& values, const BestTwoKernel& kernel, uint32_t* bias) {
  std::array<uint32_t, kNumSubsets> sums{};
  for (int i = 0; i < kSiftDescriptorDim; ++i)
    sums[i / 4 / kBestTwoPartialChunks * 2 + i % 4 / 2] += kernel.row_offset * values[i];
  for (int i = 0; i < kernel.num_bias; ++i)
    bias[i * kernel.lanes] = ((sums[2 * i] - 32768) & 0xFFFF) | ((sums[2 * i + 1] - 32768) & 0xFFFF) << 16;
}

// The values of a descriptor in the order in which they are packed; after others than SIFT's, some that stand
// for 0.
void PackValues(const uint8_t* descriptor, const DescriptorSpace& space, PackedValues* packed) {
  if (space.is_sift()) {
    const SiftValues values = Reorder(descriptor);
    std::copy(values.begin(), values.end(), packed->begin());
  } else {
    std::copy_n(descriptor, space.num_values, packed->begin());
  }
}

void Pack(const DescriptorMatrix& descriptors, const DescriptorSpace& space, const BestTwoKernel& kernel,
          DescriptorBlock* block) {
  const int lanes = kernel.lanes, num = static_cast<int>(block->idx.size());
  const int num_chunks = NumChunks(space);
  block->num_groups = (num + lanes - 1) / lanes;
  block->words.Resize(static_cast<int64_t>(block->num_groups) * num_chunks * lanes);
  block->bias.Resize(static_cast<int64_t>(block->num_groups) * kernel.num_bias * lanes);
  if (!space.is_sift()) block->terms.Resize(static_cast<int64_t>(block->num_groups) * lanes);
  PackedValues values;
  values.fill(static_cast<uint8_t>(space.offset));
  for (int i = 0; i < block->num_groups * lanes; ++i) {
    if (i < num) {
      PackValues(descriptors.row(block->idx[i]).data(), space, &values);
    } else if (i == num) {
      values.fill(static_cast<uint8_t>(space.offset));
    }
    uint32_t* words = block->words.data() + static_cast<int64_t>(i / lanes) * num_chunks * lanes + i % lanes;
    int64_t squared_norm = 0;
    uint32_t sum = 0;
    for (int chunk = 0; chunk < num_chunks; ++chunk) {
      uint32_t word = 0;
      for (int byte = 0; byte < 4; ++byte) {
        const int32_t value = values[4 * chunk + byte];
        word |= static_cast<uint32_t>(value) << (8 * byte);
        sum += value;
        squared_norm += (value - space.offset) * (value - space.offset);
      }
      words[chunk * lanes] = word;
    }
    block->max_squared_norm = std::max(block->max_squared_norm, squared_norm);
    if (kernel.num_bias > 0) {
      uint32_t* bias =
          block->bias.data() + static_cast<int64_t>(i / lanes) * kernel.num_bias * lanes + i % lanes;
      if (kernel.num_bias == 1) *bias = kernel.row_offset * sum;
      if (kernel.num_bias > 1) SetPartialBias(values, kernel, bias);
    }
    if (!space.is_sift()) block->terms.data()[i] = space.offset * sum;
  }
}

#if defined(__x86_64__)
bool HasAvxVnni() {
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  return __builtin_cpu_supports("avx2") && __get_cpuid_count(7, 1, &eax, &ebx, &ecx, &edx) != 0 &&
         (eax & (1u << 4)) != 0;
}

// Linux lends the registers of tiles, 8 KiB a thread, to programs that ask for them
// (Documentation/arch/x86/xstate.rst), unless a thread has a signal stack too small for them.
bool MayUseTiles() {
  constexpr long kRequestPermission = 0x1023;  // ARCH_REQ_XCOMP_PERM
  constexpr long kTileData = 18;               // XFEATURE_XTILEDATA
  return syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0;
}

bool HasAvx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512vl");
}

bool HasAmx() {
  constexpr unsigned kTile = 1u << 24, kInt8 = 1u << 25;
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  return HasAvx512() && __builtin_cpu_supports("avx512vbmi2") &&
         __get_cpuid_count(7, 0, &eax, &ebx, &ecx, &edx) != 0 && (edx & kTile) != 0 && (edx & kInt8) != 0 &&
         MayUseTiles();
}
#endif

}  // namespace

std::string_view NameOf(MatchKernel kernel) {
  switch (kernel) {
    case MatchKernel::kPortable:
      return "portable";
    case MatchKernel::kAvx2:
      return "avx2";
    case MatchKernel::kAvxVnni:
      return "avx_vnni";
    case MatchKernel::kAvx512Vnni:
      return "avx512_vnni";
    case MatchKernel::kAmx:
      return "amx";
    case MatchKernel::kNeonDot:
      return "neon_dot";
  }
  return "";
}

bool IsKernelSupported(MatchKernel kernel) {
  if (kernel == MatchKernel::kPortable) return true;
#if defined(__x86_64__)
  if (kernel == MatchKernel::kAvx2) return __builtin_cpu_supports("avx2");
  if (kernel == MatchKernel::kAvxVnni) return HasAvxVnni();
  if (kernel == MatchKernel::kAmx) return HasAmx();
  if (kernel == MatchKernel::kAvx512Vnni) return HasAvx512() && __builtin_cpu_supports("avx512vnni");
#elif defined(__aarch64__)
  if (kernel == MatchKernel::kNeonDot) return (getauxval(AT_HWCAP) & HWCAP_ASIMDDP) != 0;
#endif
  return false;
}

MatchKernel FastestKernel() {
  static const MatchKernel fastest = [] {
    for (const MatchKernel kernel : {MatchKernel::kAmx, MatchKernel::kAvx512Vnni, MatchKernel::kAvxVnni,
                                     MatchKernel::kAvx2, MatchKernel::kNeonDot}) {
      if (IsKernelSupported(kernel)) return kernel;
    }
    return MatchKernel::kPortable;
  }();
  return fastest;
}

const BestTwoKernel& KernelForAll(MatchKernel kernel) {
#if defined(__x86_64__)
  if (kernel == MatchKernel::kAmx) return kBestTwoAmx;
  if (kernel == MatchKernel::kAvx512Vnni) return kBestTwoAvx512Vnni;
  if (kernel == MatchKernel::kAvxVnni) return kBestTwoAvxVnni;
  if (kernel == MatchKernel::kAvx2) return kBestTwoAvx2;
#elif defined(__aarch64__)
  if (kernel == MatchKernel::kNeonDot) return kBestTwoNeonDot;
#endif
  return kBestTwoPortable;
}

const BestTwoKernel* KernelForSmall(MatchKernel kernel) {
#if defined(__x86_64__)
  if (kernel == MatchKernel::kAvx2) return &kBestTwoAvx2Small;
#endif
  return kernel == MatchKernel::kPortable ? &kBestTwoPortableSmall : nullptr;
}

PackedDescriptors::PackedDescriptors(const DescriptorMatrix& descriptors, const DescriptorSpace& space,
                                     MatchKernel kernel)
    : kernel_(kernel), space_(space) {
  const BestTwoKernel* for_small = space.is_sift() ? KernelForSmall(kernel) : nullptr;
  for (int32_t i = 0; i < descriptors.rows(); ++i) {
    const bool is_small = for_small != nullptr && FitsIn16Bits(Reorder(descriptors.row(i).data()));
    (is_small ? small_ : other_).idx.push_back(i);
  }
  small_.idx.shrink_to_fit();
  other_.idx.shrink_to_fit();
  if (for_small != nullptr) Pack(descriptors, space, *for_small, &small_);
  Pack(descriptors, space, KernelForAll(kernel), &other_);
}

int64_t PackedDescriptors::num_bytes() const {
  int64_t num_bytes = sizeof(*this);
  for (const DescriptorBlock* block : {&small_, &other_}) {
    num_bytes += static_cast<int64_t>(PooledSize(block->idx.capacity() * sizeof(int32_t))) +
                 block->words.num_bytes() + block->bias.num_bytes() + block->terms.num_bytes();
  }
  return num_bytes;
}

}  // namespace cairn
