#include "runtime/python/places.h"

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "core/features/sift.h"
#include "runtime/c_api/named_options.h"
#include "runtime/drive/place_belief.h"
#include "runtime/drive/route.h"
#include "runtime/drive/start_hypotheses.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/python/convert.h"
#include "runtime/python/objects.h"

namespace py = pybind11;

namespace cairn {
namespace {

py::array_t<double> ArrayOf(const std::vector<double>& numbers) {
  return VectorArray(
      Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<Eigen::Index>(numbers.size())));
}

std::vector<double> NumbersOf(const py::array_t<double, py::array::c_style | py::array::forcecast>& array,
                              const char* name) {
  if (array.ndim() != 1)
    throw py::value_error(
        fmt::format("{} has {} dimensions; expected one number for each place", name, array.ndim()));
  return {array.data(), array.data() + array.size()};
}

PlaceScores MakeScores(const py::array_t<double, py::array::c_style | py::array::forcecast>& scores,
                       const py::array_t<double, py::array::c_style | py::array::forcecast>& probabilities) {
  PlaceScores places{NumbersOf(scores, "scores"), NumbersOf(probabilities, "probabilities")};
  if (places.scores.empty() || places.probabilities.empty())
    throw py::value_error("scores or probabilities are empty; expected one number for each place");
  ThrowIfError(CheckPlaceScores(places, static_cast<int>(places.scores.size())));
  return places;
}

// Immutable: threads share it.
class PyPlaceModel {
 public:
  PyPlaceModel(const PyMap& map, const py::kwargs& given) : map_(map.map) {
    SetFromPython(DescribeOptions(&options_), given, kLookOptionsHelp);
    const py::gil_scoped_release release;
    model_.emplace(ValueOrThrow(PlaceModel::Make(*map_, options_.model)));
  }

  const PlaceModel& model() const { return *model_; }
  int64_t num_images() const { return map_->num_images(); }

  PlaceScores Look(const py::array& image) const {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    return model_->Look(ValueOrThrow(ExtractSift(grey, options_.sift)).descriptors);
  }

  PlaceScores LookAtFeatures(const py::array& descriptors) const {
    if (!py::isinstance<py::array_t<uint8_t>>(descriptors))
      throw py::type_error(fmt::format("descriptors have dtype {}, expected uint8",
                                       py::cast<std::string>(py::str(descriptors.dtype()))));
    if (descriptors.ndim() != 2 || descriptors.shape(1) != kSiftDescriptorDim)
      throw py::value_error(fmt::format("descriptors have shape {}, expected (n, {})",
                                        py::cast<std::string>(py::str(descriptors.attr("shape"))),
                                        kSiftDescriptorDim));
    const auto values = py::array_t<uint8_t>(descriptors).unchecked<2>();
    DescriptorMatrix rows(values.shape(0), kSiftDescriptorDim);
    for (Eigen::Index i = 0; i < rows.rows(); ++i)
      for (Eigen::Index k = 0; k < kSiftDescriptorDim; ++k) rows(i, k) = values(i, k);
    const py::gil_scoped_release release;
    return model_->Look(rows);
  }

  PlaceScores LookCloser(const py::array& image, const std::optional<Camera>& camera) const {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const Localizer localizer(map_, {.sift = options_.sift});
    const Query query = ValueOrThrow(localizer.QueryFromImage(grey, CameraFor(*map_, grey, camera)));
    return ValueOrThrow(model_->LookCloser(*map_, query, options_.closer));
  }

  int32_t PlaceOfImage(int32_t image) const {
    if (image < 0 || image >= num_images())
      throw py::index_error(fmt::format("image {} of {}", image, num_images()));
    return model_->NodeOfImage(image);
  }
  std::vector<int32_t> ImagesOfPlace(NodeIdx place) const { return model_->ImagesOfNode(Checked(place)); }
  py::array_t<double> Expected(NodeIdx place) const { return ArrayOf(model_->Expected(Checked(place))); }

 private:
  NodeIdx Checked(NodeIdx place) const {
    if (place < 0 || place >= model_->num_nodes())
      throw py::index_error(fmt::format("place {} of {}", place, model_->num_nodes()));
    return place;
  }

