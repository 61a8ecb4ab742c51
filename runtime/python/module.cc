// The Python module's native part, cairn._cairn: what runtime/python/cairn/__init__.py makes public.
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "runtime/localizer.h"
#include "runtime/python/convert.h"

namespace py = pybind11;

namespace cairn {
namespace {

struct PyMap {
  std::shared_ptr<const Map> map;
  std::string path;
};

PyMap OpenMap(const py::object& path, int64_t memory_budget_bytes,
              const std::optional<py::bytes>& public_key) {
  // As bytes: names of files need not be text.
  const std::string name = py::cast<py::bytes>(py::module_::import("os").attr("fsencode")(path));
  if (name.empty()) throw py::value_error("path is empty; expected the name of a map");
  if (name.find('\0') != std::string::npos) throw py::value_error("embedded null byte in path");
  if (memory_budget_bytes < 0)
    throw py::value_error(
        fmt::format("memory_budget_bytes is {}; must not be negative", memory_budget_bytes));
  MapOptions options = {.memory_budget_bytes = memory_budget_bytes};
  if (public_key) {
    const std::string key = *public_key;
    options.public_key.emplace();
    if (key.size() != options.public_key->size())
      throw py::value_error(
          fmt::format("public_key has {} bytes, expected {}: the bytes, not their hexadecimal text",
                      key.size(), options.public_key->size()));
    std::copy(key.begin(), key.end(), options.public_key->begin());
  }
  const py::gil_scoped_release release;
  return {ValueOrThrow(Map::Open(name, options)), name};
}

// A localizer of a thread; its use from two at once is found out.
class PyLocalizer {
 public:
  PyLocalizer(const PyMap& map, const py::kwargs& given) : map_(map.map) {
    LocalizerOptions options;
    const OptionTable table = DescribeOptions(&options);
    for (const auto& [key, value] : given) SetFromPython(table, py::cast<std::string>(key), value);
    localizer_ = std::make_unique<Localizer>(map_, options);
  }

  Localization Localize(const py::array& image, const std::optional<Camera>& camera,
                        const std::optional<PosePrior>& prior) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const std::unique_lock use(is_in_use_, std::try_to_lock);
    if (!use)
      throw PythonError(
          MakeError(ErrorCode::kBusy,
                    "another thread is using this localizer; make one per thread, they share the map"));
    const Camera chosen = camera ? *camera : ValueOrThrow(map_->CameraForSize(grey.cols, grey.rows));
    return ValueOrThrow(localizer_->Localize(grey, chosen, prior));
  }

 private:
  std::shared_ptr<const Map> map_;
  std::unique_ptr<Localizer> localizer_;
  std::mutex is_in_use_;
};

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

// Hands out objects only after __init__: pybind11 itself gives those of CLASS.__new__(CLASS) memory that
// nobody has filled.
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
struct type_caster<cairn::Camera> : ConstructedCaster<cairn::Camera> {};
template <>
struct type_caster<cairn::PosePrior> : ConstructedCaster<cairn::PosePrior> {};
template <>
struct type_caster<cairn::Localization> : ConstructedCaster<cairn::Localization> {};
template <>
struct type_caster<cairn::PyLocalizer> : ConstructedCaster<cairn::PyLocalizer> {};

}  // namespace pybind11::detail

