#include "runtime/python/servos.h"

#include <memory>
#include <optional>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "runtime/c_api/named_options.h"
#include "runtime/drive/image_servo.h"
#include "runtime/python/convert.h"
#include "runtime/python/objects.h"

namespace py = pybind11;

namespace cairn {
namespace {

class PyServo {
 public:
  PyServo(const PyMap& map, int32_t image, const py::kwargs& given) : map_(map.map) {
    ImageServoOptions options;
    SetFromPython(DescribeOptions(&options), given, kServoOptionsHelp);
    step_s_ = options.servo.step_s;
    const py::gil_scoped_release release;
    servo_.emplace(ValueOrThrow(ImageServo::ToImage(map_, image, options)));
  }

  ServoCommand Step(const py::array& image, const std::optional<Camera>& camera) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    return ValueOrThrow(servo_->Step(grey, CameraFor(*map_, grey, camera)));
  }
  void Blocked() {
    const auto used = one_thread_.Use();
    servo_->Blocked();
  }
  double step_s() const { return step_s_; }

 private:
  std::shared_ptr<const Map> map_;
  double step_s_ = 0;
  std::optional<ImageServo> servo_;
  OneThread one_thread_{"servo", "robot"};
};

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

template <>
struct type_caster<cairn::PyServo> : ConstructedCaster<cairn::PyServo> {};
template <>
struct type_caster<cairn::ServoCommand> : ConstructedCaster<cairn::ServoCommand> {};

}  // namespace pybind11::detail

namespace cairn {

void BindServos(py::module_& module) {
  py::class_<ServoCommand>(module, "ServoCommand")
      .def_readonly("speed_m_s", &ServoCommand::speed_m_s)
      .def_readonly("turn_rad_s", &ServoCommand::turn_rad_s)
      .def_property_readonly("state", [](const ServoCommand& self) { return ServoStateName(self.state); })
      .def_readonly("num_matches", &ServoCommand::num_matches)
      .def_property_readonly(
          "num_inliers",
          [](const ServoCommand& self) { return self.epipoles ? self.epipoles->num_inliers : 0; })
      .def_readonly("why", &ServoCommand::why)
      .def("__repr__", [](const ServoCommand& self) {
        return fmt::format("<cairn.ServoCommand {}: {:.3f} m/s, {:.3f} rad/s>", ServoStateName(self.state),
                           self.speed_m_s, self.turn_rad_s);
      });
  py::class_<PyServo>(module, "Servo")
      .def(py::init<const PyMap&, int32_t, const py::kwargs&>(), py::arg("map"), py::arg("image"))
      .def("step", &PyServo::Step, py::arg("image").noconvert(), py::arg("camera") = py::none())
      .def("blocked", &PyServo::Blocked)
      .def_property_readonly("step_s", &PyServo::step_s);
}

}  // namespace cairn
