#include "stages/link_appearance/fuse_images.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "core/camera/panorama.h"
#include "core/geometry/pose.h"

namespace cairn::link_appearance {
namespace {

// Number of an image in the list.  REQUIRES: ascending ids
std::optional<int> IndexOfImage(const std::vector<DatabaseImage>& images, ImageId image_id) {
  const auto found =
      std::lower_bound(images.begin(), images.end(), image_id,
                       [](const DatabaseImage& image, ImageId id) { return image.image_id < id; });
  if (found == images.end() || found->image_id != image_id) return std::nullopt;
  return static_cast<int>(found - images.begin());
}

bool IsVerified(int64_t config) {
  return config >= static_cast<int64_t>(TwoViewConfig::kCalibrated) &&
         config != static_cast<int64_t>(TwoViewConfig::kWatermark);
}

Result<std::vector<NodeIdx>> FuseByPlace(const std::vector<DatabaseImage>& images, double same_place_m,
                                         const Capture* capture) {
  std::map<std::string, Eigen::Vector3d> places;
  if (capture) {
    for (const CaptureImage& image : capture->images) {
      if (image.cam_from_world) places.emplace(image.name, image.cam_from_world->Center());
    }
  }
  std::vector<NodeIdx> node_of_image;
  std::vector<Eigen::Vector3d> node_places;
  for (const DatabaseImage& image : images) {
    const auto place = places.find(image.name);
    if (place == places.end()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "fuse = 'place': image {} has no pose in the capture{}; give --capture a survey with "
                       "poses, or choose fuse = 'name' or 'none'",
                       image.name, capture ? "" : " (none is given)");
    }
    size_t node = 0;
    while (node < node_places.size() && (node_places[node] - place->second).norm() > same_place_m) ++node;
    if (node == node_places.size()) node_places.push_back(place->second);
    node_of_image.push_back(static_cast<NodeIdx>(node));
  }
  return node_of_image;
}

}  // namespace

Result<ImageLinks> ReadImageLinks(const std::string& matches_path, int min_num_inliers) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<ImageLinks> {
    ImageLinks result;
    CAIRN_ASSIGN_OR_RETURN(result.images, ReadDatabaseImages(database));
    LimitedStatement pairs(database,
                           "SELECT pair_id, rows, config FROM two_view_geometries ORDER BY pair_id");
    while (pairs.executeStep()) {
      const auto [image_id1, image_id2] = ImageIdsFromPairId(pairs.getColumn(0).getInt64());
      const int64_t num_inliers = pairs.getColumn(1).getInt64();
      if (num_inliers < 0 || num_inliers > std::numeric_limits<int32_t>::max()) {
        return MakeError(ErrorCode::kCorrupt, "{}: pair ({}, {}) states {} inliers", matches_path, image_id1,
                         image_id2, num_inliers);
      }
      const std::optional<int> index1 = IndexOfImage(result.images, image_id1);
      const std::optional<int> index2 = IndexOfImage(result.images, image_id2);
      if (!index1 || !index2 || *index1 >= *index2) {
        return MakeError(ErrorCode::kCorrupt,
                         "{}: a pair names images {} and {}, expected two different images of the database",
                         matches_path, image_id1, image_id2);
      }
      // [Booij06 §III; Mariottini11 §V] S_ij = 1: enough matches that one geometry of two views explains
      if (num_inliers < min_num_inliers || !IsVerified(pairs.getColumn(2).getInt64())) continue;
      result.links.push_back({*index1, *index2, static_cast<int32_t>(num_inliers)});
    }
    return result;
  });
}

Result<int64_t> CountPairs(const std::string& matches_path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<int64_t> {
    return database.execAndGet("SELECT count(*) FROM two_view_geometries").getInt64();
  });
}

std::string CapturedName(const std::string& image_name) {
  const std::optional<PanoramaView> view = ParsePanoramaViewName(image_name);
  return view ? view->panorama_name : image_name;
}

ImageLinks SubsetOf(const ImageLinks& images, const std::vector<char>& is_in) {
  ImageLinks subset;
  std::vector<int> index_of(images.images.size(), -1);
  for (size_t i = 0; i < images.images.size(); ++i) {
    if (!is_in[i]) continue;
    index_of[i] = static_cast<int>(subset.images.size());
    subset.images.push_back(images.images[i]);
  }
  for (const AppearanceLink& link : images.links) {
    if (!is_in[link.node1] || !is_in[link.node2]) continue;
    subset.links.push_back({index_of[link.node1], index_of[link.node2], link.num_inliers});
  }
  for (const AppearanceLink& link : images.look_alikes) {
    if (is_in[link.node1] && is_in[link.node2])
      subset.look_alikes.push_back({index_of[link.node1], index_of[link.node2], link.num_inliers});
  }
  return subset;
}

ImageLinks SurveyImagesOf(const Capture& capture, const ImageLinks& images) {
  std::set<std::string> names;
  for (const CaptureImage& image : capture.images) names.insert(image.name);
  std::vector<char> is_listed;
  for (const DatabaseImage& image : images.images)
    is_listed.push_back(names.contains(CapturedName(image.name)));
  return SubsetOf(images, is_listed);
}

Result<std::vector<NodeIdx>> FuseImages(const std::vector<DatabaseImage>& images, const std::string& fuse,
                                        double same_place_m, const Capture* capture) {
  if (fuse == "place") return FuseByPlace(images, same_place_m, capture);
  std::vector<NodeIdx> node_of_image;
  std::map<std::string, NodeIdx> nodes;
  for (const DatabaseImage& image : images) {
    const std::string name = CapturedName(image.name);
    const size_t end = fuse == "name" ? name.rfind('_') : std::string::npos;
    // Names without '_' are used whole; a mark distinguishes them from the beginnings of other names.
    const std::string key = end == std::string::npos ? name + '/' : name.substr(0, end);
    node_of_image.push_back(nodes.emplace(key, static_cast<NodeIdx>(nodes.size())).first->second);
  }
  return node_of_image;
}

AppearanceGraph FusedGraph(const std::vector<AppearanceLink>& links,
                           const std::vector<NodeIdx>& node_of_image) {
  std::vector<AppearanceLink> fused;
  NodeIdx num_nodes = 0;
  for (const NodeIdx node : node_of_image) num_nodes = std::max(num_nodes, node + 1);
  for (const AppearanceLink& link : links) {
    const auto [node1, node2] = std::minmax(node_of_image[link.node1], node_of_image[link.node2]);
    if (node1 != node2) fused.push_back({node1, node2, link.num_inliers});
  }
  return AppearanceGraph(num_nodes, std::move(fused));
}

}  // namespace cairn::link_appearance
