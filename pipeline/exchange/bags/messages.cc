#include "pipeline/exchange/bags/messages.h"

#include <tuple>

#include "pipeline/exchange/bags/files/bag_bytes.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

// CDR's first four bytes: the kind, of which the second is 0 (big-endian) or 1 (little-endian), and options.
constexpr size_t kCdrHeadBytes = 4;

// The fields of a message, one after the other.
class MessageFields {
 public:
  static Result<MessageFields> Of(const BagMessage& message) {
    if (message.topic.serialization == Serialization::kRos1)
      return MessageFields(message.bytes, false, false);
    if (message.topic.serialization != Serialization::kCdr)
      return MakeError(ErrorCode::kUnsupported, "its serialization is neither CDR nor ROS 1's");
    if (message.bytes.size() < kCdrHeadBytes)
      return MakeError(ErrorCode::kCorrupt, "{} bytes are no message", message.bytes.size());
    const auto kind = static_cast<uint8_t>(message.bytes[1]);
    if (message.bytes[0] != 0 || kind > 1) {
      return MakeError(ErrorCode::kUnsupported, "it begins with {:02x} {:02x}; plain CDR has 00 00 or 00 01",
                       static_cast<uint8_t>(message.bytes[0]), kind);
    }
    return MessageFields(message.bytes.substr(kCdrHeadBytes), true, kind == 0);
  }

  bool is_cdr() const { return is_cdr_; }
  bool is_ok() const { return cursor_.is_ok(); }

  // CDR: numbers stand at multiples of their size.
  template <class T>
  T Get() {
    if (is_cdr_) cursor_.Take((sizeof(T) - cursor_.place() % sizeof(T)) % sizeof(T));
    return cursor_.Get<T>(is_big_endian_);
  }
  std::string Text() {
    std::string_view text = cursor_.Take(Get<uint32_t>());
    if (is_cdr_ && text.ends_with('\0')) text.remove_suffix(1);
    return std::string(text);
  }
  std::string_view Bytes() { return cursor_.Take(Get<uint32_t>()); }
  std::vector<double> Doubles() {
    const auto count = Get<uint32_t>();
    std::vector<double> values;
    for (uint32_t i = 0; i < count && is_ok(); ++i) values.push_back(Get<double>());
    return values;
  }
  std::string FrameName() {
    std::string name = Text();
    return name.starts_with('/') ? name.substr(1) : name;
  }
  MessageHeader Header() {
    if (!is_cdr_) Get<uint32_t>();  // seq
    const int64_t seconds = is_cdr_ ? Get<int32_t>() : Get<uint32_t>();
    const auto nanoseconds = Get<uint32_t>();
    return {std::max<int64_t>(seconds, 0) * 1'000'000'000 + (seconds < 0 ? 0 : nanoseconds), FrameName()};
  }
  Eigen::Vector3d Vector() {
    const auto x = Get<double>(), y = Get<double>();
    return {x, y, Get<double>()};
  }
  // The first number of a covariance of three values.
  double Covariance() {
    const auto first = Get<double>();
    for (int i = 1; i < 9; ++i) Get<double>();
    return first;
  }
  // x y z, then the quaternion x y z w.
  Result<Pose> ReadPose() {
    double v[7];
    for (double& value : v) value = Get<double>();
    const double numbers[] = {v[6], v[3], v[4], v[5], v[0], v[1], v[2]};
    return PoseFromNumbers(numbers);
  }
  Status Check(const BagMessage& message) const {
    if (is_ok()) return Ok();
    return MakeError(ErrorCode::kCorrupt, "{} bytes are too few for a {}", message.bytes.size(),
                     message.topic.type);
  }

 private:
  MessageFields(std::string_view bytes, bool is_cdr, bool is_big_endian)
      : cursor_(bytes), is_cdr_(is_cdr), is_big_endian_(is_big_endian) {}

  ByteCursor cursor_;
  bool is_cdr_;
  bool is_big_endian_;
};

}  // namespace

Result<MessageHeader> DecodeHeader(const BagMessage& message) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  MessageHeader header = fields.Header();
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  return header;
}

