#include "core/structure/schur_system.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "core/base/parallel.h"
#include "core/features/wide_clones.h"

namespace cairn {
namespace {

constexpr int64_t kPointsSummedAtOnce = 512;  // by one thread
constexpr size_t kAhead = 3;                  // so many slots of a column are on their way from memory

// body(i) for every i below `num_items`, in chunks.
template <typename Body>
void ForEach(int64_t num_items, int num_threads, const Body& body) {
  ParallelForRuns(num_items, kPointsSummedAtOnce, num_threads, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) body(i);
  });
}

// out += a^T b, all row by row; `num_rows` of a and b.
template <int kCols>
void AddTransposedProduct(const double* a, int a_cols, const double* b, int num_rows, double* out) {
  for (int r = 0; r < num_rows; ++r) {
    for (int i = 0; i < a_cols; ++i) {
      for (int k = 0; k < kCols; ++k) out[i * kCols + k] += a[r * a_cols + i] * b[r * kCols + k];
    }
  }
}

void AddTransposedProduct(const double* a, int a_cols, const double* b, int b_cols, int num_rows,
                          double* out) {
  if (b_cols == 6) return AddTransposedProduct<6>(a, a_cols, b, num_rows, out);
  for (int r = 0; r < num_rows; ++r) {
    for (int i = 0; i < a_cols; ++i) {
      for (int k = 0; k < b_cols; ++k) out[i * b_cols + k] += a[r * a_cols + i] * b[r * b_cols + k];
    }
  }
}

// out -= others own^T of `height` x 3 and `width` x 3, all row by row.
void SubtractProduct(const double* others, int height, const double* own, int width, double* out) {
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) {
      double sum = 0;
      for (int c = 0; c < 3; ++c) sum += others[3 * i + c] * own[3 * j + c];
      out[i * width + j] -= sum;
    }
  }
}

// The same for `num_others` that stand one behind the other, all of 6 x 3, as `own` is; the k-th from the row
// begin[position[k]] of the column.
CAIRN_WIDE_CLONES void SubtractSixes(const double* others, int num_others, const double* own,
                                     const int* position, const int* begin, double* column) {
  using Four = double __attribute__((vector_size(32), aligned(8), may_alias));
  using Two = double __attribute__((vector_size(16), aligned(8), may_alias));
  Four four[3];
  Two two[3];
  for (int c = 0; c < 3; ++c) {
    four[c] = Four{own[c], own[3 + c], own[6 + c], own[9 + c]};
    two[c] = Two{own[12 + c], own[15 + c]};
  }
  for (int k = 0; k < num_others; ++k, others += 18) {
    double* out = column + size_t{6} * begin[position[k]];
    for (int i = 0; i < 6; ++i, out += 6) {
      const double* row = others + 3 * i;
      *reinterpret_cast<Four*>(out) -= row[0] * four[0] + row[1] * four[1] + row[2] * four[2];
      *reinterpret_cast<Two*>(out + 4) -= row[0] * two[0] + row[1] * two[1] + row[2] * two[2];
    }
  }
}

}  // namespace

SchurSystem::SchurSystem(const SchurProblem& problem, int num_threads)
    : terms_(problem, num_threads), num_threads_(num_threads) {
  const auto num_points = static_cast<int>(terms_.points().size());
  slot_begin_ = {0};
  for (int p = 0; p < num_points; ++p) {
    std::vector<int> seen_by;
    for (const SchurTerms::Use& use : terms_.UsesOfPoint(p)) {
      for (const int b : terms_.BlocksOf(use.residual)) {
        if (terms_.IsFreeOther(b)) seen_by.push_back(terms_.index_of(b));
      }
    }
    std::sort(seen_by.begin(), seen_by.end());
    slot_position_.insert(slot_position_.end(), seen_by.begin(), std::unique(seen_by.begin(), seen_by.end()));
    slot_begin_.push_back(slot_position_.size());
  }
  cholesky_.emplace(MakeCholesky());
  OrderSlots();
  point_factor_.resize(num_points);
  point_side_.resize(num_points);
  gradient_.resize(cholesky_->num_rows() + 3 * num_points);
  diagonal_.resize(gradient_.size());
}

