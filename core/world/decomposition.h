#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"

namespace cairn {

// A region [Sala06 Def. 3.4]: connected stations that all see each of `features`.
struct Region {
  std::vector<FeatureIdx> features;  // ascending; at least k
  std::vector<StationIdx> stations;  // ascending; the tau-grown region
};

// The result of decompose_regions.  Regions may overlap; ids are indices into the world it was made from.
struct Decomposition {
  std::string algorithm;  // "a1" ... "best"
  int k = 0;
  int tau = 0;
  int rho = 0;
  uint64_t seed = 0;
  // Certified least number of regions of any decomposition that leaves at most `uncovered_limit` coverable
  // stations uncovered; nothing where no bound was computed.
  std::optional<int> lower_bound;
  int uncovered_limit = 0;
  std::vector<Region> regions;
  std::vector<StationIdx> uncovered;  // coverable stations whose neighbourhood no region contains, ascending
};

// "9 regions, at least 8 are needed"; "9 regions" where no bound is known.
std::string NumRegionsText(size_t num_regions, std::optional<int> lower_bound);

// Decomposition JSON (docs: schemas/regions.md).
Result<Decomposition> ReadDecompositionJson(const std::string& path);
Status WriteDecompositionJson(const Decomposition& decomposition, const std::string& path);
// regions.db (schemas/regions.sql).
Result<Decomposition> ReadDecompositionDatabase(const std::string& path);
Status WriteDecompositionDatabase(const Decomposition& decomposition, const std::string& path);
Result<Decomposition> ReadDecomposition(const std::string& path);  // by its first bytes
Status WriteDecomposition(const Decomposition& decomposition,
                          const std::string& path);  // .json or database by suffix

}  // namespace cairn
