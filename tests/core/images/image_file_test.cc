#include "core/images/image_file.h"

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>

#include <jpeglib.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace cairn {
namespace {

using testing::HasSubstr;

// A ramp with a square, 40 x 32: an image that loses nothing when it is compressed well.
cv::Mat GreyImage() {
  cv::Mat grey(32, 40, CV_8UC1);
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) grey.at<uchar>(y, x) = cv::saturate_cast<uchar>(3 * x + 2 * y);
  }
  grey(cv::Rect(8, 8, 8, 8)).setTo(200);
  return grey;
}

std::string Encode(const std::string& suffix, const cv::Mat& image) {
  std::vector<uchar> bytes;
  EXPECT_TRUE(
      cv::imencode(suffix, image, bytes, {cv::IMWRITE_JPEG_QUALITY, 100, cv::IMWRITE_WEBP_QUALITY, 101}));
  return std::string(bytes.begin(), bytes.end());
}

cv::Mat Channels(int count, int depth, double scale) {
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>(count, GreyImage()), image);
  image.convertTo(image, depth, scale);
  return image;
}

// As scanners and printers' programs write: four channels, inverted, black ink only.
std::string CmykJpeg() {
  const cv::Mat grey = GreyImage();
  jpeg_compress_struct compress;
  jpeg_error_mgr errors;
  compress.err = jpeg_std_error(&errors);
  jpeg_create_compress(&compress);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&compress, &buffer, &size);
  compress.image_width = grey.cols;
  compress.image_height = grey.rows;
  compress.input_components = 4;
  compress.in_color_space = JCS_CMYK;
  jpeg_set_defaults(&compress);
  jpeg_set_quality(&compress, 100, TRUE);
  jpeg_start_compress(&compress, TRUE);
  for (int y = 0; y < grey.rows; ++y) {
    std::vector<JSAMPLE> row;
    for (int x = 0; x < grey.cols; ++x) row.insert(row.end(), {255, 255, 255, grey.at<uchar>(y, x)});
    JSAMPROW rows[] = {row.data()};
    jpeg_write_scanlines(&compress, rows, 1);
  }
  jpeg_finish_compress(&compress);
  const std::string bytes(reinterpret_cast<char*>(buffer), size);
  jpeg_destroy_compress(&compress);
  std::free(buffer);
  return bytes;
}

std::string BigEndian(uint32_t value) {
  return {static_cast<char>(value >> 24), static_cast<char>(value >> 16), static_cast<char>(value >> 8),
          static_cast<char>(value)};
}

// A JPEG with an EXIF segment that states an orientation.
std::string JpegWithOrientation(char orientation) {
  const std::string jpeg = Encode(".jpg", GreyImage());
  std::string exif("Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", 24);
  exif += orientation;
  exif += std::string(7, '\0');
  const auto length = static_cast<uint32_t>(exif.size() + 2);
  return jpeg.substr(0, 2) + "\xFF\xE1" + BigEndian(length).substr(2) + exif + jpeg.substr(2);
}

// A PNG chunk, with its checksum [PNG specification, annex D].
std::string PngChunk(const std::string& type_and_data) {
  uint32_t crc = 0xFFFFFFFF;
  for (const char c : type_and_data) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? 0xEDB88320 ^ (crc >> 1) : crc >> 1;
  }
  return BigEndian(static_cast<uint32_t>(type_and_data.size() - 4)) + type_and_data + BigEndian(~crc);
}

std::string AnimatedPng() {
  const std::string png = Encode(".png", GreyImage());
  constexpr size_t kAfterHeader = 8 + 25;
  return png.substr(0, kAfterHeader) + PngChunk("acTL" + BigEndian(2) + BigEndian(0)) +
         png.substr(kAfterHeader);
}

std::string AnimatedWebp() {
  const std::string chunk("VP8X\x0A\0\0\0\x02\0\0\0\x27\0\0\x1F\0\0", 18);
  return std::string("RIFF\x16\0\0\0WEBP", 12) + chunk;
}

std::string Half(const std::string& bytes) { return bytes.substr(0, bytes.size() / 2); }

struct ImageKind {
  const char* name;
  std::string bytes;
  std::optional<const char*> reject_reason;  // none: read, and equal to GreyImage()
};

