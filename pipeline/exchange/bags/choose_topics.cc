#include "pipeline/exchange/bags/choose_topics.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <string_view>
#include <tuple>
#include <utility>

#include "core/base/printable.h"
#include "pipeline/exchange/bags/image_pixels.h"

namespace cairn::pipeline {
namespace {

constexpr char kImageType[] = "sensor_msgs/Image";
constexpr char kCompressedImageType[] = "sensor_msgs/CompressedImage";
constexpr char kCameraInfoType[] = "sensor_msgs/CameraInfo";
constexpr char kOdometryType[] = "nav_msgs/Odometry";
constexpr char kImuType[] = "sensor_msgs/Imu";

bool IsImageTopic(const BagTopic& topic) {
  return topic.type == kImageType || topic.type == kCompressedImageType;
}

// Whose messages count by when they were sent.
bool IsTimedTopic(const BagTopic& topic) {
  return IsImageTopic(topic) || topic.type == kOdometryType || topic.type == kImuType;
}

// Every so many compressed images one is decoded for its size, and more at the beginning.
constexpr int64_t kImagesPerSize = 50;

class ContentsVisitor : public BagVisitor {
 public:
  bool Wants(const BagTopic& topic, int64_t record_time_ns) override {
    TopicContents& contents = contents_.topics[topic.name];
    contents.topic = topic;
    ++contents.num_messages;
    contents.recorded.Add(record_time_ns);
    return topic.type == kCameraInfoType || IsTransformTopic(topic) || IsTimedTopic(topic);
  }

  // What cannot be read is counted where it is imported; here it is no topic's first message.
  Status Take(const BagMessage& message) override {
    TopicContents& contents = contents_.topics[message.topic.name];
    Status status;
    if (message.topic.type == kImageType) status = TakeImage(message, &contents);
    if (message.topic.type == kCompressedImageType) status = TakeCompressedImage(message, &contents);
    if (message.topic.type == kCameraInfoType) status = TakeCameraInfo(message, &contents);
    if (message.topic.type == kOdometryType) status = TakeOdometry(message, &contents);
    if (message.topic.type == kImuType) status = TakeImu(message, &contents);
    if (IsTransformTopic(message.topic)) status = TakeTransforms(message);
    if (status.ok() && IsTimedTopic(message.topic)) {
      if (const Result<MessageHeader> header = DecodeHeader(message); header.ok())
        contents.clock.Add(header->stamp_ns, message.record_time_ns);
    }
    if (!status.ok() && contents.problem.empty()) contents.problem = status.error().message;
    return Ok();
  }

  BagContents Finish() {
    for (auto& [name, contents] : contents_.topics) {
      contents.clock.Finish();
      int64_t most = 0;
      for (const auto& [size, count] : sizes_[name]) {
        if (count <= most) continue;
        most = count;
        std::tie(contents.width, contents.height) = size;
      }
    }
    for (auto& [child, clock] : contents_.frame_clocks) clock.Finish();
    return std::move(contents_);
  }

 private:
  Status TakeImage(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const ImageMessage image, DecodeImage(message));
    const bool is_whole = image.bytes.size() >= static_cast<uint64_t>(image.step) * image.height;
    if (is_whole && IsPictureEncoding(image.encoding))
      ++sizes_[message.topic.name][{image.width, image.height}];
    if (contents->header) return Ok();
    contents->header = image.header;
    contents->encoding = image.encoding;
    return Ok();
  }
  Status TakeCompressedImage(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const CompressedImageMessage image, DecodeCompressedImage(message));
    const auto index = static_cast<uint64_t>(contents->num_messages - 1);
    if (std::has_single_bit(index) || index % kImagesPerSize == 0) {
      if (const Result<BagPicture> picture = PictureOf(image); picture.ok())
        ++sizes_[message.topic.name][{picture->grey.cols, picture->grey.rows}];
    }
    if (contents->header) return Ok();
    contents->header = image.header;
    contents->encoding = image.format;
    return Ok();
  }
  static Status TakeCameraInfo(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const CameraInfoMessage camera_info, DecodeCameraInfo(message));
    if (!contents->camera_info) {
      contents->header = camera_info.header;
      contents->camera_info = camera_info;
    } else if (!(*contents->camera_info == camera_info)) {
      contents->camera_info_changes = true;
    }
    return Ok();
  }
  static Status TakeOdometry(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const OdometryMessage odometry, DecodeOdometry(message));
    if (contents->header) return Ok();
    contents->header = odometry.header;
    contents->child_frame_id = odometry.child_frame_id;
    return Ok();
  }
  static Status TakeImu(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const ImuMessage imu, DecodeImu(message));
    if (!contents->header) contents->header = imu.header;
    return Ok();
  }
  Status TakeTransforms(const BagMessage& message) {
    int64_t num_invalid = 0;
    CAIRN_ASSIGN_OR_RETURN(const auto transforms, DecodeTransforms(message, &num_invalid));
    for (const TransformMessage& transform : transforms) {
      contents_.frames.AddLink(transform.header.frame_id, transform.child_frame_id);
      if (IsStaticTransformTopic(message.topic)) continue;
      contents_.frame_clocks[transform.child_frame_id].Add(transform.header.stamp_ns, message.record_time_ns);
    }
    return Ok();
  }

  BagContents contents_;
  std::map<std::string, std::map<std::pair<int64_t, int64_t>, int64_t>> sizes_;  // of a topic's images
};

