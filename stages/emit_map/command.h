#pragma once

#include "core/line/command.h"

namespace cairn::emit_map {

// cairn stage emit-map --classes classes.db --world world.db --regions regions.db
//                      --vocabulary vocabulary.db --name NAME -o unsealed.cairn
Command EmitMapCommand();

}  // namespace cairn::emit_map