// From slots by blocks.
BlockCholesky SchurSystem::MakeCholesky() const {
  const size_t num_points = terms_.points().size(), num_others = terms_.others().size();
  std::vector<int> sizes;
  for (const int b : terms_.others()) sizes.push_back(terms_.problem().blocks()[b].tangent_size);
  std::vector<std::vector<int>> seen(num_others);  // points, by each block
  for (size_t p = 0; p < num_points; ++p) {
    for (size_t s = slot_begin_[p]; s < slot_begin_[p + 1]; ++s)
      seen[slot_position_[s]].push_back(static_cast<int>(p));
  }
  std::vector<std::vector<int>> neighbours(num_others);
  ParallelFor(static_cast<int64_t>(num_others), num_threads_, [&](int64_t i) {
    std::vector<bool> is_neighbour(num_others, false);
    const auto add = [&](int other) {
      if (other <= i || is_neighbour[other]) return;
      is_neighbour[other] = true;
      neighbours[i].push_back(other);
    };
    for (const int p : seen[i]) {
      for (size_t s = slot_begin_[p]; s < slot_begin_[p + 1]; ++s) add(slot_position_[s]);
    }
    for (const SchurTerms::Use& use : terms_.UsesOfOther(static_cast<int>(i))) {
      for (const int b : terms_.BlocksOf(use.residual)) {
        if (terms_.IsFreeOther(b)) add(terms_.index_of(b));
      }
    }
  });
  return {sizes, neighbours};
}

// From blocks to positions, and by those.
void SchurSystem::OrderSlots() {
  const size_t num_points = terms_.points().size();
  column_begin_.assign(terms_.others().size() + 1, 0);
  for (size_t p = 0; p < num_points; ++p) {
    for (size_t s = slot_begin_[p]; s < slot_begin_[p + 1]; ++s)
      slot_position_[s] = cholesky_->position_of(slot_position_[s]);
    std::sort(slot_position_.data() + slot_begin_[p], slot_position_.data() + slot_begin_[p + 1]);
  }
  size_t num_projected = 0;
  for (const int position : slot_position_) {
    ++column_begin_[position + 1];
    slot_values_.push_back(num_projected);
    num_projected += 3 * static_cast<size_t>(cholesky_->size(position));
  }
  projected_ = std::make_unique_for_overwrite<double[]>(num_projected);
  std::partial_sum(column_begin_.begin(), column_begin_.end(), column_begin_.begin());
  column_slots_.resize(slot_position_.size());
  std::vector<size_t> next(column_begin_.begin(), column_begin_.end() - 1);
  for (size_t p = 0; p < num_points; ++p) {
    for (size_t s = slot_begin_[p]; s < slot_begin_[p + 1]; ++s)
      column_slots_[next[slot_position_[s]]++] = {s, static_cast<int>(p)};
  }
}

std::vector<double> SchurSystem::Plus(const std::vector<double>& values, const Eigen::VectorXd& step) const {
  std::vector<double> sum = values;
  for (int position = 0; position < cholesky_->num_blocks(); ++position) {
    const int b = terms_.others()[cholesky_->block_of(position)];
    const SchurProblem::Block& block = terms_.problem().blocks()[b];
    const size_t begin = terms_.value_begin(b);
    const double* delta = &step[cholesky_->first_row(position)];
    if (block.manifold != nullptr) {
      block.manifold->Plus(&values[begin], delta, &sum[begin]);
    } else {
      for (int k = 0; k < block.size; ++k) sum[begin + k] += delta[k];
    }
  }
  for (size_t p = 0; p < terms_.points().size(); ++p) {
    double* point = &sum[terms_.value_begin(terms_.points()[p])];
    for (size_t k = 0; k < 3; ++k) point[k] += step[cholesky_->num_rows() + 3 * p + k];
  }
  for (const SchurProblem::Bound& bound : terms_.problem().bounds()) {
    if (terms_.index_of(bound.block) < 0) continue;
    double& value = sum[terms_.value_begin(bound.block) + bound.parameter];
    value = std::clamp(value, bound.lower, bound.upper);
  }
  return sum;
}

std::optional<double> SchurSystem::Linearize(const std::vector<double>& values) {
  const std::optional<double> cost = terms_.Linearize(values);
  if (!cost) return std::nullopt;
  SumGradient();
  if (!gradient_.allFinite()) return std::nullopt;
  return cost;
}

