#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/base/error.h"
#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::reconstruct {

// A verdict as an object of reconstruction.json: lengths in the map's unit to a hundred thousandth, long
// lists by column; images and links also by their places in these lists.
nlohmann::ordered_json VerdictJson(const Verdict& verdict);

// Reads it back.  Errors: Corrupt (a key that is missing or of another type, an image or a link that is not
// there), without the file's name.
Result<Verdict> ParseVerdict(const nlohmann::ordered_json& json);

}  // namespace cairn::reconstruct
