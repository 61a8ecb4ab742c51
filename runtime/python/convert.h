#pragma once

#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "core/base/pooled.h"
#include "core/seal/key_ring.h"
#include "runtime/localize/localizer.h"
#include "runtime/track/camera_motion.h"

// Between Python's values and the runtime's.
namespace cairn {

// An Error on its way to Python, where it becomes cairn.Error with its code and name.
class PythonError : public std::exception {
 public:
  explicit PythonError(Error error) : error_(std::move(error)) {}
  const char* what() const noexcept override { return error_.message.c_str(); }
  const Error& error() const { return error_; }

 private:
  Error error_;
};

template <typename T>
T ValueOrThrow(Result<T> result) {
  if (!result.ok()) throw PythonError(result.error());
  return std::move(result).value();
}
inline void ThrowIfError(const Status& status) {
  if (!status.ok()) throw PythonError(status.error());
}

// Makes the exception cairn.Error, and lets PythonErrors become it.
void BindErrors(pybind11::module_& module);

// The name of a file, as bytes: it need not be text.  Throws a ValueError where there is none.
std::string PathOf(const pybind11::object& path);
// A key, or the file of a ring of keys; None: none.  Throws a ValueError for another number of bytes and
// where both are given, cairn.Error as ReadTrustedKeys.
std::optional<KeyRing> TrustedOf(const std::optional<pybind11::bytes>& public_key,
                                 const pybind11::object& key_ring);

// The pixels of an array of uint8, height x width, not copied; rows may have gaps.  Throws a TypeError for
// another dtype and a ValueError for another shape or order, which say what was found.
cv::Mat PixelsOf(const pybind11::array& image);

// Of an array of floating-point numbers, n x 2, 3 or 4.  Throws a TypeError or a ValueError that says what
// was found.
PooledVector<Keypoint> KeypointsOf(const pybind11::array& keypoints);
// Of an array of the map's kind: floating-point values, or bytes of SIFT or of bits.  Throws a TypeError for
// another dtype, a ValueError for another shape or a value that is not finite.
DescriptorMatrix DescriptorsOf(const pybind11::array& descriptors, const DescriptorKind& kind);

// Sets options from keyword arguments; `help` says where they are listed.  Throws cairn.Error for an unknown
// name or a value out of range.
void SetFromPython(const OptionTable& table, const pybind11::kwargs& given,
                   const char* help = "`cairn localize --help` lists them");

// None given: the survey's camera of the image's size.  Throws cairn.Error where the map has none, or
// several.
Camera CameraFor(const Map& map, const cv::Mat& grey, const std::optional<Camera>& given);

// Throws a ValueError for an invalid rotation or number.
PosePrior MakePrior(const std::vector<double>& rotation_wxyz, const std::vector<double>& translation,
                    double sigma_m, double sigma_deg);

// Throws a ValueError for what is no direction, or a standard deviation that is not positive.
SensedUp MakeUp(const std::vector<double>& direction, double sigma_deg);

// Throws a ValueError for an invalid rotation or number.
Pose MakePose(const std::vector<double>& rotation_wxyz, const std::vector<double>& translation);

// Throws a ValueError for an invalid rotation, number or shape; None: no error at all.
UncertainPose MakeUncertainPose(const std::vector<double>& rotation_wxyz,
                                const std::vector<double>& translation,
                                const std::optional<std::vector<std::vector<double>>>& covariance);

// New arrays: w x y z, (n,), (m, n) and (4, 4).
pybind11::array_t<double> RotationArray(const Eigen::Quaterniond& rotation);
pybind11::array_t<double> VectorArray(const Eigen::Ref<const Eigen::VectorXd>& vector);
pybind11::array_t<double> MatrixArray(const Eigen::Ref<const Eigen::MatrixXd>& matrix);
pybind11::array_t<double> HomogeneousArray(const Pose& pose);

// Of a fix, as new arrays; None without a fix.
pybind11::object RotationOf(const Localization& found);
pybind11::object VectorOf(const Localization& found, const Eigen::Vector3d& vector);
pybind11::object MatrixOf(const Localization& found);
pybind11::object CovarianceOf(const Localization& found);

}  // namespace cairn
