// The C API's logs (runtime/c_api/cairn.h): what robots bring home.
#include "runtime/c_api/logs.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace cairn {

Handles<cairn_log, OpenLog, HandleKind::kLog>& OpenLogs() {
  static auto* logs = new Handles<cairn_log, OpenLog, HandleKind::kLog>;
  return *logs;
}

Result<std::shared_ptr<SharedLog>> LogFor(const cairn_log* log, const Map& map) {
  if (log == nullptr) return std::shared_ptr<SharedLog>();
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<OpenLog> open, FindObject(OpenLogs(), log));
  CAIRN_RETURN_IF_ERROR(open->log->CheckIsOf(map));
  return open->log;
}

}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_log_open(const cairn_map* map, const char* folder, const cairn_log_options* options,
                       cairn_log** log) {
  if (log != nullptr) *log = nullptr;
  return Call("cairn_log_open", [&]() -> Status {
    if (folder == nullptr || *folder == 0)
      return Misuse("folder is {}", folder == nullptr ? "NULL" : "empty");
    if (log == nullptr) return Misuse("log is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> of, FindMap(map));
    cairn_log_options asked = CAIRN_LOG_OPTIONS_INIT;
    if (options != nullptr) {
      CAIRN_RETURN_IF_ERROR(CheckStruct(options, "options"));
      std::memcpy(&asked, options, std::min(options->size, sizeof(asked)));
    }
    auto open = std::make_shared<OpenLog>();
    CAIRN_ASSIGN_OR_RETURN(open->log, SharedLog::Open(folder, *of, asked.max_mb_per_day));
    *log = OpenLogs().Add(std::move(open));
    return Ok();
  });
}

int32_t cairn_log_num_kept(const cairn_log* log, int64_t* num_kept) {
  if (num_kept != nullptr) *num_kept = 0;
  return Call("cairn_log_num_kept", [&]() -> Status {
    if (num_kept == nullptr) return Misuse("num_kept is NULL");
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<OpenLog> open, FindObject(OpenLogs(), log));
    *num_kept = open->log->num_kept();
    return open->log->error();
  });
}

int32_t cairn_log_close(cairn_log* log) {
  return Call("cairn_log_close", [&]() -> Status {
    if (log == nullptr) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<OpenLog> open, FindObject(OpenLogs(), log));
    open->log->Close();
    return DestroyObject(OpenLogs(), log);
  });
}
