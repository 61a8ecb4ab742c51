#include "pipeline/exchange/bags/files/chunk_compression.h"

#include <algorithm>
#include <memory>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

namespace cairn::pipeline {
namespace {

constexpr uint64_t kMaxChunkBytes = 1 << 30;

// What a decompressor did in one call.
struct UnpackStep {
  size_t num_read = 0;
  size_t num_written = 0;
  bool is_done = false;
  std::string error;  // "": none
};

// Calls `step(packed, out, size)` until it is done, with a buffer that grows up to `max_bytes`.
template <class Step>
Result<std::string> UnpackInto(std::string_view packed, uint64_t max_bytes, const Step& step) {
  std::string out;
  size_t num_written = 0;
  for (;;) {
    if (num_written == out.size() && out.size() < max_bytes)
      out.resize(std::min<uint64_t>(max_bytes, 2 * out.size() + 4 * packed.size() + 4096));
    const UnpackStep done = step(packed, out.data() + num_written, out.size() - num_written);
    if (!done.error.empty()) return MakeError(ErrorCode::kCorrupt, "{}", done.error);
    packed.remove_prefix(done.num_read);
    num_written += done.num_written;
    if (done.is_done) break;
    if (done.num_read == 0 && done.num_written == 0) {
      if (num_written == max_bytes)
        return MakeError(ErrorCode::kCorrupt, "more than {} bytes come out of it", max_bytes);
      return MakeError(ErrorCode::kCorrupt, "it ends in the middle");
    }
  }
  out.resize(num_written);
  return out;
}

Result<std::string> UnpackZstdUpTo(std::string_view packed, uint64_t max_bytes) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), &ZSTD_freeDCtx);
  return UnpackInto(packed, max_bytes, [&](std::string_view rest, char* to, size_t size) {
    ZSTD_inBuffer in = {rest.data(), rest.size(), 0};
    ZSTD_outBuffer out = {to, size, 0};
    const size_t code = ZSTD_decompressStream(context.get(), &out, &in);
    UnpackStep step = {.num_read = in.pos, .num_written = out.pos, .is_done = code == 0};
    if (ZSTD_isError(code)) step.error = fmt::format("Zstandard says: {}", ZSTD_getErrorName(code));
    return step;
  });
}

Result<std::string> UnpackLz4UpTo(std::string_view packed, uint64_t max_bytes) {
  LZ4F_dctx* made = nullptr;
  LZ4F_createDecompressionContext(&made, LZ4F_VERSION);
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, &LZ4F_freeDecompressionContext);
  return UnpackInto(packed, max_bytes, [&](std::string_view rest, char* to, size_t size) {
    size_t num_read = rest.size();
    size_t num_written = size;
    const size_t code = LZ4F_decompress(context.get(), to, &num_written, rest.data(), &num_read, nullptr);
    UnpackStep step = {.num_read = num_read, .num_written = num_written, .is_done = code == 0};
    if (LZ4F_isError(code)) step.error = fmt::format("LZ4 says: {}", LZ4F_getErrorName(code));
    return step;
  });
}

Result<std::string> UnpackBzip2UpTo(std::string_view packed, uint64_t max_bytes) {
  bz_stream stream = {};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK)
    return MakeError(ErrorCode::kCorrupt, "bzip2 cannot be started");
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> end(&stream, &BZ2_bzDecompressEnd);
  return UnpackInto(packed, max_bytes, [&](std::string_view rest, char* to, size_t size) {
    // Both are at most 1 GiB, which an unsigned int holds.
    stream.next_in = const_cast<char*>(rest.data());
    stream.avail_in = static_cast<unsigned>(rest.size());
    stream.next_out = to;
    stream.avail_out = static_cast<unsigned>(size);
    const int code = BZ2_bzDecompress(&stream);
    UnpackStep step = {.num_read = rest.size() - stream.avail_in,
                       .num_written = size - stream.avail_out,
                       .is_done = code == BZ_STREAM_END};
    if (code != BZ_OK && code != BZ_STREAM_END) step.error = fmt::format("bzip2 says: error {}", code);
    return step;
  });
}

}  // namespace

Result<std::string> UnpackChunk(const std::string& compression, std::string_view packed, uint64_t num_bytes) {
  if (num_bytes > kMaxChunkBytes) {
    return MakeError(ErrorCode::kUnsupported, "it says to have {} bytes unpacked, more than {}", num_bytes,
                     kMaxChunkBytes);
  }
  const auto unpack = [&]() -> Result<std::string> {
    if (compression.empty() || compression == "none") return std::string(packed);
    if (compression == "zstd") return UnpackZstdUpTo(packed, num_bytes);
    if (compression == "lz4") return UnpackLz4UpTo(packed, num_bytes);
    if (compression == "bz2") return UnpackBzip2UpTo(packed, num_bytes);
    return MakeError(ErrorCode::kUnsupported, "its compression is '{}', known are lz4, zstd and bz2",
                     compression);
  };
  CAIRN_ASSIGN_OR_RETURN(std::string bytes, unpack());
  if (bytes.size() == num_bytes) return bytes;
  return MakeError(ErrorCode::kCorrupt, "{} bytes come out of it, stated are {}", bytes.size(), num_bytes);
}

bool IsZstd(std::string_view bytes) { return bytes.starts_with("\x28\xb5\x2f\xfd"); }

Result<std::string> UnpackZstd(std::string_view packed) { return UnpackZstdUpTo(packed, kMaxChunkBytes); }

}  // namespace cairn::pipeline
