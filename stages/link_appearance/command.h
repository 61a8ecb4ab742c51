#pragma once

#include "core/line/command.h"

namespace cairn::link_appearance {

// cairn link-appearance MATCHES -o APPEARANCE
Command LinkAppearanceCommand();
// cairn check-appearance MATCHES
Command CheckAppearanceCommand();

}  // namespace cairn::link_appearance
