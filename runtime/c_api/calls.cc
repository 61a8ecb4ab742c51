#include "runtime/c_api/calls.h"

#include "core/options/find_option.h"
#include "runtime/map/map.h"

namespace cairn {

std::string& LastError() {
  thread_local std::string message;
  return message;
}

Status SetOptionByName(const OptionTable& table, const char* name, const char* value, const char* help) {
  if (name == nullptr || value == nullptr) return Misuse("{} is NULL", name == nullptr ? "name" : "value");
  CAIRN_ASSIGN_OR_RETURN(const Option* const option, FindOption(table, name, help));
  return SetOption(*option, value);
}

Handles<cairn_map, const Map, HandleKind::kMap>& OpenMaps() {
  // Outlives what other libraries do at exit.
  static auto* maps = new Handles<cairn_map, const Map, HandleKind::kMap>;
  return *maps;
}

Result<std::shared_ptr<const Map>> FindMap(const cairn_map* handle) {
  if (auto map = OpenMaps().Find(handle)) return map;
  return Misuse("map is {}", handle == nullptr ? "NULL" : "not an open map: it was closed, or never opened");
}

}  // namespace cairn
