#include "stages/link_appearance/dominating_set/connected_bound.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <CbcEventHandler.hpp>
#include <CbcModel.hpp>
#include <CglCutGenerator.hpp>
#include <OsiClpSolverInterface.hpp>

#include "stages/link_appearance/dominating_set/counting_bound.h"
#include "stages/link_appearance/dominating_set/tree_cuts.h"

namespace cairn::link_appearance {
namespace {

constexpr double kTolerance = 1e-3;  // of cuts and of rounding a bound up
// Cuts of one round, the most violated ones.
constexpr size_t kMaxCutsPerRound = 400;
// Rows that do not bind are dropped each time the bound has risen by this much.
constexpr double kRiseBetweenCleanups = 0.2;

OsiRowCut Row(const std::vector<int>& columns, const std::vector<double>& values, double low, double high) {
  OsiRowCut row;
  row.setRow(static_cast<int>(columns.size()), columns.data(), values.data());
  row.setLb(low);
  row.setUb(high);
  row.setGloballyValid(true);
  return row;
}

// The arcs into S also equal x(S) - y(arcs within S): the row with fewer entries is used.
OsiRowCut RowOf(const TreeColumns& program, const TreeCut& cut) {
  const std::vector<char> inside = NodeMarks(program.num_nodes, cut.nodes);
  std::vector<int> entering, within;
  for (size_t a = 0; a < program.arcs.size(); ++a) {
    const auto [from, to] = program.arcs[a];
    if (!inside[to]) continue;
    (from >= 0 && inside[from] ? within : entering).push_back(program.num_nodes + static_cast<int>(a));
  }
  std::vector<int> columns;
  std::vector<double> values;
  if (entering.size() <= within.size() + cut.nodes.size()) {
    columns = entering;
    values.assign(columns.size(), 1);
    if (cut.reached >= 0) {
      columns.push_back(cut.reached);
      values.push_back(-1);
    }
  } else {
    columns = within;
    values.assign(columns.size(), -1);
    for (const NodeIdx node : cut.nodes) {
      if (node == cut.reached) continue;
      columns.push_back(node);
      values.push_back(1);
    }
  }
  return Row(columns, values, cut.reached < 0 ? 1 : 0, COIN_DBL_MAX);
}

// y_uv + y_vu <= x_u: a link is in the tree once, and only with both ends.
void AddLinkRows(const TreeColumns& program, const double* values, std::vector<OsiRowCut>* rows) {
  for (int a = 0; a < program.num_link_arcs; a += 2) {
    const int column = program.num_nodes + a;
    const double both = values[column] + values[column + 1];
    for (const NodeIdx node : {program.arcs[a].from, program.arcs[a].to}) {
      if (both - values[node] <= kTolerance) continue;
      rows->push_back(Row({column, column + 1, node}, {1, 1, -1}, -COIN_DBL_MAX, 0));
    }
  }
}

std::vector<OsiRowCut> FindRows(const AppearanceGraph& graph, const TreeColumns& program,
                                const double* values) {
  std::vector<OsiRowCut> rows;
  AddLinkRows(program, values, &rows);
  std::vector<TreeCut> cuts = FindTreeCuts(graph, program, values, 10 * kTolerance);
  std::stable_sort(cuts.begin(), cuts.end(),
                   [](const TreeCut& a, const TreeCut& b) { return a.violation > b.violation; });
  if (cuts.size() > kMaxCutsPerRound) cuts.resize(kMaxCutsPerRound);
  for (const TreeCut& cut : cuts) rows.push_back(RowOf(program, cut));
  return rows;
}

// The same cuts in CBC's branching tree.
class TreeCutGenerator : public CglCutGenerator {
 public:
  TreeCutGenerator(const AppearanceGraph* graph, const TreeColumns* program)
      : graph_(graph), program_(program) {}
  void generateCuts(const OsiSolverInterface& solver, OsiCuts& cuts, const CglTreeInfo) override {
    for (const OsiRowCut& row : FindRows(*graph_, *program_, solver.getColSolution())) cuts.insert(row);
  }
  CglCutGenerator* clone() const override { return new TreeCutGenerator(*this); }

 private:
  const AppearanceGraph* graph_;
  const TreeColumns* program_;
};

class StopWhenCancelled : public CbcEventHandler {
 public:
  explicit StopWhenCancelled(const Progress* progress) : progress_(progress) {}
  CbcAction event(CbcEvent) override { return progress_ && progress_->Cancelled() ? stop : noAction; }
  CbcEventHandler* clone() const override { return new StopWhenCancelled(*this); }

