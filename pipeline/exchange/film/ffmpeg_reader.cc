// The module film.so (film_module.h).  Of cairn it has headers alone: it links none of its libraries.

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "pipeline/exchange/film/film_module.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

namespace cairn::pipeline {
namespace {

constexpr int64_t kMaxNumPixels = int64_t{1} << 26;
// Eleven days: a frame that states a later time is from no film.
constexpr double kMaxTimeS = 999999;
// Demuxers of files that are films by themselves: playlists, which name other files, are none.
constexpr const char* kFormats = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,ogg,asf,flv";
constexpr const char* kKnown = "a film is an MP4, MOV, MKV, WebM or AVI file";

std::string AvErrorText(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text = {};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

Error CannotOpen(const std::string& path, bool begins_like_mp4, int code) {
  if (begins_like_mp4) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: a film without its index ({}): the recording or a copy of it was cut off; copy it "
                     "again, or repair it with a tool such as untrunc",
                     path, AvErrorText(code));
  }
  return MakeError(ErrorCode::kCorrupt, "{}: not a film that can be read ({}); {}", path, AvErrorText(code),
                   kKnown);
}

// The stream that is shown; a picture of a record's sleeve is none.
int FindVideo(const AVFormatContext& format) {
  int best = -1;
  int64_t best_size = -1;
  for (unsigned i = 0; i < format.nb_streams; ++i) {
    const AVStream& stream = *format.streams[i];
    if (stream.codecpar->codec_type != AVMEDIA_TYPE_VIDEO) continue;
    if ((stream.disposition & AV_DISPOSITION_ATTACHED_PIC) != 0) continue;
    const int64_t size = int64_t{stream.codecpar->width} * stream.codecpar->height;
    if (size <= best_size) continue;
    best = static_cast<int>(i);
    best_size = size;
  }
  return best;
}

// Clockwise, to the nearest quarter.
int TurnDeg(const AVStream& stream) {
  const uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
  if (matrix == nullptr) return 0;
  const double anticlockwise_deg = av_display_rotation_get(reinterpret_cast<const int32_t*>(matrix));
  if (!std::isfinite(anticlockwise_deg)) return 0;
  const int quarters = static_cast<int>(std::lround(-anticlockwise_deg / 90));
  return 90 * (((quarters % 4) + 4) % 4);
}

cv::Mat Turned(const cv::Mat& image, int clockwise_deg) {
  cv::Mat turned;
  switch (clockwise_deg) {
    case 90:
      cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
      return turned;
    case 180:
      cv::rotate(image, turned, cv::ROTATE_180);
      return turned;
    case 270:
      cv::rotate(image, turned, cv::ROTATE_90_COUNTERCLOCKWISE);
      return turned;
    default:
      return image;
  }
}

// Whether the first plane is luma, or grey, of 8 bits a pixel.
bool HasLumaPlane(const AVPixFmtDescriptor& format) {
  constexpr uint64_t kOther = AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BITSTREAM |
                              AV_PIX_FMT_FLAG_HWACCEL | AV_PIX_FMT_FLAG_FLOAT;
  const AVComponentDescriptor& luma = format.comp[0];
  return (format.flags & kOther) == 0 && luma.plane == 0 && luma.depth == 8 && luma.step == 1 &&
         luma.offset == 0 && luma.shift == 0;
}

// Luma of 16 .. 235 as 0 .. 255.
cv::Mat FullRange(const cv::Mat& luma) {
  static const cv::Mat kTable = [] {
    cv::Mat table(1, 256, CV_8U);
    for (int value = 0; value < 256; ++value)
      table.at<uchar>(value) = cv::saturate_cast<uchar>((value - 16) * 255.0 / 219.0);
    return table;
  }();
  cv::Mat grey;
  cv::LUT(luma, kTable, grey);
  return grey;
}

// One decoder thread: what a decoder makes of a damaged film depends on the number.
class FfmpegReader final : public FilmReader {
 public:
  static Result<std::unique_ptr<FilmReader>> Open(const std::string& path, bool begins_like_mp4);

  Result<std::optional<FilmFrame>> Next() override;
  int64_t ExpectedNumFrames() const override;
  double StatedDurationS() const override;
  int64_t num_damaged() const override { return num_damaged_; }
  bool is_interlaced() const override { return is_interlaced_; }

 private:
  struct CloseFormat {
    void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
  };
  struct FreeCodec {
    void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  };
  struct FreePacket {
    void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  };
  struct FreeFrame {
    void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  };
  struct FreeScaler {
    void operator()(SwsContext* context) const { sws_freeContext(context); }
  };

  explicit FfmpegReader(std::string path) : path_(std::move(path)) {}

  const AVStream& stream() const { return *format_->streams[video_]; }
  Status OpenCodec();
  Status Feed();
  double FrameIntervalS() const;
  double FrameTimeS();
  Result<cv::Mat> Grey();
  Result<cv::Mat> Converted();

