#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace cairn {

// Maps without some images of their survey, which try them: what leave-out makes and check reads.  A folder:
//   left_out.txt        a line: in how many runs images are left out, and in how many rounds; or "none: " and
//                       a sentence that says why none is
//   N.cairn, N.txt      of round N, from 0: the map, not sealed, and the images with their poses, as
//   images.txt
struct LeftOutFolder {
  struct Round {
    std::string map_path;
    std::string list_path;
  };
  int num_runs = 0;
  std::vector<Round> rounds;
  std::string why_none;  // empty where there are rounds
};

// The files of a round in such a folder.
LeftOutFolder::Round LeftOutRound(const std::string& folder, size_t round);
// Writes left_out.txt: at the end, when the rounds are written.  A reason is of one line.  Errors: Io.
Status WriteLeftOutSummary(const std::string& folder, int num_runs, size_t num_rounds);
Status WriteNothingLeftOut(const std::string& folder, const std::string& reason);

// Errors: NotFound (no such folder, or another one), Corrupt (left_out.txt).
Result<LeftOutFolder> ReadLeftOutFolder(const std::string& folder);

}  // namespace cairn
