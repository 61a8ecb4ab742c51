#pragma once

#include "core/command.h"

namespace cairn {

// cairn link-appearance MATCHES -o APPEARANCE
Command LinkAppearanceCommand();
// cairn check-appearance MATCHES
Command CheckAppearanceCommand();

}  // namespace cairn
