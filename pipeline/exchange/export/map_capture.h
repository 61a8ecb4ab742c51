#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/options/options.h"

namespace cairn::pipeline {

// A map as the survey that it could have been made from, for who has nothing else: captures of features
// without pixels (core/capture/capture_features.h), one for each of the map's sessions.  An image has its
// landmarks as keypoints, where they project, with the landmarks' descriptors: images that see a landmark
// have the same descriptor of it, so that matching finds the map's landmarks again.  A keypoint has the scale
// that the landmark's size has there, and as orientation the world's up in the image: a map does not know a
// landmark's own, but keypoints of a pair turn alike.  Poses are as the map's surveys stated them, up to
// their noise, and the frame is the map's.
struct MapCapture {
  std::string session;  // NameOfMap, where it has no sessions
  std::string folder;   // of the capture, below the folder that was given
  int num_images = 0;
  int64_t num_keypoints = 0;
};

// Writes FOLDER/SESSION for each session that has an image with landmarks: images.txt, cameras.txt,
// frame.json, features.db.  The folder is replaced as a whole (ReplaceFolderAtomically); same map, same
// bytes. With `map_path`, that of the map's file, FOLDER/kCapturedMapFile is a copy of it: a name that no
// session has.  Errors: NoData (no landmark is seen by two images), InvalidArgument (the folder holds
// something else), Io.
inline constexpr const char* kCapturedMapFile = ".map.cairn";
Result<std::vector<MapCapture>> WriteMapCaptures(const MapRows& rows, const std::string& folder,
                                                 const std::string& map_path = "");

// What a recipe and a session may be called that are of this map: its name, characters that they must not
// have became '_'.  (Whoever made the map chose its name.)
std::string NameOfMap(const MapHead& head);

// The direction that the map's floor has for up, in the world frame.
Eigen::Vector3d UpOfMap(const MapHead& head);

// What a map was made with, besides its captures: those of its stages' options that differ from the defaults
// of `stages`, (stage, table) in their order, as tables of a recipe.  Left out are those that say how images
// of its survey are found, paired and posed, since they are here in another way, and options that this
// program does not know.  Errors: Corrupt (options in the map that are not TOML).
Result<std::string> OptionsOfMap(const MapHead& head,
                                 const std::vector<std::pair<std::string, OptionTable>>& stages);

}  // namespace cairn::pipeline
