#pragma once

#include "core/command.h"

namespace cairn {

// cairn emit-map --classes classes.db --world world.db --regions regions.db --vocabulary vocabulary.db --name
// NAME
//                -o unsealed.cairn
Command EmitMapCommand();

}  // namespace cairn
