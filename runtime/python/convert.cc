#include "runtime/python/convert.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <pybind11/stl.h>

#include "core/base/pooled.h"
#include "core/features/features.h"
#include "core/options/find_option.h"

namespace py = pybind11;

namespace cairn {
namespace {

PyObject* error_type = nullptr;  // cairn.Error, for the life of the module

std::string ShapeText(const py::array& array) { return py::cast<std::string>(py::str(array.attr("shape"))); }

}  // namespace

void BindErrors(py::module_& module) {
  error_type = PyErr_NewExceptionWithDoc("cairn.Error",
                                         "What went wrong; `code` and `name` as in the program's exit codes.",
                                         PyExc_RuntimeError, nullptr);
  module.attr("Error") = py::handle(error_type);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const PythonError& error) {
      const py::object raised = py::handle(error_type)(error.error().message);
      raised.attr("code") = static_cast<int>(error.error().code);
      raised.attr("name") = ErrorCodeName(error.error().code);
      PyErr_SetObject(error_type, raised.ptr());
    }
  });
}

std::string PathOf(const py::object& path) {
  std::string name = py::cast<py::bytes>(py::module_::import("os").attr("fsencode")(path));
  if (name.empty()) throw py::value_error("path is empty; expected the name of a file");
  if (name.find('\0') != std::string::npos) throw py::value_error("embedded null byte in path");
  return name;
}

std::optional<KeyRing> TrustedOf(const std::optional<py::bytes>& public_key, const py::object& key_ring) {
  if (public_key && !key_ring.is_none())
    throw py::value_error("public_key and key_ring are given; expected one of them");
  if (!key_ring.is_none()) return ValueOrThrow(ReadTrustedKeys(PathOf(key_ring)));
  if (!public_key) return std::nullopt;
  const std::string bytes = *public_key;
  PublicKey key;
  if (bytes.size() != key.size())
    throw py::value_error(
        fmt::format("public_key has {} bytes, expected {}: the bytes, not their hexadecimal text",
                    bytes.size(), key.size()));
  std::copy(bytes.begin(), bytes.end(), key.begin());
  return key;
}

cv::Mat PixelsOf(const py::array& image) {
  if (!py::isinstance<py::array_t<uint8_t>>(image))
    throw py::type_error(fmt::format("image has dtype {}, expected uint8: grey pixels, 0 to 255",
                                     py::cast<std::string>(py::str(image.dtype()))));
  if (image.ndim() != 2)
    throw py::value_error(fmt::format("image has shape {}, expected (height, width): grey pixels{}",
                                      ShapeText(image),
                                      image.ndim() == 3 ? "; make one channel of its colours first" : ""));
  if (image.shape(0) == 0 || image.shape(1) == 0 || image.shape(0) > 65536 || image.shape(1) > 65536)
    throw py::value_error(fmt::format("image has shape {}; both must be in 1 .. 65536", ShapeText(image)));
  // Pixels of a row must be contiguous and rows in order: OpenCV reads other layouts only after a copy.
  if ((image.strides(1) != 1 && image.shape(1) > 1) ||
      (image.strides(0) < image.shape(1) && image.shape(0) > 1))
    throw py::value_error(
        fmt::format("image of shape {} has strides ({}, {}) bytes: not row by row (a transposed, mirrored or "
                    "strided view, or order 'F'); numpy.ascontiguousarray(image) makes such a copy",
                    ShapeText(image), image.strides(0), image.strides(1)));
  const auto stride = static_cast<size_t>(image.shape(0) > 1 ? image.strides(0) : image.shape(1));
  return cv::Mat(static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)), CV_8UC1,
                 const_cast<void*>(image.data()), stride);
}

namespace {

// The numbers of an array of rows, as they are or converted between floating-point types.
template <typename T>
py::array_t<T> RowsOf(const py::array& array, const char* what) {
  if (array.ndim() != 2)
    throw py::value_error(fmt::format("{} have {} dimensions, expected (n, m)", what, array.ndim()));
  return py::array_t<T, py::array::c_style | py::array::forcecast>(array);
}

bool AreFloats(const py::array& array) { return array.dtype().kind() == 'f'; }

std::string DtypeOf(const py::array& array) { return py::cast<std::string>(py::str(array.dtype())); }

}  // namespace

PooledVector<Keypoint> KeypointsOf(const py::array& keypoints) {
  if (!AreFloats(keypoints))
    throw py::type_error(
        fmt::format("keypoints have dtype {}, expected floating-point numbers", DtypeOf(keypoints)));
  const py::array_t<float> rows = RowsOf<float>(keypoints, "keypoints");
  const auto values = rows.unchecked<2>();
  const py::ssize_t columns = values.shape(1);
  if (columns < 2 || columns > 4) {
    throw py::value_error(
        fmt::format("keypoints have {} columns, expected 2 to 4: x, y, scale, orientation", columns));
  }
  PooledVector<Keypoint> found(static_cast<size_t>(values.shape(0)));
  for (py::ssize_t i = 0; i < values.shape(0); ++i) {
    found[i] = {values(i, 0), values(i, 1), columns > 2 ? values(i, 2) : 0, columns > 3 ? values(i, 3) : 0};
    for (py::ssize_t k = 0; k < columns; ++k) {
      if (!std::isfinite(values(i, k))) throw py::value_error(fmt::format("keypoint {} is not finite", i));
    }
  }
  return found;
}