  const std::string path_;
  std::unique_ptr<AVFormatContext, CloseFormat> format_;
  std::unique_ptr<AVCodecContext, FreeCodec> codec_;
  std::unique_ptr<AVPacket, FreePacket> packet_{av_packet_alloc()};
  std::unique_ptr<AVFrame, FreeFrame> frame_{av_frame_alloc()};
  std::unique_ptr<SwsContext, FreeScaler> scaler_;
  int video_ = -1;
  // Clockwise, to be applied to the stored picture for it to be upright: 0, 90, 180 or 270.
  int turn_deg_ = 0;
  bool is_drained_ = false;
  bool is_interlaced_ = false;
  int64_t num_damaged_ = 0;
  int64_t num_frames_ = 0;
  double first_s_ = 0, last_s_ = 0;
};

Status FfmpegReader::OpenCodec() {
  const AVCodecParameters& parameters = *stream().codecpar;
  const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
  if (decoder == nullptr) {
    return MakeError(ErrorCode::kUnsupported, "{}: its video is {}, for which there is no decoder here",
                     path_, avcodec_get_name(parameters.codec_id));
  }
  codec_.reset(avcodec_alloc_context3(decoder));
  int code = avcodec_parameters_to_context(codec_.get(), &parameters);
  codec_->thread_count = 1;
  codec_->max_pixels = kMaxNumPixels;
  codec_->pkt_timebase = stream().time_base;
  if (code >= 0) code = avcodec_open2(codec_.get(), decoder, nullptr);
  if (code >= 0) return Ok();
  return MakeError(ErrorCode::kCorrupt, "{}: its video ({}) cannot be decoded: {}", path_,
                   avcodec_get_name(parameters.codec_id), AvErrorText(code));
}

// Gives the decoder a packet more, or tells it that there are no more.
Status FfmpegReader::Feed() {
  for (;;) {
    const int code = av_read_frame(format_.get(), packet_.get());
    if (code == AVERROR(EIO))
      return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path_, AvErrorText(code));
    if (code < 0) {  // the end, or nothing that can be read after this
      if (code != AVERROR_EOF) ++num_damaged_;
      is_drained_ = true;
      avcodec_send_packet(codec_.get(), nullptr);
      return Ok();
    }
    const bool is_video = packet_->stream_index == video_;
    const bool is_damaged = (packet_->flags & AV_PKT_FLAG_CORRUPT) != 0;
    const int sent = is_video ? avcodec_send_packet(codec_.get(), packet_.get()) : 0;
    av_packet_unref(packet_.get());
    if (!is_video) continue;
    if (sent < 0 || is_damaged) ++num_damaged_;
    return Ok();
  }
}

double FfmpegReader::FrameIntervalS() const {
  const AVRational rate = stream().avg_frame_rate.num > 0 ? stream().avg_frame_rate : stream().r_frame_rate;
  const double interval_s = rate.num > 0 && rate.den > 0 ? av_q2d(av_inv_q(rate)) : 0;
  return interval_s > 0 && interval_s < 3600 ? interval_s : 1.0 / 30;
}

// As the film states; where it states nothing, or a time that is not after the last or beyond all films, one
// interval later.
double FfmpegReader::FrameTimeS() {
  const int64_t stamp = frame_->best_effort_timestamp;
  const bool is_stated = stamp != AV_NOPTS_VALUE;
  double time_s = is_stated ? static_cast<double>(stamp) * av_q2d(stream().time_base) : 0;
  if (num_frames_ == 0) first_s_ = time_s;
  time_s -= first_s_;
  if (num_frames_ > 0 && (!is_stated || !(time_s > last_s_ && time_s < kMaxTimeS)))
    time_s = last_s_ + FrameIntervalS();
  ++num_frames_;
  return last_s_ = time_s;
}

