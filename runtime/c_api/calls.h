#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/no_throw.h"
#include "core/options/options.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/handles.h"

// What every function of the C API stands on: errors kept per thread, structs of any release, handles looked
// up.
namespace cairn {

class Map;  // runtime/map/map.h

inline constexpr char kOutOfMemory[] = "out of memory";

// This thread's last sentence, of the function named; what it is where there was no memory for it.
const char* LastError() noexcept;
void SetLastError(const char* function, const char* message) noexcept;

// Runs a function's body; its error becomes the code, its sentence this thread's last one.
template <typename Body>
int32_t Call(const char* function, Body&& body) noexcept {
  try {
    const Status status = WithoutExceptions(function, [&]() -> Status { return body(); });
    if (status.ok()) return CAIRN_OK;
    SetLastError(function, status.error().message.c_str());
    return static_cast<int32_t>(status.error().code);
  } catch (const std::bad_alloc&) {  // for the sentence
    SetLastError(function, kOutOfMemory);
    return CAIRN_NO_MEMORY;
  }
}

template <typename... Args>
Error Misuse(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, format, std::forward<Args>(args)...);
}

// Checks that a struct is given and at least as long as the first release's, `least`: later ones only grow.
template <typename Struct>
Status CheckStruct(const Struct* value, const char* name, size_t least = sizeof(Struct)) {
  if (value == nullptr) return Misuse("{} is NULL", name);
  if (value->size < least)
    return Misuse("{}->size is {}, expected at least {}: set it to sizeof *{} before the call", name,
                  value->size, least, name);
  return Ok();
}

// Copies as much of a result as the caller has room for; its size field stays.
template <typename Struct>
void Return(Struct result, Struct* to) {
  result.size = to->size;
  std::memcpy(to, &result, std::min(to->size, sizeof(Struct)));
}

// Cuts a text where a UTF-8 character begins.
template <size_t kNumBytes>
void CopyText(const std::string& text, char (&to)[kNumBytes]) {
  size_t length = std::min(text.size(), kNumBytes - 1);
  if (length < text.size()) {
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0) == 0x80) --length;
  }
  std::memcpy(to, text.data(), length);
  to[length] = 0;
}

// `help`: where the options are listed.  Errors: InvalidArgument (NULL, an unknown name, a value out of
// range).
Status SetOptionByName(const OptionTable& table, const char* name, const char* value,
                       const char* help = "`cairn localize --help` lists them");

Handles<cairn_map, const Map, HandleKind::kMap>& OpenMaps();
Result<std::shared_ptr<const Map>> FindMap(const cairn_map* handle);

// What stands behind a handle that is for one thread at a time.
struct OfOneThread {
  std::atomic<bool> is_in_use = false;
};

// The object of a handle.  An `Object` is OfOneThread, and says what it is called (kName) and what there
// should be one for each of (kOnePer).
template <typename Handle, typename Object, HandleKind kKind>
Result<std::shared_ptr<Object>> FindObject(const Handles<Handle, Object, kKind>& handles,
                                           const Handle* handle) {
  if (auto object = handles.Find(handle)) return object;
  if (handle == nullptr) return Misuse("{} is NULL", Object::kName);
  return Misuse("the handle is not a {}: it was destroyed, or never created", Object::kName);
}

template <typename Handle, typename Object, HandleKind kKind>
Status DestroyObject(Handles<Handle, Object, kKind>& handles, const Handle* handle) {
  if (handle != nullptr && !handles.Remove(handle)) return FindObject(handles, handle).error();
  return Ok();
}

// Holds the object of a handle for one thread.
template <typename Object>
class Use {
 public:
  template <typename Handle, HandleKind kKind>
  static Result<Use> Begin(const Handles<Handle, Object, kKind>& handles, const Handle* handle) {
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<Object> object, FindObject(handles, handle));
    if (object->is_in_use.exchange(true, std::memory_order_acquire))
      return MakeError(ErrorCode::kBusy,
                       "another thread is using this {}; create one per {}, they share the map",
                       Object::kName, Object::kOnePer);
    return Use(std::move(object));
  }
  Use(Use&&) noexcept = default;
  ~Use() {
    if (object_) object_->is_in_use.store(false, std::memory_order_release);
  }
  Object* operator->() const { return object_.get(); }

 private:
  explicit Use(std::shared_ptr<Object> object) : object_(std::move(object)) {}
  std::shared_ptr<Object> object_;
};

}  // namespace cairn
