#pragma once

#include <memory>
#include <mutex>
#include <string>

#include <fmt/format.h>
#include <pybind11/pybind11.h>

#include "runtime/drive/start_hypotheses.h"
#include "runtime/localize/localizer.h"
#include "runtime/python/convert.h"
#include "runtime/robot_log/shared_log.h"
#include "runtime/visual_map/visual_tracker.h"

// The objects that Python holds, in all parts of the module.
namespace cairn {

struct PyMap {
  std::shared_ptr<const Map> map;
  std::string path;
};

struct PyLog {
  std::shared_ptr<SharedLog> log;
};

// The log that a localizer or tracker of `map` is given; null: none.  Throws cairn.Error.
inline std::shared_ptr<SharedLog> LogFor(const PyLog* log, const Map& map) {
  if (log == nullptr) return nullptr;
  ThrowIfError(log->log->CheckIsOf(map));
  return log->log;
}

// What is for one thread at a time, and says so when a second thread uses it.
class OneThread {
 public:
  OneThread(const char* name, const char* one_per) : name_(name), one_per_(one_per) {}
  // Throws cairn.Error (busy) where another thread has it.
  [[nodiscard]] std::unique_lock<std::mutex> Use() {
    std::unique_lock use(mutex_, std::try_to_lock);
    if (!use)
      throw PythonError(MakeError(ErrorCode::kBusy,
                                  "another thread is using this {}; make one per {}, they share the map",
                                  name_, one_per_));
    return use;
  }

 private:
  const char* name_;     // "localizer"
  const char* one_per_;  // "thread": how many there should be
  std::mutex mutex_;
};

}  // namespace cairn

namespace pybind11::detail {

// Hands out objects only after __init__: pybind11 itself gives objects of CLASS.__new__(CLASS)
// uninitialised memory.
template <typename T>
struct ConstructedCaster : type_caster_base<T> {
  bool load(handle source, bool convert) {
    if (isinstance<T>(source) &&
        !reinterpret_cast<instance*>(source.ptr())->get_value_and_holder().holder_constructed()) {
      throw type_error(fmt::format("{}: __init__ has not been called", Py_TYPE(source.ptr())->tp_name));
    }
    return type_caster_base<T>::load(source, convert);
  }
};
template <>
struct type_caster<cairn::PyMap> : ConstructedCaster<cairn::PyMap> {};
template <>
struct type_caster<cairn::PyLog> : ConstructedCaster<cairn::PyLog> {};
template <>
struct type_caster<cairn::Camera> : ConstructedCaster<cairn::Camera> {};
template <>
struct type_caster<cairn::PosePrior> : ConstructedCaster<cairn::PosePrior> {};
template <>
struct type_caster<cairn::SensedUp> : ConstructedCaster<cairn::SensedUp> {};
template <>
struct type_caster<cairn::UncertainPose> : ConstructedCaster<cairn::UncertainPose> {};
template <>
struct type_caster<cairn::Localization> : ConstructedCaster<cairn::Localization> {};
template <>
struct type_caster<cairn::TrackedVisualPose> : ConstructedCaster<cairn::TrackedVisualPose> {};
template <>
struct type_caster<cairn::Route> : ConstructedCaster<cairn::Route> {};
template <>
struct type_caster<cairn::PlaceScores> : ConstructedCaster<cairn::PlaceScores> {};
template <>
struct type_caster<cairn::StartHypothesis> : ConstructedCaster<cairn::StartHypothesis> {};

}  // namespace pybind11::detail
