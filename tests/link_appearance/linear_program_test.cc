#include "stages/link_appearance/dominating_set/linear_program.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::link_appearance {
namespace {

using Row = LinearProgram::Row;

// A program beside its LinearProgram.
struct Program {
  struct Column {
    int cost, low, high;
  };
  std::vector<Column> columns;
  std::vector<Row> rows;
};

LinearProgram Made(const Program& program) {
  LinearProgram made;
  for (const auto& [cost, low, high] : program.columns) made.AddColumn(cost, low, high);
  made.AddRows(program.rows);
  return made;
}

template <typename T>
T ValueOf(const Row& row, const std::vector<T>& x) {
  T sum = 0;
  for (size_t i = 0; i < row.columns.size(); ++i) sum += row.values[i] * x[row.columns[i]];
  return sum;
}

template <typename T>
T CostOf(const Program& program, const std::vector<T>& x) {
  T sum = 0;
  for (size_t i = 0; i < x.size(); ++i) sum += program.columns[i].cost * x[i];
  return sum;
}

// Of whole numbers, by trying all.
std::optional<int> LeastCost(const Program& program) {
  std::vector<int> x;
  for (const auto& column : program.columns) x.push_back(column.low);
  std::optional<int> least;
  while (true) {
    bool is_allowed = true;
    for (const Row& row : program.rows) {
      const int value = ValueOf(row, x);
      is_allowed = is_allowed && (!row.low || value >= *row.low) && (!row.high || value <= *row.high);
    }
    if (is_allowed) least = std::min(least.value_or(INT32_MAX), CostOf(program, x));
    size_t i = 0;
    while (i < x.size() && x[i] == program.columns[i].high) {
      x[i] = program.columns[i].low;
      ++i;
    }
    if (i == x.size()) return least;
    ++x[i];
  }
}

// The values meet all rows, and the bound is what they cost, rounded up: so nothing costs less.
void ExpectSolved(const Program& program, const LinearProgram& solved) {
  constexpr double kTolerance = 1e-6;
  const std::vector<double>& x = solved.values();
  ASSERT_EQ(x.size(), program.columns.size());
  for (size_t i = 0; i < x.size(); ++i) {
    EXPECT_GE(x[i], program.columns[i].low - kTolerance);
    EXPECT_LE(x[i], program.columns[i].high + kTolerance);
  }
  for (const Row& row : program.rows) {
    if (row.low) EXPECT_GE(ValueOf(row, x), *row.low - kTolerance);
    if (row.high) EXPECT_LE(ValueOf(row, x), *row.high + kTolerance);
  }
  EXPECT_EQ(solved.bound(), static_cast<int64_t>(std::ceil(CostOf(program, x) - kTolerance)));
}

int DrawBelow(int end, Random* random) { return static_cast<int>(random->UniformInt(0, end - 1)); }

Program RandomProgram(Random* random) {
  Program program;
  for (int i = 0; i < 6; ++i) {
    const int low = DrawBelow(2, random);
    program.columns.push_back({DrawBelow(9, random) - 3, low, low + DrawBelow(3, random)});
  }
  for (int r = 0; r < 5; ++r) {
    Row row;
    for (int i = 0; i < 6; ++i) {
      if (DrawBelow(2, random) == 0) continue;
      row.columns.push_back(i);
      row.values.push_back(DrawBelow(9, random) - 3);
    }
    const int kind = DrawBelow(8, random);
    if (kind != 1) row.low = DrawBelow(5, random) - 2;
    if (kind == 1) row.high = DrawBelow(9, random);
    if (kind == 2) row.high = *row.low + DrawBelow(4, random);
    if (kind == 3) row.high = row.low;
    program.rows.push_back(row);
  }
  return program;
}

TEST(LinearProgram, BoundIsTheCostOfItsValuesAndNeverMoreThanOfWholeOnes) {
  Random random(1);
  int num_solved = 0, num_equal = 0;
  for (int i = 0; i < 1000; ++i) {
    const Program program = RandomProgram(&random);
    const std::optional<int> least = LeastCost(program);
    LinearProgram made = Made(program);
    if (!made.Solve()) {
      EXPECT_FALSE(least) << i;
      continue;
    }
    ++num_solved;
    ExpectSolved(program, made);
    if (least) EXPECT_LE(made.bound(), *least) << i;
    num_equal += least && made.bound() == *least ? 1 : 0;
  }
  EXPECT_GT(num_solved, 100);
  EXPECT_GT(num_equal, 40);
}

TEST(LinearProgram, IsSolvedAgainAfterRowsAndRangesChanged) {
  Random random(2);
  int num_solved = 0;
  for (int i = 0; i < 500; ++i) {
    Program program = RandomProgram(&random);
    const std::vector<Row> later(program.rows.begin() + 2, program.rows.end());
    program.rows.resize(2);
    LinearProgram made = Made(program);
    EXPECT_EQ(made.num_rows(), 2);
    const bool is_solved = made.Solve();
    if (is_solved) ExpectSolved(program, made);
    program.rows.insert(program.rows.end(), later.begin(), later.end());
    made.AddRows(later);
    const int column = DrawBelow(6, &random), value = program.columns[column].high;
    program.columns[column].low = value;
    made.SetRange(column, value, value);
    EXPECT_EQ(made.num_rows(), 5);
    const int64_t before = made.bound();
    if (!made.Solve()) {
      EXPECT_FALSE(LeastCost(program)) << i;
      EXPECT_EQ(made.bound(), before);
      continue;
    }
    ++num_solved;
    ExpectSolved(program, made);
  }
  EXPECT_GT(num_solved, 20);
}

TEST(LinearProgram, RowsThatDoNotBindAreDropped) {
  // min x0 + x1 with x0 + 2 x1 >= 3, and, later, three rows, of which the second binds: x0 >= 2.
  Program program{.columns = {{1, 0, 5}, {1, 0, 5}},
                  .rows = {{.columns = {0, 1}, .values = {1, 2}, .low = 3}}};
  LinearProgram made = Made(program);
  ASSERT_TRUE(made.Solve());
  EXPECT_EQ(made.bound(), 2);  // 1.5
  const std::vector<Row> later{{.columns = {0}, .values = {1}, .high = 4},
                               {.columns = {0}, .values = {1}, .low = 2},
                               {.columns = {0, 1}, .values = {1, 1}, .low = 1}};
  made.AddRows(later);
  ASSERT_TRUE(made.Solve());
  EXPECT_EQ(made.bound(), 3);  // 2 + 0.5
  made.DropLooseRows(1);
  EXPECT_EQ(made.num_rows(), 2);
  program.rows.push_back(later[1]);
  ASSERT_TRUE(made.Solve());
  ExpectSolved(program, made);
  EXPECT_EQ(made.bound(), 3);
  made.DropLooseRows(2);
  EXPECT_EQ(made.num_rows(), 2);
}

TEST(LinearProgram, AProgramWithoutASolutionKeepsItsBound) {
  LinearProgram made = Made({.columns = {{2, 1, 3}}, .rows = {{.columns = {0}, .values = {1}, .low = 0}}});
  ASSERT_TRUE(made.Solve());
  EXPECT_EQ(made.bound(), 2);
  made.AddRows(std::vector<Row>{{.columns = {0}, .values = {1}, .low = 4}});
  EXPECT_FALSE(made.Solve());
  EXPECT_EQ(made.bound(), 2);
}

}  // namespace
}  // namespace cairn::link_appearance
