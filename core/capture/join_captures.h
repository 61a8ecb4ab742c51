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
  // Its poses, if it has any, are in a frame of its own: it is registered to the others.
  bool is_registered = false;
};

// Which sessions are to be registered to the others, as sessions say or as follows from their folders: those
// without images.txt beside ones with it, and those whose frame.json has another unit or another origin than
// that of the first that is not registered.  All false where none has images.txt: then all are reconstructed
// together.  Errors: InvalidArgument (every session with poses is to be registered), those of frame.json.
Result<std::vector<bool>> SessionsToRegister(const std::vector<CaptureSession>& sessions);

struct JoinedCapture {
  int num_images = 0;  // listed; 0 where no capture has lists
  int num_queries = 0;
  int num_cameras = 0;     // after equal ones became one
  int num_registered = 0;  // sessions that are to be registered to the others
  std::vector<std::string> warnings;
};

// Writes a capture that holds all `sessions`, in their order, and copies no image:
//   images/SESSION             link to the images of each
//   features/SESSION.db        link to the features.db of each that has one
//   cameras.txt                renumbered 1, 2, ...; cameras that are equal in all become one
//   images.txt, queries.txt    the lines of each with the name SESSION/NAME; poses as they are written
//   frame.json                 what all coordinates mean (CaptureFrame)
//   sessions.txt               SESSION and its folder, a line each
// Captures without poses have only images/, sessions.txt, for each that has cameras.txt cameras/SESSION.txt,
// imu/SESSION.csv for each that has imu.csv, and odometry.txt with the lines of each that has one.  Beside
// others with poses they have these, too, and those that are to be registered (SessionsToRegister) are named
// in register.txt; the poses of such a session, if it has any, are poses/SESSION.txt instead of lines in
// images.txt, and its held-out images are left out.  The folder is replaced as a whole
// (ReplaceFolderAtomically): files that keep their bytes keep their date.  An image that one capture alone
// would reject is kept; the reader of the result rejects it.
//
// Errors: InvalidArgument (fewer than one session, a name that is invalid or listed twice, held-out images
// given for a session without poses in the frame; `folder` holds something else); NotFound, Corrupt, Io.
Result<JoinedCapture> JoinCaptures(const std::vector<CaptureSession>& sessions, const std::string& folder);

}  // namespace cairn
