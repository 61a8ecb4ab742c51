// DescriptorMatrix is a matrix of Eigen's, in memory of its own.
#include <utility>

#include <gtest/gtest.h>

#include "core/features/features.h"

namespace cairn {
namespace {

DescriptorMatrix Counting(Eigen::Index rows, Eigen::Index cols) {
  DescriptorMatrix matrix(rows, cols);
  for (Eigen::Index i = 0; i < rows * cols; ++i) matrix.data()[i] = static_cast<uint8_t>(i);
  return matrix;
}

TEST(DescriptorMatrix, IsRowByRow) {
  const DescriptorMatrix matrix = Counting(3, 4);
  EXPECT_EQ(matrix.rows(), 3);
  EXPECT_EQ(matrix.cols(), 4);
  EXPECT_EQ(matrix(1, 2), 6);
  EXPECT_EQ(matrix.row(2).data(), matrix.data() + 8);
}

TEST(DescriptorMatrix, ACopyIsAnother) {
  const DescriptorMatrix matrix = Counting(3, 4);
  DescriptorMatrix copy = matrix;
  EXPECT_NE(copy.data(), matrix.data());
  EXPECT_EQ(copy, matrix);
  copy(0, 0) = 77;
  EXPECT_EQ(matrix(0, 0), 0);
  copy = Counting(2, 5);
  EXPECT_EQ(copy.rows(), 2);
  EXPECT_EQ(copy(1, 4), 9);
  copy = matrix;  // of another size
  EXPECT_EQ(copy, matrix);
  const DescriptorMatrix& same = copy;
  copy = same;
  EXPECT_EQ(copy, matrix);
}

TEST(DescriptorMatrix, MovesItsMemory) {
  DescriptorMatrix matrix = Counting(3, 4);
  const uint8_t* const data = matrix.data();
  DescriptorMatrix moved = std::move(matrix);
  EXPECT_EQ(moved.data(), data);
  EXPECT_EQ(moved, Counting(3, 4));
  DescriptorMatrix assigned(1, 1);
  assigned = std::move(moved);
  EXPECT_EQ(assigned.data(), data);
  EXPECT_EQ(assigned.rows(), 3);
  std::swap(assigned, moved);
  EXPECT_EQ(moved.data(), data);
  EXPECT_EQ(assigned.rows(), 1);
}

TEST(DescriptorMatrix, TakesExpressionsAndPartsOfItself) {
  DescriptorMatrix matrix = Counting(4, 3);
  matrix = matrix.bottomRows(2).eval();
  EXPECT_EQ(matrix.rows(), 2);
  EXPECT_EQ(matrix(0, 0), 6);
  matrix = matrix.rightCols(2);
  EXPECT_EQ(matrix.cols(), 2);
  EXPECT_EQ(matrix(1, 1), 11);
  matrix = DescriptorMatrix::Constant(2, 32, 9);
  EXPECT_EQ(matrix.cols(), 32);
  EXPECT_EQ(matrix(1, 31), 9);
  EXPECT_EQ(DescriptorMatrix(DescriptorMatrix::Zero(2, 2)), DescriptorMatrix::Zero(2, 2));
}

TEST(DescriptorMatrix, KeepsItsRowsWhereTheirNumberChanges) {
  DescriptorMatrix matrix = Counting(3, 4);
  matrix.conservativeResize(5, 4);
  EXPECT_EQ(matrix.topRows(3), Counting(3, 4));
  EXPECT_EQ(matrix.rows(), 5);
  matrix.conservativeResize(2, Eigen::NoChange);
  EXPECT_EQ(matrix, Counting(2, 4));
  matrix.resize(0, 128);
  EXPECT_EQ(matrix.rows(), 0);
  EXPECT_EQ(matrix.cols(), 128);
  EXPECT_EQ(DescriptorMatrix().size(), 0);
}

}  // namespace
}  // namespace cairn
