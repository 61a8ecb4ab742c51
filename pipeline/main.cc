#include <iostream>

#include "pipeline/commands.h"
#include "pipeline/program.h"

int main(int argc, char** argv) {
  return cairn::RunProgram(cairn::AllCommands(), argc, argv, std::cout, std::cerr);
}
