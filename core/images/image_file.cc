#include "core/images/image_file.h"

#include <link.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <limits>
#include <set>

#include <opencv2/core.hpp>

#include "core/files/file.h"
#include "core/images/image_module.h"
#include "core/modules/build_id.h"
#include "core/modules/module.h"

namespace cairn {
namespace {

// OpenCV counts an image file's bytes in an int.
constexpr size_t kMaxBytes = std::numeric_limits<int>::max();

// Whether a JPEG's end-of-image marker follows its compressed data.  Walks the markers [ITU T.81 §B.1.1]: a
// thumbnail's own end marker lies inside of an APP1 segment and does not count.
bool JpegIsComplete(std::string_view bytes) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(bytes[i]); };
  size_t i = 2;  // after SOI
  bool in_scan = false;
  while (i + 1 < bytes.size()) {
    if (byte(i) != 0xFF) {
      if (!in_scan) return false;
      ++i;
      continue;
    }
    const unsigned char marker = byte(i + 1);
    if (marker == 0xD9) return true;
    if (marker == 0xFF) {  // fill byte
      ++i;
    } else if (marker == 0x00 || marker == 0x01 ||
               (marker >= 0xD0 && marker <= 0xD7)) {  // stuffed byte, TEM, RSTn
      i += 2;
    } else {
      if (i + 3 >= bytes.size()) return false;
      in_scan = marker == 0xDA;
      i += 2 + (size_t{byte(i + 2)} << 8 | byte(i + 3));
    }
  }
  return false;
}

bool PngIsComplete(std::string_view bytes) { return bytes.rfind("IEND") != std::string_view::npos; }

// Little-endian length in the header of a RIFF file, which counts from its byte 8 on.
size_t RiffLength(std::string_view bytes) {
  size_t length = 0;
  for (int i = 3; i >= 0; --i) length = length << 8 | static_cast<unsigned char>(bytes[4 + i]);
  return length + 8;
}

// What is known to be wrong with a file before its decoder sees it; "" if nothing.
std::string FindDefect(std::string_view bytes) {
  if (bytes.empty()) return "zero bytes, expected an image";
  if (bytes.size() > kMaxBytes) {
    return fmt::format("{} bytes, at most {} are read; save it with compression", bytes.size(), kMaxBytes);
  }
  if (bytes.starts_with("\xFF\xD8") && !JpegIsComplete(bytes)) {
    return fmt::format("truncated JPEG: {} bytes without an end-of-image marker; copy it again",
                       bytes.size());
  }
  if (bytes.starts_with("\x89PNG") && !PngIsComplete(bytes)) {
    return fmt::format("truncated PNG: {} bytes without an IEND chunk; copy it again", bytes.size());
  }
  if (bytes.starts_with("GIF8")) return "a GIF, which is not read; save its first frame as PNG";
  if (bytes.size() >= 12 && bytes.starts_with("RIFF") && bytes.substr(8, 4) == "WEBP") {
    if (RiffLength(bytes) > bytes.size()) {
      return fmt::format("truncated WebP: {} of {} bytes; copy it again", bytes.size(), RiffLength(bytes));
    }
    constexpr size_t kFlags = 20;  // of the VP8X chunk
    constexpr char kIsAnimated = 0x02;
    if (bytes.size() > kFlags && bytes.substr(12, 4) == "VP8X" && (bytes[kFlags] & kIsAnimated) != 0) {
      return "an animated WebP, which is not read; save its first frame as PNG";
    }
  }
  return "";
}

Result<const ImageModule*> LoadImageModule() {
  CAIRN_ASSIGN_OR_RETURN(const void* const loaded,
                         LoadModuleOfProgram("images", {.symbol = kImageModuleName,
                                                        .version = CAIRN_MODULE_VERSION,
                                                        .needs = "OpenCV's codecs",
                                                        .packages = CAIRN_CODECS_PACKAGE}));
  const auto* const module = static_cast<const ImageModule*>(loaded);
  // OpenCV makes its codecs for the first image, GDAL's too, which ends the program where there is no memory:
  // now, while other threads wait for this, rather than at any time.
  std::string image = "P5 1 1 255 \n";
  module->decode_grey(cv::Mat(1, static_cast<int>(image.size()), CV_8UC1, image.data()));
  return module;
}