DescriptorMatrix DescriptorsOf(const py::array& descriptors, const DescriptorKind& kind) {
  Result<DescriptorMatrix> found = MakeError(ErrorCode::kInvalidArgument, "");
  if (AreFloats(descriptors)) {
    if (kind.is_sift() || kind.type == DescriptorType::kBinary) {
      throw py::type_error(
          fmt::format("descriptors have dtype {}, expected uint8: the map's are of the kind '{}'",
                      DtypeOf(descriptors), ToString(kind)));
    }
    const py::array_t<float> rows = RowsOf<float>(descriptors, "descriptors");
    found = DescriptorsFromFloats(
        Eigen::Map<const FloatDescriptors>(rows.data(), rows.shape(0), rows.shape(1)), kind);
  } else if (py::isinstance<py::array_t<uint8_t>>(descriptors)) {
    const py::array_t<uint8_t> rows = RowsOf<uint8_t>(descriptors, "descriptors");
    found = DescriptorsFromBytes(rows.data(), rows.shape(0), rows.shape(1), kind);
  } else {
    throw py::type_error(fmt::format("descriptors have dtype {}, expected floating-point numbers or uint8",
                                     DtypeOf(descriptors)));
  }
  if (!found.ok()) throw py::value_error(found.error().message);
  return std::move(*found);
}

void SetFromPython(const OptionTable& table, const py::kwargs& given, const char* help) {
  for (const auto& [key, value] : given) {
    const Option* const option = ValueOrThrow(FindOption(table, py::cast<std::string>(key), help));
    const std::string text = py::isinstance<py::bool_>(value) ? (py::cast<bool>(value) ? "true" : "false")
                                                              : py::cast<std::string>(py::str(value));
    ThrowIfError(SetOption(*option, text));
  }
}

Camera CameraFor(const Map& map, const cv::Mat& grey, const std::optional<Camera>& given) {
  return given ? *given : ValueOrThrow(map.CameraForSize(grey.cols, grey.rows));
}

SensedUp MakeUp(const std::vector<double>& direction, double sigma_deg) {
  if (direction.size() != 3)
    throw py::value_error(fmt::format("direction has {} numbers; expected 3", direction.size()));
  const SensedUp up{Eigen::Vector3d(direction.data()), sigma_deg};
  if (const Status checked = CheckSensedUp(up); !checked.ok()) throw py::value_error(checked.error().message);
  return up;
}

Pose MakePose(const std::vector<double>& rotation_wxyz, const std::vector<double>& translation) {
  if (rotation_wxyz.size() != 4 || translation.size() != 3)
    throw py::value_error(fmt::format("rotation_wxyz has {} numbers and translation {}; expected 4 and 3",
                                      rotation_wxyz.size(), translation.size()));
  const Eigen::Quaterniond q(rotation_wxyz[0], rotation_wxyz[1], rotation_wxyz[2], rotation_wxyz[3]);
  if (!(std::abs(q.norm() - 1) < 1e-3))
    throw py::value_error(
        fmt::format("rotation_wxyz has the length {}; expected a unit quaternion, w first", q.norm()));
  const Eigen::Vector3d t(translation[0], translation[1], translation[2]);
  if (!t.allFinite()) throw py::value_error("translation is not finite");
  return {q.normalized(), t};
}

PosePrior MakePrior(const std::vector<double>& rotation_wxyz, const std::vector<double>& translation,
                    double sigma_m, double sigma_deg) {
  const Pose pose = MakePose(rotation_wxyz, translation);
  if (!(sigma_m > 0 && sigma_deg > 0 && std::isfinite(sigma_m + sigma_deg)))
    throw py::value_error(
        fmt::format("sigma_m is {} and sigma_deg {}; both must be positive", sigma_m, sigma_deg));
  return {.cam_from_world = pose, .sigma_m = sigma_m, .sigma_deg = sigma_deg};
}

UncertainPose MakeUncertainPose(const std::vector<double>& rotation_wxyz,
                                const std::vector<double>& translation,
                                const std::optional<std::vector<std::vector<double>>>& covariance) {
  UncertainPose made{MakePose(rotation_wxyz, translation)};
  if (!covariance) return made;
  const auto has_six = [](const std::vector<double>& row) { return row.size() == 6; };
  if (covariance->size() != 6 || !std::all_of(covariance->begin(), covariance->end(), has_six))
    throw py::value_error("covariance has not six rows of six numbers");
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) made.covariance(i, j) = (*covariance)[i][j];
  if (const Status checked = CheckUncertainPose(made); !checked.ok())
    throw py::value_error(checked.error().message);
  return made;
}

py::array_t<double> RotationArray(const Eigen::Quaterniond& rotation) {
  return VectorArray(Eigen::Vector4d(rotation.w(), rotation.x(), rotation.y(), rotation.z()));
}

py::array_t<double> VectorArray(const Eigen::Ref<const Eigen::VectorXd>& vector) {
  py::array_t<double> numbers(vector.size());
  auto view = numbers.mutable_unchecked<1>();
  for (Eigen::Index i = 0; i < vector.size(); ++i) view(i) = vector[i];
  return numbers;
}

py::array_t<double> MatrixArray(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  py::array_t<double> numbers({matrix.rows(), matrix.cols()});
  auto view = numbers.mutable_unchecked<2>();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) view(i, j) = matrix(i, j);
  return numbers;
}

py::array_t<double> HomogeneousArray(const Pose& pose) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topRows<3>() = pose.Matrix();
  return MatrixArray(matrix);
}

py::object RotationOf(const Localization& found) {
  if (!found.has_fix()) return py::none();
  return RotationArray(found.cam_from_world.rotation);
}

py::object VectorOf(const Localization& found, const Eigen::Vector3d& vector) {
  if (!found.has_fix()) return py::none();
  return VectorArray(vector);
}

py::object MatrixOf(const Localization& found) {
  if (!found.has_fix()) return py::none();
  return HomogeneousArray(found.cam_from_world);
}

py::object CovarianceOf(const Localization& found) {
  if (!found.has_fix()) return py::none();
  return MatrixArray(found.covariance);
}

}  // namespace cairn
