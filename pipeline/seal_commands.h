#pragma once

#include "core/command.h"

namespace cairn {

// cairn verify MAP [--public-key KEY.pub] [--name NAME] [--min-epoch N]
Command VerifyCommand();
// cairn keygen KEY
Command KeygenCommand();
// cairn sign MAP --key KEY -o SIGNED [--epoch N | --after PREVIOUS]
Command SignCommand();
// cairn migrate OLD -o NEW
Command MigrateCommand();

}  // namespace cairn
