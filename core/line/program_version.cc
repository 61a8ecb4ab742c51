#include "core/line/program_version.h"

namespace cairn {

const char* ProgramVersion() { return CAIRN_VERSION; }

}  // namespace cairn
