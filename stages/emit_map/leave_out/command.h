#pragma once

#include "core/line/command.h"

namespace cairn::emit_map {

// cairn stage leave-out UNSEALED --matches M --classes C --world W --regions R --vocabulary V
//     [--appearance A] -o FOLDER
Command LeaveOutCommand();

}  // namespace cairn::emit_map
