#pragma once

#include "core/line/command.h"

namespace cairn::decompose_views {

// cairn decompose-views PLAN -o views.db [--svg FILE]
Command DecomposeViewsCommand();

}  // namespace cairn::decompose_views
