#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn::pipeline {

// Unpacks a chunk of a bag.  `compression`: "lz4" (LZ4's frames), "zstd" or "bz2"; "" or "none" copies it.
// `num_bytes`: how long the chunk says to be, unpacked.  Memory grows with what really comes out, up to that.
// Errors: Unsupported (another compression, more than 1 GiB), Corrupt (not such data; more or fewer bytes
// come out than stated); without the file's name.
Result<std::string> UnpackChunk(const std::string& compression, std::string_view packed, uint64_t num_bytes);

// Whether bytes begin as Zstandard's frames do.
bool IsZstd(std::string_view bytes);
// Unpacks one frame of unstated length, up to 1 GiB.  Errors: as UnpackChunk.
Result<std::string> UnpackZstd(std::string_view packed);

}  // namespace cairn::pipeline