 private:
  const Progress* progress_;
};

// Nodes that some smallest set does not need: another node's neighbourhood contains theirs.
std::vector<char> FindReplaceable(const AppearanceGraph& graph) {
  std::vector<char> replaceable(graph.num_nodes(), 0);
  std::vector<char> around(graph.num_nodes(), 0);
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    around[node] = 1;
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) around[n.node] = 1;
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
      const auto others = graph.Neighbours(n.node);
      const bool is_within = std::all_of(others.begin(), others.end(),
                                         [&](const AppearanceGraph::Neighbour& o) { return around[o.node]; });
      const bool is_smaller = graph.NumNeighbours(n.node) < graph.NumNeighbours(node) || node < n.node;
      if (is_within && is_smaller) replaceable[n.node] = 1;
    }
    around[node] = 0;
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) around[n.node] = 0;
  }
  return replaceable;
}

class ProgramSolver {
 public:
  // The graph has one component, and one node does not suffice.
  ProgramSolver(const Domination& domination, int known_size, Progress* progress)
      : domination_(domination), known_size_(known_size), progress_(progress), program_(domination.graph()) {
    lp_.messageHandler()->setLogLevel(0);
    lp_.setHintParam(OsiDoReducePrint, true, OsiHintTry);
    AddColumns();
    AddRows();
  }

  // Rounds of cuts at the root.
  void Cut(int max_num_rounds) {
    lp_.initialSolve();
    Note(lp_.getObjValue());
    const int num_fixed_rows = lp_.getNumRows();
    double last_cleanup = lp_.getObjValue();
    for (int round = 1; round <= max_num_rounds && !IsDone(); ++round) {
      if (progress_ && progress_->Cancelled()) return;
      const std::vector<OsiRowCut> rows = FindRows(domination_.graph(), program_, lp_.getColSolution());
      if (rows.empty()) return;
      // Rows that do not bind are dropped once the bound has risen, so that the same point does not
      // occur again.
      if (lp_.getObjValue() > last_cleanup + kRiseBetweenCleanups) {
        DropLooseRows(num_fixed_rows);
        last_cleanup = lp_.getObjValue();
      }
      std::vector<const OsiRowCut*> pointers;
      for (const OsiRowCut& row : rows) pointers.push_back(&row);
      lp_.applyRowCuts(static_cast<int>(pointers.size()), pointers.data());
      lp_.resolve();
      if (!lp_.isProvenOptimal()) return;
      Note(lp_.getObjValue());
    }
  }

  void Branch(int max_num_branches) {
    if (IsDone() || max_num_branches == 0 || (progress_ && progress_->Cancelled()) || !lp_.isProvenOptimal())
      return;
    for (NodeIdx node = 0; node < program_.num_nodes; ++node) lp_.setInteger(node);
    CbcModel model(lp_);
    model.setLogLevel(0);
    model.setMaximumNodes(max_num_branches);
    model.setCutoff(known_size_ - 0.5);
    model.setDblParam(CbcModel::CbcCutoffIncrement, 0.999);
    TreeCutGenerator generator(&domination_.graph(), &program_);
    model.addCutGenerator(&generator, 1, "tree");
    StopWhenCancelled stop(progress_);
    model.passInEventHandler(&stop);
    model.branchAndBound();
    if (model.isProvenInfeasible() || (model.status() == 0 && model.bestSolution() == nullptr)) {
      bound_ = known_size_;
      return;
    }
    Note(std::min(model.getBestPossibleObjValue(), static_cast<double>(known_size_)));
    if (model.bestSolution() == nullptr) return;
    std::vector<NodeIdx> nodes;
    for (NodeIdx node = 0; node < program_.num_nodes; ++node) {
      if (model.bestSolution()[node] > 0.5) nodes.push_back(node);
    }
    const std::vector<char> kept = NodeMarks(program_.num_nodes, nodes);
    if (static_cast<int>(nodes.size()) < known_size_ && domination_.IsConnected(kept) &&
        domination_.Undominated(kept).empty()) {
      smaller_ = std::move(nodes);
    }
  }

  int bound() const { return bound_; }
  const std::vector<NodeIdx>& smaller() const { return smaller_; }

