#pragma once

#include <cstdint>
#include <vector>

namespace cairn::link_appearance {

// A network with integer capacities, and its minimum cuts between a source and a sink by Dinic's maximum
// flow: exact, and the same for the same network.  Capacities may be changed between cuts.
class CutNetwork {
 public:
  explicit CutNetwork(int num_vertices) : first_edge_(num_vertices, -1) {}

  // Adds an edge with capacities in both directions and returns its number; the reverse edge has the
  // next number.
  int AddEdge(int from, int to, int64_t capacity, int64_t reverse_capacity);
  void SetCapacity(int edge, int64_t capacity) { edges_[edge].capacity = capacity; }
  int64_t Capacity(int edge) const { return edges_[edge].capacity; }

  struct Cut {
    int64_t capacity = 0;
    std::vector<char> is_sink_side;  // per vertex; of several minimum cuts the one with the fewest vertices
  };
  // O(vertices^2 edges) at worst.  `enough`: a flow that reaches it is not increased; the cut then has
  // no sides.
  Cut LeastCut(int source, int sink, int64_t enough);

 private:
  struct Edge {
    int to;
    int next;  // edge of the same start; -1: none
    int64_t capacity;
    int64_t residual;
  };
  bool FindLevels(int source, int sink);
  int64_t Push(int vertex, int sink, int64_t most);
  std::vector<char> ReachesSink(int sink);

  std::vector<Edge> edges_;  // 2 i and 2 i + 1 are each other's reverse
  std::vector<int> first_edge_, next_edge_, levels_, queue_;
};

}  // namespace cairn::link_appearance
