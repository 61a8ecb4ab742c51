#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/line/stage_report.h"
#include "pipeline/build/folder_lock.h"

namespace cairn::pipeline {

// A failing stage leaves {code, name, stage, message} in this file of its build folder: make turns every exit
// code into 2, so `cairn compile` reads the code of the failed stage from the file.
inline constexpr const char* kErrorFile = "/error.json";

// The run of one rule of map.mk: `cairn STAGE ... --stamp BUILD/X.stamp`.  Holds the build folder and, when
// the stage has succeeded, leaves the stamp with the date at which it began: inputs that change meanwhile
// are newer.
class BuildStep {
 public:
  // Errors: Busy (another build uses the folder), Io, InvalidArgument (`stamp` does not end in .stamp).
  static Result<BuildStep> Begin(const std::string& stamp);
  BuildStep(BuildStep&& other) noexcept;
  BuildStep& operator=(BuildStep&&) = delete;
  ~BuildStep();  // leaves no stamp unless End was called

  // "BUILD/X.report.json": where the step's report goes.
  std::string ReportPath() const;
  Status End();

 private:
  BuildStep(FolderLock lock, std::string stamp, std::string temporary);
  FolderLock lock_;
  std::string stamp_;
  std::string temporary_;  // empty once it is in place
};

// What a process has done: a stage's report, and the time and threads that it took.
struct StageRun {
  std::string stage;  // "match_features"
  double seconds = 0;
  int num_threads = 0;
  int64_t memory_mib = 0;
  uint64_t seed = 0;
  std::string printed;  // on standard output
  const StageReport* report = nullptr;
};

// The report of one stage (docs/build_report.md), with this process's times and peak memory until now and
// those of the programs that it started.
nlohmann::ordered_json StageRunJson(const StageRun& run);

// Leaves error.json in a build folder.  Where the disk is full, an existing file is overwritten in place:
// `cairn compile` makes one in advance to reserve its space.
Status WriteErrorFile(const std::string& build_dir, const std::string& stage, const Error& error);
Status ReserveErrorFile(const std::string& build_dir);

// What a failed stage left, or nothing.
struct StageFailure {
  ErrorCode code = ErrorCode::kFailed;
  std::string stage, message;
};
std::optional<StageFailure> ReadErrorFile(const std::string& build_dir);

}  // namespace cairn::pipeline
