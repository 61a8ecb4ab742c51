#include "core/world/world.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/files/database.h"
#include "core/world/dropped_items.h"
#include "schemas/world_sql.h"

namespace cairn {
namespace {

constexpr int kWorldApplicationId = 0x63727764;
constexpr int kWorldVersion = 1;

Status CheckEdges(const World& world) {
  for (size_t i = 0; i < world.edges.size(); ++i) {
    const auto [u, v] = world.edges[i];
    if (u < 0 || v < 0 || u >= world.num_stations() || v >= world.num_stations()) {
      return MakeError(ErrorCode::kInvalidArgument, "edge {}: [{}, {}] names a station outside of 0 to {}", i,
                       u, v, world.num_stations() - 1);
    }
    if (u == v) return MakeError(ErrorCode::kInvalidArgument, "edge {}: joins station {} to itself", i, u);
    if (u > v || (i > 0 && world.edges[i - 1] >= world.edges[i])) {
      return MakeError(ErrorCode::kInvalidArgument, "edge {}: [{}, {}] is a duplicate or out of order", i, u,
                       v);
    }
  }
  return Ok();
}

Status CheckAreas(const World& world) {
  for (int feature = 0; feature < world.num_features(); ++feature) {
    const std::vector<StationIdx>& area = world.areas[feature];
    for (size_t i = 0; i < area.size(); ++i) {
      if (area[i] < 0 || area[i] >= world.num_stations()) {
        return MakeError(ErrorCode::kInvalidArgument, "feature {}: station {} is outside of 0 to {}", feature,
                         area[i], world.num_stations() - 1);
      }
      if (i > 0 && area[i - 1] >= area[i]) {
        return MakeError(ErrorCode::kInvalidArgument, "feature {}: station {} is a duplicate or out of order",
                         feature, area[i]);
      }
    }
  }
  return Ok();
}

Status CheckStations(const World& world) {
  struct Place {
    double x, y, heading_deg;
    StationIdx station;
  };
  std::vector<Place> places(world.num_stations());
  for (int station = 0; station < world.num_stations(); ++station) {
    const double heading_deg = world.headings_deg.empty() ? 0.0 : world.headings_deg[station];
    places[station] = {world.positions[station].x(), world.positions[station].y(), heading_deg, station};
    if (!world.positions[station].allFinite() || !std::isfinite(heading_deg)) {
      return MakeError(ErrorCode::kInvalidArgument, "station {}: its place is not a finite number", station);
    }
  }
  const auto key = [](const Place& p) { return std::tie(p.x, p.y, p.heading_deg, p.station); };
  std::sort(places.begin(), places.end(), [&](const Place& a, const Place& b) { return key(a) < key(b); });
  for (size_t i = 1; i < places.size(); ++i) {
    const Place &a = places[i - 1], &b = places[i];
    if (a.x == b.x && a.y == b.y && a.heading_deg == b.heading_deg) {
      return MakeError(ErrorCode::kInvalidArgument, "stations {} and {} are at the same place ({:g}, {:g})",
                       a.station, b.station, a.x, a.y);
    }
  }
  return Ok();
}

Status CheckSize(const char* what, size_t size, size_t expected) {
  if (size == 0 || size == expected) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{}: {} entries, expected none or {}", what, size, expected);
}

Result<World> ReadWorldTables(SQLite::Database& database, const std::string& path) {
  if (!HasTable(database, "world") ||
      database.execAndGet("PRAGMA application_id").getInt() != kWorldApplicationId) {
    return MakeError(ErrorCode::kCorrupt, "{}: not a world database (filter-visibility writes them)", path);
  }
  if (const int version = database.execAndGet("PRAGMA user_version").getInt(); version != kWorldVersion) {
    return MakeError(ErrorCode::kUnsupported, "{}: world version {}, this program reads {}", path, version,
                     kWorldVersion);
  }
  World world;
  LimitedStatement header(
      database,
      "SELECT num_stations, num_edges, num_features, lattice_spacing_m, qw, qx, qy, qz, tx, ty, tz "
      "FROM world");
  if (!header.executeStep()) return MakeError(ErrorCode::kCorrupt, "{}: table world is empty", path);
  const int64_t num_stations = header.getColumn(0).getInt64(), num_edges = header.getColumn(1).getInt64(),
                num_features = header.getColumn(2).getInt64();
  world.lattice_spacing_m = header.getColumn(3).getDouble();
  const auto number = [&](int column) { return header.getColumn(column).getDouble(); };
  world.floor_from_world.rotation = Eigen::Quaterniond(number(4), number(5), number(6), number(7));
  world.floor_from_world.translation = Eigen::Vector3d(number(8), number(9), number(10));

  LimitedStatement stations(database,
                            "SELECT station_idx, x, y, heading_deg, neighbours, images FROM stations "
                            "ORDER BY station_idx");
  for (int64_t station = 0; stations.executeStep(); ++station) {
    const std::string what = fmt::format("{}: table stations, station {}", path, station);
    if (stations.getColumn(0).getInt64() != station)
      return MakeError(ErrorCode::kCorrupt, "{}: missing", what);
    world.positions.emplace_back(stations.getColumn(1).getDouble(), stations.getColumn(2).getDouble());
    if (!stations.getColumn(3).isNull()) world.headings_deg.push_back(stations.getColumn(3).getDouble());
    CAIRN_ASSIGN_OR_RETURN(const std::vector<StationIdx> neighbours,
                           BlobToVector<StationIdx>(stations.getColumn(4), what));
    for (const StationIdx neighbour : neighbours) world.edges.emplace_back(station, neighbour);
    if (stations.getColumn(5).isNull()) continue;
    CAIRN_ASSIGN_OR_RETURN(std::vector<ImageId> images, BlobToVector<ImageId>(stations.getColumn(5), what));
    world.station_images.push_back(std::move(images));
  }
  LimitedStatement features(database,
                            "SELECT feature_idx, class_id, stations FROM features ORDER BY feature_idx");
  for (int64_t feature = 0; features.executeStep(); ++feature) {
    const std::string what = fmt::format("{}: table features, feature {}", path, feature);
    if (features.getColumn(0).getInt64() != feature)
      return MakeError(ErrorCode::kCorrupt, "{}: missing", what);
    if (!features.getColumn(1).isNull()) world.class_ids.push_back(features.getColumn(1).getUInt());
    CAIRN_ASSIGN_OR_RETURN(std::vector<StationIdx> area,
                           BlobToVector<StationIdx>(features.getColumn(2), what));
    world.areas.push_back(std::move(area));
  }
  if (world.num_stations() != num_stations || static_cast<int64_t>(world.edges.size()) != num_edges ||
      world.num_features() != num_features) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: {} stations, {} edges, {} features; its header says {}, {}, {}", path,
                     world.num_stations(), world.edges.size(), world.num_features(), num_stations, num_edges,
                     num_features);
  }
  if (Status status = CheckWorld(world); !status.ok()) {
    return MakeError(status.error().code, "{}: {}", path, status.error().message);
  }
  return world;
}

