#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/capture/capture.h"

namespace cairn {

// One of several surveys of a place that are compiled into one map.
struct CaptureSession {
  std::string name;          // letters, digits, '-', '_' and '.'
  std::string root;          // the capture's folder
  std::string queries_path;  // held-out images; empty: the capture's queries.txt, if it has one
};

struct JoinedCapture {
  int num_images = 0;  // listed; 0 where no capture has lists
  int num_queries = 0;
  int num_cameras = 0;  // after equal ones became one
  std::vector<std::string> warnings;
};

// Writes a capture that holds all `sessions`, in their order, and copies no image:
//   images/SESSION             link to the images of each
//   cameras.txt                renumbered 1, 2, ...; cameras that are equal in all become one
//   images.txt, queries.txt    the lines of each with the name SESSION/NAME; poses as they are written
//   frame.json                 what all coordinates mean (CaptureFrame)
//   sessions.txt               SESSION and its folder, a line each
// Captures without poses have only images/, sessions.txt, for each that has cameras.txt cameras/SESSION.txt,
// imu/SESSION.csv for each that has imu.csv, and odometry.txt with the lines of each that has one.  The
// folder is replaced as a whole (ReplaceFolderAtomically): files that keep their bytes keep their date.  An
// image that one capture alone would reject is kept; the reader of the result rejects it.
//
// All poses must be in one frame.  Errors: InvalidArgument (fewer than one session, a name that is invalid or
// listed twice, captures with poses beside ones without, frames of different units or anchors; `folder` holds
// something else); NotFound, Corrupt, Io.
Result<JoinedCapture> JoinCaptures(const std::vector<CaptureSession>& sessions, const std::string& folder);

}  // namespace cairn
