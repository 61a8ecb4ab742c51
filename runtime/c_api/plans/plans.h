#pragma once

#include <memory>

#include "core/base/error.h"
#include "core/plan/views.h"
#include "runtime/belief/pose_belief.h"
#include "runtime/c_api/cairn.h"
#include "runtime/scans/range_scan.h"

// What the C API's scan locators and plan trackers share: plans, scans, places.
namespace cairn {

// Errors: InvalidArgument (NULL, a closed handle).
Result<std::shared_ptr<const Views>> FindPlan(const cairn_plan* handle);

// A copy of the caller's numbers.  Errors: InvalidArgument (a struct or an array that is not there, and
// CheckRangeScan's).
Result<RangeScan> RangeScanOf(const cairn_scan* given);

Result<PossiblePlace> PossiblePlaceOf(const cairn_plan_place* given);
cairn_plan_place PlanPlaceFrom(const PossiblePlace& place, bool determined);

}  // namespace cairn
