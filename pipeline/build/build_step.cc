#include "pipeline/build/build_step.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "core/base/parallel.h"
#include "core/files/file.h"
#include "core/files/temporary.h"
#include "core/line/program_version.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::string_view kStampSuffix = ".stamp";
constexpr size_t kErrorFileRoom = 4096;  // bytes

std::string Text(const Json& document) {
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Json CountsJson(const StageReport::Counts& counts) {
  Json json = Json::object();
  for (const auto& [what, count] : counts) json[what] = count;
  return json;
}

Json RejectedJson(const std::vector<StageReport::Rejected>& rejected) {
  Json json = Json::array();
  for (const StageReport::Rejected& group : rejected) {
    json.push_back({{"what", group.what}, {"reason", group.reason}, {"count", group.count}});
    if (!group.names.empty()) json.back()["names"] = group.names;
  }
  return json;
}

double Seconds(const timeval& time) { return static_cast<double>(time.tv_sec) + 1e-6 * time.tv_usec; }
double Milliseconds(double seconds) { return std::round(seconds * 1000) / 1000; }

// Writes over the first bytes of an existing file, which needs no new space on the disk.
bool WriteInPlace(const std::string& path, const std::string& text) {
  const int fd = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool is_written = pwrite(fd, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()) &&
                          ftruncate(fd, static_cast<off_t>(text.size())) == 0;
  close(fd);
  return is_written;
}

}  // namespace

Result<BuildStep> BuildStep::Begin(const std::string& stamp) {
  if (!stamp.ends_with(kStampSuffix)) {
    return MakeError(ErrorCode::kInvalidArgument, "--stamp {}: expected a name that ends in {}", stamp,
                     kStampSuffix);
  }
  const std::string folder = fs::absolute(stamp).parent_path().string();
  CAIRN_ASSIGN_OR_RETURN(FolderLock lock, FolderLock::Acquire(folder, BuildSession()));
  CAIRN_ASSIGN_OR_RETURN(const TemporaryFile temporary, CreateTemporary(stamp, 0666));
  close(temporary.descriptor);
  return BuildStep(std::move(lock), stamp, temporary.path);
}

BuildStep::BuildStep(FolderLock lock, std::string stamp, std::string temporary)
    : lock_(std::move(lock)), stamp_(std::move(stamp)), temporary_(std::move(temporary)) {}

BuildStep::BuildStep(BuildStep&& other) noexcept
    : lock_(std::move(other.lock_)),
      stamp_(std::move(other.stamp_)),
      temporary_(std::exchange(other.temporary_, "")) {}

BuildStep::~BuildStep() {
  if (!temporary_.empty()) std::remove(temporary_.c_str());
}

std::string BuildStep::ReportPath() const {
  return stamp_.substr(0, stamp_.size() - kStampSuffix.size()) + kReportSuffix;
}

Status BuildStep::End() {
  if (std::rename(temporary_.c_str(), stamp_.c_str()) != 0)
    return MakeError(ErrorCode::kIo, "{}: cannot be written: {}", stamp_, std::strerror(errno));
  temporary_.clear();
  return Ok();
}

Json StageRunJson(const StageRun& run) {
  rusage self = {}, children = {};
  getrusage(RUSAGE_SELF, &self);
  getrusage(RUSAGE_CHILDREN, &children);
  return {
      {"stage", run.stage},
      {"program", std::string("cairn ") + ProgramVersion()},
      {"seconds", Milliseconds(run.seconds)},
      {"user_seconds", Milliseconds(Seconds(self.ru_utime) + Seconds(children.ru_utime))},
      {"system_seconds", Milliseconds(Seconds(self.ru_stime) + Seconds(children.ru_stime))},
      {"peak_memory_bytes", int64_t{1024} * std::max(self.ru_maxrss, children.ru_maxrss)},
      {"threads", NumThreads(run.num_threads)},
      {"memory_limit_mib", run.memory_mib},
      {"seed", run.seed},
      {"in", CountsJson(run.report->in)},
      {"out", CountsJson(run.report->out)},
      {"taken_over", CountsJson(run.report->taken_over)},
      {"rejected", RejectedJson(run.report->rejected)},
      {"printed", run.printed},
  };
}

Status WriteErrorFile(const std::string& build_dir, const std::string& stage, const Error& error) {
  const std::string text = Text({{"code", static_cast<int>(error.code)},
                                 {"name", ErrorCodeName(error.code)},
                                 {"stage", stage},
                                 {"message", error.message}});
  const Status status = WriteFileAtomically(build_dir + kErrorFile, text);
  return status.ok() || WriteInPlace(build_dir + kErrorFile, text) ? Ok() : status;
}

Status ReserveErrorFile(const std::string& build_dir) {
  return WriteFileAtomically(build_dir + kErrorFile, std::string(kErrorFileRoom - 1, ' ') + "\n");
}

std::optional<StageFailure> ReadErrorFile(const std::string& build_dir) {
  const auto text = ReadFile(build_dir + kErrorFile);
  const auto document = nlohmann::json::parse(text.ok() ? text.value() : "", nullptr, false);
  if (document.is_discarded() || !document.contains("code") || !document.contains("stage"))
    return std::nullopt;
  return StageFailure{static_cast<ErrorCode>(document["code"].get<int>()),
                      document["stage"].get<std::string>(), document.value("message", "")};
}

}  // namespace cairn::pipeline
