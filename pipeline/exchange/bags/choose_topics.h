#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "pipeline/exchange/bags/bag.h"
#include "pipeline/exchange/bags/frame_tree.h"
#include "pipeline/exchange/bags/messages.h"

namespace cairn::pipeline {

// What the stamps of a topic's headers are, seen from the times at which its messages were recorded.  A clock
// is right or wrong by the same for all messages, but for the delay of recording; a stamp far from that is
// none that the clock gave (a driver's first message, a counter that ran over).
class TopicClock {
 public:
  // Of a message; stamp 0: not set.
  void Add(int64_t stamp_ns, int64_t record_time_ns);
  // REQUIRES: once, after the last Add and before what follows.
  void Finish();

  // Whether a stamp is farther from the median than 10 s and ten times as far as the median stamp: where
  // recording times say nothing (a bag that was converted), all stamps count.
  bool IsWild(int64_t stamp_ns, int64_t record_time_ns) const;
  // The stamp; without one, or with a wild one, the time of recording as the topic's clock shows it.
  int64_t TimeOf(int64_t stamp_ns, int64_t record_time_ns) const;

  int64_t ahead_ns() const { return ahead_ns_; }    // of the times of recording: the median
  int64_t spread_ns() const { return spread_ns_; }  // median distance from that
  bool has_stamps() const { return !aheads_ns_.empty(); }

 private:
  std::vector<int64_t> aheads_ns_;
  int64_t ahead_ns_ = 0, spread_ns_ = 0;
};

// A topic and what its first messages say.
struct TopicContents {
  BagTopic topic;
  int64_t num_messages = 0;
  int64_t first_time_ns = 0, last_time_ns = 0;  // at which messages were recorded, since 1970
  std::optional<MessageHeader> header;          // of images, camera_info, odometry and IMUs
  std::string encoding;                         // of images: "bgr8", "jpeg"
  int64_t width = 0, height = 0;                // of most images, px; 0: not known
  TopicClock clock;                             // of images and odometry
  std::string child_frame_id;                   // of odometry
  std::optional<CameraInfoMessage> camera_info;
  bool camera_info_changes = false;
  std::string problem;  // why the first message cannot be read; "": it can
};

struct BagContents {
  std::map<std::string, TopicContents> topics;  // by name
  FrameTree frames;
  std::vector<std::string> damage;  // sentences of Bag::Read
};

// Reads a bag once, of compressed images few.  Errors: those of Bag::Read.
Result<BagContents> LookThrough(Bag& bag);

bool IsTransformTopic(const BagTopic& topic);

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