// Depth and disparity are images, but no pictures.
bool HasPictures(const TopicContents& contents) {
  if (contents.topic.type == kCompressedImageType)
    return contents.encoding.find("compressedDepth") == std::string::npos;
  return contents.topic.type == kImageType && (!contents.header || IsPictureEncoding(contents.encoding));
}

std::string RateText(const TopicContents& contents) {
  const TimeSpan& recorded = contents.recorded;
  const double seconds = 1e-9 * static_cast<double>(recorded.last_ns - recorded.first_ns);
  if (!(seconds > 0)) return "";
  return fmt::format("{:.1f}", static_cast<double>(contents.num_messages - 1) / seconds);
}

std::string SizeText(const TopicContents& contents) {
  return contents.width > 0 ? fmt::format("{} x {}", contents.width, contents.height) : "";
}

std::string TopicTable(const BagContents& contents) {
  size_t name_width = 5, type_width = 4, size_width = 4;
  for (const auto& [name, topic] : contents.topics) {
    name_width = std::max(name_width, name.size());
    type_width = std::max(type_width, topic.topic.type.size());
    size_width = std::max(size_width, SizeText(topic).size());
  }
  std::string table;
  const auto add = [&](const std::string& name, const std::string& type, const std::string& messages,
                       const std::string& rate, const std::string& size, const std::string& encoding) {
    std::string line = fmt::format("  {:{}}  {:{}}  {:>8}  {:>7}  {:{}}  {}", name, name_width, type,
                                   type_width, messages, rate, size, size_width, encoding);
    line.resize(line.find_last_not_of(' ') + 1);
    table += "\n" + line;
  };
  add("topic", "type", "messages", "Hz", "size", "encoding");
  for (const auto& [name, topic] : contents.topics) {
    add(name, topic.topic.type, std::to_string(topic.num_messages), RateText(topic), SizeText(topic),
        topic.encoding);
  }
  return Printable(table);
}

// The topic of the same camera's images as they were before they were compressed, with as many of them; null:
// none.
const TopicContents* RawTwin(const BagContents& contents, const TopicContents& compressed) {
  constexpr std::string_view kSuffix = "/compressed";
  std::string name = compressed.topic.name;
  if (compressed.topic.type != kCompressedImageType || !name.ends_with(kSuffix)) return nullptr;
  name.resize(name.size() - kSuffix.size());
  const auto raw = contents.topics.find(name);
  const bool is_twin = raw != contents.topics.end() && raw->second.topic.type == kImageType &&
                       raw->second.header && HasPictures(raw->second) &&
                       raw->second.num_messages == compressed.num_messages;
  return is_twin ? &raw->second : nullptr;
}

// What messages say of choosing one kind of topic.
struct TopicKind {
  const char* things;
  const char* option;
  const char* key;  // of a recipe
  std::function<bool(const TopicContents&)> fits;
};

// The topic that is asked for, or the only one that fits; none if none does and none is asked for.
Result<std::optional<TopicContents>> Choose(const BagContents& contents, const std::string& bag_path,
                                            const std::string& asked, const TopicKind& kind) {
  if (!asked.empty()) {
    auto topic = contents.topics.find(asked);
    if (topic == contents.topics.end()) topic = contents.topics.find("/" + asked);
    if (topic == contents.topics.end()) {
      return MakeError(ErrorCode::kNotFound, "{}: no topic {}; there are{}", bag_path, asked,
                       TopicTable(contents));
    }
    return std::optional<TopicContents>(topic->second);
  }
  std::optional<TopicContents> only;
  for (const auto& [name, topic] : contents.topics) {
    if (!kind.fits(topic)) continue;
    if (only) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: several topics have {}; choose one with {} {}, or in a recipe's [[capture]] with {} = "
          "\"{}\"{}",
          bag_path, kind.things, kind.option, only->topic.name, kind.key, only->topic.name,
          TopicTable(contents));
    }
    only = topic;
  }
  return only;
}

}  // namespace

bool IsTransformTopic(const BagTopic& topic) {
  return topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage";
}
bool IsStaticTransformTopic(const BagTopic& topic) {
  return IsTransformTopic(topic) && topic.name.ends_with("tf_static");
}

Result<BagContents> LookThrough(Bag& bag) {
  ContentsVisitor visitor;
  CAIRN_ASSIGN_OR_RETURN(std::vector<std::string> damage, bag.Read(visitor));
  BagContents contents = visitor.Finish();
  contents.damage = std::move(damage);
  return contents;
}

