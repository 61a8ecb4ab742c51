#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

struct glp_prob;

namespace cairn::link_appearance {

// A linear program of integers, min c x with rows low <= a x <= high and columns low <= x <= high, that is
// solved again as rows are added and columns are fixed.  By GLPK's simplex method, whose dual values prove a
// bound that holds whatever its rounding: any y >= 0 of rows with a low end, <= 0 of rows with a high one,
// has
//   c x >= sum of y_i end_i + sum of the lesser of (c - y a)_j low_j and (c - y a)_j high_j,
// which is computed in integers for y rounded to multiples of 2^-30.
class LinearProgram {
 public:
  struct Row {
    std::vector<int> columns;
    std::vector<int> values;
    std::optional<int> low, high;  // at least one
  };

  LinearProgram();
  // REQUIRES: 0 <= low <= high
  void AddColumn(int cost, int low, int high);
  void SetRange(int column, int low, int high);
  void AddRows(std::span<const Row> rows);
  // Takes the rows from the first one on that did not bind out again.  REQUIRES: Solve, and no change since
  void DropLooseRows(int first);
  int num_rows() const { return static_cast<int>(rows_.size()); }

  // False: the solver gave up, and values and bound are what they were.
  bool Solve();
  const std::vector<double>& values() const { return values_; }  // of columns
  // The least whole number that c x may be where it is one.
  int64_t bound() const { return bound_; }

 private:
  struct Column {
    int cost, low, high;
  };
  struct Delete {
    void operator()(glp_prob* program) const;
  };
  int64_t ProvenBound() const;

  std::unique_ptr<glp_prob, Delete> program_;
  std::vector<Column> columns_;
  std::vector<Row> rows_;
  std::vector<double> values_;
  int64_t bound_ = 0;
};

}  // namespace cairn::link_appearance
