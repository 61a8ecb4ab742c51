#include "pipeline/exchange/film/film_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "core/capture/film_file.h"
#include "core/files/input_file.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

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

Error CannotOpen(const std::string& path, int code) {
  if (BeginsLikeMp4(path)) {
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

}  // namespace

struct FilmReader::Impl {
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

  std::string path;
  std::unique_ptr<AVFormatContext, CloseFormat> format;
  std::unique_ptr<AVCodecContext, FreeCodec> codec;
  std::unique_ptr<AVPacket, FreePacket> packet{av_packet_alloc()};
  std::unique_ptr<AVFrame, FreeFrame> frame{av_frame_alloc()};
  std::unique_ptr<SwsContext, FreeScaler> scaler;
  int video = -1;
  int turn_deg = 0;
  bool is_drained = false;
  bool is_interlaced = false;
  int64_t num_damaged = 0;
  int64_t num_frames = 0;
  double first_s = 0, last_s = 0;

  const AVStream& stream() const { return *format->streams[video]; }
  Status OpenCodec();
  Status Feed();
  double FrameIntervalS() const;
  double FrameTimeS();
  Result<cv::Mat> Grey();
  Result<cv::Mat> Converted();
};

Status FilmReader::Impl::OpenCodec() {
  const AVCodecParameters& parameters = *stream().codecpar;
  const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
  if (decoder == nullptr) {
    return MakeError(ErrorCode::kUnsupported, "{}: its video is {}, for which there is no decoder here", path,
                     avcodec_get_name(parameters.codec_id));
  }
  codec.reset(avcodec_alloc_context3(decoder));
  int code = avcodec_parameters_to_context(codec.get(), &parameters);
  codec->thread_count = 1;
  codec->max_pixels = kMaxNumPixels;
  codec->pkt_timebase = stream().time_base;
  if (code >= 0) code = avcodec_open2(codec.get(), decoder, nullptr);
  if (code >= 0) return Ok();
  return MakeError(ErrorCode::kCorrupt, "{}: its video ({}) cannot be decoded: {}", path,
                   avcodec_get_name(parameters.codec_id), AvErrorText(code));
}

// Gives the decoder a packet more, or tells it that there are no more.
Status FilmReader::Impl::Feed() {
  for (;;) {
    const int code = av_read_frame(format.get(), packet.get());
    if (code == AVERROR(EIO))
      return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, AvErrorText(code));
    if (code < 0) {  // the end, or nothing that can be read after this
      if (code != AVERROR_EOF) ++num_damaged;
      is_drained = true;
      avcodec_send_packet(codec.get(), nullptr);
      return Ok();
    }
    const bool is_video = packet->stream_index == video;
    const bool is_damaged = (packet->flags & AV_PKT_FLAG_CORRUPT) != 0;
    const int sent = is_video ? avcodec_send_packet(codec.get(), packet.get()) : 0;
    av_packet_unref(packet.get());
    if (!is_video) continue;
    if (sent < 0 || is_damaged) ++num_damaged;
    return Ok();
  }
}

double FilmReader::Impl::FrameIntervalS() const {
  const AVRational rate = stream().avg_frame_rate.num > 0 ? stream().avg_frame_rate : stream().r_frame_rate;
  const double interval_s = rate.num > 0 && rate.den > 0 ? av_q2d(av_inv_q(rate)) : 0;
  return interval_s > 0 && interval_s < 3600 ? interval_s : 1.0 / 30;
}

// As the film states; where it states nothing, or a time that is not after the last or beyond all films, one
// interval later.
double FilmReader::Impl::FrameTimeS() {
  const int64_t stamp = frame->best_effort_timestamp;
  const bool is_stated = stamp != AV_NOPTS_VALUE;
  double time_s = is_stated ? static_cast<double>(stamp) * av_q2d(stream().time_base) : 0;
  if (num_frames == 0) first_s = time_s;
  time_s -= first_s;
  if (num_frames > 0 && (!is_stated || !(time_s > last_s && time_s < kMaxTimeS)))
    time_s = last_s + FrameIntervalS();
  ++num_frames;
  return last_s = time_s;
}

