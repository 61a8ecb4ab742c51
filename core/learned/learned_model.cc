#include "core/learned/learned_model.h"

#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <mutex>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/no_throw.h"
#include "core/base/text.h"
#include "core/features/smaller_image.h"
#include "core/files/file.h"
#include "core/files/input_file.h"
#include "core/learned/dense_heads.h"
#include "core/learned/onnx_outline.h"
#include "core/learned/windows.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMaxFileBytes = int64_t{512} << 20;
// An image's least side; below, most of what the net would see is continued.
constexpr int kMinImageSide = kWindowStepPx;
// Of the image on which a net is tried that takes any size.
constexpr int kTrialSide = 64;

// What the features are made of.
enum Head { kKeypoints, kReliability, kDescriptors, kNumHeads };
constexpr char kExpectedOutputs[] =
    "three, for each cell of 8 x 8 px: 65 channels (keypoints), 1 (reliability), and a descriptor";

int RoundUp(int px) { return (px + kWindowStepPx - 1) / kWindowStepPx * kWindowStepPx; }

// OpenCV reports a file's faults on the terminal before it throws them.  Its level is the whole program's:
// one file at a time.
class QuietOpenCv {
 public:
  QuietOpenCv()
      : lock_(Mutex()), level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~QuietOpenCv() { cv::utils::logging::setLogLevel(level_); }
  QuietOpenCv(const QuietOpenCv&) = delete;
  QuietOpenCv& operator=(const QuietOpenCv&) = delete;

 private:
  static std::mutex& Mutex() {
    static std::mutex mutex;
    return mutex;
  }

  std::lock_guard<std::mutex> lock_;
  cv::utils::logging::LogLevel level_;
};

// In one line, without the place in OpenCV's sources where it has one.
std::string ReasonOf(const std::exception& exception) {
  const auto* from_opencv = dynamic_cast<const cv::Exception*>(&exception);
  return fmt::format(
      "{}", fmt::join(SplitWords(from_opencv != nullptr ? from_opencv->err : exception.what()), " "));
}

// A grey image with something in it: the same in every run.
cv::Mat TrialImage(cv::Size size) {
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) image.at<uchar>(y, x) = static_cast<uchar>((x * x + 3 * y * y) / 7);
  }
  return image;
}

std::vector<int64_t> SizesOf(const cv::Mat& output) {
  return std::vector<int64_t>(output.size.p, output.size.p + output.dims);
}

std::string OutputsText(const std::vector<cv::Mat>& outputs) {
  std::string text;
  for (const cv::Mat& output : outputs) {
    if (!text.empty()) text += ", ";
    text += SizesText(SizesOf(output));
  }
  return text;
}

// Which output is which head; nothing where they are others.
std::optional<std::array<int, kNumHeads>> FindHeads(const std::vector<cv::Mat>& outputs, cv::Size image) {
  std::array<int, kNumHeads> heads{-1, -1, -1};
  if (outputs.size() != kNumHeads) return std::nullopt;
  for (int i = 0; i < kNumHeads; ++i) {
    const cv::Mat& output = outputs[i];
    if (output.dims != 4 || output.type() != CV_32F || output.size[0] != 1 ||
        output.size[2] * kCellPx != image.height || output.size[3] * kCellPx != image.width) {
      return std::nullopt;
    }
    const int num_channels = output.size[1];
    const Head head = num_channels == kNumKeypointLogits ? kKeypoints
                      : num_channels == 1                ? kReliability
                                                         : kDescriptors;
    if (heads[head] >= 0) return std::nullopt;
    heads[head] = i;
  }
  return heads;
}

// The best, in their former order.
void KeepBest(int num, std::vector<Peak>* peaks) {
  if (static_cast<int>(peaks->size()) <= num) return;
  const auto by_place = [](const Peak& a, const Peak& b) {
    return std::pair(a.pixel.y, a.pixel.x) < std::pair(b.pixel.y, b.pixel.x);
  };
  std::nth_element(peaks->begin(), peaks->begin() + num, peaks->end(), [&](const Peak& a, const Peak& b) {
    return a.score != b.score ? a.score > b.score : by_place(a, b);
  });
  peaks->resize(num);
  std::sort(peaks->begin(), peaks->end(), by_place);
}

}  // namespace

struct LearnedModel::Net {
  std::string path;
  std::string name;
  ContentHash hash;
  cv::dnn::Net net;
  int num_channels = 1;  // of its input
  cv::Size size;         // of its input; 0: any
  std::vector<std::string> outputs;
  std::array<int, kNumHeads> heads{};  // their places among the outputs
  int num_values = 0;

