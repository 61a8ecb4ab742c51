#include "runtime/robot_log/shared_log.h"

#include <mutex>
#include <new>
#include <optional>
#include <utility>

#include "core/base/no_throw.h"
#include "core/capture/capture_frame.h"
#include "runtime/localize/localizer.h"
#include "runtime/robot_log/robot_log.h"

namespace cairn {

static_assert(SharedLog::kMaxMbPerDay == RobotLogOptions().max_mb_per_day);

struct SharedLog::State {
  std::string map_name;
  std::string frame;  // as in frame.json
  mutable std::mutex mutex;
  std::optional<RobotLog> log;  // none: closed, or not to be written
  Status error = Ok();
  int num_kept = 0;
};

SharedLog::SharedLog(std::unique_ptr<State> state) : state_(std::move(state)) {}
SharedLog::~SharedLog() = default;

Result<std::shared_ptr<SharedLog>> SharedLog::Open(const std::string& folder, const Map& map,
                                                   double max_mb_per_day) {
  return WithoutExceptions("open a log", [&]() -> Result<std::shared_ptr<SharedLog>> {
    const RobotLogOptions options{.max_mb_per_day = max_mb_per_day};
    CAIRN_ASSIGN_OR_RETURN(RobotLog log, RobotLog::Open(folder, map.head(), options, ReadMachineClocks()));
    auto state = std::make_unique<State>();
    state->map_name = map.head().name;
    state->frame = CaptureFrameJson(map.head().frame);
    state->log.emplace(std::move(log));
    return std::shared_ptr<SharedLog>(new SharedLog(std::move(state)));
  });
}

Status SharedLog::CheckIsOf(const Map& map) const {
  const bool is_same =
      map.head().name == state_->map_name && CaptureFrameJson(map.head().frame) == state_->frame;
  if (is_same) return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "the log is of map '{}', not of '{}' in its frame: open one for each, in a folder of its own",
      state_->map_name, map.head().name);
}

void SharedLog::Offer(const Query& query, const Localization& found) {
  if (!found.has_fix()) return;
  const std::lock_guard lock(state_->mutex);
  if (!state_->log) return;
  const Result<bool> kept = WithoutExceptions("log a frame", [&] {
    return state_->log->Offer({.features = &query.features,
                               .camera = &query.camera,
                               .cam_from_world = found.cam_from_world,
                               .image_path = "frame.pgm"},
                              ReadMachineClocks());
  });
  state_->num_kept = state_->log->num_kept();
  if (kept.ok()) return;
  state_->log.reset();
  try {
    state_->error = kept.error();
  } catch (const std::bad_alloc&) {
    state_->error = Error{ErrorCode::kNoMemory, "out of memory"};  // as long as a string may be without any
  }
}

void SharedLog::Offer(QueryFrame* frame, const Localization& found) {
  const auto query = WithoutExceptions("log a frame", [&]() -> Result<const Query*> {
    return IsWanted(found) ? frame->WithAllFeaturesForLog() : Result<const Query*>(nullptr);
  });
  if (query.ok() && *query != nullptr) Offer(**query, found);
}

bool SharedLog::IsWanted(const Localization& found) {
  if (!found.has_fix()) return false;
  const std::lock_guard lock(state_->mutex);
  return state_->log && state_->log->IsWanted(found.cam_from_world, ReadMachineClocks());
}

Status SharedLog::error() const {
  const std::lock_guard lock(state_->mutex);
  return state_->error;
}

int SharedLog::num_kept() const {
  const std::lock_guard lock(state_->mutex);
  return state_->num_kept;
}

void SharedLog::Close() {
  const std::lock_guard lock(state_->mutex);
  state_->log.reset();
}

}  // namespace cairn
