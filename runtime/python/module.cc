// The Python module's native part, cairn._cairn: what runtime/python/cairn/__init__.py makes public.
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "core/features/features.h"
#include "core/seal/accept_key_ring.h"
#include "runtime/drive/route.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/update_map.h"
#include "runtime/python/atlases.h"
#include "runtime/python/convert.h"
#include "runtime/python/objects.h"
#include "runtime/python/places.h"
#include "runtime/python/plans.h"
#include "runtime/python/servos.h"
#include "runtime/python/trackers.h"

namespace py = pybind11;

namespace cairn {
namespace {

PyMap OpenMap(const py::object& path, int64_t memory_budget_bytes, const std::optional<py::bytes>& public_key,
              const std::string& required_name, uint64_t min_epoch, const py::object& key_ring) {
  const std::string name = PathOf(path);
  if (memory_budget_bytes < 0)
    throw py::value_error(
        fmt::format("memory_budget_bytes is {}; must not be negative", memory_budget_bytes));
  const MapOptions options = {.memory_budget_bytes = memory_budget_bytes,
                              .public_key = TrustedOf(public_key, key_ring),
                              .name = required_name,
                              .min_epoch = min_epoch};
  const py::gil_scoped_release release;
  return {ValueOrThrow(Map::Open(name, options)), name};
}

// An image of a camera of a rig.
struct PyRigImage {
  py::array image;
  Pose cam_from_rig;
  std::optional<Camera> camera;
};

class PyLocalizer {
 public:
  PyLocalizer(const PyMap& map, const PyLog* log, const py::kwargs& given)
      : map_(map.map), log_(LogFor(log, *map.map)) {
    LocalizerOptions options;
    SetFromPython(DescribeOptions(&options), given);
    localizer_ = std::make_unique<Localizer>(map_, options);
  }

  Localization Localize(const py::array& image, const std::optional<Camera>& camera,
                        const std::optional<PosePrior>& prior, const std::optional<SensedUp>& up) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    const Camera chosen = CameraFor(*map_, grey, camera);
    if (!log_) return ValueOrThrow(localizer_->Localize(grey, chosen, prior, up));
    QueryFrame frame(*localizer_, grey, chosen);
    if (up) frame.set_up(*up);
    const Query* query = ValueOrThrow(frame.WithAllFeatures());
    Localization found = ValueOrThrow(localizer_->LocalizeQuery(*query, prior));
    log_->Offer(&frame, found);
    return found;
  }

  // Features that another program found, of the map's kind.
  Localization LocalizeFeatures(const py::array& keypoints, const py::array& descriptors,
                                const Camera& camera, const std::optional<PosePrior>& prior,
                                const std::optional<SensedUp>& up) {
    Features features{
        .keypoints = KeypointsOf(keypoints), .descriptors = {}, .kind = map_->head().descriptor_kind};
    features.descriptors = DescriptorsOf(descriptors, features.kind);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    return ValueOrThrow(localizer_->LocalizeFeatures(std::move(features), camera, prior, up));
  }

  Localization LocalizeRig(const std::vector<PyRigImage>& images, const std::optional<PosePrior>& prior,
                           const std::optional<SensedUp>& up) {
    std::vector<RigImage> rig;
    for (const PyRigImage& image : images) rig.push_back({PixelsOf(image.image), {}, image.cam_from_rig});
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    for (size_t i = 0; i < rig.size(); ++i) rig[i].camera = CameraFor(*map_, rig[i].grey, images[i].camera);
    return ValueOrThrow(localizer_->LocalizeRig(rig, prior, up));
  }

 private:
  std::shared_ptr<const Map> map_;
  std::shared_ptr<SharedLog> log_;
  std::unique_ptr<Localizer> localizer_;
  OneThread one_thread_{"localizer", "thread"};
};

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

template <>
struct type_caster<cairn::PyLocalizer> : ConstructedCaster<cairn::PyLocalizer> {};
template <>
struct type_caster<cairn::PyRigImage> : ConstructedCaster<cairn::PyRigImage> {};

}  // namespace pybind11::detail

