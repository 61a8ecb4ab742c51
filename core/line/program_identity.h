#pragma once

#include <string>

namespace cairn {

// A hash of what determines the results of this process besides its inputs: the executable, the libraries
// that it is linked with (their build ids), OpenCV's version, and the instruction sets that OpenCV and the
// matcher use here.  Processes of one identity give the same bytes, but for image files: what decodes them is
// loaded later (ImageCodecsIdentity).  Empty when the executable
// cannot be read.
const std::string& ProgramIdentity();

}  // namespace cairn
