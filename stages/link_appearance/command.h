#pragma once

#include "core/line/command.h"

namespace cairn::link_appearance {

// cairn stage link-appearance MATCHES -o APPEARANCE
Command LinkAppearanceCommand();
// cairn stage check-appearance MATCHES
Command CheckAppearanceCommand();

}  // namespace cairn::link_appearance