void WriteWorldTables(SQLite::Database& database, const World& world) {
  SQLite::Statement header(database, "INSERT INTO world VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  header.bind(1, world.num_stations());
  header.bind(2, static_cast<int64_t>(world.edges.size()));
  header.bind(3, world.num_features());
  header.bind(4, world.lattice_spacing_m);
  const Eigen::Quaterniond& q = world.floor_from_world.rotation;
  const Eigen::Vector3d& t = world.floor_from_world.translation;
  const double floor[] = {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
  for (int i = 0; i < 7; ++i) header.bind(5 + i, floor[i]);
  header.exec();

  SQLite::Statement station_row(database, "INSERT INTO stations VALUES (?, ?, ?, ?, ?, ?)");
  size_t edge = 0;
  std::vector<StationIdx> neighbours;
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    neighbours.clear();
    for (; edge < world.edges.size() && world.edges[edge].first == station; ++edge) {
      neighbours.push_back(world.edges[edge].second);
    }
    station_row.bind(1, station);
    station_row.bind(2, world.positions[station].x());
    station_row.bind(3, world.positions[station].y());
    if (!world.headings_deg.empty()) station_row.bind(4, world.headings_deg[station]);
    BindVector(station_row, 5, neighbours);
    if (!world.station_images.empty()) BindVector(station_row, 6, world.station_images[station]);
    station_row.exec();
    station_row.reset();
    station_row.clearBindings();
  }
  SQLite::Statement feature_row(database, "INSERT INTO features VALUES (?, ?, ?)");
  for (FeatureIdx feature = 0; feature < world.num_features(); ++feature) {
    feature_row.bind(1, feature);
    if (!world.class_ids.empty()) feature_row.bind(2, world.class_ids[feature]);
    BindVector(feature_row, 3, world.areas[feature]);
    feature_row.exec();
    feature_row.reset();
    feature_row.clearBindings();
  }
}

}  // namespace

// [Sala06 Def. 3.2] F_v, from the visibility areas {v : f in F_v}
std::vector<std::vector<FeatureIdx>> VisibilitySets(const World& world) {
  std::vector<std::vector<FeatureIdx>> sets(world.num_stations());
  for (FeatureIdx feature = 0; feature < world.num_features(); ++feature) {
    for (const StationIdx station : world.areas[feature]) sets[station].push_back(feature);
  }
  return sets;
}

// [Sala06 Def. 3.1] G = (V, E)
std::vector<std::vector<StationIdx>> AdjacencyLists(const World& world) {
  std::vector<std::vector<StationIdx>> neighbours(world.num_stations());
  for (const auto& [u, v] : world.edges) {
    neighbours[u].push_back(v);
    neighbours[v].push_back(u);
  }
  for (std::vector<StationIdx>& list : neighbours) std::sort(list.begin(), list.end());
  return neighbours;
}

Status CheckWorld(const World& world) {
  CAIRN_RETURN_IF_ERROR(CheckSize("headings_deg", world.headings_deg.size(), world.positions.size()));
  CAIRN_RETURN_IF_ERROR(CheckSize("class_ids", world.class_ids.size(), world.areas.size()));
  CAIRN_RETURN_IF_ERROR(CheckSize("station_images", world.station_images.size(), world.positions.size()));
  CAIRN_RETURN_IF_ERROR(CheckStations(world));
  CAIRN_RETURN_IF_ERROR(CheckEdges(world));
  return CheckAreas(world);
}

Result<World> ReadWorldDatabase(const std::string& path) {
  return WithDatabaseErrors(path, [&]() -> Result<World> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
    return ReadWorldTables(database, path);
  });
}

Status WriteWorldDatabase(const World& world, const std::string& path,
                          const std::vector<DroppedItem>& dropped_items) {
  CAIRN_RETURN_IF_ERROR(CheckWorld(world));
  return WriteDatabase(path, kWorldSql, [&](SQLite::Database& database) -> Status {
    WriteWorldTables(database, world);
    WriteDroppedItems(database, kDroppedItemsTable, dropped_items);
    return Ok();
  });
}

Status WriteWorldDatabase(const World& world, const std::string& path) {
  return WriteWorldDatabase(world, path, {});
}

Result<World> ReadWorld(const std::string& path) {
  return IsSqliteFile(path) ? ReadWorldDatabase(path) : ReadWorldJson(path);
}

}  // namespace cairn
