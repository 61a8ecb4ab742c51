#include "pipeline/build/footage.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "core/base/text.h"
#include "core/capture/bag_file.h"
#include "core/capture/frame_choice.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_model.h"
#include "core/images/image_file.h"
#include "pipeline/build/make_words.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

Status CheckTopic(const std::string& text) {
  const bool is_name =
      !text.empty() && text.front() != '-' && std::all_of(text.begin(), text.end(), [](unsigned char c) {
        return c < 0x80 && (std::isalnum(c) != 0 || c == '_' || c == '/' || c == '-' || c == '.');
      });
  if (is_name) return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "'{}': not a topic's name: expected letters, digits, '_' and '/', such as /camera/image_raw", text);
}

// `what` is where.
Result<std::string> PlaceText(const std::string& text, const char* what) {
  const std::optional<std::vector<double>> numbers = ParseNumbers(text);
  if (!numbers || numbers->size() != 7) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "'{}': expected seven numbers [x, y, z, qx, qy, qz, qw]: where {}, metres, and its quaternion", text,
        what);
  }
  if (const Result<Pose> pose = CameraOnRobot(*numbers); !pose.ok()) return pose.error();
  return fmt::format("{}", fmt::join(*numbers, ","));
}

Result<std::string> TimeGapText(const std::string& text) {
  double seconds = -1;
  if (ParseNumber(text, &seconds) && std::isfinite(seconds) && seconds >= 0)
    return fmt::format("{}", seconds);
  return MakeError(ErrorCode::kInvalidArgument, "'{}': expected seconds, at least 0", text);
}

// The text as the import takes it.
Result<std::string> CheckedText(const std::string& name, const std::string& text) {
  if (name == "camera_on_robot") return PlaceText(text, "the camera's optical frame is on the robot");
  if (name == "imu_on_camera") return PlaceText(text, "the IMU is in the camera's optical frame");
  if (name == "max_time_gap_s") return TimeGapText(text);
  if (name == "topic" || name == "odometry" || name == "imu") CAIRN_RETURN_IF_ERROR(CheckTopic(text));
  if (name == "keyframes") {
    if (const auto wanted = ParseFrameChoice(text); !wanted.ok()) return wanted.error();
  }
  if (name == "camera") {
    if (const auto camera = ParseCamera(text); !camera.ok()) return camera.error();
  }
  return text;
}

// Whether a folder is laid out as a capture.  Images deeper in it may be those of a build folder, of a bag
// that was compiled where it is.
bool HasImages(const std::string& folder) {
  std::error_code error;
  if (fs::is_directory(folder + "/images", error)) return true;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (HasImageSuffix(entry.path().string())) return true;
  }
  return false;
}

const char* KindText(CaptureKind kind) {
  return kind == CaptureKind::kBag ? "a bag" : kind == CaptureKind::kFilm ? "a film" : "a folder of images";
}

}  // namespace

Result<Pose> CameraOnRobot(const std::vector<double>& v) {
  Pose pose{Eigen::Quaterniond(v[6], v[3], v[4], v[5]), Eigen::Vector3d(v[0], v[1], v[2])};
  CAIRN_RETURN_IF_ERROR(NormalizePose(&pose));
  return pose;
}

CaptureKind KindOfCapture(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error))
    return IsBag(path) && !HasImages(path) ? CaptureKind::kBag : CaptureKind::kFolder;
  if (IsBag(path)) return CaptureKind::kBag;
  return fs::is_regular_file(path, error) ? CaptureKind::kFilm : CaptureKind::kFolder;
}

const std::vector<FootageKey>& FootageKeys() {
  static const std::vector<FootageKey> keys = {
      {"keyframes", "text or number",
       "Of a film or bag: \"auto\" (sharp frames, from each of which enough of the one before is seen), "
       "\"all\", or the seconds between images. Default \"auto\".",
       true, &FootageOptions::keyframes},
      {"camera", "text",
       "Of a film or bag: its camera as \"MODEL,WIDTH,HEIGHT,PARAM,...\", of the upright picture. Default: "
       "as "
       "the bag's `camera_info` states; of a film: not known.",
       true, &FootageOptions::camera},
      {"topic", "text", "Of a bag: the topic of the images. Default: the only one.", false,
       &FootageOptions::topic},
      {"odometry", "text",
       "Of a bag: the topic of the odometry, or \"none\". Default: the only one, if there is one.", false,
       &FootageOptions::odometry},
      {"camera_on_robot", "list",
       "Of a bag: the camera's optical frame (x right, y down, z ahead) in the odometry's child frame, as "
       "[x, y, "
       "z, qx, qy, qz, qw], metres and quaternion. Default: as `/tf` and `/tf_static` state.",
       false, &FootageOptions::camera_on_robot},
      {"imu", "text",
       "Of a bag: the topic of the IMU, or \"none\". Default: the only one that measures turns and "
       "accelerations, "
       "if there is one.",
       false, &FootageOptions::imu},
      {"imu_on_camera", "list",
       "Of a bag: the IMU's frame in the camera's optical frame (x right, y down, z ahead), as [x, y, z, qx, "
       "qy, qz, "
       "qw], metres and quaternion. Default: as `/tf` and `/tf_static` state; where they do not, it is found "
       "from "
       "turns.",
       false, &FootageOptions::imu_on_camera},
      {"max_time_gap_s", "number",
       "Of a bag: an image's odometry lies between poses at most this far from it, seconds. Default 0.2.",
       false, &FootageOptions::max_time_gap_s},
  };
  return keys;
}

Status SetFootageOption(const FootageKey& key, const std::string& text, FootageOptions* options) {
  Result<std::string> checked = CheckedText(key.name, text);
  if (!checked.ok()) return MakeError(checked.error().code, "{}: {}", key.name, checked.error().message);
  CAIRN_RETURN_IF_ERROR(CheckMakeWord(key.name, *checked));
  options->*key.option = *checked;
  return Ok();
}

Status CheckIsFor(const FootageKey& key, CaptureKind kind, const std::string& path) {
  if (kind == CaptureKind::kBag || (kind == CaptureKind::kFilm && key.is_for_films)) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{} is for {}, and {} is {}; leave it out{}", key.name,
                   key.is_for_films ? "films and bags" : "bags", path, KindText(kind),
                   key.name == std::string("camera") ? " (a folder has its cameras in cameras.txt)" : "");
}

std::vector<std::string> FootageWords(CaptureKind kind, const FootageOptions& options) {
  std::vector<std::string> words = {"--format", kind == CaptureKind::kBag ? "bag" : "film"};
  for (const FootageKey& key : FootageKeys()) {
    const std::string& value = options.*key.option;
    if (value.empty()) continue;
    std::string option = std::string("--") + key.name;
    std::replace(option.begin(), option.end(), '_', '-');
    words.insert(words.end(), {option, value});
  }
  return words;
}

}  // namespace cairn::pipeline
