#include "stages/link_appearance/dominating_set/minimum_cut.h"

#include <algorithm>

namespace cairn::link_appearance {

int CutNetwork::AddEdge(int from, int to, int64_t capacity, int64_t reverse_capacity) {
  const int edge = static_cast<int>(edges_.size());
  edges_.push_back({to, first_edge_[from], capacity, 0});
  first_edge_[from] = edge;
  edges_.push_back({from, first_edge_[to], reverse_capacity, 0});
  first_edge_[to] = edge + 1;
  return edge;
}

bool CutNetwork::FindLevels(int source, int sink) {
  levels_.assign(first_edge_.size(), -1);
  levels_[source] = 0;
  queue_ = {source};
  for (size_t i = 0; i < queue_.size() && levels_[sink] < 0; ++i) {
    for (int e = first_edge_[queue_[i]]; e >= 0; e = edges_[e].next) {
      if (edges_[e].residual == 0 || levels_[edges_[e].to] >= 0) continue;
      levels_[edges_[e].to] = levels_[queue_[i]] + 1;
      queue_.push_back(edges_[e].to);
    }
  }
  return levels_[sink] >= 0;
}

int64_t CutNetwork::Push(int vertex, int sink, int64_t most) {
  if (vertex == sink) return most;
  int64_t pushed = 0;
  for (int& e = next_edge_[vertex]; e >= 0; e = edges_[e].next) {
    if (edges_[e].residual > 0 && levels_[edges_[e].to] == levels_[vertex] + 1) {
      const int64_t part = Push(edges_[e].to, sink, std::min(most - pushed, edges_[e].residual));
      edges_[e].residual -= part;
      edges_[e ^ 1].residual += part;
      pushed += part;
      if (pushed == most) return pushed;
    }
  }
  return pushed;
}

std::vector<char> CutNetwork::ReachesSink(int sink) {
  std::vector<char> reaches(first_edge_.size(), 0);
  reaches[sink] = 1;
  queue_ = {sink};
  for (size_t i = 0; i < queue_.size(); ++i) {
    for (int e = first_edge_[queue_[i]]; e >= 0; e = edges_[e].next) {
      if (edges_[e ^ 1].residual == 0 || reaches[edges_[e].to]) continue;
      reaches[edges_[e].to] = 1;
      queue_.push_back(edges_[e].to);
    }
  }
  return reaches;
}

CutNetwork::Cut CutNetwork::LeastCut(int source, int sink, int64_t enough) {
  for (Edge& edge : edges_) edge.residual = edge.capacity;
  Cut cut;
  while (cut.capacity < enough && FindLevels(source, sink)) {
    next_edge_ = first_edge_;
    cut.capacity += Push(source, sink, enough - cut.capacity);
  }
  if (cut.capacity < enough) cut.is_sink_side = ReachesSink(sink);
  return cut;
}

}  // namespace cairn::link_appearance
