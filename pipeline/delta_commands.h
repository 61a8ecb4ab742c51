#pragma once

#include "core/command.h"

namespace cairn {

// cairn delta OLD NEW -o D [--key KEY]
Command DeltaCommand();
// cairn apply OLD D -o NEW [--public-key KEY.pub]; cairn apply MAP D --in-place
Command ApplyCommand();
// cairn rollback MAP
Command RollbackCommand();

}  // namespace cairn