// `path`: what it is for.
Result<const ImageModule*> ModuleFor(const std::string& path) {
  static const Result<const ImageModule*> module = LoadImageModule();
  if (module.ok()) return module;
  return MakeError(module.error().code, "{}: image files cannot be read and written here: {}", path,
                   module.error().message);
}

// Adds the ids of the libraries that decide what a decoded image is.
int AddDecoder(dl_phdr_info* library, size_t, void* ids) {
  const std::string name = std::filesystem::path(library->dlpi_name).filename().string();
  for (const char* decoder : {"libopencv_imgcodecs.", "libjpeg.", "libpng", "libtiff.", "libwebp."}) {
    if (name.starts_with(decoder)) static_cast<std::set<std::string>*>(ids)->insert(IdOfLibrary(*library));
  }
  return 0;
}

// `kind`: for messages.
Result<std::string> Encode(const std::string& suffix, const std::string& kind, const cv::Mat& image,
                           int quality, const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const ImageModule* const module, ModuleFor(path));
  std::vector<uint8_t> bytes;
  try {
    if (module->encode(suffix, image, quality, &bytes)) return std::string(bytes.begin(), bytes.end());
  } catch (const cv::Exception& exception) {
    if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
    return MakeError(ErrorCode::kFailed, "{}: cannot be encoded as {}: {}", path, kind, exception.err);
  }
  return MakeError(ErrorCode::kFailed, "{}: cannot be encoded as {}", path, kind);
}

}  // namespace

bool HasImageSuffix(const std::string& path) {
  static const std::set<std::string> kSuffixes = {".jpg", ".jpeg", ".png", ".tif", ".tiff",
                                                  ".bmp", ".pgm",  ".ppm", ".pnm", ".webp"};
  std::string suffix = std::filesystem::path(path).extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return kSuffixes.count(suffix) > 0;
}

Result<cv::Mat> DecodeGreyImage(std::string_view bytes, const std::string& path) {
  if (const std::string defect = FindDefect(bytes); !defect.empty()) {
    return MakeError(ErrorCode::kCorrupt, "{}: {}", path, defect);
  }
  CAIRN_ASSIGN_OR_RETURN(const ImageModule* const module, ModuleFor(path));
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    cv::Mat grey = module->decode_grey(buffer);
    if (!grey.empty()) return grey;
  } catch (const cv::Exception& exception) {
    if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();  // not the image's fault
    return MakeError(ErrorCode::kCorrupt, "{}: cannot be decoded: {}", path, exception.err);
  }
  return MakeError(ErrorCode::kCorrupt,
                   "{}: not an image that can be decoded ({} bytes; JPEG, PNG, TIFF, BMP, PNM and "
                   "WebP are read)",
                   path, bytes.size());
}

Result<std::string> EncodeJpeg(const cv::Mat& image, int quality, const std::string& path) {
  return Encode(".jpg", "JPEG", image, quality, path);
}

Result<std::string> EncodePng(const cv::Mat& image, const std::string& path) {
  return Encode(".png", "PNG", image, 0, path);
}

Result<cv::Mat> ReadGreyImage(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return DecodeGreyImage(bytes, path);
}

Status CheckImageCodecs(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN([[maybe_unused]] const ImageModule* const module, ModuleFor(path));
  return Ok();
}

Result<std::string> ImageCodecsIdentity(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckImageCodecs(path));
  static const std::string identity = [] {
    std::set<std::string> ids;
    dl_iterate_phdr(AddDecoder, &ids);
    std::string all;
    for (const std::string& id : ids) all += id;
    return HashBytes(all);
  }();
  return identity;
}

const std::string* ImageCopies::FindOrAdd(const std::string& path) {
  std::error_code error;
  const uintmax_t num_bytes = std::filesystem::file_size(path, error);
  if (error) return nullptr;
  std::vector<Given>& same_size = of_size_[num_bytes];
  const auto hash_of = [](const std::string& file) -> std::string {
    const Result<std::string> hash = HashFile(file);
    return hash.ok() ? *hash : "";
  };
  const std::string hash = same_size.empty() ? "" : hash_of(path);
  for (Given& given : same_size) {
    if (given.hash.empty()) given.hash = hash_of(given.path);
    if (!hash.empty() && given.hash == hash) return &given.path;
  }
  same_size.push_back({path, hash});
  return nullptr;
}

}  // namespace cairn
