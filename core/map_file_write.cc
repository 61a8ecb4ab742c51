// Maps in SQLite, written: the tables of schemas/0001_map.sql, and those of schemas/vocabulary.sql beside
// them.
#include <cmath>

#include "core/blob.h"
#include "core/database.h"
#include "core/map_rows.h"
#include "schemas/0001_map_sql.h"

namespace cairn {
namespace {

void BindBlob(SQLite::Statement& statement, int index, const std::string& blob) {
  statement.bind(index, blob.data(), static_cast<int>(blob.size()));
}

void BindPose(SQLite::Statement& statement, int first, const Pose& pose) {
  statement.bind(first, pose.rotation.w());
  statement.bind(first + 1, pose.rotation.x());
  statement.bind(first + 2, pose.rotation.y());
  statement.bind(first + 3, pose.rotation.z());
  for (int i = 0; i < 3; ++i) statement.bind(first + 4 + i, pose.translation[i]);
}

void Step(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
}

void WriteTexts(SQLite::Database& database, const char* sql,
                const std::map<std::string, std::string>& texts) {
  SQLite::Statement insert(database, sql);
  for (const auto& [key, value] : texts) {
    insert.bind(1, key);
    insert.bind(2, value);
    Step(insert);
  }
}

// Rows of `meta` that say what the world frame means.
std::map<std::string, std::string> FrameTexts(const CaptureFrame& frame) {
  std::map<std::string, std::string> texts = {{"unit", frame.unit},
                                              {"frame_source", frame.source},
                                              {"is_reconstructed", frame.is_reconstructed ? "1" : "0"}};
  if (frame.anchor) {
    texts["anchor_latitude_deg"] = fmt::format("{}", frame.anchor->latitude_deg);
    texts["anchor_longitude_deg"] = fmt::format("{}", frame.anchor->longitude_deg);
    texts["anchor_altitude_m"] = fmt::format("{}", frame.anchor->altitude_m);
  }
  return texts;
}

void WriteHead(SQLite::Database& database, const MapRows& rows) {
  WriteTexts(database, "INSERT INTO meta VALUES (?, ?)", FrameTexts(rows.frame));
  if (rows.lower_bound) {
    WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
               {{"lower_bound", std::to_string(*rows.lower_bound)},
                {"uncovered_limit", std::to_string(rows.uncovered_limit)}});
  }
  WriteTexts(database, "INSERT INTO meta VALUES (?, ?)",
             {{"name", rows.name},
              {"writer", rows.writer},
              {"seed", std::to_string(rows.seed)},
              {"sealed", rows.sealed ? "1" : "0"},
              {"landmarks", rows.landmark_choice},
              {"algorithm", rows.algorithm},
              {"k", std::to_string(rows.k)},
              {"tau", std::to_string(rows.tau)},
              {"rho", std::to_string(rows.rho)},
              {"stated_pose_sigma_m", fmt::format("{}", rows.stated_pose_sigma_m)},
              {"stated_pose_sigma_deg", fmt::format("{}", rows.stated_pose_sigma_deg)}});
  WriteTexts(database, "INSERT INTO stage_options VALUES (?, ?)", rows.stage_options);
  WriteTexts(database, "INSERT INTO inputs VALUES (?, ?)", rows.input_hashes);
  SQLite::Statement frame(database, "INSERT INTO frames VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  for (const auto& [name, pose] : {std::pair("camera_from_given", rows.camera_from_given),
                                   std::pair("floor_from_world", rows.floor_from_world)}) {
    frame.bind(1, name);
    BindPose(frame, 2, pose);
    Step(frame);
  }
  SQLite::Statement figure(database, "INSERT INTO self_test VALUES (?, ?)");
  for (const auto& [name, value] : rows.self_test) {
    figure.bind(1, name);
    figure.bind(2, value);
    Step(figure);
  }
}