Result<ImageMessage> DecodeImage(const BagMessage& message) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  ImageMessage image;
  image.header = fields.Header();
  image.height = fields.Get<uint32_t>();
  image.width = fields.Get<uint32_t>();
  image.encoding = fields.Text();
  image.is_big_endian = fields.Get<uint8_t>() != 0;
  image.step = fields.Get<uint32_t>();
  image.bytes = fields.Bytes();
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  return image;
}

Result<CompressedImageMessage> DecodeCompressedImage(const BagMessage& message) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  CompressedImageMessage image;
  image.header = fields.Header();
  image.format = fields.Text();
  image.bytes = fields.Bytes();
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  return image;
}

bool CameraInfoMessage::operator==(const CameraInfoMessage& other) const {
  const auto parts = [](const CameraInfoMessage& c) {
    return std::tie(c.width, c.height, c.distortion_model, c.d, c.k, c.p, c.binning_x, c.binning_y, c.roi_x,
                    c.roi_y, c.roi_width, c.roi_height);
  };
  return parts(*this) == parts(other);
}

Result<CameraInfoMessage> DecodeCameraInfo(const BagMessage& message) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  CameraInfoMessage camera;
  camera.header = fields.Header();
  camera.height = fields.Get<uint32_t>();
  camera.width = fields.Get<uint32_t>();
  camera.distortion_model = fields.Text();
  camera.d = fields.Doubles();
  for (double& value : camera.k) value = fields.Get<double>();
  for (int i = 0; i < 9; ++i) fields.Get<double>();  // R
  for (double& value : camera.p) value = fields.Get<double>();
  camera.binning_x = fields.Get<uint32_t>();
  camera.binning_y = fields.Get<uint32_t>();
  camera.roi_x = fields.Get<uint32_t>();
  camera.roi_y = fields.Get<uint32_t>();
  camera.roi_height = fields.Get<uint32_t>();
  camera.roi_width = fields.Get<uint32_t>();
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  return camera;
}

Result<OdometryMessage> DecodeOdometry(const BagMessage& message) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  OdometryMessage odometry;
  odometry.header = fields.Header();
  odometry.child_frame_id = fields.FrameName();
  const Result<Pose> pose = fields.ReadPose();
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  if (!pose.ok()) return pose.error();
  odometry.odom_from_child = *pose;
  return odometry;
}

Result<ImuMessage> DecodeImu(const BagMessage& message) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  ImuMessage imu;
  imu.header = fields.Header();
  for (int i = 0; i < 4; ++i) fields.Get<double>();  // orientation, which the driver has guessed
  fields.Covariance();
  imu.turn_rad_s = fields.Vector();
  const bool has_turn = fields.Covariance() != -1;
  imu.accel_m_s2 = fields.Vector();
  const bool has_accel = fields.Covariance() != -1;
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  if (!has_turn || !has_accel) {
    return MakeError(ErrorCode::kCorrupt, "it says that it has no {}",
                     has_turn ? "linear acceleration" : "angular velocity");
  }
  if (!imu.turn_rad_s.allFinite() || !imu.accel_m_s2.allFinite())
    return MakeError(ErrorCode::kCorrupt, "a value that is not finite");
  return imu;
}

Result<std::vector<TransformMessage>> DecodeTransforms(const BagMessage& message, int64_t* num_invalid) {
  CAIRN_ASSIGN_OR_RETURN(MessageFields fields, MessageFields::Of(message));
  std::vector<TransformMessage> transforms;
  const auto count = fields.Get<uint32_t>();
  for (uint32_t i = 0; i < count && fields.is_ok(); ++i) {
    TransformMessage transform;
    transform.header = fields.Header();
    transform.child_frame_id = fields.FrameName();
    const Result<Pose> pose = fields.ReadPose();
    CAIRN_RETURN_IF_ERROR(fields.Check(message));
    if (!pose.ok()) {
      ++*num_invalid;
      continue;
    }
    transform.parent_from_child = *pose;
    transforms.push_back(std::move(transform));
  }
  CAIRN_RETURN_IF_ERROR(fields.Check(message));
  return transforms;
}

}  // namespace cairn::pipeline
