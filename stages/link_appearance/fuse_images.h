#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_database.h"
#include "core/world/appearance_graph.h"

namespace cairn::link_appearance {

// The images of a survey, with a link for every verified pair.
struct ImageLinks {
  std::vector<DatabaseImage> images;  // ascending image_id
  std::vector<AppearanceLink> links;  // of indices into `images`
  // Links that join places which only look alike (contradicted_links.h): they lead nowhere.
  std::vector<AppearanceLink> look_alikes;
};

// Reads the verified pairs of a COLMAP database that have at least `min_num_inliers` inliers: pairs from
// which the local space can be reconstructed [Booij06 §III], or which show it from the same place.  No
// features are read.  Errors: as OpenColmapDatabase; Corrupt (a pair of unknown images, of one image, or with
// an invalid number of inliers).
Result<ImageLinks> ReadImageLinks(const std::string& matches_path, int min_num_inliers);

// Number of rows that ReadImageLinks would read.  Errors: as OpenColmapDatabase.
Result<int64_t> CountPairs(const std::string& matches_path);

// The name of an image's file: its own, or that of the panorama of which it is a view.
std::string CapturedName(const std::string& image_name);

// Some of the images (a mark per image), and the links among them.
ImageLinks SubsetOf(const ImageLinks& images, const std::vector<char>& is_in);

// The images that a capture lists as its survey (a panorama's views by its name), and their links.
ImageLinks SurveyImagesOf(const Capture& capture, const ImageLinks& images);

// Groups images into nodes: per image the index of its node; nodes are numbered by their first images.  The
// views of a panorama are always one node.  "none": each image is a node.  "name": those whose names are
// equal up to the last '_', as those of a rig or of several headings at one station often are.  "place":
// those whose cameras stand within `same_place_m` of a node's first image, by the capture's poses.  Errors:
// InvalidArgument ("place", and an image without a pose: `capture` is null, or has none for it).
Result<std::vector<NodeIdx>> FuseImages(const std::vector<DatabaseImage>& images, const std::string& fuse,
                                        double same_place_m, const Capture* capture);

// The graph of the nodes: a link counts the inliers of all pairs of its nodes' images.
AppearanceGraph FusedGraph(const std::vector<AppearanceLink>& links,
                           const std::vector<NodeIdx>& node_of_image);

}  // namespace cairn::link_appearance
