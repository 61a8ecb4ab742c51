// Floor plans in Python: scans located in them, robots followed.
#include "runtime/python/plans.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "core/geometry/pose.h"
#include "core/options/options.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/belief/robot_on_plan.h"
#include "runtime/c_api/named_options.h"
#include "runtime/map/open_views.h"
#include "runtime/python/convert.h"
#include "runtime/python/objects.h"
#include "runtime/scans/read_scans.h"

namespace py = pybind11;

namespace cairn {
namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

struct PyPlan {
  std::shared_ptr<const Views> plan;
  std::string path;
};

// A pose that explains a scan, or a place of a belief.
struct PyPlanPlace {
  PossiblePlace place;
  bool is_determined = false;
  std::optional<double> explained_ratio;  // of a scan
};

struct PyLocatedScan {
  std::vector<PyPlanPlace> places;
  bool is_complete = true;
};

std::vector<double> ListOf(const Numbers& array, const char* name) {
  if (array.ndim() != 1)
    throw py::value_error(
        fmt::format("{} has {} dimensions; expected one number for each beam", name, array.ndim()));
  return {array.data(), array.data() + array.size()};
}

RangeScan MakeScan(const Numbers& ranges, const std::optional<Numbers>& angles, double first_angle_rad,
                   double step_rad, double max_range_m) {
  RangeScan scan;
  scan.ranges_m = ListOf(ranges, "ranges");
  if (angles) {
    scan.angles_rad = ListOf(*angles, "angles");
    // No angles would stand for equal steps.
    if (scan.angles_rad.empty()) throw py::value_error("angles are empty; expected one for each range");
  }
  scan.first_angle_rad = first_angle_rad;
  scan.step_rad = step_rad;
  scan.max_range_m = max_range_m;
  if (const Status checked = CheckRangeScan(scan); !checked.ok())
    throw py::value_error(checked.error().message);
  return scan;
}

py::array_t<double> ArrayOfBeams(const RangeScan& scan, bool angles) {
  const auto num = static_cast<py::ssize_t>(scan.ranges_m.size());
  py::array_t<double> numbers(num);
  auto view = numbers.mutable_unchecked<1>();
  for (py::ssize_t i = 0; i < num; ++i) view(i) = angles ? scan.AngleOf(i) : scan.ranges_m[i];
  return numbers;
}

py::array_t<double> WallsOf(const PyPlan& plan) {
  const std::vector<PlanWall>& walls = plan.plan->plan.walls;
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(walls.size()), 4);
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    rows.row(i) << walls[i].start.transpose(), walls[i].end.transpose();
  return MatrixArray(rows);
}

class PyScanLocator {
 public:
  PyScanLocator(const PyPlan& plan, const py::kwargs& given) : plan_(plan.plan) {
    ScanSearchOptions options;
    SetFromPython(DescribeOptions(&options), given, kScanOptionsHelp);
    scan_options_ = options.scan;
    const py::gil_scoped_release release;
    locator_.emplace(ValueOrThrow(ScanLocator::Make(*plan_, options.locator)));
  }

  PyLocatedScan Locate(const RangeScan& scan) const {
    const py::gil_scoped_release release;
    const LocatedScan located = ValueOrThrow(locator_->Locate(ViewOf(scan, scan_options_)));
    PyLocatedScan found{.places = {}, .is_complete = located.complete};
    for (const ScanHypothesis& each : located.hypotheses)
      found.places.push_back(
          {{{each.pose, each.covariance}, each.probability}, each.determined, each.explained_ratio});
    return found;
  }

 private:
  std::shared_ptr<const Views> plan_;
  ScanSegmentsOptions scan_options_;
  std::optional<ScanLocator> locator_;  // immutable: threads share it
};

class PyPlanTracker {
 public:
  PyPlanTracker(const PyPlan& plan, const py::kwargs& given) {
    RobotOnPlanOptions options;
    SetFromPython(DescribeOptions(&options), given, kPlanTrackerOptionsHelp);
    const py::gil_scoped_release release;
    robot_.emplace(ValueOrThrow(RobotOnPlan::Make(plan.plan, options)));
  }