void WriteImages(SQLite::Database& database, const MapRows& rows) {
  SQLite::Statement insert_camera(database, "INSERT INTO cameras VALUES (?, ?, ?, ?, ?, ?)");
  for (const Camera& camera : rows.cameras) {
    BlobWriter params;
    for (const double param : camera.params) params.Float64(param);
    insert_camera.bind(1, static_cast<int64_t>(camera.camera_id));
    insert_camera.bind(2, static_cast<int>(camera.model));
    insert_camera.bind(3, camera.width);
    insert_camera.bind(4, camera.height);
    insert_camera.bind(5, camera.has_focal_prior ? 1 : 0);
    BindBlob(insert_camera, 6, params.Take());
    Step(insert_camera);
  }
  SQLite::Statement insert_image(database,
                                 "INSERT INTO images VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const MapImage& image : rows.images) {
    insert_image.bind(1, static_cast<int64_t>(image.image_id));
    insert_image.bind(2, image.name);
    insert_image.bind(3, static_cast<int64_t>(image.camera_id));
    if (image.station >= 0) {
      insert_image.bind(4, image.station);
    } else {
      insert_image.bind(4);  // NULL
    }
    BindPose(insert_image, 5, image.cam_from_world);
    insert_image.bind(12, static_cast<int64_t>(image.landmarks.size()));
    BindBlob(insert_image, 13, EncodeAscending(image.landmarks));
    Step(insert_image);
  }
}

void WriteRegions(SQLite::Database& database, const MapRows& rows) {
  SQLite::Statement insert_station(database, "INSERT INTO stations VALUES (?, ?, ?, ?, ?, ?, ?)");
  size_t edge = 0;
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    const MapStation& station = rows.stations[i];
    std::vector<int32_t> neighbours;
    for (; edge < rows.station_edges.size() && rows.station_edges[edge].first == static_cast<StationIdx>(i);
         ++edge) {
      neighbours.push_back(rows.station_edges[edge].second);
    }
    insert_station.bind(1, static_cast<int64_t>(i));
    insert_station.bind(2, station.position.x());
    insert_station.bind(3, station.position.y());
    if (station.heading_deg) {
      insert_station.bind(4, *station.heading_deg);
    } else {
      insert_station.bind(4);  // NULL
    }
    insert_station.bind(5, station.is_covered ? 1 : 0);
    insert_station.bind(6, static_cast<int64_t>(neighbours.size()));
    BindBlob(insert_station, 7, EncodeAscending(neighbours));
    Step(insert_station);
  }
  SQLite::Statement insert_region(database, "INSERT INTO regions VALUES (?, ?, ?, ?, ?)");
  for (size_t i = 0; i < rows.regions.size(); ++i) {
    insert_region.bind(1, static_cast<int64_t>(i));
    insert_region.bind(2, static_cast<int64_t>(rows.regions[i].stations.size()));
    insert_region.bind(3, static_cast<int64_t>(rows.regions[i].landmarks.size()));
    BindBlob(insert_region, 4, EncodeAscending(rows.regions[i].stations));
    BindBlob(insert_region, 5, EncodeAscending(rows.regions[i].landmarks));
    Step(insert_region);
  }
}

void WriteLandmarks(SQLite::Database& database, const MapRows& rows) {
  SQLite::Statement insert(database, "INSERT INTO landmarks VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (size_t i = 0; i < rows.landmarks.size(); ++i) {
    const MapLandmark& landmark = rows.landmarks[i];
    BlobWriter covariance;
    for (int row = 0; row < 3; ++row) {
      for (int col = row; col < 3; ++col)
        covariance.Float32(static_cast<float>(landmark.covariance(row, col)));
    }
    insert.bind(1, static_cast<int64_t>(i));
    insert.bind(2, static_cast<int64_t>(landmark.class_id));
    for (int axis = 0; axis < 3; ++axis) {
      insert.bind(3 + axis, static_cast<int64_t>(std::llround(landmark.position[axis] / kMapLengthUnitM)));
    }
    insert.bind(6, static_cast<int64_t>(std::llround(landmark.scale_m / kMapLengthUnitM)));
    insert.bind(7, landmark.num_observations);
    BindBlob(insert, 8, covariance.Take());
    insert.bind(9, rows.descriptors.row(i).data(), kDescriptorDim);
    Step(insert);
  }
}

}  // namespace

Status WriteMapRows(const MapRows& rows, const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckMapRows(rows));
  const std::string schema = std::string(k0001MapSql) + kVocabularySchema;
  return WriteDatabase(path, schema, [&](SQLite::Database& database) -> Status {
    WriteHead(database, rows);
    WriteImages(database, rows);
    WriteRegions(database, rows);
    WriteLandmarks(database, rows);
    WriteVocabularyTables(database, rows.vocabulary);
    return Ok();
  });
}

}  // namespace cairn
