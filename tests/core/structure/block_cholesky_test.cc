#include "core/structure/block_cholesky.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "core/base/parallel.h"
#include "core/base/random.h"

namespace cairn {
namespace {

struct BlockMatrix {
  std::vector<int> sizes;
  std::vector<std::vector<int>> neighbours;
  Eigen::MatrixXd values;  // in the order of blocks
  std::vector<int> begin;  // row of each block
};

// Every diagonal entry is as large as its row's others together, and some more.
BlockMatrix RandomMatrix(const std::vector<int>& sizes, double density, uint64_t seed) {
  Random random(seed);
  BlockMatrix matrix{sizes, std::vector<std::vector<int>>(sizes.size()), {}, {0}};
  for (const int size : sizes) matrix.begin.push_back(matrix.begin.back() + size);
  const int n = matrix.begin.back();
  matrix.values.setZero(n, n);
  for (size_t i = 0; i < sizes.size(); ++i) {
    for (size_t j = 0; j <= i; ++j) {
      if (i != j && random.Uniform() >= density) continue;
      if (i != j) {
        // It is enough to say it of one of the two.
        const bool of_first = random.Uniform() < 0.5;
        matrix.neighbours[of_first ? i : j].push_back(static_cast<int>(of_first ? j : i));
      }
      for (int r = matrix.begin[i]; r < matrix.begin[i + 1]; ++r) {
        for (int c = matrix.begin[j]; c < matrix.begin[j + 1]; ++c)
          matrix.values(r, c) = matrix.values(c, r) = random.Uniform(-1, 1);
      }
    }
  }
  for (int r = 0; r < n; ++r) matrix.values(r, r) = matrix.values.row(r).cwiseAbs().sum() + 0.1;
  return matrix;
}

// A chain of small blocks, with every 7th of another size.
BlockMatrix Chain(int num_blocks) {
  std::vector<int> sizes(num_blocks, 6);
  for (int i = 0; i < num_blocks; i += 7) sizes[i] = 2;
  BlockMatrix matrix = RandomMatrix(sizes, 0, 3);
  Random random(4);
  for (int i = 1; i < num_blocks; ++i) {
    matrix.neighbours[i].push_back(i - 1);
    const double value = random.Uniform(0.1, 0.3);
    matrix.values(matrix.begin[i], matrix.begin[i - 1]) = value;
    matrix.values(matrix.begin[i - 1], matrix.begin[i]) = value;
  }
  return matrix;
}

void Set(const BlockMatrix& matrix, BlockCholesky* cholesky) {
  ParallelFor(cholesky->num_blocks(), 3, [&](int64_t p) {
    const auto position = static_cast<int>(p);
    const int col = matrix.begin[cholesky->block_of(position)], width = cholesky->size(position);
    std::vector<double> values;
    for (const int row : cholesky->RowsOf(position)) {
      for (int r = 0; r < cholesky->size(row); ++r) {
        for (int c = 0; c < width; ++c) {
          // Above the diagonal nothing is read.
          values.push_back(row == position && r < c
                               ? 1e300
                               : matrix.values(matrix.begin[cholesky->block_of(row)] + r, col + c));
        }
      }
    }
    cholesky->SetColumn(position, values.data());
  });
}

// In the order of blocks.
Eigen::VectorXd Solve(const BlockMatrix& matrix, const Eigen::VectorXd& b, const BlockCholesky& cholesky) {
  Eigen::VectorXd x(b.size()), out(b.size());
  for (int p = 0; p < cholesky.num_blocks(); ++p) {
    x.segment(cholesky.first_row(p), cholesky.size(p)) =
        b.segment(matrix.begin[cholesky.block_of(p)], cholesky.size(p));
  }
  cholesky.Solve(&x);
  for (size_t i = 0; i < matrix.sizes.size(); ++i) {
    const int position = cholesky.position_of(static_cast<int>(i));
    EXPECT_EQ(cholesky.block_of(position), static_cast<int>(i));
    EXPECT_EQ(cholesky.size(position), matrix.sizes[i]);
    out.segment(matrix.begin[i], matrix.sizes[i]) = x.segment(cholesky.first_row(position), matrix.sizes[i]);
  }
  return out;
}

void ExpectSolves(const BlockMatrix& matrix) {
  BlockCholesky cholesky(matrix.sizes, matrix.neighbours);
  ASSERT_EQ(cholesky.num_blocks(), static_cast<int>(matrix.sizes.size()));
  ASSERT_EQ(cholesky.num_rows(), matrix.begin.back());
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(cholesky.num_rows(), -1, 2);
  // A second time, with other values in the same places.
  for (const double factor : {1.0, 3.0}) {
    BlockMatrix scaled = matrix;
    scaled.values *= factor;
    Set(scaled, &cholesky);
    ASSERT_TRUE(cholesky.Factorize(2));
    const Eigen::VectorXd expected = scaled.values.llt().solve(b);
    EXPECT_LT((Solve(scaled, b, cholesky) - expected).norm(), 1e-12 * expected.norm());
  }
}

TEST(BlockCholesky, SolvesSparseSystems) {
  ExpectSolves(RandomMatrix({3}, 1, 1));
  ExpectSolves(RandomMatrix({6, 6, 6, 2, 6, 1, 6, 6}, 0.3, 1));
  ExpectSolves(RandomMatrix(std::vector<int>(60, 6), 0.05, 2));
  ExpectSolves(RandomMatrix(std::vector<int>(40, 5), 0, 2));
  ExpectSolves(Chain(200));
  std::vector<int> sizes;  // one to seven rows, odd sums of them too
  for (int i = 0; i < 80; ++i) sizes.push_back(1 + i % 7);
  for (const double density : {0.02, 0.05, 0.2}) ExpectSolves(RandomMatrix(sizes, density, 8));
  for (int n = 1; n <= 20; ++n) ExpectSolves(RandomMatrix(std::vector<int>(n, 1), 0.3, n));
}

TEST(BlockCholesky, SolvesWhereSupernodesAreManyAndWide) {
  ExpectSolves(RandomMatrix(std::vector<int>(100, 6), 1, 5));
  ExpectSolves(RandomMatrix(std::vector<int>(120, 6), 0.1, 6));
}

TEST(BlockCholesky, NoBlocksAreSolved) {
  BlockCholesky cholesky({}, {});
  EXPECT_EQ(cholesky.num_rows(), 0);
  EXPECT_TRUE(cholesky.Factorize(2));
  Eigen::VectorXd nothing;
  cholesky.Solve(&nothing);
}

TEST(BlockCholesky, AStarIsEliminatedFromItsTips) {
  //  1   2   3
  //   \  |  /
  //    \ | /
  //  7 - 0 - 4     without fill: each tip has the centre's rows, and no other's
  //     / \ .
  //    6   5
  const BlockCholesky cholesky(std::vector<int>(8, 6), {{1, 2, 3, 4, 5, 6, 7}, {}, {}, {}, {}, {}, {}, {}});
  EXPECT_GE(cholesky.position_of(0), 6);  // the last tip is as good
  int num_rows = 0;
  for (int p = 0; p < 8; ++p) num_rows += static_cast<int>(cholesky.RowsOf(p).size());
  EXPECT_EQ(num_rows, 15);
}

TEST(BlockCholesky, LittleOfAChainIsFilled) {
  const BlockMatrix chain = Chain(200);
  const BlockCholesky cholesky(chain.sizes, chain.neighbours);
  for (int p = 0; p < 200; ++p) EXPECT_LE(cholesky.RowsOf(p).size(), 3u) << p;
}

TEST(BlockCholesky, ColumnsOfLikeStructureAreFactorisedTogether) {
  // All share entries: one supernode, whose columns have the later ones' rows.
  const BlockMatrix matrix = RandomMatrix(std::vector<int>(5, 6), 1, 1);
  const BlockCholesky cholesky(matrix.sizes, matrix.neighbours);
  EXPECT_EQ(cholesky.num_supernodes(), 1);
  for (int p = 0; p < 5; ++p) {
    ASSERT_EQ(cholesky.RowsOf(p).size(), 5u - p);
    for (int k = p; k < 5; ++k) EXPECT_EQ(cholesky.RowsOf(p)[k - p], k);
  }
  // Of 192 columns at most: 32 blocks.
  const BlockMatrix wide = RandomMatrix(std::vector<int>(100, 6), 1, 5);
  EXPECT_EQ(BlockCholesky(wide.sizes, wide.neighbours).num_supernodes(), 4);
  for (const int num_columns : {192, 193}) {
    const BlockMatrix narrow = RandomMatrix(std::vector<int>(num_columns, 1), 1, 5);
    EXPECT_EQ(BlockCholesky(narrow.sizes, narrow.neighbours).num_supernodes(), num_columns - 191);
  }
  // Nothing in common.
  EXPECT_EQ(BlockCholesky({6, 6, 6}, {{}, {}, {}}).num_supernodes(), 3);
}

TEST(BlockCholesky, AColumnIsFactorisedWithOthersWhereThatStoresFewZeros) {
  // A block of 2 hangs on one of a clique of 1 + m blocks of 6 and is eliminated first where m > 1.  With its
  // neighbour its column has 2 x 6 m zeros of 8 x (8 + 6 m) entries: 17 and 20 %.
  for (const int m : {0, 1, 3, 5}) {
    std::vector<int> sizes(m + 1, 6);
    sizes.push_back(2);
    std::vector<std::vector<int>> neighbours(m + 2);
    for (int i = 0; i <= m; ++i) {
      for (int j = 0; j < i; ++j) neighbours[i].push_back(j);
    }
    neighbours.back() = {0};
    const BlockCholesky cholesky(sizes, neighbours);
    EXPECT_EQ(cholesky.num_supernodes(), m <= 1 ? 1 : 2) << m;
  }
}

TEST(BlockCholesky, WhatIsNotPositiveDefiniteIsSaid) {
  for (const BlockMatrix& matrix : {Chain(100), RandomMatrix(std::vector<int>(100, 6), 1, 5)}) {
    for (const int row : {0, 77, matrix.begin.back() - 1}) {
      BlockMatrix wrong = matrix;
      wrong.values(row, row) = -1;
      for (const int num_threads : {1, 3}) {
        BlockCholesky cholesky(matrix.sizes, matrix.neighbours);
        Set(wrong, &cholesky);
        EXPECT_FALSE(cholesky.Factorize(num_threads)) << row;
        Set(matrix, &cholesky);
        EXPECT_TRUE(cholesky.Factorize(num_threads)) << row;
      }
    }
  }
}

TEST(BlockCholesky, TheNumberOfThreadsChangesNoBit) {
  for (const BlockMatrix& matrix : {Chain(300), RandomMatrix(std::vector<int>(120, 6), 0.1, 6),
                                    RandomMatrix(std::vector<int>(90, 6), 1, 7)}) {
    std::vector<Eigen::VectorXd> found;
    for (const int num_threads : {1, 2, 3, 7}) {
      BlockCholesky cholesky(matrix.sizes, matrix.neighbours);
      Set(matrix, &cholesky);
      ASSERT_TRUE(cholesky.Factorize(num_threads));
      found.push_back(Solve(matrix, Eigen::VectorXd::Ones(cholesky.num_rows()), cholesky));
      EXPECT_EQ(found.front(), found.back());
    }
  }
}

}  // namespace
}  // namespace cairn
