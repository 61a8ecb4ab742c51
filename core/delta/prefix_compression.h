#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn {

// Bytes as what they have beyond others that the reader has too: a Zstandard frame with these as its prefix.
// Same bytes, same prefix and same version of libzstd, same frame.  `what` names the bytes in messages.
// Errors: Failed (libzstd).
Result<std::string> CompressAfter(std::string_view prefix, std::string_view bytes, const std::string& what);

// The inverse.  Allocates `num_bytes` before it reads.  Errors: Corrupt where the frame makes no sense or
// does not hold exactly so many bytes.
Result<std::string> DecompressAfter(std::string_view prefix, std::string_view frame, size_t num_bytes,
                                    const std::string& what);

}  // namespace cairn
