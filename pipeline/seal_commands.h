#pragma once

#include "core/command.h"

namespace cairn {

// cairn verify MAP [--public-key KEY.pub]
Command VerifyCommand();
// cairn keygen KEY
Command KeygenCommand();
// cairn sign MAP --key KEY -o SIGNED
Command SignCommand();
// cairn migrate OLD -o NEW
Command MigrateCommand();

}  // namespace cairn
