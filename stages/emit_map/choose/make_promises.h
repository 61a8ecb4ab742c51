#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "core/blocks/map_findings.h"
#include "core/promise/expected_matches.h"
#include "core/promise/landmark_order.h"
#include "core/promise/landmark_sights.h"
#include "core/promise/promise_model.h"
#include "core/promise/promise_nodes.h"
#include "core/promise/promise_regions.h"
#include "core/world/feature_class.h"

namespace cairn::emit_map {

struct PromiseOptions {
  PromiseTerms terms;
  size_t max_region_landmarks = 500;  // REQUIRES: > 0
};

// What a map promises, and the regions whose landmarks alone keep it.
struct Promises {
  struct Region {
    // Positions in Classes::images, ascending: those of its nodes, and those nearest to one of them.
    std::vector<size_t> images;
    std::vector<size_t> classes;  // positions, ascending
  };
  MapPromise findings;
  std::vector<Region> regions;  // in the order of findings.nodes[...].region
  int regions_lower_bound = 0;
};

// What promises are made by, and how those that were made by it fared.
struct PromiseBasis {
  PromiseModel model;
  std::vector<PromiseBin> left_out;
};

// What a node is to expect at least, where more is known of it than the promise.
struct NodeDemand {
  double least_matches = 0;  // where all classes together give as many
  double needed_ratio = 1;   // of what the promise takes
};

// Divides the nodes into regions; nothing: this is left to DivideNodes (core/promise/promise_regions.h).
using DivideLike = std::function<std::optional<PromiseRegions>(
    const std::vector<PromiseNode>& nodes, const CoverProblem& problem, int64_t cover_bound)>;

// Of the classes at these positions, `first` before the others.
LandmarkOrder OrderOf(const Classes& classes, const MatchModel& model, std::vector<size_t> pool,
                      std::vector<size_t> first, int num_threads);

// Makes promises about maps of a survey: at every node, with which probability a robot is localized.
class PromiseMaker {
 public:
  // `classes` must outlive it; `model`, learnt from them, need not.
  PromiseMaker(const Classes& classes, const MatchModel& model, int num_threads);

  // `fared`: how left-out images fared in maps of parts of the survey.
  static PromiseBasis BasisOf(const std::vector<PromiseTrial>& fared, const PromiseOptions& options);

  // Per class, whether it is one of `first` or is needed besides: the fewest more with which the promise is
  // kept at every node where all classes together would keep it; elsewhere nearly all that helps.
  // `demands`: per node; empty: what the promise takes.
  std::vector<char> Complete(const std::vector<size_t>& first, const PromiseModel& model,
                             const PromiseOptions& options,
                             const std::vector<NodeDemand>& demands = {}) const;

  // What a map with these landmarks promises.
  Promises Promise(const std::vector<char>& keep, const PromiseBasis& basis, const PromiseOptions& options,
                   const DivideLike& divide = nullptr) const;

  const std::vector<PromiseNode>& nodes() const { return nodes_; }

 private:
  const Classes& classes_;
  int num_threads_;
  ViewDistance distance_;
  LandmarkSights sights_;
  std::vector<PromiseNode> nodes_;
  std::vector<std::vector<ClassMatch>> of_node_;
  std::vector<std::vector<ExpectedMatch>> of_class_;  // `view`: the node
};

}  // namespace cairn::emit_map
