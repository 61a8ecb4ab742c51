#pragma once

#include "core/command.h"

namespace cairn {

// `cairn import SOURCE -o CAPTURE`: a public data set's layout, or a COLMAP model, as a capture.
Command ImportCommand();

}  // namespace cairn