 private:
  void AddColumns() {
    const DominationOptions& options = domination_.options();
    std::vector<char> replaceable(program_.num_nodes, 0);
    if (options.num_dominators == 1 && options.strong_num_inliers == 1) {
      replaceable = FindReplaceable(domination_.graph());
    }
    for (NodeIdx node = 0; node < program_.num_nodes; ++node) {
      lp_.addCol(0, nullptr, nullptr, 0, replaceable[node] ? 0 : 1, 1);
    }
    for (const auto& [from, to] : program_.arcs) {
      const bool is_out = (from >= 0 && replaceable[from]) || replaceable[to];
      lp_.addCol(0, nullptr, nullptr, 0, is_out ? 0 : 1, 0);
    }
  }

  void AddRows() {
    const AppearanceGraph& graph = domination_.graph();
    const int num_nodes = program_.num_nodes;
    std::vector<std::vector<int>> columns(num_nodes);  // arcs into a node
    std::vector<int> roots;
    for (size_t a = 0; a < program_.arcs.size(); ++a) {
      const int column = num_nodes + static_cast<int>(a);
      columns[program_.arcs[a].to].push_back(column);
      if (program_.arcs[a].from < 0) roots.push_back(column);
    }
    const auto add = [&](const std::vector<int>& row, const std::vector<double>& values, double low,
                         double high) {
      lp_.addRow(static_cast<int>(row.size()), row.data(), values.data(), low, high);
    };
    add(roots, std::vector<double>(roots.size(), 1), 1, 1);
    for (NodeIdx node = 0; node < num_nodes; ++node) {
      columns[node].push_back(node);
      std::vector<double> values(columns[node].size(), 1);
      values.back() = -1;
      add(columns[node], values, 0, 0);
      std::vector<int> neighbours;
      std::vector<double> weights;
      for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
        neighbours.push_back(n.node);
        weights.push_back(static_cast<double>(domination_.Weight(n.num_inliers)));
      }
      add(neighbours, std::vector<double>(neighbours.size(), 1), 1, COIN_DBL_MAX);
      neighbours.push_back(node);
      weights.push_back(static_cast<double>(domination_.Demand(node)));
      add(neighbours, weights, static_cast<double>(domination_.Demand(node)), COIN_DBL_MAX);
    }
  }

  void DropLooseRows(int num_fixed_rows) {
    const CoinWarmStartBasis* basis = dynamic_cast<const CoinWarmStartBasis*>(lp_.getPointerToWarmStart());
    std::vector<int> loose;
    for (int row = num_fixed_rows; basis && row < lp_.getNumRows(); ++row) {
      if (basis->getArtifStatus(row) == CoinWarmStartBasis::basic) loose.push_back(row);
    }
    if (!loose.empty()) lp_.deleteRows(static_cast<int>(loose.size()), loose.data());
  }

  void Note(double objective) {
    bound_ = std::max(bound_, static_cast<int>(std::ceil(objective - kTolerance)));
    bound_ = std::min(bound_, known_size_);
  }
  bool IsDone() const { return bound_ >= known_size_; }

  const Domination& domination_;
  const int known_size_;
  Progress* const progress_;
  const TreeColumns program_;
  OsiClpSolverInterface lp_;
  int bound_ = 0;
  std::vector<NodeIdx> smaller_;
};

}  // namespace

ConnectedBound BoundConnectedSet(const Domination& domination, const std::vector<NodeIdx>& kept,
                                 const ConnectedBoundOptions& options, Progress* progress) {
  const AppearanceGraph& graph = domination.graph();
  ConnectedBound result;
  if (options.lower_bound == "none" || kept.empty()) return result;
  result.lower_bound = std::min(CountingBound(graph), static_cast<int>(kept.size()));
  const bool has_program =
      options.lower_bound == "program" ||
      (options.lower_bound == "auto" && graph.num_links() <= options.max_num_program_links);
  if (!has_program || result.lower_bound == static_cast<int>(kept.size())) return result;
  // The program's sets have at least two nodes.
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    if (domination.Undominated(NodeMarks(graph.num_nodes(), {node})).empty()) {
      result.smaller = {node};
      return result;
    }
  }
  ProgramSolver solver(domination, static_cast<int>(kept.size()), progress);
  solver.Cut(options.max_num_cut_rounds);
  solver.Branch(options.max_num_branches);
  result.lower_bound = std::max(result.lower_bound, solver.bound());
  result.smaller = solver.smaller();
  return result;
}

}  // namespace cairn::link_appearance
