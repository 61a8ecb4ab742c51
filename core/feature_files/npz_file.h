#pragma once

#include <string>

#include "core/base/error.h"
#include "core/feature_files/raw_features.h"

namespace cairn {

// The array `name` of an .npz file, as numpy.savez and savez_compressed write it: a zip archive with an entry
// NAME.npy for each array, of numbers that NumberType has, in rows and columns (an array of one dimension is
// a row).  Nothing where the file has no such array.  Errors: NotFound, Corrupt (no archive, an entry that is
// cut off, more than 1 GiB), Unsupported (another type, more dimensions); each names the file.
Result<std::optional<NumberTable>> ReadNpzArray(const std::string& path, const std::string& name);

}  // namespace cairn
