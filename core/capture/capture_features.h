#pragma once

#include <map>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/camera/camera.h"
#include "core/features/features.h"

namespace cairn {

// Features of images that have no file: beside, or in place of, its images a capture may hold a COLMAP
// database with their keypoints and descriptors, as extract_features writes one.
inline constexpr const char* kFeaturesFile = "features.db";

// Where a joined capture has those of its sessions, each by the names that images have in the session.
inline constexpr const char* kFeaturesFolder = "features";
std::string SessionFeaturesPath(const std::string& root, const std::string& session);

// Where the features of an image are.
struct FeaturesRow {
  std::string path;  // of the database
  ImageId image_id = 0;
  Camera camera;  // with which they were found
  // Its database states the kind of its descriptors: they stand for the image, whether it has a file or not.
  bool replaces_file = false;
  // They are landmarks of a map, seen where it says: no robot's image looks like this, and no map is tried on
  // it.
  bool are_landmarks = false;
};

// Of a database whose features are landmarks of a map: a table that stands beside COLMAP's.
inline constexpr const char* kLandmarkFeaturesSchema =
    "CREATE TABLE cairn_landmark_images (image_id INTEGER PRIMARY KEY NOT NULL);";

// The images of such databases of a capture, each read when it is first asked for.
class CaptureFeatures {
 public:
  explicit CaptureFeatures(std::string root) : root_(std::move(root)) {}

  // Which database an image without a file is looked for in; empty: there is none.
  std::string PathFor(const std::string& name) const;
  // The image's row there; null: it has none.  Errors: as of List.
  Result<const FeaturesRow*> Find(const std::string& name);
  // Whether the database that an image is looked for in states the kind of its descriptors: its features then
  // stand for images, whether they have a file or not.  A database that cannot be read does not.
  bool ReplacesFiles(const std::string& name);
  // All images of the capture's database, or of a session's ("": of none), as the capture names them; empty
  // where there is none.  Errors: those of OpenColmapDatabase and its readers; Corrupt (an image without a
  // camera).
  Result<const std::map<std::string, FeaturesRow>*> List(const std::string& session);

 private:
  std::string PathOf(const std::string& session) const;
  // Of the image SESSION/NAME, where that session has a database; else "".
  std::string SessionOf(const std::string& name) const;

  std::string root_;
  std::map<std::string, std::map<std::string, FeaturesRow>> read_;  // by session
  std::map<std::string, bool> replace_files_;  // by session; one that cannot be read does not
};

// Reads an image's features and checks them.  Errors, each with the file: those of OpenColmapDatabase and its
// readers; Corrupt (descriptors without keypoints, or the reverse; a keypoint outside of the image of
// `camera`, or without a size), InvalidArgument (found in an image of another size than `camera` takes).
Result<Features> ReadCaptureFeatures(const FeaturesRow& row, const Camera& camera);

}  // namespace cairn