  // From what the file says.
  Status TakeOutline(const OnnxOutline& outline);
  // A run on an image shows what the outputs are.
  Status Try();
  // The outputs for an image of a size that the net takes.
  Result<std::vector<cv::Mat>> Run(const cv::Mat& grey);
  Result<DenseHeads> Heads(const cv::Mat& grey);
  Result<LearnedFeatures> Extract(const cv::Mat& grey, const LearnedOptions& options, const cv::Mat& mask);
};

Status LearnedModel::Net::TakeOutline(const OnnxOutline& outline) {
  constexpr char kExpected[] = "one of 1 x 1 or 3 x height x width, in multiples of 32 px or not fixed";
  if (outline.inputs.size() != 1) {
    return MakeError(ErrorCode::kUnsupported, "{}: the net has {} inputs, expected {}", path,
                     outline.inputs.size(), kExpected);
  }
  const std::vector<int64_t>& sizes = outline.inputs.front().sizes;
  const auto is_side = [](int64_t side) { return side % kWindowStepPx == 0 && side <= 1 << 16; };
  if (sizes.size() != 4 || sizes[0] > 1 || (sizes[1] != 1 && sizes[1] != 3) || !is_side(sizes[2]) ||
      !is_side(sizes[3]) || (sizes[2] == 0) != (sizes[3] == 0)) {
    return MakeError(ErrorCode::kUnsupported, "{}: the net's input is of {}, expected {}", path,
                     SizesText(sizes), kExpected);
  }
  if (outline.outputs.size() != kNumHeads) {
    return MakeError(ErrorCode::kUnsupported, "{}: the net has {} outputs, expected {}", path,
                     outline.outputs.size(), kExpectedOutputs);
  }
  num_channels = static_cast<int>(sizes[1]);
  size = cv::Size(static_cast<int>(sizes[3]), static_cast<int>(sizes[2]));
  for (const OnnxTensor& output : outline.outputs) outputs.push_back(output.name);
  return Ok();
}

Status LearnedModel::Net::Try() {
  const cv::Size trial = size.empty() ? cv::Size(kTrialSide, kTrialSide) : size;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<cv::Mat> found, Run(TrialImage(trial)));
  const auto found_heads = FindHeads(found, trial);
  if (!found_heads) {
    return MakeError(ErrorCode::kUnsupported, "{}: the net's outputs for {} x {} px are of {}; expected {}",
                     path, trial.width, trial.height, OutputsText(found), kExpectedOutputs);
  }
  heads = *found_heads;
  num_values = found[heads[kDescriptors]].size[1];
  return Ok();
}

Result<std::vector<cv::Mat>> LearnedModel::Net::Run(const cv::Mat& grey) {
  cv::Mat input({1, num_channels, grey.rows, grey.cols}, CV_32F);
  for (int channel = 0; channel < num_channels; ++channel) {
    cv::Mat plane(grey.size(), CV_32F, input.ptr<float>(0, channel));
    grey.convertTo(plane, CV_32F, 1.0 / 255);
  }
  std::vector<cv::Mat> found;
  try {
    net.setInput(input);
    net.forward(found, outputs);
  } catch (const std::exception& exception) {
    if (IsOutOfMemory(exception)) throw;
    return MakeError(ErrorCode::kUnsupported, "{}: OpenCV {} does not run the net on {} x {} px: {}", path,
                     CV_VERSION, grey.cols, grey.rows, ReasonOf(exception));
  }
  for (const cv::Mat& output : found) {
    if (!cv::checkRange(output.reshape(1, 1)))
      return Corrupt(path, "the net's outputs for {} x {} px are no numbers", grey.cols, grey.rows);
  }
  return found;
}

Result<DenseHeads> LearnedModel::Net::Heads(const cv::Mat& grey) {
  // Not below the size of a window, and in whole cells of the net's coarsest layer.
  const cv::Size whole(std::max(size.width, RoundUp(grey.cols)), std::max(size.height, RoundUp(grey.rows)));
  const cv::Size window_size = size.empty() ? whole : size;
  cv::Mat canvas;
  cv::copyMakeBorder(grey, canvas, 0, whole.height - grey.rows, 0, whole.width - grey.cols,
                     cv::BORDER_REFLECT_101);
  DenseHeads dense = EmptyHeads({whole.width / kCellPx, whole.height / kCellPx}, num_values);
  for (const Window& down : CutWindows(whole.height, window_size.height)) {
    for (const Window& across : CutWindows(whole.width, window_size.width)) {
      const cv::Point begin(across.begin_px, down.begin_px);
      CAIRN_ASSIGN_OR_RETURN(const std::vector<cv::Mat> found, Run(canvas(cv::Rect(begin, window_size))));
      if (FindHeads(found, window_size) != heads) {
        return MakeError(ErrorCode::kUnsupported, "{}: the net's outputs for {} x {} px are of {}", path,
                         window_size.width, window_size.height, OutputsText(found));
      }
      const cv::Point to(across.inner_begin_px / kCellPx, down.inner_begin_px / kCellPx);
      const cv::Size inner((across.inner_end_px - across.inner_begin_px) / kCellPx,
                           (down.inner_end_px - down.inner_begin_px) / kCellPx);
      TakeOutputs(found[heads[kKeypoints]], found[heads[kReliability]], found[heads[kDescriptors]],
                  {to - begin / kCellPx, inner}, to, &dense);
    }
  }
  return dense;
}

