#include "stages/link_appearance/dominating_set/connected_bound.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/link_appearance/dominating_set/counting_bound.h"
#include "stages/link_appearance/dominating_set/linear_program.h"
#include "stages/link_appearance/dominating_set/tree_cuts.h"

namespace cairn::link_appearance {
namespace {

using Row = LinearProgram::Row;

constexpr double kTolerance = 1e-3;  // of cuts, and of what is a whole number
// Cuts of one round, the most violated ones.
constexpr size_t kMaxCutsPerRound = 400;
// Rounds of cuts of each part of the search.
constexpr int kMaxRoundsPerBranch = 10;
// What to give up costs, in sizes of the known set: so much that it is no part of a cheap solution.
constexpr int kGiveUpCost = 100;

// The arcs into S also equal x(S) - y(arcs within S): the row with fewer entries is used.
Row RowOf(const TreeColumns& program, const TreeCut& cut) {
  const std::vector<char> inside = NodeMarks(program.num_nodes, cut.nodes);
  std::vector<int> entering, within;
  for (size_t a = 0; a < program.arcs.size(); ++a) {
    const auto [from, to] = program.arcs[a];
    if (!inside[to]) continue;
    (from >= 0 && inside[from] ? within : entering).push_back(program.num_nodes + static_cast<int>(a));
  }
  Row row;
  if (entering.size() <= within.size() + cut.nodes.size()) {
    row.columns = entering;
    row.values.assign(entering.size(), 1);
    if (cut.reached >= 0) {
      row.columns.push_back(cut.reached);
      row.values.push_back(-1);
    }
  } else {
    row.columns = within;
    row.values.assign(within.size(), -1);
    for (const NodeIdx node : cut.nodes) {
      if (node == cut.reached) continue;
      row.columns.push_back(node);
      row.values.push_back(1);
    }
  }
  row.low = cut.reached < 0 ? 1 : 0;
  return row;
}

// y_uv + y_vu <= x_u: a link is in the tree once, and only with both ends.
void AddLinkRows(const TreeColumns& program, const std::vector<double>& values, std::vector<Row>* rows) {
  for (int a = 0; a < program.num_link_arcs; a += 2) {
    const int column = program.num_nodes + a;
    const double both = values[column] + values[column + 1];
    for (const NodeIdx node : {program.arcs[a].from, program.arcs[a].to}) {
      if (both - values[node] <= kTolerance) continue;
      rows->push_back({.columns = {column, column + 1, node}, .values = {1, 1, -1}, .high = 0});
    }
  }
}

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
    AddColumns();
    AddRows();
  }

  // Rounds of cuts at the root.
  void Cut(int max_num_rounds) {
    is_solved_ = lp_.Solve();
    if (!is_solved_) return;
    AddCuts(max_num_rounds);
    bound_ = BoundOfProgram();
  }

  // Best first: of the parts of all sets, which fix some nodes, the one whose bound is least is divided.
  void Branch(int max_num_branches) {
    if (bound_ >= known_size_ || max_num_branches == 0 || !is_solved_) return;
    std::set<Part> parts{{.bound = bound_}};
    for (int num = 0; num < max_num_branches && !parts.empty() && !IsCancelled(); ++num) {
      Part part = std::move(parts.extract(parts.begin()).value());
      if (part.bound >= known_size_) return Close(known_size_);
      const NodeIdx node = Explore(&part);
      if (part.bound >= known_size_) continue;
      if (node < 0) return Close(part.bound);  // it cannot be divided
      for (const int value : {1, 0}) {
        Part half{.bound = part.bound, .number = ++num_parts_, .fixed = part.fixed};
        half.fixed.emplace_back(node, value);
        parts.insert(std::move(half));
      }
    }
    Close(parts.empty() ? known_size_ : parts.begin()->bound);
  }

  int bound() const { return bound_; }
  const std::vector<NodeIdx>& smaller() const { return smaller_; }

 private:
  // The sets with some nodes in or out.
  struct Part {
    int bound = 0;
    int number = 0;
    std::vector<std::pair<NodeIdx, int>> fixed;
    // Of those that are as good the deepest, which are sets soonest.
    friend bool operator<(const Part& a, const Part& b) {
      const auto key = [](const Part& part) {
        return std::tuple(part.bound, -static_cast<int>(part.fixed.size()), part.number);
      };
      return key(a) < key(b);
    }
  };

  bool IsCancelled() const { return progress_ != nullptr && progress_->Cancelled(); }
  int BoundOfProgram() const { return static_cast<int>(std::min<int64_t>(lp_.bound(), known_size_)); }
  void Close(int bound) { bound_ = std::clamp(bound, bound_, known_size_); }

  void AddColumns() {
    const DominationOptions& options = domination_.options();
    std::vector<char> replaceable(program_.num_nodes, 0);
    if (options.num_dominators == 1 && options.strong_num_inliers == 1) {
      replaceable = FindReplaceable(domination_.graph());
    }
    for (NodeIdx node = 0; node < program_.num_nodes; ++node) {
      tops_.push_back(replaceable[node] ? 0 : 1);
      lp_.AddColumn(1, 0, tops_.back());
    }
    for (const auto& [from, to] : program_.arcs) {
      const bool is_out = (from >= 0 && replaceable[from]) || replaceable[to];
      lp_.AddColumn(0, 0, is_out ? 0 : 1);
    }
    // To give up meets all rows: so that every part has a bound.
    lp_.AddColumn(kGiveUpCost * known_size_, 0, 1);
  }

