// The module images.so (image_module.h).  Of cairn it has that header alone: it links none of its libraries.
#include <opencv2/imgcodecs.hpp>

#include "core/images/image_module.h"

namespace cairn {
namespace {

cv::Mat DecodeGrey(const cv::Mat& bytes) {
  return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
}

bool Encode(const std::string& suffix, const cv::Mat& image, int quality, std::vector<uint8_t>* bytes) {
  return cv::imencode(
      suffix, image, *bytes,
      suffix == ".jpg" ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, quality} : std::vector<int>());
}

}  // namespace
}  // namespace cairn

extern "C" {

// The name is kImageModuleName.
extern const cairn::ImageModule cairn_images_module;
const cairn::ImageModule cairn_images_module = {
    .version = CAIRN_MODULE_VERSION, .decode_grey = &cairn::DecodeGrey, .encode = &cairn::Encode};
}
