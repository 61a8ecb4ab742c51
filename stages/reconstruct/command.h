#pragma once

#include "core/command.h"

namespace cairn {

// cairn reconstruct matches.db --capture CAPTURE -o poses/
Command ReconstructCommand();

}  // namespace cairn
