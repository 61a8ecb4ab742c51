#include "core/structure/block_cholesky.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include "core/base/parallel.h"
#include "core/features/wide_clones.h"

namespace cairn {
namespace {

using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMajorMap = Eigen::Map<RowMajorMatrix>;
using ConstRowMajorMap = Eigen::Map<const RowMajorMatrix>;

// A supernode has so many columns at most, and a tile so many rows at least: what one thread does at once.
constexpr int kMaxWidth = 192, kMinTileRows = 96;
// A column joins the supernode before it as long as no more than this part of the entries is zero.
constexpr double kMaxZeroRatio = 0.15;
// A subtree of supernodes that one thread factorises takes so much of the work at most.
constexpr double kMaxSubtreeRatio = 1.0 / 16;
// Products of a supernode's updates that are worth threads of their own.
constexpr double kMinParallelWork = 2e6;

// Rows of a strip that is multiplied at once, and of a tile of the other factor.
constexpr int kStrip = 8, kQuad = 4;

// Rows of `b`, which has `width` columns, in strips of kStrip: column after column; zeros where there are
// none.
void PackStrips(const double* b, int num_rows, int width, std::vector<double>* packed) {
  const int num_strips = (num_rows + kStrip - 1) / kStrip;
  packed->resize(std::max<size_t>(packed->size(), static_cast<size_t>(num_strips) * kStrip * width));
  double* out = packed->data();
  for (int strip = 0; strip < num_strips; ++strip) {
    for (int k = 0; k < width; ++k) {
      for (int i = 0; i < kStrip; ++i, ++out) {
        const int row = strip * kStrip + i;
        *out = row < num_rows ? b[static_cast<size_t>(row) * width + k] : 0;
      }
    }
  }
}

// product = a b^T, for `b` in strips; all row by row, the product's rows as long as the strips together.
CAIRN_WIDE_CLONES void MultiplyByStrips(const double* a, int num_rows, const double* strips, int num_strips,
                                        int width, double* product) {
  using Four = double __attribute__((vector_size(32), aligned(8), may_alias));
  const int stride = num_strips * kStrip;
  for (int strip = 0; strip < num_strips; ++strip) {
    for (int i = 0; i < num_rows; i += kQuad) {
      // Rows past the last are the last again.
      const double* row[kQuad];
      for (int r = 0; r < kQuad; ++r) row[r] = a + static_cast<size_t>(std::min(i + r, num_rows - 1)) * width;
      const double* b = strips + static_cast<size_t>(strip) * kStrip * width;
      Four sum[kQuad][2] = {};
      for (int k = 0; k < width; ++k, b += kStrip) {
        const Four left = *reinterpret_cast<const Four*>(b), right = *reinterpret_cast<const Four*>(b + 4);
        for (int r = 0; r < kQuad; ++r) {
          sum[r][0] += row[r][k] * left;
          sum[r][1] += row[r][k] * right;
        }
      }
      for (int r = 0; r < kQuad && i + r < num_rows; ++r) {
        double* out = product + static_cast<size_t>(i + r) * stride + strip * kStrip;
        *reinterpret_cast<Four*>(out) = sum[r][0];
        *reinterpret_cast<Four*>(out + 4) = sum[r][1];
      }
    }
  }
}

// Order of elimination: block at each position.
std::vector<int> OrderByMinimumDegree(const std::vector<std::vector<int>>& neighbours) {
  const auto n = static_cast<int>(neighbours.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < n; ++i) {
    entries.emplace_back(i, i, 1);
    for (const int j : neighbours[i]) entries.emplace_back(i, j, 1);
  }
  Eigen::SparseMatrix<double> graph(n, n);
  graph.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(graph, order);
  return {order.indices().data(), order.indices().data() + order.size()};
}

// Rows below the diagonal of each column of the factor, positions ascending [Davis06 §4].
std::vector<std::vector<int>> SymbolicFactor(const std::vector<std::vector<int>>& neighbours,
                                             const std::vector<int>& block_of) {
  const size_t n = block_of.size();
  std::vector<int> position_of(n);
  for (size_t p = 0; p < n; ++p) position_of[block_of[p]] = static_cast<int>(p);
  std::vector<std::vector<int>> structure(n);
  for (size_t i = 0; i < n; ++i) {
    for (const int j : neighbours[i]) {
      const auto [earlier, later] = std::minmax(position_of[i], position_of[j]);
      if (earlier != later) structure[earlier].push_back(later);
    }
  }
  for (size_t p = 0; p < n; ++p) {
    std::vector<int>& rows = structure[p];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    // What a column's elimination fills is passed on to its parent, the first row below.
    if (rows.empty()) continue;
    structure[rows.front()].insert(structure[rows.front()].end(), rows.begin() + 1, rows.end());
  }
  return structure;
}

// The positions in an order in which each subtree of the elimination tree stands together, the child with
// most rows next to its parent.
std::vector<int> Postorder(const std::vector<std::vector<int>>& structure) {
  const auto n = static_cast<int>(structure.size());
  std::vector<std::vector<int>> children(n);
  std::vector<std::pair<int, bool>> stack;
  for (int p = n - 1; p >= 0; --p) {
    if (structure[p].empty()) {
      stack.emplace_back(p, false);
    } else {
      children[structure[p].front()].push_back(p);
    }
  }
  std::vector<int> order;
  while (!stack.empty()) {
    const auto [p, has_children_done] = stack.back();
    stack.pop_back();
    if (has_children_done) {
      order.push_back(p);
      continue;
    }
    stack.emplace_back(p, true);
    std::stable_sort(children[p].begin(), children[p].end(),
                     [&](int a, int b) { return structure[a].size() > structure[b].size(); });
    for (const int child : children[p]) stack.emplace_back(child, false);
  }
  return order;
}

}  // namespace

BlockCholesky::BlockCholesky(const std::vector<int>& sizes, const std::vector<std::vector<int>>& neighbours) {
  const auto n = static_cast<int>(sizes.size());
  const std::vector<int> order = OrderByMinimumDegree(neighbours);
  for (const int p : Postorder(SymbolicFactor(neighbours, order))) block_of_.push_back(order[p]);
  position_of_.resize(n);
  row_begin_ = {0};
  for (int p = 0; p < n; ++p) {
    position_of_[block_of_[p]] = p;
    row_begin_.push_back(row_begin_.back() + sizes[block_of_[p]]);
  }
  MakeSupernodes(SymbolicFactor(neighbours, block_of_));
  FindUpdates();
  FindSubtrees();
}

void BlockCholesky::MakeSupernodes(const std::vector<std::vector<int>>& structure) {
  supernode_of_.resize(structure.size());
  double num_nonzeros = 0;  // of the last supernode
  for (int p = 0; p < num_blocks(); ++p) {
    double height = size(p);
    for (const int row : structure[p]) height += size(row);
    const double own_nonzeros = size(p) * height;
    if (!supernodes_.empty()) {
      Supernode& last = supernodes_.back();
      const int width = row_begin_[p + 1] - row_begin_[last.first];
      const double num_entries = width * (height + row_begin_[p] - row_begin_[last.first]);
      const bool is_parent = !structure[p - 1].empty() && structure[p - 1].front() == p;
      // Above the diagonal there are entries, too, that are never zero.
      const double above = static_cast<double>(width - size(p)) * size(p);
      if (is_parent && width <= kMaxWidth &&
          num_nonzeros + own_nonzeros + above >= (1 - kMaxZeroRatio) * num_entries) {
        num_nonzeros += own_nonzeros + above;
        last.end = p + 1;
        supernode_of_[p] = supernode_of_[p - 1];
        continue;
      }
    }
    supernode_of_[p] = static_cast<int>(supernodes_.size());
    supernodes_.emplace_back().first = p;
    supernodes_.back().end = p + 1;
    num_nonzeros = own_nonzeros;
  }
  size_t num_values = 0;
  for (Supernode& supernode : supernodes_) {
    supernode.rows.resize(supernode.end - supernode.first);
    std::iota(supernode.rows.begin(), supernode.rows.end(), supernode.first);
    const std::vector<int>& below = structure[supernode.end - 1];
    supernode.rows.insert(supernode.rows.end(), below.begin(), below.end());
    supernode.row_begin = {0};
    for (const int row : supernode.rows)
      supernode.row_begin.push_back(supernode.row_begin.back() + size(row));
    supernode.width = supernode.row_begin[supernode.end - supernode.first];
    supernode.begin = num_values;
    num_values += static_cast<size_t>(supernode.width) * supernode.row_begin.back();
    supernode.tiles = {0, supernode.end - supernode.first};
    for (int row = supernode.tiles.back(); row < std::ssize(supernode.rows);) {
      const int least = supernode.row_begin[row] + kMinTileRows;
      while (row < std::ssize(supernode.rows) && supernode.row_begin[row] < least) ++row;
      supernode.tiles.push_back(row);
    }
  }
  values_ = std::make_unique_for_overwrite<double[]>(num_values);
}

void BlockCholesky::FindUpdates() {
  for (size_t s = 0; s < supernodes_.size(); ++s) {
    const std::vector<int>& rows = supernodes_[s].rows;
    for (int begin = supernodes_[s].end - supernodes_[s].first; begin < std::ssize(rows);) {
      const int ancestor = supernode_of_[rows[begin]];
      int end = begin + 1;
      while (end < std::ssize(rows) && supernode_of_[rows[end]] == ancestor) ++end;
      supernodes_[ancestor].updates.push_back({static_cast<int>(s), begin, end});
      const std::vector<int>& row_begin = supernodes_[s].row_begin;
      supernodes_[ancestor].work += static_cast<double>(supernodes_[s].width) *
                                    (row_begin.back() - row_begin[begin]) *
                                    (row_begin[end] - row_begin[begin]);
      begin = end;
    }
  }
}

void BlockCholesky::FindSubtrees() {
  const size_t n = supernodes_.size();
  std::vector<double> work(n, 0);  // of the subtree
  std::vector<int> begin(n);       // of the subtree
  double total = 0;
  std::iota(begin.begin(), begin.end(), 0);
  std::vector<int> parent(n, -1);
  for (size_t s = 0; s < n; ++s) {
    const Supernode& supernode = supernodes_[s];
    const double own =
        static_cast<double>(supernode.width) * supernode.row_begin.back() * supernode.row_begin.back();
    work[s] += own;
    total += own;
    const size_t first_below = supernode.end - supernode.first;
    if (first_below == supernode.rows.size()) continue;
    parent[s] = supernode_of_[supernode.rows[first_below]];
    work[parent[s]] += work[s];
    begin[parent[s]] = std::min(begin[parent[s]], begin[s]);
  }
  const double most = kMaxSubtreeRatio * total;
  for (size_t s = 0; s < n; ++s) {
    if (work[s] > most) {
      others_.push_back(static_cast<int>(s));
    } else if (parent[s] < 0 || work[parent[s]] > most) {
      subtrees_.emplace_back(begin[s], static_cast<int>(s) + 1);
    }
  }
}

std::span<const int> BlockCholesky::RowsOf(int position) const {
  const Supernode& supernode = supernodes_[supernode_of_[position]];
  return std::span<const int>(supernode.rows).subspan(position - supernode.first);
}

void BlockCholesky::SetColumn(int position, const double* values) {
  const Supernode& supernode = supernodes_[supernode_of_[position]];
  RowMajorMap all(&values_[supernode.begin], supernode.row_begin.back(), supernode.width);
  const int first = row_begin_[position] - row_begin_[supernode.first];
  auto column = all.middleCols(first, size(position));
  column.topRows(first).setZero();
  column.bottomRows(all.rows() - first) = ConstRowMajorMap(values, all.rows() - first, size(position));
}

// Subtracts from a tile what the supernodes before have to say of it.
void BlockCholesky::UpdateTile(const Supernode& supernode, int tile) {
  const int tile_begin = supernode.tiles[tile], tile_end = supernode.tiles[tile + 1];
  RowMajorMap target(&values_[supernode.begin], supernode.row_begin.back(), supernode.width);
  // Not kept by threads: what ends with a thread takes memory to register, and glibc aborts where there is
  // none.
  std::vector<double> strips, values;
  for (const Supernode::Update& update : supernode.updates) {
    const Supernode& other = supernodes_[update.supernode];
    const auto from =
        std::lower_bound(other.rows.begin() + update.begin, other.rows.end(), supernode.rows[tile_begin]);
    const auto to = std::upper_bound(from, other.rows.end(), supernode.rows[tile_end - 1]);
    if (from == to) continue;
    const auto begin = static_cast<int>(from - other.rows.begin());
    const auto end = static_cast<int>(to - other.rows.begin());
    const ConstRowMajorMap source(&values_[other.begin], other.row_begin.back(), other.width);
    const int first_row = other.row_begin[begin], first_col = other.row_begin[update.begin];
    const int num_rows = other.row_begin[end] - first_row;
    const int num_cols = other.row_begin[update.end] - first_col;
    const int num_strips = (num_cols + kStrip - 1) / kStrip;
    PackStrips(source.row(first_col).data(), num_cols, other.width, &strips);
    values.resize(std::max<size_t>(values.size(), static_cast<size_t>(num_rows) * num_strips * kStrip));
    MultiplyByStrips(source.row(first_row).data(), num_rows, strips.data(), num_strips, other.width,
                     values.data());
    const ConstRowMajorMap product(values.data(), num_rows, num_strips * kStrip);
    for (int i = begin, own = tile_begin; i < end; ++i) {
      while (supernode.rows[own] < other.rows[i]) ++own;
      const int height = other.row_begin[i + 1] - other.row_begin[i];
      for (int j = update.begin; j < update.end; ++j) {
        const int width = other.row_begin[j + 1] - other.row_begin[j];
        target.block(supernode.row_begin[own], row_begin_[other.rows[j]] - row_begin_[supernode.first],
                     height, width) -=
            product.block(other.row_begin[i] - first_row, other.row_begin[j] - first_col, height, width);
      }
    }
  }
}

bool BlockCholesky::FactorizeSupernode(const Supernode& supernode, int num_threads) {
  const int64_t num_tiles = std::ssize(supernode.tiles) - 1;
  if (supernode.work < kMinParallelWork) num_threads = 1;
  ParallelFor(num_tiles, num_threads, [&](int64_t tile) { UpdateTile(supernode, static_cast<int>(tile)); });
  RowMajorMap all(&values_[supernode.begin], supernode.row_begin.back(), supernode.width);
  auto diagonal = all.topRows(supernode.width);
  Eigen::Ref<RowMajorMatrix> diagonal_ref(diagonal);
  const Eigen::LLT<Eigen::Ref<RowMajorMatrix>, Eigen::Lower> llt(diagonal_ref);
  if (llt.info() != Eigen::Success) return false;
  ParallelFor(num_tiles - 1, num_threads, [&](int64_t below) {
    const int begin = supernode.row_begin[supernode.tiles[below + 1]];
    const int end = supernode.row_begin[supernode.tiles[below + 2]];
    auto rows = all.middleRows(begin, end - begin).transpose();
    diagonal.triangularView<Eigen::Lower>().solveInPlace(rows);
  });
  return true;
}

bool BlockCholesky::Factorize(int num_threads) {
  std::atomic<bool> is_definite = true;
  ParallelFor(std::ssize(subtrees_), num_threads, [&](int64_t t) {
    for (int s = subtrees_[t].first; s < subtrees_[t].second && is_definite; ++s) {
      if (!FactorizeSupernode(supernodes_[s], 1)) is_definite = false;
    }
  });
  for (const int s : others_) {
    if (!is_definite) return false;
    if (!FactorizeSupernode(supernodes_[s], num_threads)) is_definite = false;
  }
  return is_definite;
}

void BlockCholesky::Solve(Eigen::VectorXd* b) const {
  Eigen::VectorXd below;
  for (const Supernode& supernode : supernodes_) {
    const ConstRowMajorMap all(&values_[supernode.begin], supernode.row_begin.back(), supernode.width);
    auto own = b->segment(row_begin_[supernode.first], supernode.width);
    all.topRows(supernode.width).triangularView<Eigen::Lower>().solveInPlace(own);
    below.noalias() = all.bottomRows(all.rows() - supernode.width) * own;
    for (int i = supernode.end - supernode.first; i < std::ssize(supernode.rows); ++i) {
      const int row = supernode.rows[i];
      b->segment(row_begin_[row], size(row)) -=
          below.segment(supernode.row_begin[i] - supernode.width, size(row));
    }
  }
  for (auto it = supernodes_.rbegin(); it != supernodes_.rend(); ++it) {
    const Supernode& supernode = *it;
    const ConstRowMajorMap all(&values_[supernode.begin], supernode.row_begin.back(), supernode.width);
    auto own = b->segment(row_begin_[supernode.first], supernode.width);
    below.resize(all.rows() - supernode.width);
    for (int i = supernode.end - supernode.first; i < std::ssize(supernode.rows); ++i) {
      const int row = supernode.rows[i];
      below.segment(supernode.row_begin[i] - supernode.width, size(row)) =
          b->segment(row_begin_[row], size(row));
    }
    own.noalias() -= all.bottomRows(below.size()).transpose() * below;
    all.topRows(supernode.width).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
}

}  // namespace cairn