  std::shared_ptr<const Map> map_;
  LookOptions options_;
  std::optional<PlaceModel> model_;
};

class PyStartHypotheses {
 public:
  PyStartHypotheses(const PyPlaceModel& model, const PlaceScores& first, NodeIdx goal,
                    const py::kwargs& given)
      : num_places_(model.model().num_nodes()) {
    StartHypothesesOptions options;
    SetFromPython(DescribeOptions(&options), given, kStartOptionsHelp);
    const py::gil_scoped_release release;
    starts_.emplace(ValueOrThrow(StartHypotheses::Make(model.model(), first, goal, options)));
  }

  std::string Observe(const PlaceScores& seen) {
    ThrowIfError(CheckPlaceScores(seen, num_places_));
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    return VerdictName(starts_->Observe(seen));
  }
  bool Refute() {
    const auto used = one_thread_.Use();
    return starts_->Refute();
  }
  void Restart() {
    const auto used = one_thread_.Use();
    starts_->Restart();
  }
  std::vector<StartHypothesis> hypotheses() {
    const auto used = one_thread_.Use();
    return starts_->hypotheses();
  }
  int followed() {
    const auto used = one_thread_.Use();
    return starts_->followed();
  }
  int num_images() {
    const auto used = one_thread_.Use();
    return starts_->num_images();
  }
  NodeIdx Whereabouts(int hypothesis) {
    const auto used = one_thread_.Use();
    return starts_->Whereabouts(Checked(hypothesis));
  }
  std::optional<std::vector<NodeIdx>> Replan(int hypothesis) {
    const auto used = one_thread_.Use();
    const std::optional<NodePath> path = starts_->Replan(Checked(hypothesis));
    if (!path) return std::nullopt;
    return path->nodes;
  }

 private:
  int Checked(int hypothesis) const {
    if (hypothesis < 0 || hypothesis >= static_cast<int>(starts_->hypotheses().size()))
      throw py::index_error(fmt::format("hypothesis {} of {}", hypothesis, starts_->hypotheses().size()));
    return hypothesis;
  }

  int num_places_;
  std::optional<StartHypotheses> starts_;
  OneThread one_thread_{"set of starts", "robot"};
};

class PyPlaceBelief {
 public:
  PyPlaceBelief(const PyMap& map, const py::kwargs& given) : map_(map.map) {
    BeliefOptions options;
    SetFromPython(DescribeOptions(&options), given, kBeliefOptionsHelp);
    const py::gil_scoped_release release;
    belief_.emplace(ValueOrThrow(PlaceBelief::Make(map_, options.belief)));
    localizer_.emplace(map_, options.localizer);
  }

  void Move(double ahead_m, double left_m, double turn_left_rad) {
    const auto used = one_thread_.Use();
    ThrowIfError(belief_->Move({ahead_m, left_m}, turn_left_rad));
  }
  void Elapse(double seconds) {
    const auto used = one_thread_.Use();
    ThrowIfError(belief_->Elapse(seconds));
  }
  void SenseUp(const std::array<double, 3>& up_in_camera, double sigma_deg) {
    const auto used = one_thread_.Use();
    ThrowIfError(belief_->SenseUp(Eigen::Vector3d(up_in_camera.data()), sigma_deg));
  }
  Localization See(const py::array& image, const std::optional<Camera>& camera) {
    const cv::Mat grey = PixelsOf(image);
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    const Query query = ValueOrThrow(localizer_->QueryFromImage(grey, CameraFor(*map_, grey, camera)));
    Localization found = ValueOrThrow(localizer_->LocalizeQuery(query, std::nullopt));
    ThrowIfError(belief_->See(query, found));
    return found;
  }
  std::vector<std::pair<int32_t, double>> Places(int max_num) {
    if (max_num < 0) throw py::value_error(fmt::format("max_num is {}; must not be negative", max_num));
    const auto used = one_thread_.Use();
    std::vector<std::pair<int32_t, double>> places;
    for (const PlaceHypothesis& place : ValueOrThrow(belief_->Hypotheses(max_num)))
      places.emplace_back(place.image, place.probability);
    return places;
  }
  double elsewhere() {
    const auto used = one_thread_.Use();
    return belief_->elsewhere();
  }

 private:
  std::shared_ptr<const Map> map_;
  std::optional<Localizer> localizer_;
  std::optional<PlaceBelief> belief_;
  OneThread one_thread_{"place belief", "robot"};
};

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

template <>
struct type_caster<cairn::PyPlaceModel> : ConstructedCaster<cairn::PyPlaceModel> {};
template <>
struct type_caster<cairn::PyPlaceBelief> : ConstructedCaster<cairn::PyPlaceBelief> {};
template <>
struct type_caster<cairn::PyStartHypotheses> : ConstructedCaster<cairn::PyStartHypotheses> {};

}  // namespace pybind11::detail

