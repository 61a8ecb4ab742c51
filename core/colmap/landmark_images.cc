#include "core/colmap/landmark_images.h"

namespace cairn {

std::set<ImageId> ReadLandmarkImages(SQLite::Database& database) {
  std::set<ImageId> image_ids;
  if (!HasTable(database, "cairn_landmark_images")) return image_ids;
  LimitedStatement row(database, "SELECT image_id FROM cairn_landmark_images");
  while (row.executeStep()) image_ids.insert(row.getColumn(0).getUInt());
  return image_ids;
}

}  // namespace cairn
