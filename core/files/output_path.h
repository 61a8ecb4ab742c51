#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"

namespace cairn {

// Whether two paths lead to one file, under whichever names; of files that do not exist, by the names alone.
bool IsSameFile(const std::string& path1, const std::string& path2);

// The folder that a file is in, or is to be in: "." where the path names none.
std::string FolderOf(const std::string& path);

// The file itself where a path is a link to it: what replaces a file that others read replaces that one.
std::string FileOf(const std::string& path);

// Whether a file can be written there by making a new one that takes its name: checked before long work, and
// again when it is done.  Errors: InvalidArgument (no path), Io (no such folder, or a folder, a device or a
// pipe is there), ReadOnly (the folder may not be written).
Status CheckCanBeReplaced(const std::string& path);

// Errors: InvalidArgument when an output is one of the inputs, under whichever name: it would be lost.
// Inputs that are empty or do not exist are ignored.
Status CheckOutputIsNoInput(const std::string& output, const std::vector<std::string>& inputs);

}  // namespace cairn
