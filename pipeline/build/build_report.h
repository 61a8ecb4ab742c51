#pragma once

#include <optional>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "core/base/error.h"

namespace cairn::pipeline {

// What `cairn compile` knows about its run when it ends.
struct BuildRun {
  std::string build_dir;
  std::string recipe;  // as given
  std::string map;     // as given
  uint64_t seed = 0;
  bool simulated = false, joined = false, reconstructed = false, has_floor_plan = false,
       leaves_out = false;        // whether the line has these stages
  std::set<std::string> footage;  // names in the build folder of what is imported: "film-walk"
  bool whole_line = true;         // false with --until
  std::set<std::string> ran;      // names in the build folder whose rules ran: "features.db"
  double seconds = 0;
  std::optional<Error> error;  // why there is no map
};

// The build report (docs/build_report.md), keys in a fixed order: the reports that the stages left in the
// build folder, in the order of the line, with their options and whether they ran this time.  Errors: Io,
// Corrupt (a stage's report).
Result<nlohmann::ordered_json> MakeBuildReport(const BuildRun& run);

// The same as a table: per stage seconds, peak memory, in -> out, taken over, rejected and why.
std::string BuildReportTable(const nlohmann::ordered_json& report);

}  // namespace cairn::pipeline
