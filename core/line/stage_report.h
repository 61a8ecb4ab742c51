#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/capture/capture.h"
#include "core/world/feature_class.h"

namespace cairn {

// What a stage reports about its run besides its result: for the table that ends `cairn compile` and for the
// build report (docs/build_report.md).  No stage reads it, and nothing of it enters a map.
struct StageReport {
  // Numbers of things, each with a plural noun, in the order in which they are shown.
  using Counts = std::vector<std::pair<std::string, int64_t>>;

  // Things left out of the result for one reason.
  struct Rejected {
    std::string what;  // "images", "classes"
    std::string reason;
    int64_t count = 0;
    std::vector<std::string> names;  // names of all of them, or empty where they have no names
  };

  Counts in;          // what the stage was given
  Counts out;         // what it made of it
  Counts taken_over;  // what of it was taken from an earlier result and not computed again
  std::vector<Rejected> rejected;
};

// Adds rejects grouped by reason, in the order of the first of each.  A reason that starts with the thing's
// own name or path ("PATH/NAME: ") is shown without it.
void AddRejects(const std::string& what, const std::vector<Reject>& rejects, StageReport* report);
// The same to be read on a terminal: "rejected NAME: REASON" where a reason has ten or fewer, else
// "rejected 30 images, FIRST to LAST: REASON".  `what`: plural.
std::vector<std::string> RejectLines(const std::string& what, const std::vector<Reject>& rejects);
void AddDropped(const std::string& what, const DropCounts& dropped, StageReport* report);

}  // namespace cairn
