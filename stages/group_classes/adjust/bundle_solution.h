#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/base/content_hash.h"
#include "stages/group_classes/adjust/bundle.h"

namespace cairn::group_classes {

// How a solver ended.
struct BundleOutcome {
  bool has_converged = false;
  bool was_stopped = false;  // cancelled; never kept
  int num_steps = 0;
  double trust_region_radius = 0;
};

// Of all that a solution depends on, to the last bit.
ContentHash HashBundle(const BundleOptions& options, const BundleProblem& problem, bool with_evidence);

// What a solution changes of a problem, and what it says of it; `evidence` may be null.
std::string WriteSolution(const BundleProblem& problem, const BundleOutcome& outcome,
                          const BundleEvidence* evidence);

// Puts it into the problem that it is a solution of.  Nothing, and the problem as it was, where the bytes are
// of another one.
std::optional<BundleOutcome> ReadSolution(std::string_view bytes, BundleProblem* problem,
                                          BundleEvidence* evidence);

}  // namespace cairn::group_classes
