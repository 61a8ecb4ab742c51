#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/blocks/map_findings.h"
#include "core/blocks/map_head.h"
#include "core/features/features.h"
#include "core/features/transform_code.h"
#include "core/geometry/pose.h"
#include "core/packing/map_landmark.h"
#include "core/plan/views.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/visual_map.h"

namespace cairn {

// The contents of a map file as plain values, the same for writers and readers.  schemas/FORMAT.md says what
// each means on disk.

struct MapImage {
  ImageId image_id = 0;
  std::string name;
  CameraId camera_id = 0;
  Pose cam_from_world;
  StationIdx station = -1;             // -1: at no station
  std::vector<LandmarkIdx> landmarks;  // seen in it, ascending
};

struct MapStation {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // floor frame, metres
  std::optional<double> heading_deg;                   // counter-clockwise from +x; none: sees all around
  bool is_covered = true;                              // false: its neighbourhood lies in no region
};

struct MapRegion {
  std::vector<StationIdx> stations;    // ascending
  std::vector<LandmarkIdx> landmarks;  // ascending
};

// A node of the appearance graph: images of one place.  The relative pose can be recovered between any two of
// them, and between them and images of linked nodes.
struct MapAppearanceNode {
  struct Link {
    int32_t node = 0;
    int32_t num_inliers = 0;  // verified matches, > 0
    friend bool operator==(const Link&, const Link&) = default;
  };
  // A node that looks like this one and lies elsewhere.
  struct LookAlike {
    int32_t node = 0;
    double score = 0;  // of one node as a query for the other, in (0, 1]
    friend bool operator==(const LookAlike&, const LookAlike&) = default;
  };
  std::vector<int32_t> images;  // by index, ascending; no image is of two nodes
  bool is_kept = false;         // of the connected set that all other nodes are linked to
  // To nodes of larger index, ascending; one of the two is kept.
  std::vector<Link> links;
  // Entropy of the places that it could be taken for, nats [Mariottini11 eq. 1]: of all nodes or of none.
  std::optional<double> entropy;
  std::vector<LookAlike> look_alikes;  // of larger index, ascending
  friend bool operator==(const MapAppearanceNode&, const MapAppearanceNode&) = default;
};

struct MapRows : MapHead {
  std::vector<MapImage> images;  // ascending image_id
  std::vector<MapStation> stations;
  std::vector<std::pair<StationIdx, StationIdx>> station_edges;  // u < v, ascending
  std::vector<MapRegion> regions;
  std::vector<MapLandmark> landmarks;
  DescriptorMatrix descriptors;  // row i: landmark i
  // Where it is known, landmarks and what images see are stored packed, and the descriptors' own levels stand
  // for them.
  std::optional<TransformCode> descriptor_code;
  std::vector<MapAppearanceNode> appearance;  // none: not known
  // Its documents are among `images`.  Without nodes: every landmark is its own word, found by exact search.
  Vocabulary vocabulary;
  // The place's floor plan and its view-invariant regions, floor frame; no walls: not known.  Vertices are
  // numbered by use (NumberVerticesByUse).
  Views views;
  // How landmarks look from different places; its images are indices in `images`.  No landmarks: not
  // in the map.
  VisualMapData visual_map;
  MapFindings findings;
};

inline constexpr int kMapVersionMajor = 2;
inline constexpr int kMapVersionMinor = 8;
// The major version that maps with other descriptors than SIFT's state, so that programs which know those
// alone refuse them; all else is as in kMapVersionMajor.
inline constexpr int kMapVersionOfKinds = 3;
inline int MapVersionMajor(const DescriptorKind& kind) {
  return kind.is_sift() ? kMapVersionMajor : kMapVersionOfKinds;
}
// Most landmarks of an image, and the longest name of one: what a reader allocates is bounded.
inline constexpr int kMaxImageLandmarks = 1 << 18;
inline constexpr int kMaxNameBytes = 4096;

// Errors: InvalidArgument, naming the element: an index or id that refers to nothing, a list that is not
// strictly ascending, a number that is not finite, an invalid rotation, sizes that differ.
Status CheckMapRows(const MapRows& rows);

// The surveys that see each landmark: positions in `sessions`, ascending.  Empty lists where the map is of
// one survey.  O(observations).
std::vector<std::vector<int>> LandmarkSessions(const MapRows& rows);

// Distinct landmarks that the images taken at each station see.
std::vector<int> LandmarksSeenAt(const MapRows& rows);
// The same, of landmarks whose entry in `counts` is not 0 only.
std::vector<int> LandmarksSeenAt(const MapRows& rows, const std::vector<char>& counts);

// Writes a map file, unsigned.  Same rows, same bytes.  Errors: InvalidArgument (CheckMapRows), Io,
// DiskFull, ReadOnly.
Status WriteMapRows(const MapRows& rows, const std::string& path);

// Reads a whole map file; every hash, length, index and number is checked, and nothing larger than the file
// states is allocated.  Errors: as MapFile::Open (core/map/map_file.h).
Result<MapRows> ReadMapRows(const std::string& path);

// Reads a map of format 1.x, which today's runtime does not read: for `cairn migrate`.  Errors: NotFound;
// Corrupt; Unsupported (another version).
Result<MapRows> ReadMapRowsVersion1(const std::string& path);

}  // namespace cairn
