#pragma once

#include <cstdio>
#include <string>

#include <fmt/format.h>

#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "stages/link_appearance/fuse_images.h"

namespace cairn::link_appearance {

// Images of a graph, one a node.
inline ImageLinks ImagesOf(const AppearanceGraph& graph) {
  ImageLinks images{.links = graph.Links()};
  for (int i = 0; i < graph.num_nodes(); ++i) {
    images.images.push_back({static_cast<ImageId>(i + 1), fmt::format("image{}.jpg", i), 1});
  }
  return images;
}

// A COLMAP database of images and verified pairs without features.
inline void WriteMatches(const std::string& path, const ImageLinks& images, TwoViewConfig config) {
  std::remove(path.c_str());
  SQLite::Database database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(kColmapSchema);
  SQLite::Transaction transaction(database);
  WriteDatabaseCamera(database, *ParseCamera("PINHOLE,640,480,500,500,320,240"));
  for (const DatabaseImage& image : images.images) WriteDatabaseImage(database, image);
  for (const AppearanceLink& link : images.links) {
    TwoViewGeometry geometry;
    geometry.image_id1 = images.images[link.node1].image_id;
    geometry.image_id2 = images.images[link.node2].image_id;
    geometry.config = config;
    for (int i = 0; i < link.num_inliers; ++i) {
      geometry.inliers.push_back({static_cast<KeypointIdx>(i), static_cast<KeypointIdx>(i)});
    }
    WriteDatabaseTwoViewGeometry(database, geometry);
  }
  transaction.commit();
}

}  // namespace cairn::link_appearance
