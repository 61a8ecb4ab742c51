#include "core/descriptor_matcher.h"

#include <algorithm>
#include <cmath>

#include "core/best_two_kernel.h"

namespace cairn {
namespace {

struct KernelRow {
  MatchKernel kernel;
  void (*sweep)(const BestTwoSweep&);
  int lanes;
  bool is_8bit;  // VNNI packing, else 16-bit
};

KernelRow RowOf(MatchKernel kernel) {
#if defined(__x86_64__)
  if (kernel == MatchKernel::kAvx512Vnni) return {kernel, SweepAvx512Vnni, 16, true};
  if (kernel == MatchKernel::kAvx2) return {kernel, SweepAvx2, 8, false};
#endif
  return {MatchKernel::kPortable, SweepPortable, 4, false};
}

uint32_t Chunk8(const uint8_t* bytes, uint8_t flip) {
  uint32_t chunk = 0;
  for (int i = 0; i < 4; ++i)
    chunk |= static_cast<uint32_t>(static_cast<uint8_t>(bytes[i] ^ flip)) << (8 * i);
  return chunk;
}

uint32_t Chunk16(const uint8_t* bytes) { return bytes[0] | static_cast<uint32_t>(bytes[1]) << 16; }

// Rows as the kernel reads them: x - 128 (which flips the top bit) in 8 bits, or x in 16.
std::vector<int32_t> PackRows(const DescriptorMatrix& descriptors, bool is_8bit) {
  const int num_chunks = is_8bit ? kDescriptorDim / 4 : kDescriptorDim / 2;
  std::vector<int32_t> packed(descriptors.rows() * num_chunks);
  for (Eigen::Index row = 0; row < descriptors.rows(); ++row) {
    const uint8_t* bytes = descriptors.row(row).data();
    for (int chunk = 0; chunk < num_chunks; ++chunk) {
      packed[row * num_chunks + chunk] =
          static_cast<int32_t>(is_8bit ? Chunk8(bytes + 4 * chunk, 0x80) : Chunk16(bytes + 2 * chunk));
    }
  }
  return packed;
}

}  // namespace

bool IsKernelSupported(MatchKernel kernel) {
#if defined(__x86_64__)
  if (kernel == MatchKernel::kAvx512Vnni) {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vnni");
  }
  if (kernel == MatchKernel::kAvx2) return __builtin_cpu_supports("avx2");
#endif
  return kernel == MatchKernel::kPortable;
}

MatchKernel FastestKernel() {
  static const MatchKernel kernel = IsKernelSupported(MatchKernel::kAvx512Vnni) ? MatchKernel::kAvx512Vnni
                                    : IsKernelSupported(MatchKernel::kAvx2)     ? MatchKernel::kAvx2
                                                                                : MatchKernel::kPortable;
  return kernel;
}

void FindBestTwo(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2,
                 MatchKernel kernel, std::vector<BestTwo>* rows, std::vector<BestTwo>* columns) {
  const KernelRow k = RowOf(kernel);
  const int num_rows = static_cast<int>(descriptors1.rows());
  const int num_columns = static_cast<int>(descriptors2.rows());
  rows->assign(num_rows, {});
  columns->assign(num_columns, {});
  if (num_rows == 0 || num_columns == 0) return;

  BestTwoSweep sweep;
  sweep.num_rows = num_rows;
  sweep.num_groups = (num_columns + 2 * k.lanes - 1) / (2 * k.lanes) * 2;
  const int num_chunks = k.is_8bit ? kDescriptorDim / 4 : kDescriptorDim / 2;
  const int num_padded = sweep.num_groups * k.lanes;
  const std::vector<int32_t> packed_rows = PackRows(descriptors1, k.is_8bit);
  std::vector<int32_t> packed_columns(static_cast<size_t>(num_padded) * num_chunks);
  std::vector<int32_t> bias(num_padded, -1);
  for (int column = 0; column < num_columns; ++column) {
    const uint8_t* bytes = descriptors2.row(column).data();
    int32_t* packed = packed_columns.data() + static_cast<size_t>(column / k.lanes) * num_chunks * k.lanes +
                      column % k.lanes;
    int32_t sum = 0;
    for (int d = 0; d < kDescriptorDim; ++d) sum += bytes[d];
    bias[column] = k.is_8bit ? 128 * sum : 0;
    for (int chunk = 0; chunk < num_chunks; ++chunk) {
      packed[chunk * k.lanes] =
          static_cast<int32_t>(k.is_8bit ? Chunk8(bytes + 4 * chunk, 0) : Chunk16(bytes + 2 * chunk));
    }
  }
  std::vector<int32_t> row_state(3 * static_cast<size_t>(num_rows) * k.lanes, -1);
  std::vector<int32_t> column_state(3 * static_cast<size_t>(num_padded), -1);
  sweep.rows = packed_rows.data();
  sweep.columns = packed_columns.data();
  sweep.column_bias = bias.data();
  sweep.row_best = row_state.data();
  sweep.row_second = sweep.row_best + static_cast<size_t>(num_rows) * k.lanes;
  sweep.row_idx = sweep.row_second + static_cast<size_t>(num_rows) * k.lanes;
  sweep.column_best = column_state.data();
  sweep.column_second = sweep.column_best + num_padded;
  sweep.column_idx = sweep.column_second + num_padded;
  k.sweep(sweep);

  for (int row = 0; row < num_rows; ++row) {
    BestTwo& merged = (*rows)[row];
    for (int lane = 0; lane < k.lanes; ++lane) {
      const size_t i = static_cast<size_t>(row) * k.lanes + lane;
      const int32_t best = sweep.row_best[i], idx = sweep.row_idx[i];
      if (best > merged.best || (best == merged.best && idx >= 0 && idx < merged.idx)) {
        merged.second = std::max(merged.best, sweep.row_second[i]);
        merged.best = best;
        merged.idx = idx;
      } else {
        merged.second = std::max(merged.second, best);
      }
    }
  }
  for (int column = 0; column < num_columns; ++column) {
    (*columns)[column] = {sweep.column_idx[column], sweep.column_best[column], sweep.column_second[column]};
  }
}

PackedDescriptors::PackedDescriptors(const DescriptorMatrix& descriptors, MatchKernel kernel)
    : kernel_(kernel), descriptors_(descriptors) {}

std::vector<Match> MatchDescriptors(const DescriptorMatrix& descriptors1,
                                    const DescriptorMatrix& descriptors2,
                                    const DescriptorMatcherOptions& options) {
  return MatchDescriptors(PackedDescriptors(descriptors1), PackedDescriptors(descriptors2), options);
}

std::vector<Match> MatchDescriptors(const PackedDescriptors& descriptors1,
                                    const PackedDescriptors& descriptors2,
                                    const DescriptorMatcherOptions& options) {
  std::vector<BestTwo> rows, columns;
  FindBestTwo(descriptors1.descriptors(), descriptors2.descriptors(), descriptors1.kernel(), &rows, &columns);
  constexpr double kSquaredNorm = 512.0 * 512.0;
  const auto angle = [&](int32_t dot) { return std::acos(std::clamp(dot / kSquaredNorm, 0.0, 1.0)); };
  const auto passes = [&](const BestTwo& b) {
    if (b.idx < 0) return false;
    const double best = angle(b.best);
    return best <= options.max_angle_rad && (b.second < 0 || best <= options.max_ratio * angle(b.second));
  };
  std::vector<Match> matches;
  for (uint32_t row = 0; row < rows.size(); ++row) {
    if (!passes(rows[row])) continue;
    const BestTwo& column = columns[rows[row].idx];
    if (options.mutual && (column.idx != static_cast<int32_t>(row) || !passes(column))) continue;
    matches.push_back({row, static_cast<uint32_t>(rows[row].idx)});
  }
  return matches;
}

}  // namespace cairn
