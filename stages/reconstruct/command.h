#pragma once

#include "core/line/command.h"

namespace cairn::reconstruct {

// cairn stage reconstruct matches.db --capture CAPTURE -o poses/
Command ReconstructCommand();

}  // namespace cairn::reconstruct
