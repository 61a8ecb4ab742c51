#pragma once

#include "core/command.h"

namespace cairn {

// cairn delta OLD NEW -o D [--key KEY] [--allow-older]
Command DeltaCommand();
// cairn apply OLD D -o NEW [--public-key KEY.pub] [--name NAME] [--min-epoch N] [--allow-older]
// cairn apply MAP D --in-place, likewise
Command ApplyCommand();
// cairn rollback MAP [--public-key KEY.pub] [--name NAME] [--min-epoch N]
Command RollbackCommand();

}  // namespace cairn
