#pragma once

#include <string>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "pipeline/exchange/import/layouts.h"

namespace cairn::pipeline {

// Which images are held out as queries.  With neither, those that the data set itself holds out.
struct HoldOut {
  int every = 0;             // every N-th image in the order of names; 0: none
  std::string queries_path;  // file with the name of an image per line; empty: none
};

// Marks the queries in `survey`.  Errors: InvalidArgument (both ways at once), NotFound (the file, or a name
// in it that no image has), NoData (nothing is left to survey).
Status ChooseQueries(const HoldOut& hold_out, ImportedSurvey* survey);

// How image files come into the capture.
enum class ImageTransfer {
  kSymbolicLink,  // costs nothing; the capture needs the data set where it is
  kHardLink,      // costs nothing; same file system only
  kCopy,
};

// Writes a capture (core/capture/capture.h) in one step: images/, cameras.txt, images.txt, queries.txt where
// images are held out, left_out.txt (NAME<tab>REASON) where frames are missing.  A capture that exists is
// replaced.  Errors: Corrupt (a name that leads out of the folder), Io, Cancelled.
Status WriteImportedCapture(const ImportedSurvey& survey, ImageTransfer transfer, const std::string& path,
                            Progress& progress);

}  // namespace cairn::pipeline
