#pragma once

#include "core/command.h"

namespace cairn {

// cairn check-map MAP [--queries QUERIES.txt] [--capture DIR] [--foreign DIR]... [-o SEALED] [--json]
Command CheckMapCommand();

}  // namespace cairn
