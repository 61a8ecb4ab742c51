#pragma once

#include "core/line/command.h"

namespace cairn::decompose_views {

// cairn plan decompose PLAN -o views.db [--svg FILE]
Command DecomposeViewsCommand();

}  // namespace cairn::decompose_views