// By FFmpeg's scaler, for pixels that are not 8 bits of luma in a plane.
Result<cv::Mat> FfmpegReader::Converted() {
  const auto pixel_format = static_cast<AVPixelFormat>(frame_->format);
  scaler_.reset(sws_getCachedContext(scaler_.release(), frame_->width, frame_->height, pixel_format,
                                     frame_->width, frame_->height, AV_PIX_FMT_BGR24,
                                     SWS_POINT | SWS_ACCURATE_RND | SWS_BITEXACT, nullptr, nullptr, nullptr));
  if (!scaler_) {
    return MakeError(ErrorCode::kUnsupported, "{}: its pixels ({}) cannot be converted", path_,
                     av_get_pix_fmt_name(pixel_format));
  }
  cv::Mat colour(frame_->height, frame_->width, CV_8UC3);
  uint8_t* const rows[] = {colour.data};
  const int strides[] = {static_cast<int>(colour.step)};
  sws_scale(scaler_.get(), frame_->data, frame_->linesize, 0, frame_->height, rows, strides);
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

Result<cv::Mat> FfmpegReader::Grey() {
  const AVPixFmtDescriptor* format_of = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame_->format));
  cv::Mat grey;
  if (format_of != nullptr && HasLumaPlane(*format_of) && frame_->linesize[0] >= frame_->width) {
    const cv::Mat luma(frame_->height, frame_->width, CV_8UC1, frame_->data[0],
                       static_cast<size_t>(frame_->linesize[0]));
    const bool is_full = frame_->color_range == AVCOL_RANGE_JPEG || format_of->nb_components < 3 ||
                         std::string_view(format_of->name).starts_with("yuvj");
    grey = is_full ? luma.clone() : FullRange(luma);
  } else {
    CAIRN_ASSIGN_OR_RETURN(grey, Converted());
  }
  const AVRational aspect =
      av_guess_sample_aspect_ratio(format_.get(), format_->streams[video_], frame_.get());
  const double ratio = aspect.num > 0 && aspect.den > 0 ? av_q2d(aspect) : 1;
  if (std::abs(ratio - 1) > 0.005 && ratio > 0.25 && ratio < 4) {
    const cv::Size square(std::max(1, cvRound(grey.cols * std::max(ratio, 1.0))),
                          std::max(1, cvRound(grey.rows / std::min(ratio, 1.0))));
    cv::resize(grey, grey, square, 0, 0, cv::INTER_LINEAR);
  }
  return Turned(grey, turn_deg_);
}

Result<std::unique_ptr<FilmReader>> FfmpegReader::Open(const std::string& path, bool begins_like_mp4) {
  av_log_set_level(AV_LOG_QUIET);  // what it found is said here
  std::unique_ptr<FfmpegReader> reader(new FfmpegReader(path));
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  av_dict_set(&options, "format_whitelist", kFormats, 0);
  AVFormatContext* format = nullptr;
  int code = avformat_open_input(&format, ("file:" + path).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (code < 0) return CannotOpen(path, begins_like_mp4, code);
  reader->format_.reset(format);
  code = avformat_find_stream_info(format, nullptr);
  if (code < 0) return CannotOpen(path, begins_like_mp4, code);
  reader->video_ = FindVideo(*format);
  if (reader->video_ < 0) {
    return MakeError(ErrorCode::kNoData, "{}: there is no video in it{}; {}", path,
                     format->nb_streams > 0 ? ", only sound or other streams" : "", kKnown);
  }
  for (int i = 0; i < static_cast<int>(format->nb_streams); ++i) {
    if (i != reader->video_) format->streams[i]->discard = AVDISCARD_ALL;
  }
  CAIRN_RETURN_IF_ERROR(reader->OpenCodec());
  reader->turn_deg_ = TurnDeg(reader->stream());
  return std::unique_ptr<FilmReader>(std::move(reader));
}

Result<std::optional<FilmFrame>> FfmpegReader::Next() {
  for (;;) {
    const int code = avcodec_receive_frame(codec_.get(), frame_.get());
    if (code == AVERROR(EAGAIN)) {
      CAIRN_RETURN_IF_ERROR(Feed());
      continue;
    }
    if (code == AVERROR_EOF || (code < 0 && is_drained_)) return std::optional<FilmFrame>();
    const AVFrame& frame = *frame_;
    if (code < 0 || (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame.decode_error_flags != 0) {
      ++num_damaged_;
      if (code < 0) CAIRN_RETURN_IF_ERROR(Feed());
      continue;
    }
    if (frame.interlaced_frame != 0) is_interlaced_ = true;
    CAIRN_ASSIGN_OR_RETURN(cv::Mat grey, Grey());
    return std::optional<FilmFrame>({.time_s = FrameTimeS(), .grey = std::move(grey)});
  }
}

int64_t FfmpegReader::ExpectedNumFrames() const {
  if (stream().nb_frames > 0) return stream().nb_frames;
  const double num_frames = StatedDurationS() / FrameIntervalS();
  return num_frames < 1e9 ? static_cast<int64_t>(num_frames) : 0;
}

double FfmpegReader::StatedDurationS() const {
  double duration_s = 0;
  if (stream().duration != AV_NOPTS_VALUE) {
    duration_s = static_cast<double>(stream().duration) * av_q2d(stream().time_base);
  } else if (format_->duration != AV_NOPTS_VALUE) {
    duration_s = static_cast<double>(format_->duration) / AV_TIME_BASE;
  }
  return std::isfinite(duration_s) && duration_s > 0 ? duration_s : 0;
}

}  // namespace

extern "C" {
// The name is kFilmModuleName.
extern const FilmModule cairn_film_module;
const FilmModule cairn_film_module = {.version = CAIRN_MODULE_VERSION, .open = &FfmpegReader::Open};
}

}  // namespace cairn::pipeline