// The gradient J^T f and the diagonal of J^T J.
void SchurSystem::SumGradient() {
  gradient_.setZero();
  diagonal_.setZero();
  const auto sum = [&](std::span<const SchurTerms::Use> uses, Eigen::Index first_row, int size) {
    for (const SchurTerms::Use& use : uses) {
      const double* jacobian = terms_.Jacobian(use);
      const double* residual = terms_.Residual(use.residual);
      for (int k = 0; k < terms_.NumRows(use.residual); ++k) {
        for (int c = 0; c < size; ++c) {
          gradient_[first_row + c] += jacobian[k * size + c] * residual[k];
          diagonal_[first_row + c] += jacobian[k * size + c] * jacobian[k * size + c];
        }
      }
    }
  };
  ForEach(std::ssize(terms_.points()), num_threads_,
          [&](int64_t p) { sum(terms_.UsesOfPoint(static_cast<int>(p)), cholesky_->num_rows() + 3 * p, 3); });
  // The last have most residuals: first.
  ParallelFor(cholesky_->num_blocks(), num_threads_, [&](int64_t k) {
    const auto position = static_cast<int>(cholesky_->num_blocks() - 1 - k);
    sum(terms_.UsesOfOther(cholesky_->block_of(position)), cholesky_->first_row(position),
        cholesky_->size(position));
  });
}

// Calls body(position, Jacobian) for every free block of a residual that is no point.
template <typename Body>
void SchurSystem::ForEachOther(int residual, const Body& body) const {
  const double* jacobian = terms_.Residual(residual) + terms_.NumRows(residual);
  for (const int b : terms_.BlocksOf(residual)) {
    if (terms_.index_of(b) < 0) continue;
    if (terms_.IsFreeOther(b)) body(cholesky_->position_of(terms_.index_of(b)), jacobian);
    jacobian += terms_.NumRows(residual) * terms_.problem().blocks()[b].tangent_size;
  }
}

void SchurSystem::AddTransposed(int residual, const Eigen::VectorXd& weights, Eigen::VectorXd* side) const {
  ForEachOther(residual, [&](int position, const double* jacobian) {
    for (int k = 0; k < terms_.NumRows(residual); ++k) {
      for (int c = 0; c < cholesky_->size(position); ++c)
        (*side)[cholesky_->first_row(position) + c] += *jacobian++ * weights[k];
    }
  });
}

bool SchurSystem::EliminatePoint(int point, const Eigen::VectorXd& damping) {
  const size_t slots_begin = slot_begin_[point], slots_end = slot_begin_[point + 1];
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  for (size_t s = slots_begin; s < slots_end; ++s)
    std::fill_n(&projected_[slot_values_[s]], 3 * cholesky_->size(slot_position_[s]), 0.0);
  for (const SchurTerms::Use& use : terms_.UsesOfPoint(point)) {
    const int num_rows = terms_.NumRows(use.residual);
    const double* by_point = terms_.Jacobian(use);
    AddTransposedProduct(by_point, 3, by_point, 3, num_rows, square.data());
    ForEachOther(use.residual, [&](int position, const double* by_block) {
      const auto slot =
          std::lower_bound(slot_position_.begin() + static_cast<std::ptrdiff_t>(slots_begin),
                           slot_position_.begin() + static_cast<std::ptrdiff_t>(slots_end), position) -
          slot_position_.begin();
      AddTransposedProduct(by_block, cholesky_->size(position), by_point, 3, num_rows,
                           &projected_[slot_values_[slot]]);
    });
  }
  const Eigen::Index first_row = cholesky_->num_rows() + Eigen::Index{3} * point;
  square.diagonal() += damping.segment<3>(first_row);
  const Eigen::LLT<Eigen::Matrix3d> llt(square);
  if (llt.info() != Eigen::Success) return false;
  const Eigen::Matrix3d& l = point_factor_[point] = llt.matrixL();
  point_side_[point] = l.triangularView<Eigen::Lower>().solve(gradient_.segment<3>(first_row));
  for (size_t s = slots_begin; s < slots_end; ++s) {
    double* row = &projected_[slot_values_[s]];
    for (int k = 0; k < cholesky_->size(slot_position_[s]); ++k, row += 3) {
      row[0] = row[0] / l(0, 0);
      row[1] = (row[1] - l(1, 0) * row[0]) / l(1, 1);
      row[2] = (row[2] - l(2, 0) * row[0] - l(2, 1) * row[1]) / l(2, 2);
    }
  }
  return true;
}