namespace cairn {
namespace {

Camera MakeCamera(const std::string& model, int width, int height, std::vector<double> params) {
  Camera camera;
  camera.model = ValueOrThrow(CameraModelFromName(model));
  camera.width = width;
  camera.height = height;
  camera.params = std::move(params);
  ThrowIfError(CheckCamera(camera));
  return camera;
}

void BindMap(py::module_& module) {
  py::class_<PyMap>(module, "Map")
      .def_static("open", &OpenMap, py::arg("path"), py::kw_only(),
                  py::arg("memory_budget_bytes") = MapOptions().memory_budget_bytes,
                  py::arg("public_key") = py::none())
      .def(
          "camera_for_size",
          [](const PyMap& self, int width, int height) {
            return ValueOrThrow(self.map->CameraForSize(width, height));
          },
          py::arg("width"), py::arg("height"))
      .def_property_readonly("name", [](const PyMap& self) { return self.map->head().name; })
      .def_property_readonly("num_landmarks", [](const PyMap& self) { return self.map->num_landmarks(); })
      .def_property_readonly("num_images", [](const PyMap& self) { return self.map->num_images(); })
      .def_property_readonly(
          "num_regions", [](const PyMap& self) { return self.map->directory().Count(BlockKind::kRegions); })
      .def_property_readonly("is_metric",
                             [](const PyMap& self) { return self.map->head().frame.unit == "metre"; })
      .def("__repr__", [](const PyMap& self) {
        return fmt::format("<cairn.Map '{}' of {}: {} landmarks>", self.map->head().name, self.path,
                           self.map->num_landmarks());
      });
  py::class_<Camera>(module, "Camera")
      .def(py::init(&MakeCamera), py::arg("model"), py::arg("width"), py::arg("height"), py::arg("params"))
      .def_property_readonly("model", [](const Camera& self) { return CameraModelName(self.model); })
      .def_readonly("width", &Camera::width)
      .def_readonly("height", &Camera::height)
      .def_readonly("params", &Camera::params)
      .def("__repr__", [](const Camera& self) {
        return fmt::format("cairn.Camera('{}', {}, {}, [{}])", CameraModelName(self.model), self.width,
                           self.height, fmt::join(self.params, ", "));
      });
}

void BindLocalizer(py::module_& module) {
  py::class_<PosePrior>(module, "Prior")
      .def(py::init(&MakePrior), py::arg("rotation_wxyz"), py::arg("translation"), py::kw_only(),
           py::arg("sigma_m") = 1.0, py::arg("sigma_deg") = 10.0);
  py::class_<Localization>(module, "Fix")
      .def("__bool__", &Localization::has_fix)
      .def_property_readonly("reason", [](const Localization& self) { return NoFixName(self.reason); })
      .def_readonly("message", &Localization::message)
      .def_property_readonly("rotation_wxyz", [](const Localization& self) { return RotationOf(self); })
      .def_property_readonly(
          "translation",
          [](const Localization& self) { return VectorOf(self, self.cam_from_world.translation); })
      .def_property_readonly(
          "center", [](const Localization& self) { return VectorOf(self, self.cam_from_world.Center()); })
      .def_property_readonly("cam_from_world", [](const Localization& self) { return MatrixOf(self); })
      .def_property_readonly("covariance", [](const Localization& self) { return CovarianceOf(self); })
      .def_readonly("region", &Localization::region)
      .def_property_readonly("scope", [](const Localization& self) { return ScopeName(self.scope); })
      .def_readonly("num_features", &Localization::num_features)
      .def_readonly("num_matches", &Localization::num_matches)
      .def_readonly("num_inliers", &Localization::num_inliers)
      .def_readonly("candidates", &Localization::candidates)
      .def("__repr__", [](const Localization& self) {
        if (!self.has_fix())
          return fmt::format("<cairn.Fix: none, {}: {}>", NoFixName(self.reason), self.message);
        const Eigen::Vector3d center = self.cam_from_world.Center();
        return fmt::format("<cairn.Fix at ({:.3f}, {:.3f}, {:.3f}) m, {} inliers>", center.x(), center.y(),
                           center.z(), self.num_inliers);
      });
  py::class_<PyLocalizer>(module, "Localizer")
      .def(py::init<const PyMap&, const py::kwargs&>(), py::arg("map"))
      .def("localize", &PyLocalizer::Localize, py::arg("image").noconvert(), py::arg("camera") = py::none(),
           py::arg("prior") = py::none());
}

}  // namespace
}  // namespace cairn

PYBIND11_MODULE(_cairn, module) {
  module.attr("__version__") = CAIRN_VERSION;
  cairn::BindErrors(module);
  cairn::BindMap(module);
  cairn::BindLocalizer(module);
}
