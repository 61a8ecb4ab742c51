#include "core/features/descriptor_matcher.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/pooled.h"
#include "core/features/best_two_kernel.h"
#include "core/features/descriptor_distance.h"
#include "core/threads/of_thread.h"

namespace cairn {
namespace {

// Indices of at most 8191 in a sweep: its states stay in the second-level cache.
constexpr int kMaxIndexBits = 13;

// Kept from pair to pair: allocating takes longer than matching small images.
struct Scratch {
  AlignedWords rows, row_terms, row_states, row_keys, column_keys;
};

// Of a space.
struct SweepSpace {
  int num_chunks = 0;
  uint32_t offset = 0;
  bool has_terms = false;  // other than SIFT's
  // Added to dot products about the offset, so that none is negative.
  uint32_t shift = 0;
};

// A run of groups of a block.
struct GroupRange {
  const DescriptorBlock& block;
  int begin = 0;
  int end = 0;
};

// The range's rows less the kernel's offset.
const uint32_t* OffsetRows(const GroupRange& range, const BestTwoKernel& kernel, int num_chunks,
                           AlignedWords* scratch) {
  const int64_t group_size = static_cast<int64_t>(num_chunks) * kernel.lanes;
  const uint32_t* rows = range.block.words.data() + range.begin * group_size;
  if (kernel.row_offset == 0) return rows;
  const int64_t num_words = (range.end - range.begin) * group_size;
  scratch->Resize(num_words);
  const auto* from = reinterpret_cast<const uint8_t*>(rows);
  auto* to = reinterpret_cast<uint8_t*>(scratch->data());
  const auto offset = static_cast<uint8_t>(kernel.row_offset);
  for (int64_t i = 0; i < 4 * num_words; ++i) to[i] = static_cast<uint8_t>(from[i] - offset);
  return scratch->data();
}

// Of each of the range's rows: what is subtracted from its products with the columns' values, besides the
// terms of the columns.
const uint32_t* RowTerms(const GroupRange& range, int lanes, const SweepSpace& space, AlignedWords* scratch) {
  const int num_rows = (range.end - range.begin) * lanes;
  scratch->Resize(num_rows);
  const uint32_t* terms = range.block.terms.data() + static_cast<int64_t>(range.begin) * lanes;
  // (a - o) (b - o) = a b - o a - o b + o^2, of every value
  const uint32_t common = 4 * space.num_chunks * space.offset * space.offset + space.shift;
  for (int i = 0; i < num_rows; ++i) scratch->data()[i] = terms[i] - common;
  return scratch->data();
}

// Offers the best two of a sweep, as keys, to a descriptor of the other image than that of `range`.
void Offer(uint32_t best_key, uint32_t second_key, int index_bits, const GroupRange& range, int lanes,
           const SweepSpace& space, BestTwo* kept) {
  const uint32_t last = (uint32_t{1} << index_bits) - 1;
  const int first = range.begin * lanes;
  const int num = static_cast<int>(range.block.idx.size());
  // -1 for padding, which comes after all that counts, and for what is at a right angle or more.
  const auto position = [&](uint32_t key) {
    const int i = first + static_cast<int>(last - (key & last));
    const bool counts = space.has_terms ? key >> index_bits > space.shift : key != 0;
    return counts && i < num ? i : -1;
  };
  const auto dot = [&](uint32_t key) { return static_cast<int32_t>((key >> index_bits) - space.shift); };
  const int best_position = position(best_key);
  if (best_position < 0) return;
  const int32_t best = dot(best_key);
  const int32_t second = position(second_key) < 0 ? -1 : dot(second_key);
  const int32_t idx = range.block.idx[best_position];
  if (best > kept->best || (best == kept->best && idx < kept->idx)) {
    *kept = {idx, best, std::max(kept->best, second)};
  } else {
    kept->second = std::max(kept->second, best);
  }
}

void SweepRanges(const GroupRange& range1, const GroupRange& range2, const BestTwoKernel& kernel,
                 const SweepSpace& space, int index_bits, Scratch* scratch, PooledVector<BestTwo>* rows,
                 PooledVector<BestTwo>* columns) {
  const int lanes = kernel.lanes;
  BestTwoSweep sweep;
  sweep.num_row_groups = range1.end - range1.begin;
  sweep.num_column_groups = range2.end - range2.begin;
  sweep.index_bits = index_bits;
  const int64_t num_rows = sweep.num_row_groups * lanes;
  scratch->row_states.Resize(num_rows * 2 * lanes);
  scratch->row_keys.Resize(num_rows * 2);
  scratch->column_keys.Resize(static_cast<int64_t>(sweep.num_column_groups) * 2 * lanes);
  sweep.num_chunks = space.num_chunks;
  sweep.rows = OffsetRows(range1, kernel, space.num_chunks, &scratch->rows);
  sweep.columns = range2.block.words.data() + static_cast<int64_t>(range2.begin) * space.num_chunks * lanes;
  if (space.has_terms) {
    sweep.row_terms = RowTerms(range1, lanes, space, &scratch->row_terms);
    sweep.column_terms = range2.block.terms.data() + static_cast<int64_t>(range2.begin) * lanes;
  }
  if (kernel.num_bias > 0)
    sweep.bias = range2.block.bias.data() + static_cast<int64_t>(range2.begin) * kernel.num_bias * lanes;
  sweep.row_states = scratch->row_states.data();
  sweep.row_keys = scratch->row_keys.data();
  sweep.column_keys = scratch->column_keys.data();
  kernel.sweep(sweep);

  const int num1 = std::min(range1.end * lanes, static_cast<int>(range1.block.idx.size()));
  for (int i = range1.begin * lanes; i < num1; ++i) {
    const uint32_t* keys = sweep.row_keys + 2 * (i - range1.begin * lanes);
    Offer(keys[0], keys[1], index_bits, range2, lanes, space, &(*rows)[range1.block.idx[i]]);
  }
  const int num2 = std::min(range2.end * lanes, static_cast<int>(range2.block.idx.size()));
  for (int i = range2.begin * lanes; i < num2; ++i) {
    const uint32_t* keys =
        sweep.column_keys + static_cast<int64_t>(i / lanes - range2.begin) * 2 * lanes + i % lanes;
    Offer(keys[0], keys[lanes], index_bits, range1, lanes, space, &(*columns)[range2.block.idx[i]]);
  }
}

// All of a block of one image with all of a block of the other, in ranges that keys can index.
void SweepBlocks(const DescriptorBlock& block1, const DescriptorBlock& block2, const BestTwoKernel& kernel,
                 SweepSpace space, Scratch* scratch, PooledVector<BestTwo>* rows,
                 PooledVector<BestTwo>* columns) {
  // Cauchy and Schwarz: no product is larger.
  const double max_dot =
      std::sqrt(static_cast<double>(block1.max_squared_norm) * static_cast<double>(block2.max_squared_norm));
  if (space.has_terms) space.shift = static_cast<uint32_t>(max_dot) + 1;
  const int dot_bits = std::bit_width(static_cast<uint32_t>(max_dot) + 1 + space.shift);
  const int index_bits = std::min(kernel.key_bits - dot_bits, kMaxIndexBits);
  const int max_groups = ((1 << index_bits) - 1) / kernel.lanes;
  for (int begin2 = 0; begin2 < block2.num_groups; begin2 += max_groups) {
    const GroupRange range2{block2, begin2, std::min(begin2 + max_groups, block2.num_groups)};
    for (int begin1 = 0; begin1 < block1.num_groups; begin1 += max_groups) {
      const GroupRange range1{block1, begin1, std::min(begin1 + max_groups, block1.num_groups)};
      SweepRanges(range1, range2, kernel, space, index_bits, scratch, rows, columns);
    }
  }
}

}  // namespace

void FindBestTwo(const PackedDescriptors& descriptors1, const PackedDescriptors& descriptors2,
                 PooledVector<BestTwo>* rows, PooledVector<BestTwo>* columns) {
  Scratch& scratch = RequiredOfThread<Scratch>();
  rows->assign(descriptors1.size(), {});
  columns->assign(descriptors2.size(), {});
  const BestTwoKernel& kernel = KernelForAll(descriptors1.kernel());
  const DescriptorSpace& of = descriptors1.space();
  const SweepSpace space{
      .num_chunks = NumChunks(of), .offset = static_cast<uint32_t>(of.offset), .has_terms = !of.is_sift()};
  if (const BestTwoKernel* for_small = KernelForSmall(descriptors1.kernel()))
    SweepBlocks(descriptors1.small(), descriptors2.small(), *for_small, space, &scratch, rows, columns);
  SweepBlocks(descriptors1.small(), descriptors2.other(), kernel, space, &scratch, rows, columns);
  SweepBlocks(descriptors1.other(), descriptors2.small(), kernel, space, &scratch, rows, columns);
  SweepBlocks(descriptors1.other(), descriptors2.other(), kernel, space, &scratch, rows, columns);
}

void FindBestTwo(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2,
                 const DescriptorSpace& space, MatchKernel kernel, PooledVector<BestTwo>* rows,
                 PooledVector<BestTwo>* columns) {
  FindBestTwo(PackedDescriptors(descriptors1, space, kernel), PackedDescriptors(descriptors2, space, kernel),
              rows, columns);
}

PooledVector<Match> MatchDescriptors(const DescriptorMatrix& descriptors1,
                                     const DescriptorMatrix& descriptors2, const DescriptorSpace& space,
                                     const DescriptorMatcherOptions& options) {
  return MatchDescriptors(PackedDescriptors(descriptors1, space), PackedDescriptors(descriptors2, space),
                          options);
}

PooledVector<Match> MatchDescriptors(const PackedDescriptors& descriptors1,
                                     const PackedDescriptors& descriptors2,
                                     const DescriptorMatcherOptions& options) {
  PooledVector<BestTwo> rows, columns;
  FindBestTwo(descriptors1, descriptors2, &rows, &columns);
  return SelectMatches(rows, columns, descriptors1.space(), options);
}

PooledVector<Match> SelectMatches(const PooledVector<BestTwo>& rows, const PooledVector<BestTwo>& columns,
                                  const DescriptorSpace& space, const DescriptorMatcherOptions& options) {
  const int32_t least_dot = LeastDotWithin(options.max_angle_rad, space);
  const auto passes = [&](const BestTwo& b) {
    if (b.best < least_dot) return false;
    const double best = DescriptorAngleRad(b.best, space);
    return best <= options.max_angle_rad &&
           (b.second < 0 || best < options.max_ratio * DescriptorAngleRad(b.second, space));
  };
  PooledVector<Match> matches;
  for (uint32_t row = 0; row < rows.size(); ++row) {
    const BestTwo& best = rows[row];
    if (best.idx < 0) continue;
    const BestTwo& column = columns[best.idx];
    if (options.mutual && column.idx != static_cast<int32_t>(row)) continue;
    if (passes(best) && (!options.mutual || passes(column)))
      matches.push_back({row, static_cast<uint32_t>(best.idx)});
  }
  return matches;
}

}  // namespace cairn