// A column of the reduced matrix, and its rows of the right side.
void SchurSystem::SetColumn(int position, const Eigen::VectorXd& damping, Eigen::VectorXd* right_side) {
  const int size = cholesky_->size(position), first_row = cholesky_->first_row(position);
  // Not kept by threads: what ends with a thread takes memory to register, and glibc aborts where there is
  // none.
  std::vector<int> begin(cholesky_->num_blocks());  // per position: of its rows in the column
  std::vector<double> column;
  int num_rows = 0;
  for (const int row : cholesky_->RowsOf(position)) {
    begin[row] = num_rows;
    num_rows += cholesky_->size(row);
  }
  column.assign(static_cast<size_t>(num_rows) * size, 0);
  for (const SchurTerms::Use& use : terms_.UsesOfOther(cholesky_->block_of(position))) {
    const double* by_column = terms_.Jacobian(use);
    ForEachOther(use.residual, [&](int row, const double* by_row) {
      if (row < position) return;
      AddTransposedProduct(by_row, cholesky_->size(row), by_column, size, terms_.NumRows(use.residual),
                           &column[static_cast<size_t>(begin[row]) * size]);
    });
  }
  for (int k = 0; k < size; ++k) column[k * size + k] += damping[first_row + k];
  auto side = right_side->segment(first_row, size);
  side = -gradient_.segment(first_row, size);
  for (size_t k = column_begin_[position]; k < column_begin_[position + 1]; ++k) {
    if (k + kAhead < column_begin_[position + 1])
      __builtin_prefetch(&projected_[slot_values_[column_slots_[k + kAhead].slot]]);
    const auto [slot, point] = column_slots_[k];
    const double* own = &projected_[slot_values_[slot]];
    for (int i = 0; i < size; ++i) {
      for (int c = 0; c < 3; ++c) side[i] += own[3 * i + c] * point_side_[point][c];
    }
    SubtractSlots(slot, slot_begin_[point + 1], begin, &column);
  }
  cholesky_->SetColumn(position, column.data());
}

// From the column of the first slot what it has in common with itself and those that follow, of the same
// point.
void SchurSystem::SubtractSlots(size_t first, size_t end, const std::vector<int>& begin,
                                std::vector<double>* column) const {
  const int size = cholesky_->size(slot_position_[first]);
  const double* own = &projected_[slot_values_[first]];
  for (size_t s = first; s < end;) {
    size_t sixes_end = s;
    while (size == 6 && sixes_end < end && cholesky_->size(slot_position_[sixes_end]) == 6) ++sixes_end;
    const double* others = &projected_[slot_values_[s]];
    if (sixes_end > s) {
      SubtractSixes(others, static_cast<int>(sixes_end - s), own, &slot_position_[s], begin.data(),
                    column->data());
      s = sixes_end;
    } else {
      const int row = slot_position_[s];
      SubtractProduct(others, cholesky_->size(row), own, size,
                      &(*column)[static_cast<size_t>(begin[row]) * size]);
      ++s;
    }
  }
}

bool SchurSystem::Solve(const Eigen::VectorXd& damping, Eigen::VectorXd* step) {
  std::atomic<bool> is_definite = true;
  ForEach(std::ssize(terms_.points()), num_threads_, [&](int64_t p) {
    if (!EliminatePoint(static_cast<int>(p), damping)) is_definite = false;
  });
  if (!is_definite) return false;
  Eigen::VectorXd reduced(cholesky_->num_rows());
  // The last have most residuals: first.
  ParallelFor(cholesky_->num_blocks(), num_threads_, [&](int64_t k) {
    SetColumn(static_cast<int>(cholesky_->num_blocks() - 1 - k), damping, &reduced);
  });
  if (!cholesky_->Factorize(num_threads_)) return false;
  cholesky_->Solve(&reduced);
  step->resize(gradient_.size());
  step->head(reduced.size()) = reduced;
  ForEach(std::ssize(terms_.points()), num_threads_, [&](int64_t p) {
    Eigen::Vector3d side = point_side_[p];
    for (size_t s = slot_begin_[p]; s < slot_begin_[p + 1]; ++s) {
      const double* own = &projected_[slot_values_[s]];
      const int position = slot_position_[s];
      for (int i = 0; i < cholesky_->size(position); ++i, own += 3) {
        const double moved = reduced[cholesky_->first_row(position) + i];
        for (int c = 0; c < 3; ++c) side[c] += own[c] * moved;
      }
    }
    step->segment<3>(reduced.size() + 3 * p) =
        -point_factor_[p].transpose().triangularView<Eigen::Upper>().solve(side);
  });
  return true;
}

}  // namespace cairn
