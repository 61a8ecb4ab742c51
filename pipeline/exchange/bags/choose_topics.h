#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "pipeline/exchange/bags/files/bag.h"
#include "pipeline/exchange/bags/frame_tree.h"
#include "pipeline/exchange/bags/messages.h"
#include "pipeline/exchange/bags/topic_clock.h"

namespace cairn::pipeline {

// A topic and what its first messages say.
struct TopicContents {
  BagTopic topic;
  int64_t num_messages = 0;
  TimeSpan recorded;                    // when messages were recorded, since 1970
  std::optional<MessageHeader> header;  // of images, camera_info, odometry and IMUs
  std::string encoding;                 // of images: "bgr8", "jpeg"
  int64_t width = 0, height = 0;        // of most images, px; 0: not known
  TopicClock clock;                     // of images, odometry and IMUs
  std::string child_frame_id;           // of odometry
  std::optional<CameraInfoMessage> camera_info;
  bool camera_info_changes = false;
  std::string problem;  // why the first message cannot be read; "": it can
};

struct BagContents {
  std::map<std::string, TopicContents> topics;  // by name
  FrameTree frames;
  std::map<std::string, TopicClock> frame_clocks;  // of the frames' transforms, by child; /tf_static has none
  std::vector<std::string> damage;                 // sentences of Bag::Read
};

// Reads a bag once, of compressed images few.  Errors: those of Bag::Read.
Result<BagContents> LookThrough(Bag& bag);

bool IsTransformTopic(const BagTopic& topic);
// Its frames hold for ever.
bool IsStaticTransformTopic(const BagTopic& topic);

// The topic of images that is asked for, or the only one whose messages are pictures (depth is not).  A topic
// and its NAME/compressed with as many messages are one camera: then the former is taken, which `warnings`
// say.
// Errors, with a table of the bag's topics: NotFound (no such topic), NoData (no images), InvalidArgument
// (the topic has none; several have); Unsupported (an encoding that is not known).
Result<TopicContents> ChooseImages(const BagContents& contents, const std::string& bag_path,
                                   const std::string& asked, std::vector<std::string>* warnings);

// The topic of odometry that is asked for, or the only one; none if there is none, or "none" is asked for.
// Errors: as ChooseImages.
Result<std::optional<TopicContents>> ChooseOdometry(const BagContents& contents, const std::string& bag_path,
                                                    const std::string& asked);

// The topic of an IMU that is asked for, or the only one that measures both turns and accelerations; none if
// there is none, if "none" is asked for, or if there are several, which `warnings` say.  Errors: as
// ChooseImages, of what is asked for.
Result<std::optional<TopicContents>> ChooseImu(const BagContents& contents, const std::string& bag_path,
                                               const std::string& asked, std::vector<std::string>* warnings);

// The camera_info of images: that beside them (/camera/camera_info of /camera/image_raw/compressed), else the
// only one in their frame.
std::optional<TopicContents> CameraInfoOf(const BagContents& contents, const TopicContents& images);

// Whether images have been rectified: the name of their topic says so (/camera/image_rect_color).
bool AreRectified(const TopicContents& images);

}  // namespace cairn::pipeline
