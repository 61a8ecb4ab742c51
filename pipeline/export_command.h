#pragma once

#include "core/command.h"

namespace cairn {

// `cairn export MAP|classes.db -o FOLDER`: a COLMAP model of a map or of a survey's feature classes.
Command ExportCommand();

}  // namespace cairn
