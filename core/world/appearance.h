#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/world/appearance_graph.h"

namespace cairn {

// Entropies and scores are stored as integers.
inline int64_t Thousandths(double value) { return std::llround(value * 1000); }
inline double OfThousandths(int64_t thousandths) { return static_cast<double>(thousandths) / 1000; }
// Larger than that of any distribution over places, nats.
inline constexpr double kMaxEntropy = 64;

// Why a node is kept, or not.
enum class NodeRole : int {
  kDropped = 0,
  kDominating = 1,
  kRestored = 2,  // for a cycle
};

struct AppearanceNode {
  std::vector<ImageId> images;  // ascending
  int component = 0;
  NodeRole role = NodeRole::kDropped;
  // How many places it could be mistaken for: the entropy of its look-alikes' distribution, nats, in
  // thousandths [Mariottini11 eq. 1]; none: not computed.
  std::optional<double> entropy;
  friend bool operator==(const AppearanceNode&, const AppearanceNode&) = default;
};

// Two nodes that look alike and lie apart, node1 < node2.
struct ConfusablePair {
  NodeIdx node1 = 0;
  NodeIdx node2 = 0;
  double score = 0;  // of one node as a query for the other, in (0, 1], in thousandths
  friend bool operator==(const ConfusablePair&, const ConfusablePair&) = default;
};

// Content of appearance.db.
struct Appearance {
  std::vector<AppearanceNode> nodes;
  AppearanceGraph graph;
  // Per component: every connected set that meets its nodes' demands has at least this many nodes; 0:
  // not computed.
  std::vector<int> lower_bounds;
  std::vector<ConfusablePair> confusable;  // ascending
  int num_dominators = 1;
  int strong_num_inliers = 1;
  int max_detour_links = 0;

  std::vector<NodeIdx> Kept() const;        // ascending
  std::vector<ImageId> KeptImages() const;  // ascending
  int NumComponents() const { return static_cast<int>(lower_bounds.size()); }
  int LowerBound() const;  // of all components; 0: not computed for some
};

// appearance.db (schemas/appearance.sql).
Status WriteAppearance(const Appearance& appearance, const std::string& path);
// Errors: as OpenDatabaseReadOnly; Corrupt (another file, or rows that do not fit together; says which),
// Unsupported (a version that this program does not read).
Result<Appearance> ReadAppearance(const std::string& path);

}  // namespace cairn
