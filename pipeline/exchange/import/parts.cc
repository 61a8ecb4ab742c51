#include "pipeline/exchange/import/parts.h"

#include "core/base/pooled.h"
#include "core/base/text.h"
#include "core/colmap/colmap_model.h"
#include "core/geometry/rotations.h"
#include "core/images/image_file.h"

namespace cairn::pipeline {

std::vector<ListLine> ListLines(std::string_view contents, const std::string& path) {
  std::vector<ListLine> lines;
  int line_number = 0;
  for (const std::string_view line : SplitLines(contents)) {
    ++line_number;
    const std::string_view text = Trim(line);
    if (!text.empty() && !text.starts_with('#'))
      lines.push_back({text, fmt::format("{}:{}", path, line_number)});
  }
  return lines;
}

Result<std::vector<double>> ParseNumbers(std::span<const std::string> words) {
  std::vector<double> numbers;
  for (const std::string& word : words) {
    double number = 0;
    // Other programs accept a leading '+'; from_chars does not.
    if (!ParseNumber(std::string_view(word).substr(word.starts_with('+') ? 1 : 0), &number))
      return MakeError(ErrorCode::kCorrupt, "'{}' is not a number", word);
    numbers.push_back(number);
  }
  return numbers;
}

Result<Pose> PoseFromMatrix(std::span<const double> rows) {
  constexpr double kMaxRotationError = 0.02;
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(rows.data());
  if (!matrix.allFinite()) return MakeError(ErrorCode::kCorrupt, "pose is not finite");
  const Eigen::Matrix3d R = matrix.leftCols<3>();
  const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (error > kMaxRotationError || R.determinant() < 0) {
    return MakeError(ErrorCode::kCorrupt,
                     "the pose's rotation is not valid: R R^T is off by {:g}, its determinant is {:g}", error,
                     R.determinant());
  }
  return Pose{Eigen::Quaterniond(NearestRotation(R)).normalized(), matrix.col(3)};
}

Result<Pose> PoseFromNumbers(std::span<const double> numbers) {
  Pose pose{Eigen::Quaterniond(numbers[0], numbers[1], numbers[2], numbers[3]),
            Eigen::Vector3d(numbers[4], numbers[5], numbers[6])};
  CAIRN_RETURN_IF_ERROR(NormalizePose(&pose));
  return pose;
}

Camera CameraFromOpenCv(CameraId camera_id, CameraModel model, int width, int height,
                        PooledVector<double> params) {
  Camera camera;
  camera.camera_id = camera_id;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.params = std::move(params);
  const bool has_one_focal = model == CameraModel::kSimplePinhole || model == CameraModel::kSimpleRadial ||
                             model == CameraModel::kRadial;
  const size_t first = has_one_focal ? 1 : 2;
  camera.params[first] += 0.5;
  camera.params[first + 1] += 0.5;
  return camera;
}

Result<ImageSize> ReadImageSize(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const cv::Mat image, ReadGreyImage(path));
  return ImageSize{image.cols, image.rows};
}

}  // namespace cairn::pipeline
