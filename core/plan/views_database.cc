#include "core/plan/views_database.h"
#include "core/base/blob.h"
#include "core/files/database.h"
#include "core/plan/views.h"
#include "schemas/views_sql.h"

namespace cairn {
namespace {

constexpr int kViewsApplicationId = 0x63727677;
constexpr int kViewsVersion = 1;
constexpr size_t kLinksPerRow = 65536;
constexpr FaceIdx kRegionsPerReport = 4096;

std::vector<int32_t> Flat(const std::vector<GridPoint>& points) {
  std::vector<int32_t> values;
  values.reserve(2 * points.size());
  for (const GridPoint& point : points) {
    values.push_back(static_cast<int32_t>(point.x));
    values.push_back(static_cast<int32_t>(point.y));
  }
  return values;
}

Result<std::vector<GridPoint>> ReadPoints(const SQLite::Column& column, const std::string& what) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<int32_t> values, BlobToVector<int32_t>(column, what));
  if (values.size() % 2 != 0) return Corrupt(what, "{} numbers are not pairs", values.size());
  std::vector<GridPoint> points(values.size() / 2);
  for (size_t i = 0; i < points.size(); ++i) points[i] = {values[2 * i], values[2 * i + 1]};
  return points;
}

void WritePlan(SQLite::Database& database, const Views& views) {
  const FloorPlan& plan = views.plan;
  SQLite::Statement head(database, "INSERT INTO plan VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  head.bind(1, plan.grid_m);
  head.bind(2, plan.origin.x());
  head.bind(3, plan.origin.y());
  head.bind(4, plan.closed ? 1 : 0);
  head.bind(5, plan.low.x);
  head.bind(6, plan.low.y);
  head.bind(7, plan.high.x);
  head.bind(8, plan.high.y);
  head.bind(9, views.num_faces());
  const std::vector<int32_t> plan_vertices = Flat(plan.vertices), vertices = Flat(views.vertices);
  BindVector(head, 10, plan_vertices);
  BindVector(head, 11, vertices);
  head.exec();

  std::vector<std::vector<int32_t>> pieces(plan.walls.size());
  for (const PlanPiece& piece : plan.pieces)
    pieces[piece.wall].insert(pieces[piece.wall].end(), {piece.start, piece.end});
  SQLite::Statement row(database, "INSERT INTO walls VALUES (?, ?, ?, ?, ?, ?)");
  for (size_t i = 0; i < plan.walls.size(); ++i) {
    row.bind(1, static_cast<int64_t>(i));
    row.bind(2, plan.walls[i].start.x());
    row.bind(3, plan.walls[i].start.y());
    row.bind(4, plan.walls[i].end.x());
    row.bind(5, plan.walls[i].end.y());
    BindVector(row, 6, pieces[i]);
    row.exec();
    row.reset();
  }
}

Status WriteRegions(SQLite::Database& database, const Views& views, Progress& progress) {
  SQLite::Statement row(database, "INSERT INTO regions VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  progress.Begin("regions written", views.num_faces(), "regions");
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    if (face % kRegionsPerReport == kRegionsPerReport - 1) {
      progress.Advance(kRegionsPerReport);
      if (progress.Cancelled()) break;
    }
    const std::vector<int32_t> corners(views.face_vertices.begin() + views.face_offsets[face],
                                       views.face_vertices.begin() + views.face_offsets[face + 1]);
    const std::string toggled =
        EncodeAscending({views.toggled_labels.begin() + views.toggle_offsets[face],
                         views.toggled_labels.begin() + views.toggle_offsets[face + 1]});
    row.bind(1, face);
    BindVector(row, 2, corners);
    if (views.parents[face] >= 0) {
      row.bind(3, views.parents[face]);
    } else {
      row.bind(3);
    }
    row.bindNoCopy(4, toggled.empty() ? "" : toggled.data(), static_cast<int>(toggled.size()));
    const ViewIndex& index = views.index[face];
    row.bind(5, index.num_labels);
    row.bind(6, index.wall_length_m);
    row.bind(7, index.visible_length_m);
    row.bind(8, index.visible_area_m2);
    row.bind(9, index.longest_m);
    row.exec();
    row.reset();
  }
  progress.End();
  return progress.Cancelled() ? Status(MakeError(ErrorCode::kCancelled, "cancelled")) : Ok();
}

void WriteLinks(SQLite::Database& database, const Views& views) {
  SQLite::Statement row(database, "INSERT INTO links VALUES (?, ?)");
  for (size_t first = 0; first < views.links.size(); first += kLinksPerRow) {
    std::vector<int32_t> values;
    for (size_t i = first; i < std::min(first + kLinksPerRow, views.links.size()); ++i) {
      const ViewLink& link = views.links[i];
      values.insert(values.end(), {link.a, link.b, link.start, link.end});
    }
    row.bind(1, static_cast<int64_t>(first / kLinksPerRow));
    BindVector(row, 2, values);
    row.exec();
    row.reset();
  }
}

Status ReadPlanTables(SQLite::Database& database, const std::string& path, Views* views,
                      int64_t* num_regions) {
  LimitedStatement head(
      database,
      "SELECT grid_m, origin_x, origin_y, closed, low_x, low_y, high_x, high_y, num_regions, "
      "plan_vertices, vertices FROM plan");
  if (!head.executeStep()) return Corrupt(path, "table plan is empty");
  FloorPlan& plan = views->plan;
  plan.grid_m = head.getColumn(0).getDouble();
  plan.origin = {head.getColumn(1).getDouble(), head.getColumn(2).getDouble()};
  plan.closed = head.getColumn(3).getInt() != 0;
  plan.low = {head.getColumn(4).getInt64(), head.getColumn(5).getInt64()};
  plan.high = {head.getColumn(6).getInt64(), head.getColumn(7).getInt64()};
  *num_regions = head.getColumn(8).getInt64();
  CAIRN_ASSIGN_OR_RETURN(plan.vertices, ReadPoints(head.getColumn(9), path + ": plan vertices"));
  CAIRN_ASSIGN_OR_RETURN(views->vertices, ReadPoints(head.getColumn(10), path + ": vertices"));
  LimitedStatement walls(database, "SELECT wall_idx, x0, y0, x1, y1, pieces FROM walls ORDER BY wall_idx");
  for (int32_t idx = 0; walls.executeStep(); ++idx) {
    const std::string what = fmt::format("{}: wall {}", path, idx);
    if (walls.getColumn(0).getInt64() != idx) return Corrupt(what, "missing");
    plan.walls.push_back({{walls.getColumn(1).getDouble(), walls.getColumn(2).getDouble()},
                          {walls.getColumn(3).getDouble(), walls.getColumn(4).getDouble()}});
    CAIRN_ASSIGN_OR_RETURN(const std::vector<int32_t> ends, BlobToVector<int32_t>(walls.getColumn(5), what));
    if (ends.size() % 2 != 0) return Corrupt(what, "{} ends of pieces are not pairs", ends.size());
    for (size_t i = 0; i < ends.size(); i += 2) plan.pieces.push_back({ends[i], ends[i + 1], idx});
  }
  return Ok();
}

Status ReadRegions(SQLite::Database& database, const std::string& path, Views* views) {
  LimitedStatement rows(database,
                        "SELECT region_idx, corners, parent, toggled, num_labels, wall_length_m, "
                        "visible_length_m, visible_area_m2, longest_m FROM regions ORDER BY region_idx");
  for (FaceIdx face = 0; rows.executeStep(); ++face) {
    if (rows.getColumn(0).getInt64() != face) return Corrupt(path, "region {} is missing", face);
    CAIRN_ASSIGN_OR_RETURN(const std::vector<int32_t> corners,
                           BlobToVector<int32_t>(rows.getColumn(1), path + ": corners"));
    views->face_vertices.insert(views->face_vertices.end(), corners.begin(), corners.end());
    views->face_offsets.push_back(static_cast<int64_t>(views->face_vertices.size()));
    views->parents.push_back(rows.getColumn(2).isNull() ? -1 : rows.getColumn(2).getInt());
    BlobReader reader({static_cast<const char*>(rows.getColumn(3).getBlob()),
                       static_cast<size_t>(rows.getColumn(3).getBytes())});
    for (int64_t label = -1; reader.num_left() > 0 && reader.ok();) {
      const uint64_t step = reader.Varint();
      if (step == 0 || step > static_cast<uint64_t>(views->plan.num_labels())) reader.Fail();
      label += static_cast<int64_t>(step);
      views->toggled_labels.push_back(static_cast<LabelIdx>(label));
    }
    if (!reader.Finished()) return Corrupt(path, "region {}: its labels are not a valid list", face);
    views->toggle_offsets.push_back(static_cast<int64_t>(views->toggled_labels.size()));
    views->index.push_back({.num_labels = rows.getColumn(4).getInt(),
                            .wall_length_m = static_cast<float>(rows.getColumn(5).getDouble()),
                            .visible_length_m = static_cast<float>(rows.getColumn(6).getDouble()),
                            .visible_area_m2 = static_cast<float>(rows.getColumn(7).getDouble()),
                            .longest_m = static_cast<float>(rows.getColumn(8).getDouble())});
  }
  return Ok();
}

Status ReadLinks(SQLite::Database& database, const std::string& path, Views* views) {
  LimitedStatement rows(database, "SELECT links FROM links ORDER BY part_idx");
  while (rows.executeStep()) {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<int32_t> values,
                           BlobToVector<int32_t>(rows.getColumn(0), path + ": links"));
    if (values.size() % 4 != 0)
      return Corrupt(path, "links: {} numbers are not groups of four", values.size());
    for (size_t i = 0; i < values.size(); i += 4)
      views->links.push_back({values[i], values[i + 1], values[i + 2], values[i + 3]});
  }
  return Ok();
}

}  // namespace

