#pragma once

#include <functional>
#include <string>

#include "core/base/error.h"
#include "core/colmap/colmap_model.h"

namespace cairn {

// An image of a list in COLMAP's images.txt form.
struct ListedImage {
  int line_number = 0;    // from 1 on
  std::string pose_text;  // "QW QX QY QZ TX TY TZ", as written
  ModelImage image;       // as ParseImageLine gives it, without keypoints
};

// Calls `visit` for each image of such a list, in its order.  The line after an image's, with its keypoints
// or empty, may be missing.  Errors: those of ReadFile and ParseImageLine, the latter with file and line.
Status VisitImageList(const std::string& path, const std::function<void(ListedImage)>& visit);

// Whether an image of this name can stand in a list of one image per line, `path`.  Errors: InvalidArgument
// (a control character, such as a line end, which would make one line into two).
Status CheckListedName(const std::string& path, const std::string& name);

}  // namespace cairn
