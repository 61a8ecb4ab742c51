// Atlases of many maps in Python.
#include "runtime/python/atlases.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "runtime/atlas/atlas.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/c_api/named_options.h"
#include "runtime/python/objects.h"

namespace py = pybind11;

namespace cairn {
namespace {

struct PyAtlas {
  std::shared_ptr<const Atlas> atlas;

  // Errors as Python's: IndexError.
  int CheckedMap(int map) const {
    if (map < 0 || map >= atlas->num_maps())
      throw py::index_error(fmt::format("map {} of {}", map, atlas->num_maps()));
    return map;
  }
};

PyAtlas OpenAtlas(const py::object& path, const std::optional<py::bytes>& public_key, const std::string& name,
                  uint64_t min_epoch, const py::object& key_ring) {
  const std::string file = PathOf(path);
  const AtlasOptions options = {
      .public_key = TrustedOf(public_key, key_ring), .name = name, .min_epoch = min_epoch};
  const py::gil_scoped_release release;
  return {ValueOrThrow(Atlas::Open(file, options))};
}

std::vector<std::string> MapNames(const PyAtlas& atlas) {
  std::vector<std::string> names;
  for (int map = 0; map < atlas.atlas->num_maps(); ++map) names.push_back(atlas.atlas->map_name(map));
  return names;
}

class PyAtlasLocalizer {
 public:
  PyAtlasLocalizer(const PyAtlas& atlas, const py::kwargs& given) {
    AtlasSearchOptions options;
    SetFromPython(DescribeOptions(&options), given);
    localizer_.emplace(atlas.atlas, options.localizer, options.atlas);
  }

  AtlasAnswer Localize(const py::array& image, const std::optional<Camera>& camera) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    return ValueOrThrow(localizer_->Localize(grey, camera));
  }

 private:
  std::optional<AtlasLocalizer> localizer_;
  OneThread one_thread_{"atlas localizer", "thread"};
};

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

template <>
struct type_caster<cairn::PyAtlas> : ConstructedCaster<cairn::PyAtlas> {};
template <>
struct type_caster<cairn::PyAtlasLocalizer> : ConstructedCaster<cairn::PyAtlasLocalizer> {};
template <>
struct type_caster<cairn::AtlasHypothesis> : ConstructedCaster<cairn::AtlasHypothesis> {};
template <>
struct type_caster<cairn::AtlasAnswer> : ConstructedCaster<cairn::AtlasAnswer> {};

}  // namespace pybind11::detail

namespace cairn {

void BindAtlases(py::module_& module) {
  py::class_<PyAtlas>(module, "Atlas")
      .def_static("open", &OpenAtlas, py::arg("path"), py::kw_only(), py::arg("public_key") = py::none(),
                  py::arg("name") = "", py::arg("min_epoch") = 0, py::arg("key_ring") = py::none())
      .def_property_readonly("map_names", &MapNames)
      .def(
          "find_map",
          [](const PyAtlas& self, const std::string& name) {
            return ValueOrThrow(self.atlas->FindMap(name));
          },
          py::arg("name"))
      .def(
          "open_map",
          [](const PyAtlas& self, int map) {
            const int checked = self.CheckedMap(map);
            const py::gil_scoped_release release;
            return PyMap{ValueOrThrow(self.atlas->OpenMap(checked)), self.atlas->map_name(checked)};
          },
          py::arg("map"))
      .def("__len__", [](const PyAtlas& self) { return self.atlas->num_maps(); })
      .def("__repr__", [](const PyAtlas& self) {
        return fmt::format("<cairn.Atlas of {} maps>", self.atlas->num_maps());
      });
  py::class_<AtlasHypothesis>(module, "AtlasPlace")
      .def_readonly("map", &AtlasHypothesis::map)
      .def_property_readonly("fix", [](const AtlasHypothesis& self) { return self.found; })
      .def_readonly("probability", &AtlasHypothesis::probability)
      .def("__repr__", [](const AtlasHypothesis& self) {
        return fmt::format("<cairn.AtlasPlace in map {}, {:.3f}>", self.map, self.probability);
      });
  py::class_<AtlasAnswer>(module, "AtlasAnswer")
      .def_property_readonly("places", [](const AtlasAnswer& self) { return self.hypotheses; })
      .def_readonly("elsewhere", &AtlasAnswer::elsewhere)
      .def_readonly("maps_tried", &AtlasAnswer::maps_tried)
      .def_property_readonly("failure", [](const AtlasAnswer& self) { return self.best_failure; })
      .def("__bool__",
           [](const AtlasAnswer& self) {
             return !self.hypotheses.empty() && self.hypotheses[0].found.has_fix();
           })
      .def("__repr__", [](const AtlasAnswer& self) {
        return fmt::format("<cairn.AtlasAnswer of {} places, elsewhere {:.3f}>", self.hypotheses.size(),
                           self.elsewhere);
      });
  py::class_<PyAtlasLocalizer>(module, "AtlasLocalizer")
      .def(py::init<const PyAtlas&, const py::kwargs&>(), py::arg("atlas"))
      .def("localize", &PyAtlasLocalizer::Localize, py::arg("image").noconvert(),
           py::arg("camera") = py::none());
}

}  // namespace cairn