  void Move(double ahead_m, double left_m, double turn_left_rad) {
    const auto used = one_thread_.Use();
    ThrowIfError(robot_->Move({{ahead_m, left_m}, turn_left_rad}));
  }
  void MoveTo(double x_m, double y_m, double heading_rad) {
    const auto used = one_thread_.Use();
    ThrowIfError(robot_->MoveTo({{x_m, y_m}, heading_rad}));
  }
  void SeeScan(const RangeScan& scan) {
    const py::gil_scoped_release release;
    const auto used = one_thread_.Use();
    ThrowIfError(robot_->SeeScan(scan));
  }
  void SeeFix(const PyMap& map, const Localization& fix) {
    const auto used = one_thread_.Use();
    ThrowIfError(robot_->SeeImage(fix, map.map->head()));
  }
  void SeePlaces(const std::vector<PyPlanPlace>& places) {
    std::vector<PossiblePlace> seen;
    for (const PyPlanPlace& place : places) seen.push_back(place.place);
    const auto used = one_thread_.Use();
    ThrowIfError(robot_->SeePlaces(seen));
  }
  std::vector<PyPlanPlace> places() {
    const auto used = one_thread_.Use();
    std::vector<PyPlanPlace> places;
    for (const PossiblePlace& place : robot_->Places())
      places.push_back({place, IsDetermined(place.covariance), std::nullopt});
    return places;
  }
  double elsewhere() {
    const auto used = one_thread_.Use();
    return robot_->elsewhere();
  }

 private:
  std::optional<RobotOnPlan> robot_;
  OneThread one_thread_{"plan tracker", "robot"};
};

PyPlanPlace MakePlanPlace(const std::vector<double>& position, double heading_rad,
                          const std::vector<std::vector<double>>& covariance, double probability) {
  const auto has_three = [](const std::vector<double>& row) { return row.size() == 3; };
  if (position.size() != 2)
    throw py::value_error(fmt::format("position has {} numbers; expected 2", position.size()));
  if (covariance.size() != 3 || !std::all_of(covariance.begin(), covariance.end(), has_three))
    throw py::value_error("covariance has not three rows of three numbers");
  PyPlanPlace made;
  made.place.pose = {{position[0], position[1]}, heading_rad};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) made.place.covariance(i, j) = covariance[i][j];
  made.place.probability = probability;
  made.is_determined = IsDetermined(made.place.covariance);
  return made;
}

}  // namespace
}  // namespace cairn

namespace pybind11::detail {

template <>
struct type_caster<cairn::PyPlan> : ConstructedCaster<cairn::PyPlan> {};
template <>
struct type_caster<cairn::RangeScan> : ConstructedCaster<cairn::RangeScan> {};
template <>
struct type_caster<cairn::PyPlanPlace> : ConstructedCaster<cairn::PyPlanPlace> {};
template <>
struct type_caster<cairn::PyLocatedScan> : ConstructedCaster<cairn::PyLocatedScan> {};
template <>
struct type_caster<cairn::PyScanLocator> : ConstructedCaster<cairn::PyScanLocator> {};
template <>
struct type_caster<cairn::PyPlanTracker> : ConstructedCaster<cairn::PyPlanTracker> {};

}  // namespace pybind11::detail