Status WriteViews(const Views& views, const std::string& path, Progress& progress,
                  const std::function<Status(SQLite::Database&)>& fill_changes) {
  return WriteDatabase(path, kViewsSql, [&](SQLite::Database& database) -> Status {
    WritePlan(database, views);
    CAIRN_RETURN_IF_ERROR(WriteRegions(database, views, progress));
    WriteLinks(database, views);
    return fill_changes(database);
  });
}

Result<Views> ReadViews(const std::string& path) {
  return WithDatabaseErrors(path, [&]() -> Result<Views> {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
    if (!HasTable(database, "plan") ||
        database.execAndGet("PRAGMA application_id").getInt() != kViewsApplicationId) {
      return Corrupt(path, "not a database of view-invariant regions (decompose-views writes them)");
    }
    if (const int version = database.execAndGet("PRAGMA user_version").getInt(); version != kViewsVersion) {
      return MakeError(ErrorCode::kUnsupported, "{}: views version {}, this program reads {}", path, version,
                       kViewsVersion);
    }
    Views views;
    int64_t num_regions = 0;
    CAIRN_RETURN_IF_ERROR(ReadPlanTables(database, path, &views, &num_regions));
    CAIRN_RETURN_IF_ERROR(ReadRegions(database, path, &views));
    if (views.num_faces() != num_regions) {
      return Corrupt(path, "{} regions of {}", views.num_faces(), num_regions);
    }
    CAIRN_RETURN_IF_ERROR(ReadLinks(database, path, &views));
    CAIRN_RETURN_IF_ERROR(CheckViews(views, path));
    return views;
  });
}

}  // namespace cairn