namespace cairn {
namespace {

Camera MakeCamera(const std::string& model, int width, int height, const std::vector<double>& params) {
  Camera camera;
  camera.model = ValueOrThrow(CameraModelFromName(model));
  camera.width = width;
  camera.height = height;
  camera.params.assign(params.begin(), params.end());
  ThrowIfError(CheckCamera(camera));
  return camera;
}

void BindUpdates(py::module_& module) {
  module.def(
      "update_map",
      [](const py::object& map, const py::object& delta, const std::optional<py::bytes>& public_key,
         const std::string& name, uint64_t min_epoch, bool allow_older, const py::object& key_ring,
         const py::object& signatures) {
        const std::string map_path = PathOf(map), delta_path = PathOf(delta);
        const UpdateOptions options = {.public_key = TrustedOf(public_key, key_ring),
                                       .allow_older = allow_older,
                                       .name = name,
                                       .min_epoch = min_epoch,
                                       .signatures = signatures.is_none() ? "" : PathOf(signatures)};
        const py::gil_scoped_release release;
        return ValueOrThrow(UpdateMap(map_path, delta_path, options));
      },
      py::arg("map"), py::arg("delta"), py::kw_only(), py::arg("public_key") = py::none(),
      py::arg("name") = "", py::arg("min_epoch") = 0, py::arg("allow_older") = false,
      py::arg("key_ring") = py::none(), py::arg("signatures") = py::none());
  module.def(
      "roll_back_map",
      [](const py::object& map, const std::optional<py::bytes>& public_key, const std::string& name,
         uint64_t min_epoch, const py::object& key_ring) {
        const std::string map_path = PathOf(map);
        const UpdateOptions options = {
            .public_key = TrustedOf(public_key, key_ring), .name = name, .min_epoch = min_epoch};
        const py::gil_scoped_release release;
        ThrowIfError(RollBackMap(map_path, options));
      },
      py::arg("map"), py::kw_only(), py::arg("public_key") = py::none(), py::arg("name") = "",
      py::arg("min_epoch") = 0, py::arg("key_ring") = py::none());
  module.def(
      "accept_key_ring",
      [](const py::object& ring, const py::object& next) {
        const std::string ring_path = PathOf(ring), next_path = PathOf(next);
        const py::gil_scoped_release release;
        return ValueOrThrow(AcceptKeyRings(ring_path, {next_path})).version;
      },
      py::arg("ring"), py::arg("next"));
}

void BindMap(py::module_& module) {
  py::class_<PyMap>(module, "Map")
      .def_static("open", &OpenMap, py::arg("path"), py::kw_only(),
                  py::arg("memory_budget_bytes") = MapOptions().memory_budget_bytes,
                  py::arg("public_key") = py::none(), py::arg("name") = "", py::arg("min_epoch") = 0,
                  py::arg("key_ring") = py::none())
      .def(
          "camera_for_size",
          [](const PyMap& self, int width, int height) {
            return ValueOrThrow(self.map->CameraForSize(width, height));
          },
          py::arg("width"), py::arg("height"))
      .def(
          "find_image",
          [](const PyMap& self, const std::string& name) { return ValueOrThrow(FindImage(*self.map, name)); },
          py::arg("name"))
      .def(
          "image_name",
          [](const PyMap& self, int32_t image) {
            ValueOrThrow(PoseOfImage(*self.map, image));  // there is such an image
            return ValueOrThrow(self.map->ImageName(image));
          },
          py::arg("image"))
      .def(
          "image_pose",
          [](const PyMap& self, int32_t image) {
            return HomogeneousArray(ValueOrThrow(PoseOfImage(*self.map, image)));
          },
          py::arg("image"))
      .def(
          "route",
          [](const PyMap& self, int32_t start, int32_t goal, const std::string& weight) {
            const py::gil_scoped_release release;
            return ValueOrThrow(PlanRoute(*self.map, start, goal, {.weight = weight}));
          },
          py::arg("start"), py::arg("goal"), py::arg("weight") = RouteOptions().weight)
      .def_property_readonly("name", [](const PyMap& self) { return self.map->head().name; })
      .def_property_readonly("descriptors",
                             [](const PyMap& self) { return ToString(self.map->head().descriptor_kind); })
      .def_property_readonly("epoch", [](const PyMap& self) { return self.map->head().epoch; })
      .def_property_readonly("num_landmarks", [](const PyMap& self) { return self.map->num_landmarks(); })
      .def_property_readonly("num_images", [](const PyMap& self) { return self.map->num_images(); })
      .def_property_readonly("num_regions", [](const PyMap& self) { return self.map->num_regions(); })
      .def_property_readonly("is_metric", [](const PyMap& self) { return IsMetric(self.map->head().frame); })
      .def_property_readonly("scale_sigma_ratio",
                             [](const PyMap& self) { return self.map->head().frame.scale_sigma_ratio; })
      .def_property_readonly(
          "scale_centre", [](const PyMap& self) { return VectorArray(self.map->head().frame.scale_centre); })
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
           py::arg("sigma_m") = 1.0, py::arg("sigma_deg") = 10.0)
      .def_property_readonly(
          "rotation_wxyz", [](const PosePrior& self) { return RotationArray(self.cam_from_world.rotation); })
      .def_property_readonly(
          "translation", [](const PosePrior& self) { return VectorArray(self.cam_from_world.translation); })
      .def_readonly("sigma_m", &PosePrior::sigma_m)
      .def_readonly("sigma_deg", &PosePrior::sigma_deg)
      .def("__repr__", [](const PosePrior& self) {
        const Eigen::Vector3d center = self.cam_from_world.Center();
        return fmt::format("<cairn.Prior at ({:.3f}, {:.3f}, {:.3f}) m, +- {:g} m, {:g} deg>", center.x(),
                           center.y(), center.z(), self.sigma_m, self.sigma_deg);
      });
  py::class_<SensedUp>(module, "Up")
      .def(py::init(&MakeUp), py::arg("direction"), py::arg("sigma_deg") = SensedUp().sigma_deg)
      .def_property_readonly("direction", [](const SensedUp& self) { return VectorArray(self.direction); })
      .def_readonly("sigma_deg", &SensedUp::sigma_deg)
      .def("__repr__", [](const SensedUp& self) {
        return fmt::format("cairn.Up(({:g}, {:g}, {:g}), {:g})", self.direction.x(), self.direction.y(),
                           self.direction.z(), self.sigma_deg);
      });
  py::class_<PyRigImage>(module, "RigImage")
      .def(py::init([](const py::array& image, const std::vector<double>& rotation_wxyz,
                       const std::vector<double>& translation, const std::optional<Camera>& camera) {
             PixelsOf(image);  // throws where it has none
             return PyRigImage{image, MakePose(rotation_wxyz, translation), camera};
           }),
           py::arg("image").noconvert(), py::arg("rotation_wxyz") = std::vector<double>{1, 0, 0, 0},
           py::arg("translation") = std::vector<double>{0, 0, 0}, py::arg("camera") = py::none())
      .def_property_readonly("image", [](const PyRigImage& self) { return self.image; })
      .def_property_readonly("rotation_wxyz",
                             [](const PyRigImage& self) { return RotationArray(self.cam_from_rig.rotation); })
      .def_property_readonly(
          "translation", [](const PyRigImage& self) { return VectorArray(self.cam_from_rig.translation); })
      .def_property_readonly("camera",
                             [](const PyRigImage& self) -> py::object {
                               return self.camera ? py::cast(Camera(*self.camera)) : py::none();
                             })
      .def("__repr__", [](const PyRigImage& self) {
        const Eigen::Vector3d& t = self.cam_from_rig.translation;
        return fmt::format("<cairn.RigImage of {} x {} px, translation ({:.3f}, {:.3f}, {:.3f}) m>",
                           self.image.shape(1), self.image.shape(0), t.x(), t.y(), t.z());
      });
  py::class_<UncertainPose>(module, "UncertainPose")
      .def(py::init(&MakeUncertainPose), py::arg("rotation_wxyz"), py::arg("translation"),
           py::arg("covariance") = py::none())
      .def_property_readonly("rotation_wxyz",
                             [](const UncertainPose& self) { return RotationArray(self.pose.rotation); })
      .def_property_readonly("translation",
                             [](const UncertainPose& self) { return VectorArray(self.pose.translation); })
      .def_property_readonly("covariance",
                             [](const UncertainPose& self) { return MatrixArray(self.covariance); })
      .def("__repr__", [](const UncertainPose& self) {
        const Eigen::Vector3d& t = self.pose.translation;
        return fmt::format("<cairn.UncertainPose with translation ({:.3f}, {:.3f}, {:.3f}) m, +- {:.3f} m>",
                           t.x(), t.y(), t.z(), std::sqrt(self.covariance.diagonal().tail<3>().maxCoeff()));
      });
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
      .def_readonly("probability", &Localization::probability)
      .def_readonly("region", &Localization::region)
      .def_property_readonly("scope", [](const Localization& self) { return ScopeName(self.scope); })
      .def_readonly("work_ms", &Localization::work_ms)
      .def_readonly("num_features", &Localization::num_features)
      .def_readonly("num_matches", &Localization::num_matches)
      .def_readonly("num_inliers", &Localization::num_inliers)
      .def_readonly("candidates", &Localization::candidates)
      .def_readonly("voted_regions", &Localization::voted_regions)
      .def("__repr__", [](const Localization& self) {
        if (!self.has_fix())
          return fmt::format("<cairn.Fix: none, {}: {}>", NoFixName(self.reason), self.message);
        const Eigen::Vector3d center = self.cam_from_world.Center();
        return fmt::format("<cairn.Fix at ({:.3f}, {:.3f}, {:.3f}) m, {} inliers, P(right) {:.2f}>",
                           center.x(), center.y(), center.z(), self.num_inliers, self.probability);
      });
  py::class_<PyLocalizer>(module, "Localizer")
      .def(py::init<const PyMap&, const PyLog*, const py::kwargs&>(), py::arg("map"), py::kw_only(),
           py::arg("log") = py::none())
      .def("localize", &PyLocalizer::Localize, py::arg("image").noconvert(), py::arg("camera") = py::none(),
           py::arg("prior") = py::none(), py::arg("up") = py::none())
      .def("localize_features", &PyLocalizer::LocalizeFeatures, py::arg("keypoints").noconvert(),
           py::arg("descriptors").noconvert(), py::arg("camera"), py::arg("prior") = py::none(),
           py::arg("up") = py::none())
      .def("localize_rig", &PyLocalizer::LocalizeRig, py::arg("images"), py::arg("prior") = py::none(),
           py::arg("up") = py::none());
}

PyLog OpenLog(const PyMap& map, const py::object& folder, double max_mb_per_day) {
  const std::string path = PathOf(folder);
  const py::gil_scoped_release release;
  return {ValueOrThrow(SharedLog::Open(path, *map.map, max_mb_per_day))};
}

void BindLog(py::module_& module) {
  py::class_<PyLog>(module, "Log")
      .def(py::init(&OpenLog), py::arg("map"), py::arg("folder"), py::kw_only(),
           py::arg("max_mb_per_day") = SharedLog::kMaxMbPerDay)
      .def_property_readonly("num_kept", [](const PyLog& self) { return self.log->num_kept(); })
      .def_property_readonly("error",
                             [](const PyLog& self) -> std::optional<std::string> {
                               const Status error = self.log->error();
                               if (error.ok()) return std::nullopt;
                               return error.error().message;
                             })
      .def("close", [](const PyLog& self) {
        const py::gil_scoped_release release;
        self.log->Close();
      });
}

}  // namespace
}  // namespace cairn

PYBIND11_MODULE(_cairn, module) {
  module.attr("__version__") = CAIRN_VERSION;
  cairn::BindErrors(module);
  cairn::BindMap(module);
  cairn::BindUpdates(module);
  cairn::BindLog(module);
  cairn::BindLocalizer(module);
  cairn::BindTrackers(module);
  cairn::BindPlaces(module);
  cairn::BindServos(module);
  cairn::BindAtlases(module);
  cairn::BindPlans(module);
}
