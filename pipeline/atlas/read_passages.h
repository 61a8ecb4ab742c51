#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/atlas/atlas_file.h"
#include "core/base/error.h"
#include "runtime/map/map.h"

namespace cairn::pipeline {

// Lifts, stairs and doors between maps: lines `NAME, MAP/IMAGE, MAP/IMAGE[, COST]`; lines that begin with '#'
// and empty ones are skipped.  `maps`: the atlas's.  Errors:
// NotFound (file, map or image), Io, InvalidArgument (another number of fields, a cost that is none); each
// names the line.
Result<std::vector<AtlasPassage>> ReadPassages(const std::string& path, const AtlasRows& atlas,
                                               const std::vector<std::shared_ptr<const Map>>& maps);

}  // namespace cairn::pipeline
