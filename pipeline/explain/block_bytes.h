#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/blocks/map_blocks.h"

namespace cairn::pipeline {

// Bytes of the blocks of each kind, by its name.
std::map<std::string, int64_t> BytesPerBlockKind(const MapDirectory& directory);

}  // namespace cairn::pipeline
