#include "runtime/c_api/calls.h"

#include "core/options/find_option.h"
#include "core/threads/of_thread.h"
#include "runtime/map/map.h"

namespace cairn {

namespace {

struct Sentence {
  std::string text;
};

thread_local bool is_lost = false;  // there was no memory for this thread's sentence

}  // namespace

const char* LastError() noexcept {
  if (is_lost) return kOutOfMemory;
  const Sentence* const last = OfThread<Sentence>();
  return last == nullptr ? "" : last->text.c_str();
}

void SetLastError(const char* function, const char* message) noexcept {
  is_lost = true;
  Sentence* const last = OfThread<Sentence>();
  if (last == nullptr) return;
  try {
    last->text = message;
    if (!last->text.starts_with(function)) last->text.insert(0, std::string(function) + ": ");
    is_lost = false;
  } catch (const std::bad_alloc&) {  // is lost
  }
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
