#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn {

// Errors: NotFound, Io (also when only a part of it can be read).
Result<std::string> ReadFile(const std::string& path);
// The first bytes, to tell what it is: fewer where it has fewer, none where it cannot be read.
std::string ReadHead(const std::string& path, size_t num_bytes);

// Writes through a temporary file in the target's folder (core/files/replacement.h): a reader sees the old
// file or the whole new one.  A target that has the same bytes already is left untouched, its date included.
Status WriteFileAtomically(const std::string& path, std::string_view contents);

// The same for a file that other code writes: `write` gets the path of the temporary, an empty file; on its
// error the temporary is removed and the target stays as it was.
Status ReplaceFileAtomically(const std::string& path,
                             const std::function<Status(const std::string& temporary)>& write);

// XXH3, 128 bits as 32 hexadecimal digits: content hashes of files and options.  Not cryptographic.
std::string HashBytes(std::string_view bytes);
// Of a file of any size, in little memory.  Errors: as ReadFile.
Result<std::string> HashFile(const std::string& path);

}  // namespace cairn
