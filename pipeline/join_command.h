#pragma once

#include "core/command.h"

namespace cairn {

// `cairn join-captures NAME=FOLDER... -o FOLDER`: several surveys as one capture.
Command JoinCapturesCommand();

}  // namespace cairn
