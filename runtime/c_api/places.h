#pragma once

#include <memory>
#include <optional>

#include "core/base/error.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/named_options.h"
#include "runtime/drive/place_model.h"
#include "runtime/map/map.h"

namespace cairn {

// What stands behind a cairn_place_model.
struct OpenPlaceModel : OfOneThread {
  static constexpr const char* kName = "place model";
  static constexpr const char* kOnePer = "thread";
  std::shared_ptr<const Map> map;
  LookOptions options;
  std::optional<PlaceModel> model;

  // After an error it is as before.
  Status Begin(const LookOptions& given);
};
Handles<cairn_place_model, OpenPlaceModel, HandleKind::kPlaceModel>& OpenPlaceModels();

// Writes as many numbers as there is room for, and says how many there are; the caller's arguments are called
// `what` and `num_what`.  Errors: InvalidArgument.
Status ReturnNumbers(const std::vector<int32_t>& numbers, const char* what, int32_t* to, int32_t capacity,
                     int32_t* num_numbers);

}  // namespace cairn
