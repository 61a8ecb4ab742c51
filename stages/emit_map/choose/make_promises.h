#pragma once

#include <cstddef>
#include <vector>

#include "core/blocks/map_findings.h"
#include "core/promise/expected_matches.h"
#include "core/promise/landmark_order.h"
#include "core/promise/landmark_sights.h"
#include "core/promise/promise_model.h"
#include "core/promise/promise_nodes.h"
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

// Makes promises about maps of a survey: at every node, with which probability a robot is localized.
class PromiseMaker {
 public:
  // `classes` must outlive it.
  PromiseMaker(const Classes& classes, int num_threads);

  // Of the classes at these positions.
  LandmarkOrder Order(std::vector<size_t> pool) const;

  // Per class, whether it is one of `first` or is needed besides: the fewest more with which the promise is
  // kept at every node where all classes together would keep it; elsewhere nearly all that helps. `fared`:
  // how left-out images fared in maps of parts of the survey.
  std::vector<char> Complete(const std::vector<size_t>& first, const std::vector<PromiseTrial>& fared,
                             const PromiseOptions& options) const;

  // What a map with these landmarks promises.
  Promises Promise(const std::vector<char>& keep, const std::vector<PromiseTrial>& fared,
                   const PromiseOptions& options) const;

 private:
  const Classes& classes_;
  int num_threads_;
  MatchModel model_;
  LandmarkSights sights_;
  std::vector<PromiseNode> nodes_;
  std::vector<std::vector<ClassMatch>> of_node_;
  std::vector<std::vector<ExpectedMatch>> of_class_;  // `view`: the node
};

}  // namespace cairn::emit_map