// By FFmpeg's scaler, for pixels that are not 8 bits of luma in a plane.
Result<cv::Mat> FilmReader::Impl::Converted() {
  const auto pixel_format = static_cast<AVPixelFormat>(frame->format);
  scaler.reset(sws_getCachedContext(scaler.release(), frame->width, frame->height, pixel_format, frame->width,
                                    frame->height, AV_PIX_FMT_BGR24,
                                    SWS_POINT | SWS_ACCURATE_RND | SWS_BITEXACT, nullptr, nullptr, nullptr));
  if (!scaler) {
    return MakeError(ErrorCode::kUnsupported, "{}: its pixels ({}) cannot be converted", path,
                     av_get_pix_fmt_name(pixel_format));
  }
  cv::Mat colour(frame->height, frame->width, CV_8UC3);
  uint8_t* const rows[] = {colour.data};
  const int strides[] = {static_cast<int>(colour.step)};
  sws_scale(scaler.get(), frame->data, frame->linesize, 0, frame->height, rows, strides);
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

Result<cv::Mat> FilmReader::Impl::Grey() {
  const AVPixFmtDescriptor* format_of = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame->format));
  cv::Mat grey;
  if (format_of != nullptr && HasLumaPlane(*format_of) && frame->linesize[0] >= frame->width) {
    const cv::Mat luma(frame->height, frame->width, CV_8UC1, frame->data[0],
                       static_cast<size_t>(frame->linesize[0]));
    const bool is_full = frame->color_range == AVCOL_RANGE_JPEG || format_of->nb_components < 3 ||
                         std::string_view(format_of->name).starts_with("yuvj");
    grey = is_full ? luma.clone() : FullRange(luma);
  } else {
    CAIRN_ASSIGN_OR_RETURN(grey, Converted());
  }
  const AVRational aspect = av_guess_sample_aspect_ratio(format.get(), format->streams[video], frame.get());
  const double ratio = aspect.num > 0 && aspect.den > 0 ? av_q2d(aspect) : 1;
  if (std::abs(ratio - 1) > 0.005 && ratio > 0.25 && ratio < 4) {
    const cv::Size square(std::max(1, cvRound(grey.cols * std::max(ratio, 1.0))),
                          std::max(1, cvRound(grey.rows / std::min(ratio, 1.0))));
    cv::resize(grey, grey, square, 0, 0, cv::INTER_LINEAR);
  }
  return Turned(grey, turn_deg);
}

FilmReader::FilmReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FilmReader::~FilmReader() = default;

Result<std::unique_ptr<FilmReader>> FilmReader::Open(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  std::error_code error;
  if (fs::file_size(path, error) == 0 && !error)
    return MakeError(ErrorCode::kEmptyFile, "{}: zero bytes; copy the film again", path);
  av_log_set_level(AV_LOG_QUIET);  // what it found is said here
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  av_dict_set(&options, "format_whitelist", kFormats, 0);
  AVFormatContext* format = nullptr;
  int code = avformat_open_input(&format, ("file:" + path).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (code < 0) return CannotOpen(path, code);
  impl->format.reset(format);
  code = avformat_find_stream_info(format, nullptr);
  if (code < 0) return CannotOpen(path, code);
  impl->video = FindVideo(*format);
  if (impl->video < 0) {
    return MakeError(ErrorCode::kNoData, "{}: there is no video in it{}; {}", path,
                     format->nb_streams > 0 ? ", only sound or other streams" : "", kKnown);
  }
  for (int i = 0; i < static_cast<int>(format->nb_streams); ++i) {
    if (i != impl->video) format->streams[i]->discard = AVDISCARD_ALL;
  }
  CAIRN_RETURN_IF_ERROR(impl->OpenCodec());
  impl->turn_deg = TurnDeg(impl->stream());
  return std::unique_ptr<FilmReader>(new FilmReader(std::move(impl)));
}

Result<std::optional<FilmFrame>> FilmReader::Next() {
  for (;;) {
    const int code = avcodec_receive_frame(impl_->codec.get(), impl_->frame.get());
    if (code == AVERROR(EAGAIN)) {
      CAIRN_RETURN_IF_ERROR(impl_->Feed());
      continue;
    }
    if (code == AVERROR_EOF || (code < 0 && impl_->is_drained)) return std::optional<FilmFrame>();
    const AVFrame& frame = *impl_->frame;
    if (code < 0 || (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame.decode_error_flags != 0) {
      ++impl_->num_damaged;
      if (code < 0) CAIRN_RETURN_IF_ERROR(impl_->Feed());
      continue;
    }
    if (frame.interlaced_frame != 0) impl_->is_interlaced = true;
    CAIRN_ASSIGN_OR_RETURN(cv::Mat grey, impl_->Grey());
    return std::optional<FilmFrame>({.time_s = impl_->FrameTimeS(), .grey = std::move(grey)});
  }
}

int64_t FilmReader::ExpectedNumFrames() const {
  const AVStream& stream = impl_->stream();
  if (stream.nb_frames > 0) return stream.nb_frames;
  const double num_frames = StatedDurationS() / impl_->FrameIntervalS();
  return num_frames < 1e9 ? static_cast<int64_t>(num_frames) : 0;
}

double FilmReader::StatedDurationS() const {
  const AVStream& stream = impl_->stream();
  double duration_s = 0;
  if (stream.duration != AV_NOPTS_VALUE) {
    duration_s = static_cast<double>(stream.duration) * av_q2d(stream.time_base);
  } else if (impl_->format->duration != AV_NOPTS_VALUE) {
    duration_s = static_cast<double>(impl_->format->duration) / AV_TIME_BASE;
  }
  return std::isfinite(duration_s) && duration_s > 0 ? duration_s : 0;
}

int64_t FilmReader::num_damaged() const { return impl_->num_damaged; }
int FilmReader::turn_deg() const { return impl_->turn_deg; }
bool FilmReader::is_interlaced() const { return impl_->is_interlaced; }

}  // namespace cairn::pipeline
