#include "core/delta/prefix_compression.h"

#include <zstd.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <utility>

namespace cairn {
namespace {

// Strong enough to find the common parts; higher levels take several times as long and gain about a percent.
constexpr int kCompressionLevel = 12;
// Of so few bytes, prefix included, that it takes no time.
constexpr int kHighestLevel = 19;
constexpr size_t kFewBytes = 1 << 22;

// A window that reaches from the last byte back to the first of the prefix.
int WindowLog(size_t num_bytes) {
  const ZSTD_bounds bounds = ZSTD_cParam_getBounds(ZSTD_c_windowLog);
  return std::clamp<int>(std::bit_width(num_bytes), bounds.lowerBound, bounds.upperBound);
}

Error ZstdError(const std::string& what, size_t code) {
  return MakeError(ErrorCode::kFailed, "{}: Zstandard says: {}", what, ZSTD_getErrorName(code));
}

}  // namespace

Result<std::string> CompressAfter(std::string_view prefix, std::string_view bytes, const std::string& what) {
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(), &ZSTD_freeCCtx);
  const size_t num_all = prefix.size() + bytes.size();
  for (const auto& [parameter, value] :
       {std::pair(ZSTD_c_compressionLevel, num_all <= kFewBytes ? kHighestLevel : kCompressionLevel),
        std::pair(ZSTD_c_windowLog, WindowLog(num_all)), std::pair(ZSTD_c_enableLongDistanceMatching, 1)}) {
    const size_t code = ZSTD_CCtx_setParameter(context.get(), parameter, value);
    if (ZSTD_isError(code)) return ZstdError(what, code);
  }
  ZSTD_CCtx_refPrefix(context.get(), prefix.data(), prefix.size());
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const size_t num_bytes =
      ZSTD_compress2(context.get(), frame.data(), frame.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(num_bytes)) return ZstdError(what, num_bytes);
  frame.resize(num_bytes);
  return frame;
}

Result<std::string> DecompressAfter(std::string_view prefix, std::string_view frame, size_t num_bytes,
                                    const std::string& what) {
  // Before memory for it is asked for.
  const unsigned long long stated = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (stated == ZSTD_CONTENTSIZE_ERROR || stated == ZSTD_CONTENTSIZE_UNKNOWN)
    return MakeError(ErrorCode::kCorrupt, "{}: its payload cannot be unpacked: it has no size", what);
  if (stated != num_bytes) {
    return MakeError(ErrorCode::kCorrupt, "{}: its payload has {} bytes, but its head states {}", what,
                     stated, num_bytes);
  }
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), &ZSTD_freeDCtx);
  ZSTD_DCtx_setParameter(context.get(), ZSTD_d_windowLogMax,
                         ZSTD_dParam_getBounds(ZSTD_d_windowLogMax).upperBound);
  ZSTD_DCtx_refPrefix(context.get(), prefix.data(), prefix.size());
  std::string bytes(num_bytes, '\0');
  const size_t found =
      ZSTD_decompressDCtx(context.get(), bytes.data(), bytes.size(), frame.data(), frame.size());
  if (ZSTD_isError(found)) {
    return MakeError(ErrorCode::kCorrupt, "{}: its payload cannot be unpacked: {}", what,
                     ZSTD_getErrorName(found));
  }
  return bytes;
}

}  // namespace cairn
