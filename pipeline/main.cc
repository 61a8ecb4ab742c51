#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>

#include "core/base/error.h"
#include "core/base/no_throw.h"
#include "core/modules/module.h"
#include "pipeline/commands/commands.h"
#include "pipeline/program/program.h"

namespace {

int Run(int argc, char** argv) {
  try {
    return cairn::pipeline::RunProgram(cairn::pipeline::AllCommands(), argc, argv, std::cout, std::cerr);
  } catch (const std::exception& exception) {  // before or after a command, whose own are caught
    if (!cairn::IsOutOfMemory(exception)) throw;
    std::fputs("cairn: out of memory\n", stderr);
    return static_cast<int>(cairn::ErrorCode::kNoMemory);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond `ulimit -f` fails then, and says so
  const int exit_code = Run(argc, argv);
  if (cairn::LoaderIsHeld()) {
    std::cout.flush();
    std::cerr.flush();
    std::_Exit(exit_code);
  }
  return exit_code;
}