Result<LearnedFeatures> LearnedModel::Net::Extract(const cv::Mat& grey, const LearnedOptions& options,
                                                   const cv::Mat& mask) {
  LearnedFeatures features;
  features.descriptors.resize(0, num_values);
  if (std::min(grey.cols, grey.rows) < kMinImageSide) return features;
  CAIRN_ASSIGN_OR_RETURN(const DenseHeads dense, Heads(grey));
  std::vector<Peak> peaks = FindPeaks(dense, grey.size(), options.min_score);
  if (!mask.empty()) std::erase_if(peaks, [&](const Peak& peak) { return mask.at<uchar>(peak.pixel) == 0; });
  KeepBest(options.max_num_features, &peaks);
  features.descriptors.resize(static_cast<Eigen::Index>(peaks.size()), num_values);
  features.keypoints.reserve(peaks.size());
  for (const Peak& peak : peaks) {
    const float x = static_cast<float>(peak.pixel.x) + 0.5f, y = static_cast<float>(peak.pixel.y) + 0.5f;
    features.descriptors.row(static_cast<Eigen::Index>(features.keypoints.size())) =
        DescriptorAt(dense, x, y).transpose();
    features.keypoints.push_back({.x = x, .y = y});
  }
  return features;
}

LearnedModel::LearnedModel(std::unique_ptr<Net> net) : net_(std::move(net)) {}
LearnedModel::LearnedModel(LearnedModel&&) noexcept = default;
LearnedModel& LearnedModel::operator=(LearnedModel&&) noexcept = default;
LearnedModel::~LearnedModel() = default;

int LearnedModel::num_values() const { return net_->num_values; }
const ContentHash& LearnedModel::hash() const { return net_->hash; }
const std::string& LearnedModel::name() const { return net_->name; }

Result<LearnedModel> LearnedModel::Open(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  std::error_code error;
  const auto num_bytes = static_cast<int64_t>(fs::file_size(path, error));
  if (!error && num_bytes > kMaxFileBytes) {
    return MakeError(ErrorCode::kUnsupported, "{}: has {} bytes; a learned model has at most {}", path,
                     num_bytes, kMaxFileBytes);
  }
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  CAIRN_ASSIGN_OR_RETURN(const OnnxOutline outline, ReadOnnxOutline(bytes, path));
  auto net = std::make_unique<Net>();
  net->path = path;
  net->name = fs::path(path).stem().string();
  net->hash = HashContents(bytes);
  CAIRN_RETURN_IF_ERROR(net->TakeOutline(outline));
  const QuietOpenCv quiet;
  try {
    net->net = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
  } catch (const std::exception& exception) {
    if (IsOutOfMemory(exception)) throw;
    return MakeError(ErrorCode::kUnsupported, "{}: OpenCV {} does not build the net: {}", path, CV_VERSION,
                     ReasonOf(exception));
  }
  net->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  net->net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  CAIRN_RETURN_IF_ERROR(net->Try());
  return LearnedModel(std::move(net));
}

Result<LearnedFeatures> LearnedModel::Extract(const cv::Mat& grey, const LearnedOptions& options,
                                              const cv::Mat& mask) {
  CAIRN_RETURN_IF_ERROR(CheckGreyImage(grey, "a learned model"));
  CAIRN_RETURN_IF_ERROR(CheckMask(mask, grey));
  const std::optional<SmallerImage> smaller = MakeSmaller(grey, mask, options.max_image_side_px);
  if (!smaller) return net_->Extract(grey, options, mask);
  CAIRN_ASSIGN_OR_RETURN(LearnedFeatures features, net_->Extract(smaller->grey, options, smaller->mask));
  for (Keypoint& keypoint : features.keypoints) keypoint = smaller->Larger(keypoint);
  return features;
}

}  // namespace cairn
