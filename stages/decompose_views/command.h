#pragma once

#include "core/command.h"

namespace cairn {

// cairn decompose-views PLAN -o views.db [--svg FILE]
Command DecomposeViewsCommand();

}  // namespace cairn
