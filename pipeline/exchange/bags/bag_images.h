#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <opencv2/core/types.hpp>

#include "core/base/error.h"
#include "core/capture/keyframes.h"
#include "pipeline/exchange/bags/bag_options.h"
#include "pipeline/exchange/bags/bag_plan.h"
#include "pipeline/exchange/bags/image_pixels.h"
#include "pipeline/exchange/bags/topic_clock.h"

namespace cairn::pipeline {

struct WrittenImage {
  std::string name;
  int64_t time_ns = 0;
};

// Seconds, of one length, so that the order of names is that of time.
std::string TimeName(int64_t time_ns, const char* suffix);

// Chooses images of a bag and writes them into a capture's folder, named by their times.
class ImageImporter {
 public:
  // `plan` and `options` outlive it; `folder` has a folder images.
  ImageImporter(const BagPlan& plan, const BagOptions& options, std::string folder);

  // The next message of plan.images.  Errors: Io; what cannot be read is counted.
  Status Take(const BagMessage& message);
  // After the last one.
  Status Finish();

  const std::vector<WrittenImage>& written() const { return written_; }
  const TimeSpan& span() const { return span_; }  // of all that could be read
  cv::Size size() const { return size_; }
  std::vector<std::string> Warnings() const;  // without the bag's name

 private:
  struct HeldImage {
    BagPicture picture;
    int64_t time_ns = 0;
  };
  Result<HeldImage> Decode(const BagMessage& message);
  Status Write(const std::vector<int64_t>& indices);
  Status WriteImage(const HeldImage& image);

  const BagPlan& plan_;
  const BagOptions& options_;
  std::string folder_;
  SourceTimes times_;
  KeyframeChooser chooser_;
  int64_t num_taken_ = 0;
  std::map<int64_t, HeldImage> held_;  // those that may become keyframes
  std::vector<WrittenImage> written_;
  TimeSpan span_;
  cv::Size size_;
  PassedOver damaged_, resized_, late_;
};

}  // namespace cairn::pipeline
