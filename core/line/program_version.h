#pragma once

namespace cairn {

// "0.1.0": the version of the program.
const char* ProgramVersion();

}  // namespace cairn
