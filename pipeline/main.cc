#include <iostream>

#include "pipeline/commands/commands.h"
#include "pipeline/program/program.h"

int main(int argc, char** argv) {
  return cairn::pipeline::RunProgram(cairn::pipeline::AllCommands(), argc, argv, std::cout, std::cerr);
}
