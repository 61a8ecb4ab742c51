#include <array>
#include <filesystem>
#include <iterator>

#include "core/base/text.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_model.h"
#include "core/colmap/image_list.h"
#include "core/files/file.h"

namespace cairn {
namespace {

// Numbers of a line one after the other, without copies: images of a large model have thousands of keypoints.
class NumberReader {
 public:
  explicit NumberReader(std::string_view line) : rest_(Trim(line)) {}

  bool AtEnd() const { return rest_.empty(); }
  // 0, and not ok() from then on, where the next word is not a number of this type.
  template <typename T>
  T Next() {
    const size_t end = std::min(rest_.find_first_of(" \t"), rest_.size());
    T value{};
    ok_ = ok_ && ParseNumber(rest_.substr(0, end), &value);
    rest_ = Trim(rest_.substr(end));
    return ok_ ? value : T{};
  }
  // A point's id, where -1 stands for none.
  uint64_t NextPointId() {
    const auto point_id = Next<int64_t>();
    ok_ = ok_ && point_id >= -1;
    return static_cast<uint64_t>(point_id);
  }
  bool ok() const { return ok_; }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

// "X Y POINT3D_ID" for each keypoint.  False when the line is anything else.
bool ParseKeypoints(std::string_view line, std::vector<ModelKeypoint>* keypoints) {
  NumberReader reader(line);
  while (reader.ok() && !reader.AtEnd()) {
    ModelKeypoint keypoint;
    keypoint.position.x() = reader.Next<double>();
    keypoint.position.y() = reader.Next<double>();
    keypoint.point_id = reader.NextPointId();
    keypoints->push_back(keypoint);
  }
  if (!reader.ok()) keypoints->clear();
  return reader.ok();
}

Status ReadTextImages(const std::string& path, ColmapModel* model) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  const std::vector<std::string_view> lines = SplitLines(contents);
  for (size_t i = 0; i < lines.size(); ++i) {
    if (Trim(lines[i]).empty() || Trim(lines[i]).starts_with('#')) continue;
    Result<ModelImage> image = ParseImageLine(lines[i]);
    const Status status = image.ok() ? NormalizePose(&image->cam_from_world) : Status(image.error());
    if (!status.ok()) return MakeError(status.error().code, "{}:{}: {}", path, i + 1, status.error().message);
    // The line that follows holds keypoints, or nothing.
    if (i + 1 < lines.size() && ParseKeypoints(lines[i + 1], &image->keypoints)) ++i;
    model->images.push_back(*std::move(image));
  }
  return Ok();
}

Status ReadTextPoints(const std::string& path, ColmapModel* model) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  int line_number = 0;
  for (const std::string_view line : SplitLines(contents)) {
    ++line_number;
    if (Trim(line).empty() || Trim(line).starts_with('#')) continue;
    NumberReader reader(line);
    ModelPoint point;
    point.point_id = reader.Next<uint64_t>();
    for (int i = 0; i < 3; ++i) point.position[i] = reader.Next<double>();
    for (uint8_t& channel : point.color) channel = reader.Next<uint8_t>();
    point.error_px = reader.Next<double>();
    while (reader.ok() && !reader.AtEnd()) {
      const ImageId image_id = reader.Next<ImageId>();
      point.track.emplace_back(image_id, reader.Next<KeypointIdx>());
    }
    if (!reader.ok() || !point.position.allFinite()) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}:{}: expected POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX for each "
                       "keypoint of its track; is the file truncated?",
                       path, line_number);
    }
    model->points.push_back(std::move(point));
  }
  return Ok();
}

std::string ImagesText(const ColmapModel& model) {
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME (cam_from_world); second line: X Y POINT3D_ID of each "
      "keypoint\n";
  auto out = std::back_inserter(text);
  for (const ModelImage& image : model.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const Eigen::Vector3d& t = image.cam_from_world.translation;
    fmt::format_to(out, "{} {} {} {} {} {} {} {} {} {}\n", image.image_id, q.w(), q.x(), q.y(), q.z(), t.x(),
                   t.y(), t.z(), image.camera_id, image.name);
    for (const ModelKeypoint& keypoint : image.keypoints) {
      fmt::format_to(out, "{}{} {} {}", &keypoint == image.keypoints.data() ? "" : " ", keypoint.position.x(),
                     keypoint.position.y(), static_cast<int64_t>(keypoint.point_id));
    }
    text += '\n';
  }
  return text;
}

std::string PointsText(const ColmapModel& model) {
  std::string text = "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of each keypoint\n";
  auto out = std::back_inserter(text);
  for (const ModelPoint& point : model.points) {
    fmt::format_to(out, "{} {} {} {} {} {} {} {}", point.point_id, point.position.x(), point.position.y(),
                   point.position.z(), point.color[0], point.color[1], point.color[2], point.error_px);
    for (const auto& [image_id, keypoint_idx] : point.track)
      fmt::format_to(out, " {} {}", image_id, keypoint_idx);
    text += '\n';
  }
  return text;
}

}  // namespace

Result<ModelImage> ParseImageLine(std::string_view line) {
  const std::vector<std::string> words = SplitWords(line);
  if (words.size() < 10) {
    return MakeError(
        ErrorCode::kCorrupt,
        "expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, found {} fields; is the file truncated?",
        words.size());
  }
  ModelImage image;
  std::array<double, 7> numbers{};
  bool are_numbers = ParseNumber(words[0], &image.image_id) && ParseNumber(words[8], &image.camera_id);
  for (int i = 0; i < 7; ++i) are_numbers &= ParseNumber(words[1 + i], &numbers[i]);
  if (!are_numbers) return MakeError(ErrorCode::kCorrupt, "a pose or camera id is not a number: '{}'", line);
  image.cam_from_world.rotation = Eigen::Quaterniond(numbers[0], numbers[1], numbers[2], numbers[3]);
  image.cam_from_world.translation = Eigen::Vector3d(numbers[4], numbers[5], numbers[6]);
  // The name is the rest of the line, spaces inside it included.
  std::string_view rest = Trim(line);
  for (int i = 0; i < 9; ++i) rest = Trim(rest.substr(words[i].size()));
  image.name = rest;
  return image;
}

Result<ColmapModel> ReadColmapModelText(const std::string& folder) {
  ColmapModel model;
  CAIRN_ASSIGN_OR_RETURN(model.cameras, ReadCamerasText(folder + "/cameras.txt"));
  CAIRN_RETURN_IF_ERROR(ReadTextImages(folder + "/images.txt", &model));
  const std::string points_path = folder + "/points3D.txt";
  std::error_code error;
  if (std::filesystem::exists(points_path, error)) CAIRN_RETURN_IF_ERROR(ReadTextPoints(points_path, &model));
  return model;
}

Status WriteColmapModelText(const ColmapModel& model, const std::string& folder) {
  const std::string images_path = folder + "/images.txt";
  for (const ModelImage& image : model.images)
    CAIRN_RETURN_IF_ERROR(CheckListedName(images_path, image.name));
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", model.cameras));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(images_path, ImagesText(model)));
  return WriteFileAtomically(folder + "/points3D.txt", PointsText(model));
}

}  // namespace cairn