  void Add(std::vector<Row> rows) {
    for (Row& row : rows) {
      if (row.low.value_or(0) <= 0) continue;
      row.columns.push_back(program_.size());
      row.values.push_back(*row.low);
    }
    lp_.AddRows(rows);
  }

  void AddRows() {
    const AppearanceGraph& graph = domination_.graph();
    const int num_nodes = program_.num_nodes;
    std::vector<std::vector<int>> columns(num_nodes);  // arcs into a node
    Row root{.low = 1, .high = 1};
    for (size_t a = 0; a < program_.arcs.size(); ++a) {
      const int column = num_nodes + static_cast<int>(a);
      columns[program_.arcs[a].to].push_back(column);
      if (program_.arcs[a].from < 0) root.columns.push_back(column);
    }
    root.values.assign(root.columns.size(), 1);
    std::vector<Row> rows{root};
    for (NodeIdx node = 0; node < num_nodes; ++node) {
      Row entered{.columns = columns[node], .low = 0, .high = 0};
      entered.values.assign(entered.columns.size(), 1);
      entered.columns.push_back(node);
      entered.values.push_back(-1);
      Row reached{.low = 1}, demand{.low = static_cast<int>(domination_.Demand(node))};
      for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
        reached.columns.push_back(n.node);
        demand.values.push_back(static_cast<int>(domination_.Weight(n.num_inliers)));
      }
      reached.values.assign(reached.columns.size(), 1);
      demand.columns = reached.columns;
      demand.columns.push_back(node);
      demand.values.push_back(*demand.low);
      rows.insert(rows.end(), {entered, reached, demand});
    }
    Add(std::move(rows));
    num_fixed_rows_ = lp_.num_rows();
  }

  // Until no row is violated, or the bound is good enough.
  void AddCuts(int max_num_rounds) {
    for (int round = 0; round < max_num_rounds && BoundOfProgram() < known_size_ && !IsCancelled(); ++round) {
      std::vector<Row> rows = FindRows();
      if (rows.empty()) return;
      // Rows that do not bind are dropped once the bound has risen, so that the same point does not
      // occur again.
      if (lp_.bound() > cleanup_bound_) {
        lp_.DropLooseRows(num_fixed_rows_);
        cleanup_bound_ = lp_.bound();
      }
      Add(std::move(rows));
      is_solved_ = lp_.Solve();
      if (!is_solved_) return;
    }
  }

  std::vector<Row> FindRows() const {
    std::vector<Row> rows;
    AddLinkRows(program_, lp_.values(), &rows);
    std::vector<TreeCut> cuts =
        FindTreeCuts(domination_.graph(), program_, lp_.values().data(), 10 * kTolerance);
    std::stable_sort(cuts.begin(), cuts.end(),
                     [](const TreeCut& a, const TreeCut& b) { return a.violation > b.violation; });
    if (cuts.size() > kMaxCutsPerRound) cuts.resize(kMaxCutsPerRound);
    for (const TreeCut& cut : cuts) rows.push_back(RowOf(program_, cut));
    return rows;
  }

  // Raises the bound of a part by its program, and takes the set that this may be.  The node by which it is
  // divided; -1: there is none.
  NodeIdx Explore(Part* part) {
    for (NodeIdx node = 0; node < program_.num_nodes; ++node) lp_.SetRange(node, 0, tops_[node]);
    for (const auto& [node, value] : part->fixed) lp_.SetRange(node, value, value);
    cleanup_bound_ = 0;
    is_solved_ = lp_.Solve();
    if (is_solved_) AddCuts(kMaxRoundsPerBranch);
    if (!is_solved_) return -1;
    part->bound = std::max(part->bound, BoundOfProgram());
    if (part->bound >= known_size_) return -1;
    NodeIdx most_open = -1;
    double least = 0.5 - kTolerance;
    std::vector<NodeIdx> nodes;
    for (NodeIdx node = 0; node < program_.num_nodes; ++node) {
      const double value = lp_.values()[node];
      if (value > 0.5) nodes.push_back(node);
      if (std::abs(value - 0.5) < least) {
        least = std::abs(value - 0.5);
        most_open = node;
      }
    }
    TakeSet(std::move(nodes));
    if (part->bound >= known_size_) most_open = -1;
    return most_open;
  }

  void TakeSet(std::vector<NodeIdx> nodes) {
    const std::vector<char> kept = NodeMarks(program_.num_nodes, nodes);
    if (static_cast<int>(nodes.size()) >= known_size_ || !domination_.IsConnected(kept) ||
        !domination_.Undominated(kept).empty())
      return;
    known_size_ = static_cast<int>(nodes.size());
    smaller_ = std::move(nodes);
  }

  const Domination& domination_;
  int known_size_;
  Progress* const progress_;
  const TreeColumns program_;
  LinearProgram lp_;
  std::vector<int> tops_;  // of nodes
  int num_fixed_rows_ = 0;
  int64_t cleanup_bound_ = 0;  // of the program when loose rows were dropped last
  bool is_solved_ = false;
  int num_parts_ = 0;
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
