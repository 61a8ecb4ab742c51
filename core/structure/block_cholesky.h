#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace cairn {

// Sparse Cholesky factorisation A = L L^T of a symmetric, positive definite matrix of blocks, such as the
// reduced system of a bundle adjustment.  Blocks are ordered once by approximate minimum degree [Amestoy96],
// columns of like structure are joined to supernodes, and each supernode gathers what those before it have to
// say of it (left-looking, [Ng93]).  Each entry is summed by one thread in one order: the result does not
// depend on the number of threads.  No BLAS, whose rounding would be another machine's.
//
// Blocks are numbered in the order of their elimination: block_of() and position_of() translate.
class BlockCholesky {
 public:
  // `sizes`: number of rows of each block, > 0.  `neighbours`: per block, others with which it shares an
  // entry that is not zero; to say it of one of the two is enough.
  BlockCholesky(const std::vector<int>& sizes, const std::vector<std::vector<int>>& neighbours);

  int num_blocks() const { return static_cast<int>(block_of_.size()); }
  int num_rows() const { return row_begin_.back(); }
  // Groups of columns that are factorised together.
  int num_supernodes() const { return static_cast<int>(supernodes_.size()); }
  int block_of(int position) const { return block_of_[position]; }
  int position_of(int block) const { return position_of_[block]; }
  // Of the block at a position: its first row, and the number of its rows.
  int first_row(int position) const { return row_begin_[position]; }
  int size(int position) const { return row_begin_[position + 1] - row_begin_[position]; }

  // Positions of the blocks of rows in the column of blocks at `position`: itself first, then later ones,
  // ascending.
  std::span<const int> RowsOf(int position) const;
  // Sets the column of blocks at `position`: for each of RowsOf(position), one below the other, a matrix of
  // size(row) rows and size(position) columns, row by row.  Of the first, only the lower triangle is read.
  // May be called for several positions at once.
  void SetColumn(int position, const double* values);
  // Of the columns set since the last call; all must be.  False: the matrix is not positive definite.
  bool Factorize(int num_threads);
  // Of A x = b, whose rows are in the order of elimination, in place.  REQUIRES: Factorize() returned true
  void Solve(Eigen::VectorXd* b) const;

 private:
  // Columns [first, end) with the same rows: their own, then `rows.size() - (end - first)` later ones.
  struct Supernode {
    int first = 0, end = 0;
    std::vector<int> rows;       // positions, ascending
    std::vector<int> row_begin;  // per row of blocks, and the end: index of a row in the values
    int width = 0;               // number of columns
    size_t begin = 0;            // of its values, row by row, in values_
    // Those before it that have rows among its columns: index, and which of its rows those are.
    struct Update {
      int supernode = 0, begin = 0, end = 0;
    };
    std::vector<Update> updates;
    double work = 0;         // number of their products
    std::vector<int> tiles;  // rows of blocks at which a tile begins, and the end; the first: its own columns
  };

  void MakeSupernodes(const std::vector<std::vector<int>>& structure);
  void FindUpdates();
  void FindSubtrees();
  void UpdateTile(const Supernode& supernode, int tile);
  bool FactorizeSupernode(const Supernode& supernode, int num_threads);

  std::vector<int> block_of_, position_of_;
  std::vector<int> row_begin_;  // per position, and the end
  std::vector<Supernode> supernodes_;
  std::vector<int> supernode_of_;  // per position
  // Supernodes [begin, end) that depend on no others: factorised one beside the other.  Then the rest.
  std::vector<std::pair<int, int>> subtrees_;
  std::vector<int> others_;
  std::unique_ptr<double[]> values_;  // not cleared: SetColumn() does it, on all threads
};

}  // namespace cairn
