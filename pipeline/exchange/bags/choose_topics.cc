#include "pipeline/exchange/bags/choose_topics.h"

#include <algorithm>

#include "core/base/printable.h"
#include "pipeline/exchange/bags/image_pixels.h"

namespace cairn::pipeline {
namespace {

constexpr char kImageType[] = "sensor_msgs/Image";
constexpr char kCompressedImageType[] = "sensor_msgs/CompressedImage";
constexpr char kCameraInfoType[] = "sensor_msgs/CameraInfo";
constexpr char kOdometryType[] = "nav_msgs/Odometry";

bool IsImageTopic(const BagTopic& topic) {
  return topic.type == kImageType || topic.type == kCompressedImageType;
}

class ContentsVisitor : public BagVisitor {
 public:
  bool Wants(const BagTopic& topic) override {
    TopicContents& contents = contents_.topics[topic.name];
    contents.topic = topic;
    ++contents.num_messages;
    const bool is_first = !contents.header;
    return topic.type == kCameraInfoType || IsTransformTopic(topic) ||
           (is_first && (IsImageTopic(topic) || topic.type == kOdometryType));
  }

  // What cannot be read is counted where it is imported; here it is no topic's first message.
  Status Take(const BagMessage& message) override {
    TopicContents& contents = contents_.topics[message.topic.name];
    Status status;
    if (message.topic.type == kImageType) status = TakeImage(message, &contents);
    if (message.topic.type == kCompressedImageType) status = TakeCompressedImage(message, &contents);
    if (message.topic.type == kCameraInfoType) status = TakeCameraInfo(message, &contents);
    if (message.topic.type == kOdometryType) status = TakeOdometry(message, &contents);
    if (IsTransformTopic(message.topic)) status = TakeTransforms(message);
    if (!status.ok() && contents.problem.empty()) contents.problem = status.error().message;
    return Ok();
  }

  BagContents contents_;

 private:
  static Status TakeImage(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const ImageMessage image, DecodeImage(message));
    contents->header = image.header;
    contents->encoding = image.encoding;
    return Ok();
  }
  static Status TakeCompressedImage(const BagMessage& message, TopicContents* contents) {
    CAIRN_ASSIGN_OR_RETURN(const CompressedImageMessage image, DecodeCompressedImage(message));
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
    contents->header = odometry.header;
    contents->child_frame_id = odometry.child_frame_id;
    return Ok();
  }
  Status TakeTransforms(const BagMessage& message) {
    int64_t num_invalid = 0;
    CAIRN_ASSIGN_OR_RETURN(const auto transforms, DecodeTransforms(message, &num_invalid));
    for (const TransformMessage& transform : transforms)
      contents_.frames.AddLink(transform.header.frame_id, transform.child_frame_id);
    return Ok();
  }
};

// Depth and disparity are images, but no pictures.
bool HasPictures(const TopicContents& contents) {
  if (contents.topic.type == kCompressedImageType)
    return contents.encoding.find("compressedDepth") == std::string::npos;
  return contents.topic.type == kImageType && (!contents.header || IsPictureEncoding(contents.encoding));
}

std::string TopicTable(const BagContents& contents) {
  size_t name_width = 5, type_width = 4;
  for (const auto& [name, topic] : contents.topics) {
    name_width = std::max(name_width, name.size());
    type_width = std::max(type_width, topic.topic.type.size());
  }
  std::string table =
      fmt::format("\n  {:{}}  {:{}}  {:>8}", "topic", name_width, "type", type_width, "messages");
  for (const auto& [name, topic] : contents.topics) {
    table += fmt::format("\n  {:{}}  {:{}}  {:>8}", name, name_width, topic.topic.type, type_width,
                         topic.num_messages);
    if (!topic.encoding.empty()) table += "  " + topic.encoding;
  }
  return Printable(table);
}

// What messages say of choosing one kind of topic.
struct TopicKind {
  const char* things;
  const char* option;
  bool (*fits)(const TopicContents&);
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
      return MakeError(ErrorCode::kInvalidArgument, "{}: several topics have {}; choose one with {} {}{}",
                       bag_path, kind.things, kind.option, only->topic.name, TopicTable(contents));
    }
    only = topic;
  }
  return only;
}

}  // namespace

bool IsTransformTopic(const BagTopic& topic) {
  return topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage";
}

Result<BagContents> LookThrough(Bag& bag) {
  ContentsVisitor visitor;
  CAIRN_ASSIGN_OR_RETURN(visitor.contents_.damage, bag.Read(visitor));
  return std::move(visitor.contents_);
}

Result<TopicContents> ChooseImages(const BagContents& contents, const std::string& bag_path,
                                   const std::string& asked) {
  CAIRN_ASSIGN_OR_RETURN(const std::optional<TopicContents> chosen,
                         Choose(contents, bag_path, asked, {"images", "--topic", HasPictures}));
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
  return *chosen;
}

Result<std::optional<TopicContents>> ChooseOdometry(const BagContents& contents, const std::string& bag_path,
                                                    const std::string& asked) {
  if (asked == "none") return std::optional<TopicContents>();
  CAIRN_ASSIGN_OR_RETURN(
      std::optional<TopicContents> chosen,
      Choose(contents, bag_path, asked, {"odometry", "--odometry none, or --odometry", [](const auto& topic) {
                                           return topic.topic.type == kOdometryType;
                                         }}));
  if (chosen && chosen->topic.type != kOdometryType) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: the topic {} has no odometry ({}), but {}; there are{}", bag_path, asked,
                     kOdometryType, chosen->topic.type, TopicTable(contents));
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
