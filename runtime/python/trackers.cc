#include "runtime/python/trackers.h"

#include <array>
#include <memory>
#include <optional>
#include <string>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "runtime/c_api/named_options.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/python/convert.h"
#include "runtime/python/objects.h"
#include "runtime/visual_map/visual_tracker.h"

namespace py = pybind11;

namespace cairn {
namespace {

class PyTracker {
 public:
  PyTracker(const PyMap& map, const PyLog* log, const py::kwargs& given)
      : map_(map.map), log_(LogFor(log, *map.map)) {
    SpaceTrackerOptions options;
    SetFromPython(DescribeOptions(&options), given);
    const py::gil_scoped_release release;
    tracker_ = ValueOrThrow(SureTracker::Make(map_, options.localizer, options.tracker, options.sure));
    localizer_.emplace(map_, options.localizer);
  }

  void Move(double ahead_m, double left_m, double turn_left_rad) {
    const auto used = one_thread_.Use();
    ThrowIfError(tracker_->Move({ahead_m, left_m}, turn_left_rad));
  }
  void MoveCamera(const UncertainPose& next_from_last) {
    const auto used = one_thread_.Use();
    ThrowIfError(tracker_->Move(next_from_last));
  }
  void Elapse(double seconds) {
    const auto used = one_thread_.Use();
    ThrowIfError(tracker_->Elapse(seconds));
  }
  void SenseUp(const std::array<double, 3>& up_in_camera, double sigma_deg) {
    const auto used = one_thread_.Use();
    ThrowIfError(tracker_->SenseUp(Eigen::Vector3d(up_in_camera.data()), sigma_deg));
  }

  Localization Track(const py::array& image, const std::optional<Camera>& camera) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    const Camera chosen = CameraFor(*map_, grey, camera);
    QueryFrame frame(*localizer_, grey, chosen);
    Localization found = ValueOrThrow(tracker_->TrackFrame(&frame));
    if (log_) log_->Offer(&frame, found);
    return found;
  }

  std::optional<PosePrior> Predict() {
    const auto used = one_thread_.Use();
    return tracker_->Prediction();
  }
  std::optional<UncertainPose> Believe() {
    const auto used = one_thread_.Use();
    return tracker_->Believed();
  }

 private:
  std::shared_ptr<const Map> map_;
  std::shared_ptr<SharedLog> log_;
  std::optional<Localizer> localizer_;  // for the features of frames
  std::optional<SureTracker> tracker_;
  OneThread one_thread_{"tracker", "camera"};
};

class PyVisualTracker {
 public:
  PyVisualTracker(const PyMap& map, const py::kwargs& given) : map_(map.map) {
    FloorTrackerOptions options;
    SetFromPython(DescribeOptions(&options), given);
    const py::gil_scoped_release release;
    localizer_.emplace(map_, options.features);
    tracker_ = ValueOrThrow(
        VisualTracker::Make(map_, options.map, options.tracker, options.filter, options.estimate));
  }

  void Move(double ahead_m, double left_m, double turn_left_rad) {
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    ThrowIfError(tracker_->Move({ahead_m, left_m}, turn_left_rad));
  }

  TrackedVisualPose Track(const py::array& image, const std::optional<Camera>& camera) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    const Query query = ValueOrThrow(localizer_->QueryFromImage(grey, CameraFor(*map_, grey, camera)));
    return ValueOrThrow(tracker_->See(query));
  }

 private:
  std::shared_ptr<const Map> map_;
  std::optional<Localizer> localizer_;  // for the features of images
  std::optional<VisualTracker> tracker_;
  OneThread one_thread_{"visual tracker", "camera"};
};

bool HasFix(const TrackedVisualPose& found) { return found.pose.flag == VisualFlag::kNone; }

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

template <>
struct type_caster<cairn::PyTracker> : ConstructedCaster<cairn::PyTracker> {};
template <>
struct type_caster<cairn::PyVisualTracker> : ConstructedCaster<cairn::PyVisualTracker> {};

}  // namespace pybind11::detail

namespace cairn {

void BindTrackers(py::module_& module) {
  py::class_<TrackedVisualPose>(module, "FloorFix")
      .def("__bool__", &HasFix)
      .def_property_readonly("reason",
                             [](const TrackedVisualPose& self) { return VisualFlagName(self.pose.flag); })
      .def_property_readonly("message", [](const TrackedVisualPose& self) { return self.pose.message; })
      .def_property_readonly("position",
                             [](const TrackedVisualPose& self) -> py::object {
                               if (!HasFix(self)) return py::none();
                               return VectorArray(self.pose.position);
                             })
      .def_property_readonly("heading_deg",
                             [](const TrackedVisualPose& self) {
                               return HasFix(self) ? std::optional(self.pose.heading_deg) : std::nullopt;
                             })
      .def_property_readonly("covariance",
                             [](const TrackedVisualPose& self) { return MatrixArray(self.pose.covariance); })
      .def_property_readonly("mean",
                             [](const TrackedVisualPose& self) { return VectorArray(self.pose.mean); })
      .def_property_readonly("entropy", [](const TrackedVisualPose& self) { return self.pose.entropy; })
      .def_property_readonly("scope", [](const TrackedVisualPose& self) { return ScopeName(self.scope); })
      .def_readonly("regions", &TrackedVisualPose::regions)
      .def_property_readonly("num_matches",
                             [](const TrackedVisualPose& self) { return self.pose.num_matches; })
      .def_property_readonly("num_agreeing",
                             [](const TrackedVisualPose& self) { return self.pose.num_agreeing; })
      .def("__repr__", [](const TrackedVisualPose& self) {
        if (!HasFix(self))
          return fmt::format("<cairn.FloorFix: none, {}: {}>", VisualFlagName(self.pose.flag),
                             self.pose.message);
        return fmt::format("<cairn.FloorFix at ({:.3f}, {:.3f}) m, {:.1f} deg, {} landmarks agree>",
                           self.pose.position.x(), self.pose.position.y(), self.pose.heading_deg,
                           self.pose.num_agreeing);
      });
  py::class_<PyTracker>(module, "Tracker")
      .def(py::init<const PyMap&, const PyLog*, const py::kwargs&>(), py::arg("map"), py::kw_only(),
           py::arg("log") = py::none())
      .def("track", &PyTracker::Track, py::arg("image").noconvert(), py::arg("camera") = py::none())
      .def("move", &PyTracker::Move, py::arg("ahead_m"), py::arg("left_m"), py::arg("turn_left_rad"))
      .def("move_camera", &PyTracker::MoveCamera, py::arg("next_from_last"))
      .def("elapse", &PyTracker::Elapse, py::arg("seconds"))
      .def("sense_up", &PyTracker::SenseUp, py::arg("up_in_camera"), py::arg("sigma_deg"))
      .def("predict", &PyTracker::Predict)
      .def("believe", &PyTracker::Believe);
  py::class_<PyVisualTracker>(module, "VisualTracker")
      .def(py::init<const PyMap&, const py::kwargs&>(), py::arg("map"))
      .def("move", &PyVisualTracker::Move, py::arg("ahead_m"), py::arg("left_m"), py::arg("turn_left_rad"))
      .def("track", &PyVisualTracker::Track, py::arg("image").noconvert(), py::arg("camera") = py::none());
}

}  // namespace cairn
