#include "runtime/map/open_views.h"

#include <string>

#include "core/files/file.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

// By the application_id in SQLite's header.
bool IsMap(const std::string& path) {
  const std::string head = ReadHead(path, 72);  // of what cannot be read, reading it as views says why
  return head.size() == 72 && head.ends_with("crmp");
}

// By `of_map` from a map.
template <typename OfMap>
Result<std::shared_ptr<const Views>> Open(const std::string& path, OfMap&& of_map) {
  if (!IsMap(path)) {
    CAIRN_ASSIGN_OR_RETURN(Views views, ReadViews(path));
    return std::make_shared<const Views>(std::move(views));
  }
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(path));
  Result<std::shared_ptr<const Views>> views = of_map(*map);
  if (!views.ok()) return MakeError(views.error().code, "{}: {}", path, views.error().message);
  return views;
}

}  // namespace

Result<std::shared_ptr<const Views>> OpenPlan(const std::string& path) {
  return Open(path, [](const Map& map) { return map.Plan(); });
}

Result<std::shared_ptr<const Views>> OpenViews(const std::string& path, int num_threads, int64_t memory_mib,
                                               Progress& progress) {
  return Open(path, [&](const Map& map) { return map.FloorViews(num_threads, memory_mib, progress); });
}

}  // namespace cairn
