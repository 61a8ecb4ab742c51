// The C API's scan locators (runtime/c_api/cairn.h): where one scan was taken.
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/beams/scan_locator.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/named_options.h"
#include "runtime/c_api/plans/plans.h"

namespace cairn {
namespace {

struct OpenScanLocator : OfOneThread {
  static constexpr const char* kName = "scan locator";
  static constexpr const char* kOnePer = "thread";
  std::shared_ptr<const Views> plan;
  ScanSearchOptions options;
  std::optional<ScanLocator> locator;
  std::vector<ScanHypothesis> found;  // of the last scan

  // After an error it is as before.
  Status Begin(const ScanSearchOptions& given) {
    ScanSearchOptions checked = given;
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
    CAIRN_ASSIGN_OR_RETURN(locator, ScanLocator::Make(*plan, given.locator));
    options = given;
    return Ok();
  }
};

Handles<cairn_scan_locator, OpenScanLocator, HandleKind::kScanLocator>& OpenScanLocators() {
  static auto* locators = new Handles<cairn_scan_locator, OpenScanLocator, HandleKind::kScanLocator>;
  return *locators;
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_scan_locator_create(const cairn_plan* plan, cairn_scan_locator** locator) {
  if (locator != nullptr) *locator = nullptr;
  return Call("cairn_scan_locator_create", [&]() -> Status {
    if (locator == nullptr) return Misuse("locator is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenScanLocator>();
    CAIRN_ASSIGN_OR_RETURN(created->plan, FindPlan(plan));
    CAIRN_RETURN_IF_ERROR(created->Begin({}));
    *locator = OpenScanLocators().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_scan_locator_set_option(cairn_scan_locator* locator, const char* name, const char* value) {
  return Call("cairn_scan_locator_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenScanLocator>::Begin(OpenScanLocators(), locator));
    ScanSearchOptions options = used->options;
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value, kScanOptionsHelp));
    return used->Begin(options);
  });
}

int32_t cairn_scan_locator_locate(cairn_scan_locator* locator, const cairn_scan* scan, int32_t* num_places,
                                  int32_t* is_complete) {
  if (num_places != nullptr) *num_places = 0;
  if (is_complete != nullptr) *is_complete = 0;
  return Call("cairn_scan_locator_locate", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenScanLocator>::Begin(OpenScanLocators(), locator));
    used->found.clear();
    if (num_places == nullptr) return Misuse("num_places is NULL");
    CAIRN_ASSIGN_OR_RETURN(const RangeScan given, RangeScanOf(scan));
    CAIRN_ASSIGN_OR_RETURN(LocatedScan located, used->locator->Locate(ViewOf(given, used->options.scan)));
    used->found = std::move(located.hypotheses);
    *num_places = static_cast<int32_t>(used->found.size());
    if (is_complete != nullptr) *is_complete = located.complete ? 1 : 0;
    return Ok();
  });
}

int32_t cairn_scan_locator_place(const cairn_scan_locator* locator, int32_t number, cairn_plan_place* place) {
  return Call("cairn_scan_locator_place", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckStruct(place, "place"));
    Return(cairn_plan_place CAIRN_PLAN_PLACE_INIT, place);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenScanLocator>::Begin(OpenScanLocators(), locator));
    if (number < 0 || number >= static_cast<int32_t>(used->found.size()))
      return Misuse("place {} of {}", number, used->found.size());
    const ScanHypothesis& found = used->found[number];
    cairn_plan_place given =
        PlanPlaceFrom({{found.pose, found.covariance}, found.probability}, found.determined);
    given.explained_ratio = found.explained_ratio;
    Return(given, place);
    return Ok();
  });
}

int32_t cairn_scan_locator_destroy(cairn_scan_locator* locator) {
  return Call("cairn_scan_locator_destroy", [&] { return DestroyObject(OpenScanLocators(), locator); });
}
