#pragma once

#include "core/command.h"

namespace cairn {

// cairn localize MAP IMAGE... [--list FILE] [-o poses.txt] [--camera MODEL,W,H,P... | --cameras FILE]
// JSON lines on stdout, in the order of the images; IMAGE "-" reads names from stdin, answering one by one.
Command LocalizeCommand();

}  // namespace cairn