namespace cairn {

void BindPlans(py::module_& module) {
  py::class_<PyPlan>(module, "Plan")
      .def_static(
          "open",
          [](const py::object& path) {
            const std::string name = PathOf(path);
            const py::gil_scoped_release release;
            return PyPlan{ValueOrThrow(OpenPlan(name)), name};
          },
          py::arg("path"))
      .def_static(
          "of_map",
          [](const PyMap& map) {
            const py::gil_scoped_release release;
            return PyPlan{ValueOrThrow(map.map->Plan()), map.path};
          },
          py::arg("map"))
      .def_property_readonly("walls", &WallsOf)
      .def("__repr__", [](const PyPlan& self) {
        return fmt::format("<cairn.Plan of {}: {} walls>", self.path, self.plan->plan.num_walls());
      });
  py::class_<RangeScan>(module, "Scan")
      .def(py::init(&MakeScan), py::arg("ranges"), py::arg("angles") = py::none(), py::kw_only(),
           py::arg("first_angle_rad") = 0.0, py::arg("step_rad") = 0.0,
           py::arg("max_range_m") = RangeScan().max_range_m)
      .def_property_readonly("ranges", [](const RangeScan& self) { return ArrayOfBeams(self, false); })
      .def_property_readonly("angles", [](const RangeScan& self) { return ArrayOfBeams(self, true); })
      .def_readonly("max_range_m", &RangeScan::max_range_m)
      .def_property_readonly(
          "odometry",
          [](const RangeScan& self) -> py::object {
            if (!self.odometry) return py::none();
            const PlanarPose& pose = *self.odometry;
            return VectorArray(Eigen::Vector3d(pose.position.x(), pose.position.y(), pose.heading_rad));
          })
      .def("__len__", [](const RangeScan& self) { return self.ranges_m.size(); })
      .def("__repr__", [](const RangeScan& self) {
        return fmt::format("<cairn.Scan of {} beams>", self.ranges_m.size());
      });
  module.def(
      "read_scans",
      [](const py::object& path) {
        const std::string name = PathOf(path);
        const py::gil_scoped_release release;
        return ValueOrThrow(ReadRangeScans(name));
      },
      py::arg("path"));
  py::class_<PyPlanPlace>(module, "PlanPlace")
      .def(py::init(&MakePlanPlace), py::arg("position"), py::arg("heading_rad"), py::arg("covariance"),
           py::arg("probability"))
      .def_property_readonly("position",
                             [](const PyPlanPlace& self) { return VectorArray(self.place.pose.position); })
      .def_property_readonly("heading_rad",
                             [](const PyPlanPlace& self) { return self.place.pose.heading_rad; })
      .def_property_readonly("covariance",
                             [](const PyPlanPlace& self) { return MatrixArray(self.place.covariance); })
      .def_property_readonly("probability", [](const PyPlanPlace& self) { return self.place.probability; })
      .def_readonly("is_determined", &PyPlanPlace::is_determined)
      .def_readonly("explained_ratio", &PyPlanPlace::explained_ratio)
      .def("__repr__", [](const PyPlanPlace& self) {
        const PlanarPose& pose = self.place.pose;
        return fmt::format("<cairn.PlanPlace at ({:.3f}, {:.3f}) m, {:.1f} deg, {:.3f}>", pose.position.x(),
                           pose.position.y(), DegFromRad(pose.heading_rad), self.place.probability);
      });
  py::class_<PyLocatedScan>(module, "LocatedScan")
      // Copies: what only refers to another object counts as not constructed (ConstructedCaster).
      .def_property_readonly("places", [](const PyLocatedScan& self) { return self.places; })
      .def_readonly("is_complete", &PyLocatedScan::is_complete)
      .def("__repr__", [](const PyLocatedScan& self) {
        return fmt::format("<cairn.LocatedScan of {} places>", self.places.size());
      });
  py::class_<PyScanLocator>(module, "ScanLocator")
      .def(py::init<const PyPlan&, const py::kwargs&>(), py::arg("plan"))
      .def("locate", &PyScanLocator::Locate, py::arg("scan"));
  py::class_<PyPlanTracker>(module, "PlanTracker")
      .def(py::init<const PyPlan&, const py::kwargs&>(), py::arg("plan"))
      .def("move", &PyPlanTracker::Move, py::arg("ahead_m"), py::arg("left_m"), py::arg("turn_left_rad"))
      .def("move_to", &PyPlanTracker::MoveTo, py::arg("x_m"), py::arg("y_m"), py::arg("heading_rad"))
      .def("see_scan", &PyPlanTracker::SeeScan, py::arg("scan"))
      .def("see_fix", &PyPlanTracker::SeeFix, py::arg("map"), py::arg("fix"))
      .def("see_places", &PyPlanTracker::SeePlaces, py::arg("places"))
      .def_property_readonly("places", &PyPlanTracker::places)
      .def_property_readonly("elsewhere", &PyPlanTracker::elsewhere);
}

}  // namespace cairn