namespace cairn {

void BindPlaces(py::module_& module) {
  py::class_<Route>(module, "Route")
      .def_readonly("images", &Route::images)
      .def_readonly("num_links", &Route::num_links)
      .def_readonly("cost", &Route::cost)
      .def("__repr__", [](const Route& self) {
        return fmt::format("<cairn.Route of {} images, cost {:g}>", self.images.size(), self.cost);
      });
  py::class_<PlaceScores>(module, "PlaceScores")
      .def(py::init(&MakeScores), py::arg("scores"), py::arg("probabilities"))
      .def_property_readonly("scores", [](const PlaceScores& self) { return ArrayOf(self.scores); })
      .def_property_readonly("probabilities",
                             [](const PlaceScores& self) { return ArrayOf(self.probabilities); })
      .def("__repr__", [](const PlaceScores& self) {
        return fmt::format("<cairn.PlaceScores of {} places>", self.scores.size());
      });
  py::class_<PyPlaceModel>(module, "PlaceModel")
      .def(py::init<const PyMap&, const py::kwargs&>(), py::arg("map"))
      .def_property_readonly("num_places", [](const PyPlaceModel& self) { return self.model().num_nodes(); })
      .def("place_of_image", &PyPlaceModel::PlaceOfImage, py::arg("image"))
      .def("images_of_place", &PyPlaceModel::ImagesOfPlace, py::arg("place"))
      .def("look", &PyPlaceModel::Look, py::arg("image").noconvert())
      .def("look_at_features", &PyPlaceModel::LookAtFeatures, py::arg("descriptors").noconvert())
      .def("look_closer", &PyPlaceModel::LookCloser, py::arg("image").noconvert(),
           py::arg("camera") = py::none())
      .def("expected", &PyPlaceModel::Expected, py::arg("place"));
  py::class_<StartHypothesis>(module, "StartHypothesis")
      .def_readonly("start", &StartHypothesis::start)
      .def_readonly("score", &StartHypothesis::score)
      .def_readonly("posterior", &StartHypothesis::posterior)
      .def_property_readonly("way", [](const StartHypothesis& self) { return self.path.nodes; })
      .def_property_readonly("way_cost", [](const StartHypothesis& self) { return self.path.cost; })
      .def("__repr__", [](const StartHypothesis& self) {
        return fmt::format("<cairn.StartHypothesis: place {}, {:.3f}>", self.start, self.posterior);
      });
  py::class_<PyStartHypotheses>(module, "StartHypotheses")
      .def(py::init<const PyPlaceModel&, const PlaceScores&, NodeIdx, const py::kwargs&>(), py::arg("model"),
           py::arg("first"), py::arg("goal"))
      .def("observe", &PyStartHypotheses::Observe, py::arg("places"))
      .def("refute", &PyStartHypotheses::Refute)
      .def("restart", &PyStartHypotheses::Restart)
      .def_property_readonly("hypotheses", &PyStartHypotheses::hypotheses)
      .def_property_readonly("followed", &PyStartHypotheses::followed)
      .def_property_readonly("num_images", &PyStartHypotheses::num_images)
      .def("whereabouts", &PyStartHypotheses::Whereabouts, py::arg("hypothesis"))
      .def("replan", &PyStartHypotheses::Replan, py::arg("hypothesis"));
  py::class_<PyPlaceBelief>(module, "PlaceBelief")
      .def(py::init<const PyMap&, const py::kwargs&>(), py::arg("map"))
      .def("move", &PyPlaceBelief::Move, py::arg("ahead_m"), py::arg("left_m"), py::arg("turn_left_rad"))
      .def("elapse", &PyPlaceBelief::Elapse, py::arg("seconds"))
      .def("sense_up", &PyPlaceBelief::SenseUp, py::arg("up_in_camera"), py::arg("sigma_deg"))
      .def("see", &PyPlaceBelief::See, py::arg("image").noconvert(), py::arg("camera") = py::none())
      .def("places", &PyPlaceBelief::Places, py::arg("max_num") = 3)
      .def_property_readonly("elsewhere", &PyPlaceBelief::elsewhere);
}

}  // namespace cairn