TEST(ImageFile, KindsOfImagesAreReadOrRefusedWithTheReason) {
  const cv::Mat grey = GreyImage();
  const std::vector<ImageKind> kinds = {
      {"grey JPEG", Encode(".jpg", grey), {}},
      {"colour JPEG", Encode(".jpg", Channels(3, CV_8U, 1)), {}},
      {"CMYK JPEG", CmykJpeg(), {}},
      {"EXIF orientation 0", JpegWithOrientation(0), {}},
      {"EXIF orientation 3", JpegWithOrientation(3), {}},
      {"EXIF orientation 6", JpegWithOrientation(6), {}},
      {"EXIF orientation 9", JpegWithOrientation(9), {}},
      {"grey PNG", Encode(".png", grey), {}},
      {"PNG with alpha", Encode(".png", Channels(4, CV_8U, 1)), {}},
      {"16-bit grey PNG", Encode(".png", Channels(1, CV_16U, 257)), {}},
      {"16-bit colour PNG", Encode(".png", Channels(3, CV_16U, 257)), {}},
      {"animated PNG", AnimatedPng(), {}},
      {"grey TIFF", Encode(".tiff", grey), {}},
      {"16-bit grey TIFF", Encode(".tiff", Channels(1, CV_16U, 257)), {}},
      {"16-bit colour TIFF", Encode(".tiff", Channels(3, CV_16U, 257)), {}},
      {"WebP", Encode(".webp", Channels(3, CV_8U, 1)), {}},
      {"BMP", Encode(".bmp", grey), {}},
      {"PGM", Encode(".pgm", grey), {}},
      {"zero bytes", "", "zero bytes"},
      {"text", "not an image", "not an image that can be decoded"},
      {"GIF", "GIF89a\x28", "GIF, which is not read; save its first frame as PNG"},
      {"animated WebP", AnimatedWebp(), "animated WebP, which is not read"},
      {"half a JPEG", Half(Encode(".jpg", grey)), "truncated JPEG"},
      {"half a PNG", Half(Encode(".png", grey)), "truncated PNG"},
      {"half a WebP", Half(Encode(".webp", Channels(3, CV_8U, 1))), "truncated WebP"},
      {"half a TIFF", Half(Encode(".tiff", grey)), "decoded"},
      {"half a BMP", Half(Encode(".bmp", grey)), "decoded"},
      {"half a PGM", Half(Encode(".pgm", grey)), "decoded"},
      {"start of a JPEG", "\xFF\xD8", "truncated JPEG"},
      {"start of a RIFF", "RIFF", "not an image that can be decoded"},
  };
  for (const ImageKind& kind : kinds) {
    const Result<cv::Mat> image = DecodeGreyImage(kind.bytes, "folder/a.jpg");
    if (kind.reject_reason) {
      ASSERT_FALSE(image.ok()) << kind.name;
      EXPECT_EQ(image.error().code, ErrorCode::kCorrupt) << kind.name;
      EXPECT_THAT(image.error().message, HasSubstr("folder/a.jpg: ")) << kind.name;
      EXPECT_THAT(image.error().message, HasSubstr(*kind.reject_reason)) << kind.name;
      continue;
    }
    ASSERT_TRUE(image.ok()) << kind.name << ": " << image.error().message;
    ASSERT_EQ(image->type(), CV_8UC1) << kind.name;
    ASSERT_EQ(image->size(), grey.size()) << kind.name;
    EXPECT_LE(cv::norm(*image, grey, cv::NORM_INF), 6) << kind.name;
  }
}

TEST(ImageFile, OnePixelIsAnImage) {
  const auto image = DecodeGreyImage(Encode(".png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(7))), "a.png");
  ASSERT_TRUE(image.ok());
  EXPECT_EQ(image->size(), cv::Size(1, 1));
}

TEST(ImageFile, UnreadableFilesAreErrorsThatNameThem) {
  const std::string path = testing::TempDir() + "/unreadable.png";
  std::ofstream(path, std::ios::binary) << Encode(".png", GreyImage());
  std::filesystem::permissions(path, std::filesystem::perms::none);
  const Result<cv::Mat> image = ReadGreyImage(path);
  if (geteuid() == 0) {
    EXPECT_TRUE(image.ok()) << "root reads everything";
  } else {
    ASSERT_FALSE(image.ok());
    EXPECT_THAT(image.error().message, HasSubstr(path));
  }
  EXPECT_FALSE(ReadGreyImage(path + ".missing").ok());
  EXPECT_FALSE(ReadGreyImage(testing::TempDir()).ok()) << "a folder is not an image";
}

TEST(ImageCopies, FindsFilesOfTheSameBytes) {
  const auto write = [](const std::string& name, const std::string& bytes) {
    const std::string path = testing::TempDir() + "/image_copies_" + name;
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  };
  const std::string first = write("first", "aab");
  ImageCopies copies;
  EXPECT_EQ(copies.FindOrAdd(first), nullptr);
  EXPECT_EQ(copies.FindOrAdd(write("same_size", "aba")), nullptr);
  EXPECT_EQ(copies.FindOrAdd(write("longer", "aaba")), nullptr);
  const std::string* found = copies.FindOrAdd(write("copy", "aab"));
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(*found, first);
  EXPECT_EQ(copies.FindOrAdd(first + ".missing"), nullptr);
  EXPECT_EQ(copies.FindOrAdd(first + ".missing"), nullptr) << "files that are not there are no copies";
}

}  // namespace
}  // namespace cairn
