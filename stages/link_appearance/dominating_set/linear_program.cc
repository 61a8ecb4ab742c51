#include "stages/link_appearance/dominating_set/linear_program.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glpk.h>

namespace cairn::link_appearance {
namespace {

// Of a program of a thousand columns a thousand are usual; a program that turns in circles ends, too.
constexpr int kMaxNumIterations = 200000;
constexpr double kDualUnit = 1 << 30;  // 1 / of what dual values are rounded to
constexpr double kMaxDual = 1 << 20;   // larger ones prove nothing that matters

int TypeOf(bool has_low, bool has_high, bool is_one) {
  if (is_one) return GLP_FX;
  return has_low ? (has_high ? GLP_DB : GLP_LO) : GLP_UP;
}

}  // namespace

LinearProgram::LinearProgram() : program_(glp_create_prob()) { glp_set_obj_dir(program_.get(), GLP_MIN); }

void LinearProgram::Delete::operator()(glp_prob* program) const { glp_delete_prob(program); }

void LinearProgram::AddColumn(int cost, int low, int high) {
  const int column = glp_add_cols(program_.get(), 1);
  glp_set_obj_coef(program_.get(), column, cost);
  columns_.push_back({cost, low, high});
  SetRange(column - 1, low, high);
}

void LinearProgram::SetRange(int column, int low, int high) {
  columns_[column].low = low;
  columns_[column].high = high;
  glp_set_col_bnds(program_.get(), column + 1, TypeOf(true, true, low == high), low, high);
}

void LinearProgram::AddRows(std::span<const Row> rows) {
  if (rows.empty()) return;
  int number = glp_add_rows(program_.get(), static_cast<int>(rows.size()));
  for (const Row& row : rows) {
    // GLPK counts from 1.
    std::vector<int> columns(1);
    for (const int column : row.columns) columns.push_back(column + 1);
    std::vector<double> values(1);
    values.insert(values.end(), row.values.begin(), row.values.end());
    glp_set_mat_row(program_.get(), number, static_cast<int>(row.columns.size()), columns.data(),
                    values.data());
    glp_set_row_bnds(program_.get(), number,
                     TypeOf(row.low.has_value(), row.high.has_value(), row.low == row.high),
                     row.low.value_or(0), row.high.value_or(0));
    rows_.push_back(row);
    ++number;
  }
}

void LinearProgram::DropLooseRows(int first) {
  std::vector<int> loose(1);
  std::vector<Row> kept(rows_.begin(), rows_.begin() + first);
  for (int row = first; row < num_rows(); ++row) {
    if (glp_get_row_stat(program_.get(), row + 1) == GLP_BS) {
      loose.push_back(row + 1);
    } else {
      kept.push_back(std::move(rows_[row]));
    }
  }
  if (loose.size() > 1) glp_del_rows(program_.get(), static_cast<int>(loose.size()) - 1, loose.data());
  rows_ = std::move(kept);
}

bool LinearProgram::Solve() {
  glp_smcp options;
  glp_init_smcp(&options);
  options.msg_lev = GLP_MSG_OFF;
  options.meth = GLP_DUALP;
  options.it_lim = kMaxNumIterations;
  int error = glp_simplex(program_.get(), &options);
  if (error == GLP_EBADB || error == GLP_ESING || error == GLP_ECOND) {
    glp_std_basis(program_.get());
    error = glp_simplex(program_.get(), &options);
  }
  if (error != 0 || glp_get_status(program_.get()) != GLP_OPT) return false;
  values_.resize(columns_.size());
  for (size_t column = 0; column < columns_.size(); ++column)
    values_[column] = glp_get_col_prim(program_.get(), static_cast<int>(column) + 1);
  bound_ = ProvenBound();
  return true;
}

int64_t LinearProgram::ProvenBound() const {
  // All in units of 1 / kDualUnit.
  __int128 bound = 0;
  std::vector<__int128> reduced(columns_.size());
  for (size_t column = 0; column < columns_.size(); ++column)
    reduced[column] = static_cast<__int128>(columns_[column].cost) * static_cast<int64_t>(kDualUnit);
  for (int row = 0; row < num_rows(); ++row) {
    const Row& r = rows_[row];
    const double dual = glp_get_row_dual(program_.get(), row + 1);
    if (!(std::abs(dual) <= kMaxDual)) continue;
    const auto y = static_cast<int64_t>(std::nearbyint(dual * kDualUnit));
    const std::optional<int>& end = y > 0 ? r.low : r.high;
    if (y == 0 || !end) continue;
    bound += static_cast<__int128>(y) * *end;
    for (size_t i = 0; i < r.columns.size(); ++i)
      reduced[r.columns[i]] -= static_cast<__int128>(y) * r.values[i];
  }
  for (size_t column = 0; column < columns_.size(); ++column)
    bound += std::min(reduced[column] * columns_[column].low, reduced[column] * columns_[column].high);
  // The least whole number that is not less.
  const auto unit = static_cast<__int128>(kDualUnit);
  const __int128 whole = bound / unit;
  return static_cast<int64_t>(whole * unit < bound ? whole + 1 : whole);
}

}  // namespace cairn::link_appearance