Result<TopicContents> ChooseImages(const BagContents& contents, const std::string& bag_path,
                                   const std::string& asked, std::vector<std::string>* warnings) {
  const auto fits = [&](const TopicContents& topic) {
    return HasPictures(topic) && RawTwin(contents, topic) == nullptr;
  };
  CAIRN_ASSIGN_OR_RETURN(const std::optional<TopicContents> chosen,
                         Choose(contents, bag_path, asked, {"images", "--topic", "topic", fits}));
  if (!chosen) {
    return MakeError(ErrorCode::kNoData, "{}: no topic has images ({} or {}, no depth); the bag has {}",
                     bag_path, kImageType, kCompressedImageType,
                     contents.topics.empty() ? "no messages" : TopicTable(contents));
  }
  if (!IsImageTopic(chosen->topic)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the topic {} has no images, but {}; there are{}",
                     bag_path, asked, chosen->topic.type, TopicTable(contents));
  }
  if (!chosen->header) {
    return MakeError(ErrorCode::kCorrupt, "{}: no message of {} can be read; the first: {}", bag_path,
                     chosen->topic.name, chosen->problem);
  }
  const auto compressed = contents.topics.find(chosen->topic.name + "/compressed");
  if (asked.empty() && compressed != contents.topics.end() &&
      RawTwin(contents, compressed->second) != nullptr) {
    warnings->push_back(
        fmt::format("{}: the images of {} are taken, not those of {}, of which there are as many", bag_path,
                    chosen->topic.name, compressed->first));
  }
  return *chosen;
}

Result<std::optional<TopicContents>> ChooseOdometry(const BagContents& contents, const std::string& bag_path,
                                                    const std::string& asked) {
  if (asked == "none") return std::optional<TopicContents>();
  CAIRN_ASSIGN_OR_RETURN(std::optional<TopicContents> chosen,
                         Choose(contents, bag_path, asked,
                                {"odometry", "--odometry none, or --odometry", "odometry",
                                 [](const auto& topic) { return topic.topic.type == kOdometryType; }}));
  if (chosen && chosen->topic.type != kOdometryType) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: the topic {} has no odometry ({}), but {}; there are{}", bag_path, asked,
                     kOdometryType, chosen->topic.type, TopicTable(contents));
  }
  return chosen;
}

Result<std::optional<TopicContents>> ChooseImu(const BagContents& contents, const std::string& bag_path,
                                               const std::string& asked, std::vector<std::string>* warnings) {
  if (asked == "none") return std::optional<TopicContents>();
  const auto fits = [](const TopicContents& topic) { return topic.topic.type == kImuType && topic.header; };
  if (asked.empty()) {
    std::string names;
    int num = 0;
    for (const auto& [name, topic] : contents.topics) {
      if (fits(topic)) names += (num++ == 0 ? "" : ", ") + name;
    }
    if (num > 1) {
      warnings->push_back(fmt::format(
          "{}: several topics have an IMU ({}), and none is taken: --imu chooses one, or imu in a recipe's "
          "[[capture]]",
          bag_path, names));
      return std::optional<TopicContents>();
    }
  }
  CAIRN_ASSIGN_OR_RETURN(std::optional<TopicContents> chosen,
                         Choose(contents, bag_path, asked, {"an IMU", "--imu none, or --imu", "imu", fits}));
  if (chosen && chosen->topic.type != kImuType) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the topic {} has no IMU ({}), but {}; there are{}",
                     bag_path, asked, kImuType, chosen->topic.type, TopicTable(contents));
  }
  if (chosen && !chosen->header) {
    return MakeError(ErrorCode::kCorrupt, "{}: no message of {} can be read; the first: {}", bag_path,
                     chosen->topic.name, chosen->problem);
  }
  return chosen;
}

std::optional<TopicContents> CameraInfoOf(const BagContents& contents, const TopicContents& images) {
  std::string name = images.topic.name;
  if (images.topic.type == kCompressedImageType && name.ends_with("/compressed"))
    name.resize(name.rfind('/'));
  const size_t end = name.rfind('/');
  const std::string beside = end == std::string::npos ? "camera_info" : name.substr(0, end) + "/camera_info";
  if (const auto topic = contents.topics.find(beside);
      topic != contents.topics.end() && topic->second.topic.type == kCameraInfoType)
    return topic->second;
  std::optional<TopicContents> only;
  for (const auto& [other, topic] : contents.topics) {
    if (!topic.camera_info || topic.header->frame_id != images.header->frame_id) continue;
    if (only) return std::nullopt;
    only = topic;
  }
  return only;
}

bool AreRectified(const TopicContents& images) {
  return images.topic.name.find("/image_rect") != std::string::npos ||
         images.topic.name.starts_with("image_rect");
}

}  // namespace cairn::pipeline
