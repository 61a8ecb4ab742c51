#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/blocks/map_findings.h"
#include "core/blocks/map_rows.h"
#include "core/promise/promise_model.h"
#include "stages/check_map/check_map.h"

namespace cairn::check_map {

// What was promised to held-out images with a true pose, and whether it was kept: the promise of the node
// whose view is nearest, as far as it reaches; images beyond have none.  Kept: localized within the terms'
// limits, by as many inliers.  O(images nodes).  REQUIRES: rows.findings.promise
std::vector<PromiseOutcome> PromiseOutcomes(const MapRows& rows, const std::vector<HeldOutResult>& images);

// num_promised: images to which the map promises what its terms say, with their probability or more;
// num_promised_kept, promised_kept_ratio (where there are any); num_beyond_promises: images that no node
// answers for.
void AddPromiseFigures(const MapRows& rows, const std::vector<HeldOutResult>& images,
                       std::map<std::string, double>* figures);

// Why a node does not keep the promise, for people; empty where it does.
std::string WhyNotPromised(const NodePromise& node, const MapPromise& promise);

// For people: the terms, how many nodes keep them, and the calibration curves.
std::string PromiseText(const MapPromise& promise, const std::string& unit);

}  // namespace cairn::check_map
