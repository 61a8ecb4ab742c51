#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn {

// A part of the program that is loaded when it is needed, lib/cairn/NAME.so: it links libraries that are slow
// to load or that not everybody has (cmake/cairn_module.cmake).  It exports one struct, whose first member is
// the version of its build, a const char*: one build makes both, and values of C++ pass between them.
struct ModuleWanted {
  const char* symbol;   // the struct's name
  const char* version;  // CAIRN_MODULE_VERSION of its loader: the release, and a hash of the module's sources
                        // and of what compiled them ("0.1.0-91c37a5d3b0f6a24")
  std::string needs;    // of messages: "FFmpeg's libraries"
  std::string packages;  // Debian's, that have them
};

// Loads a module and its libraries, for as long as the program runs; again: the same.  Returns its struct.
// REQUIRES: `path` is absolute, and so looked for nowhere else.  Errors: NotFound (libraries that it needs),
// Unsupported (no module, or one of another build).  Throws std::bad_alloc where memory is too short for it.
Result<const void*> LoadModule(const std::string& path, const ModuleWanted& wanted);

// Whether a constructor of a module's library has thrown std::bad_alloc through LoadModule.  The thread that
// loaded it holds the lock of the C library's loader then, though it has ended: the process has to end by
// std::_Exit, since std::exit would wait for that lock.
bool LoaderIsHeld();

// The same, of lib/cairn/NAME.so of this program.  Errors: also NotFound (no such file), Failed.
Result<const void*> LoadModuleOfProgram(const std::string& name, const ModuleWanted& wanted);

}  // namespace cairn
