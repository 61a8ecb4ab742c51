#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/line/stage_report.h"
#include "pipeline/build/folder_lock.h"

namespace cairn::pipeline {

// A failing stage leaves {code, name, stage, message} there, in its build folder: make flattens exit codes to
// 2, so `cairn compile` reads the failed stage's from it.
inline constexpr const char* kErrorFile = "/error.json";

// One rule of map.mk at work: `cairn STAGE ... --stamp BUILD/X.stamp`.  Holds the build folder and, when the
// stage has succeeded, leaves the stamp with the date at which it began: inputs that change meanwhile are
// newer.
class BuildStep {
 public:
  // Errors: Busy (another build is at work there), Io, InvalidArgument (`stamp` does not end in .stamp).
  static Result<BuildStep> Begin(const std::string& stamp);
  BuildStep(BuildStep&& other) noexcept;
  BuildStep& operator=(BuildStep&&) = delete;
  ~BuildStep();  // without the stamp, if End has not left it

  // "BUILD/X.report.json": where the step's report goes.
  std::string ReportPath() const;
  Status End();

 private:
  BuildStep(FolderLock lock, std::string stamp, std::string temporary);
  FolderLock lock_;
  std::string stamp_;
  std::string temporary_;  // empty once it is in place
};

// What a process has done: a stage's report and what it took.
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

// Leaves error.json in a build folder.  Where the disk is full, a file that is there already is written over
// in place: `cairn compile` keeps room in one.
Status WriteErrorFile(const std::string& build_dir, const std::string& stage, const Error& error);
Status ReserveErrorFile(const std::string& build_dir);

// What a failed stage left, or nothing.
struct StageFailure {
  ErrorCode code = ErrorCode::kFailed;
  std::string stage, message;
};
std::optional<StageFailure> ReadErrorFile(const std::string& build_dir);

}  // namespace cairn::pipeline
