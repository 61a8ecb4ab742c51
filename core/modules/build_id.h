#pragma once

#include <link.h>

#include <string>

namespace cairn {

// What tells a loaded library from any other: the linker's hash of its contents, else a hash of its file,
// else its name.
std::string IdOfLibrary(const dl_phdr_info& library);

}  // namespace cairn
