#pragma once

#include "core/line/command.h"

namespace cairn::check_map {

// cairn check MAP [--queries QUERIES.txt] [--capture DIR] [--foreign DIR]... [-o SEALED] [--json]
Command CheckMapCommand();

}  // namespace cairn::check_map
