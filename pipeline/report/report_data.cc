#include "pipeline/report/report_data.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "core/geometry/floor_pose.h"
#include "pipeline/explain/compare_maps.h"
#include "pipeline/explain/station_losses.h"
#include "pipeline/report/reconstruction_data.h"
#include "pipeline/report/report_inputs.h"

namespace cairn::pipeline {
namespace {

using Json = nlohmann::ordered_json;

// Floor coordinates in the page: hundredths of a metre.
int64_t Centi(double metres) { return std::llround(100 * metres); }
double Rounded(double value, double unit) { return std::round(value / unit) * unit; }

// Entropies of the appearance nodes at every station, the largest; negative: not known.
std::vector<double> StationEntropies(const MapRows& rows) {
  std::vector<double> entropies(rows.stations.size(), -1);
  for (const MapAppearanceNode& node : rows.appearance) {
    for (const int32_t image : node.images) {
      const StationIdx station = rows.images[image].station;
      if (station >= 0 && node.entropy) entropies[station] = std::max(entropies[station], *node.entropy);
    }
  }
  return entropies;
}

Json StationsJson(const MapRows& rows) {
  Json json = {{"x", Json::array()},       {"y", Json::array()},       {"heading", Json::array()},
               {"covered", Json::array()}, {"seen", Json::array()},    {"visible", Json::array()},
               {"why", Json::array()},     {"entropy", Json::array()}, {"images", Json::array()}};
  const StationLosses losses(rows);
  const std::vector<double> entropies = StationEntropies(rows);
  std::vector<Json> images(rows.stations.size(), Json::array());
  for (size_t image = 0; image < rows.images.size(); ++image) {
    if (rows.images[image].station >= 0) images[rows.images[image].station].push_back(image);
  }
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    const auto station = static_cast<StationIdx>(i);
    const MapStation& row = rows.stations[i];
    json["x"].push_back(Centi(row.position.x()));
    json["y"].push_back(Centi(row.position.y()));
    json["heading"].push_back(row.heading_deg ? Json(std::llround(*row.heading_deg)) : Json());
    json["covered"].push_back(row.is_covered ? 1 : 0);
    json["seen"].push_back(losses.NumLandmarks(station));
    json["visible"].push_back(losses.NumVisible(station));
    const auto why = losses.WhyUncovered(station);
    json["why"].push_back(why ? Json(DescribeDropReason(*why).name) : Json());
    json["entropy"].push_back(entropies[i] >= 0 ? Json(Rounded(entropies[i], 1e-3)) : Json());
    json["images"].push_back(images[i]);
  }
  return json;
}

Json RegionsJson(const MapRows& rows) {
  std::vector<std::vector<RegionIdx>> regions_at(rows.stations.size());
  for (size_t region = 0; region < rows.regions.size(); ++region) {
    for (const StationIdx station : rows.regions[region].stations)
      regions_at[station].push_back(static_cast<RegionIdx>(region));
  }
  std::vector<std::set<RegionIdx>> adjacent(rows.regions.size());
  const auto join = [&](StationIdx u, StationIdx v) {
    for (const RegionIdx a : regions_at[u]) {
      for (const RegionIdx b : regions_at[v]) {
        if (a == b) continue;
        adjacent[a].insert(b);
        adjacent[b].insert(a);
      }
    }
  };
  for (size_t i = 0; i < rows.stations.size(); ++i)
    join(static_cast<StationIdx>(i), static_cast<StationIdx>(i));
  for (const auto& [u, v] : rows.station_edges) join(u, v);
  Json list = Json::array();
  for (size_t region = 0; region < rows.regions.size(); ++region) {
    list.push_back({{"stations", rows.regions[region].stations},
                    {"landmarks", rows.regions[region].landmarks},
                    {"adjacent", adjacent[region]}});
  }
  for (const RegionSelfTest& test : rows.findings.self_test_regions) {
    Json entry = {
        {"held_out", test.num_held_out}, {"localized", test.num_localized}, {"wrong", test.num_gross_errors}};
    if (test.errors) {
      entry["median_m"] = Rounded(test.errors->median_m, 1e-4);
      entry["median_deg"] = Rounded(test.errors->median_deg, 1e-3);
      entry["p90_m"] = Rounded(test.errors->p90_m, 1e-4);
    }
    if (test.region >= 0) list[test.region]["test"] = std::move(entry);
  }
  for (const RegionEntropy& entropy : rows.findings.region_entropies)
    list[entropy.region]["entropy"] = Rounded(entropy.entropy, 1e-3);
  return list;
}

Json CurveJson(const std::vector<PromiseBin>& bins) {
  Json list = Json::array();
  for (const PromiseBin& bin : bins)
    list.push_back({Rounded(bin.mean_promised, 1e-3), bin.num_kept, bin.num});
  return list;
}

// The terms, the calibration curves, and per station the least probability of its nodes.
Json PromiseJson(const MapRows& rows) {
  if (!rows.findings.promise) return {};
  const MapPromise& promise = *rows.findings.promise;
  std::vector<std::optional<double>> least(rows.stations.size());
  for (const NodePromise& node : promise.nodes) {
    for (const int32_t image : {node.image, node.other_image}) {
      const StationIdx station = rows.images[image].station;
      if (station >= 0) least[station] = std::min(least[station].value_or(1), node.probability);
    }
  }
  Json at_stations = Json::array();
  for (const std::optional<double>& probability : least)
    at_stations.push_back(probability ? Json(Rounded(*probability, 1e-3)) : Json());
  return {{"probability", promise.terms.probability},
          {"min_matches", promise.terms.min_matches},
          {"max_error_m", promise.terms.max_error_m},
          {"max_error_deg", promise.terms.max_error_deg},
          {"num_nodes", promise.nodes.size()},
          {"num_kept", promise.NumKept()},
          {"landmarks_lower_bound", promise.landmarks_lower_bound},
          {"at_stations", std::move(at_stations)},
          {"left_out", CurveJson(promise.left_out)},
          {"held_out", CurveJson(promise.held_out)}};
}

Json LandmarksJson(const MapRows& rows) {
  std::vector<RegionIdx> first_region(rows.landmarks.size(), -1);
  for (RegionIdx region = static_cast<RegionIdx>(rows.regions.size()) - 1; region >= 0; --region) {
    for (const LandmarkIdx landmark : rows.regions[region].landmarks) first_region[landmark] = region;
  }
  Json json = {{"x", Json::array()},
               {"y", Json::array()},
               {"z", Json::array()},
               {"observations", Json::array()},
               {"region", first_region}};
  for (const MapLandmark& landmark : rows.landmarks) {
    const Eigen::Vector3d place = rows.floor_from_world * landmark.position;
    json["x"].push_back(Centi(place.x()));
    json["y"].push_back(Centi(place.y()));
    json["z"].push_back(Centi(place.z()));
    json["observations"].push_back(landmark.num_observations);
  }
  return json;
}

// Images, and the appearance graph over them: a node stands where its first image was taken.
Json ImagesJson(const MapRows& rows) {
  Json json = {{"name", Json::array()},
               {"x", Json::array()},
               {"y", Json::array()},
               {"heading", Json::array()},
               {"num_landmarks", Json::array()}};
  for (const MapImage& image : rows.images) {
    const FloorPose pose = FloorPoseOf(image.cam_from_world, rows.floor_from_world);
    json["name"].push_back(image.name);
    json["x"].push_back(Centi(pose.position.x()));
    json["y"].push_back(Centi(pose.position.y()));
    json["heading"].push_back(std::llround(pose.heading_deg));
    json["num_landmarks"].push_back(image.landmarks.size());
  }
  json["kept"] = Json::array();
  json["links"] = Json::array();
  json["look_alikes"] = Json::array();
  for (const MapAppearanceNode& node : rows.appearance) {
    const int32_t image = node.images[0];
    if (node.is_kept) json["kept"].push_back(image);
    for (const auto& link : node.links)
      json["links"].push_back({image, rows.appearance[link.node].images[0], link.num_inliers});
    for (const auto& other : node.look_alikes)
      json["look_alikes"].push_back(
          {image, rows.appearance[other.node].images[0], Rounded(other.score, 1e-3)});
  }
  return json;
}

Json ViewsJson(const Views& views) {
  Json json = {{"walls", Json::array()}, {"faces", Json::array()}};
  for (const auto& wall : views.plan.walls)
    json["walls"].push_back(
        {Centi(wall.start.x()), Centi(wall.start.y()), Centi(wall.end.x()), Centi(wall.end.y())});
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    Json corners = Json::array();
    for (int64_t i = views.face_offsets[face]; i < views.face_offsets[face + 1]; ++i) {
      const Eigen::Vector2d place = views.plan.Metres(views.vertices[views.face_vertices[i]]);
      corners.push_back(Centi(place.x()));
      corners.push_back(Centi(place.y()));
    }
    json["faces"].push_back(std::move(corners));
  }
  return json;
}

Json DropsJson(const MapFindings& findings) {
  Json list = Json::array();
  for (const DropCount& drop : findings.drops) {
    list.push_back({{"stage", drop.stage},
                    {"kind", drop.kind},
                    {"name", drop.name},
                    {"text", drop.text},
                    {"num", drop.num_dropped},
                    {"at", drop.at_stations}});
  }
  return list;
}

Json AdviceJson(const std::vector<Advice>& advice) {
  Json list = Json::array();
  for (const Advice& entry : advice) {
    Json views = Json::array();
    for (const Advice::View& view : entry.images_to_take) {
      views.push_back({Centi(view.position.x()), Centi(view.position.y()),
                       view.heading_deg ? Json(std::llround(*view.heading_deg)) : Json()});
    }
    list.push_back({{"text", entry.text},
                    {"stations", entry.stations},
                    {"region", entry.region ? Json(*entry.region) : Json()},
                    {"views", views},
                    {"weak", entry.is_weakness}});
  }
  return list;
}

// Where the place changed between the map's surveys; images by index.
Json ChangedPlacesJson(const MapRows& rows) {
  Json list = Json::array();
  for (const MapChange& change : rows.findings.changes) {
    const Eigen::Vector3d place = rows.floor_from_world * change.position;
    list.push_back({{"x", Centi(place.x())},
                    {"y", Centi(place.y())},
                    {"radius", Centi(change.radius_m)},
                    {"session", rows.sessions[change.session]},
                    {"gone", change.num_vanished},
                    {"new", change.num_appeared},
                    {"to", change.moved_to},
                    {"moved", change.num_moved},
                    {"before", change.image_before},
                    {"after", change.image_after}});
  }
  return list;
}

// What changed from the compared map (A) to this one (B).
Json ChangesJson(const ReportInputs& inputs) {
  const MapRows &a = *inputs.compared, &b = *inputs.rows;
  const MapComparison comparison = CompareMaps(a, b);
  Json json = ComparisonJson(a, b, inputs.compared_bytes, inputs.num_bytes, comparison);
  json["file"] = inputs.compared_name;
  json["gone"] = Json::array();
  std::vector<char> is_shared(b.landmarks.size(), 0);
  for (size_t i = 0; i < a.landmarks.size(); ++i) {
    if (comparison.landmark_in_b[i] >= 0) {
      is_shared[comparison.landmark_in_b[i]] = 1;
      continue;
    }
    const Eigen::Vector3d place = b.floor_from_world * a.landmarks[i].position;
    json["gone"].push_back({Centi(place.x()), Centi(place.y())});
  }
  json["added"] = Json::array();
  for (size_t i = 0; i < b.landmarks.size(); ++i) {
    if (is_shared[i] == 0) json["added"].push_back(i);
  }
  return json;
}

// x, y, heading of a check's image, of millimetres and tenths of a degree.
Json PlaceJson(const Json& floor) {
  Json place = {Rounded(100 * floor[0].get<double>(), 0.1), Rounded(100 * floor[1].get<double>(), 0.1)};
  if (floor.size() > 2) place.push_back(Rounded(floor[2].get<double>(), 0.1));
  return place;
}

// The station of a check's image, if it is one of the map.
std::optional<StationIdx> StationOf(const Json& image, const MapRows& rows) {
  if (!image.contains("station") || !image["station"].is_number_integer()) return std::nullopt;
  const auto station = image["station"].get<int64_t>();
  if (station < 0 || station >= static_cast<int64_t>(rows.stations.size())) return std::nullopt;
  return static_cast<StationIdx>(station);
}

// Per held-out image: where it was taken and where the map put it, or why it did not.
Json HeldOutJson(const Json& check, const MapRows& rows) {
  Json list = Json::array();
  for (const Json& image : check["images"]) {
    if (!image.contains("true_floor")) continue;
    Json entry = {
        {"name", image.value("name", "")}, {"at", PlaceJson(image["true_floor"])}, {"station", nullptr}};
    if (const auto station = StationOf(image, rows)) entry["station"] = *station;
    if (image.contains("floor")) {
      entry["found"] = PlaceJson(image["floor"]);
      entry["error_m"] = Rounded(image["error_m"].get<double>(), 1e-5);
      entry["error_deg"] = Rounded(image.value("error_deg", 0.0), 1e-4);
      entry["wrong"] = image.value("is_gross_error", false);
    }
    if (image.contains("reason") && !image.contains("floor")) entry["reason"] = image["reason"];
    if (image.contains("num_inliers")) entry["inliers"] = image["num_inliers"];
    for (const char* key : {"message", "rejected"}) {
      if (image.contains(key)) entry["message"] = image[key];
    }
    list.push_back(std::move(entry));
  }
  return list;
}

Eigen::Vector2d PlaceOf(const Json& floor) { return {floor[0].get<double>(), floor[1].get<double>()}; }

// Adds advice from a check's images: where they failed, and the errors of those that were
// localized correctly.
void AddCheckAdvice(const Json& check, const MapRows& rows, std::vector<Advice>* advice) {
  std::vector<FailedImage> failed;
  std::vector<PlacedImage> placed;
  for (const Json& image : check["images"]) {
    if (!image.contains("true_floor")) continue;
    const Json& taken = image["true_floor"];
    if (image.contains("floor") && !image.value("is_gross_error", false)) {
      placed.push_back({.taken = PlaceOf(taken), .found = PlaceOf(image["floor"])});
      continue;
    }
    failed.push_back({.name = image.value("name", ""), .station = StationOf(image, rows)});
    failed.back().view.position = PlaceOf(taken);
    if (taken.size() > 2) failed.back().view.heading_deg = taken[2].get<double>();
  }
  AddFailedImages(rows, failed, advice);
  // The poses of left-out images are the map's own.
  if (IsMetric(rows.frame) && !rows.self_test.contains(kLeftOutRunsFigure)) AddMisalignment(placed, advice);
}

// The map in other sizes, small to large: bytes, part localized, part within 10 cm and 5 degrees,
// median error.
Json ParetoJson(std::vector<ParetoPoint> points) {
  std::sort(points.begin(), points.end(),
            [](const ParetoPoint& a, const ParetoPoint& b) { return a.num_bytes < b.num_bytes; });
  Json list = Json::array();
  for (const ParetoPoint& point : points) {
    list.push_back({{"bytes", point.num_bytes},
                    {"localized", point.localized_ratio},
                    {"within", point.within_10cm_5deg_ratio},
                    {"median_m", point.median_error_m ? Json(*point.median_error_m) : Json()}});
  }
  return list;
}

// Of a recorded drive (cairn drive -o): where the robot was, in order.
Json DriveJson(const Json& drive) {
  Json places = Json::array();
  const auto add = [&](const Json& pose, const std::string& kind) {
    if (!pose.is_object() || !pose.contains("x_m") || !pose.contains("y_m")) return;
    places.push_back({Centi(pose["x_m"].get<double>()), Centi(pose["y_m"].get<double>()),
                      std::llround(pose.value("heading_deg", 0.0)), kind});
  };
  if (drive.contains("start")) add(drive["start"], "start");
  if (drive.contains("legs") && drive["legs"].is_array()) {
    for (const Json& leg : drive["legs"]) {
      const std::string kind = leg.value("kind", "");
      if (leg.contains("steps") && leg["steps"].is_array()) {
        for (const Json& step : leg["steps"]) {
          if (step.contains("pose")) add(step["pose"], kind);
        }
      }
      if (leg.contains("pose")) add(leg["pose"], kind);
    }
  }
  Json json = {{"places", std::move(places)}, {"reached", drive.value("reached", false)}};
  return json;
}

// The stages of a build: what each made and left out, seconds and bytes of memory.
Json BuildJson(const Json& build) {
  Json stages = Json::array();
  for (const Json& stage : build["stages"]) {
    Json entry = Json::object();
    for (const char* key : {"stage", "seconds", "peak_memory_bytes", "out"}) {
      if (stage.contains(key)) entry[key] = stage[key];
    }
    entry["rejected"] = Json::array();
    if (stage.contains("rejected")) {
      for (const Json& reject : stage["rejected"])
        entry["rejected"].push_back(
            {{"what", reject["what"]}, {"count", reject["count"]}, {"reason", reject["reason"]}});
    }
    stages.push_back(std::move(entry));
  }
  return stages;
}

}  // namespace

std::vector<Advice> ReportAdvice(const ReportInputs& inputs) {
  std::vector<Advice> advice = Advise(*inputs.rows);
  if (inputs.check != nullptr) AddCheckAdvice(*inputs.check, *inputs.rows, &advice);
  AddSizes(*inputs.rows, inputs.num_bytes, inputs.pareto, &advice);
  return advice;
}

nlohmann::ordered_json ReportData(const ReportInputs& inputs) {
  const MapRows& rows = *inputs.rows;
  Json json = {{"name", rows.name},
               {"writer", rows.writer},
               {"unit", LengthUnit(rows.frame)},
               {"scale_sigma_ratio", rows.frame.scale_sigma_ratio},
               {"frame_source", rows.frame.source},
               {"sealed", rows.sealed},
               {"algorithm", rows.algorithm},
               {"k", rows.k},
               {"tau", rows.tau},
               {"rho", rows.rho},
               {"landmark_choice", rows.landmark_choice},
               {"lower_bound", rows.lower_bound ? Json(*rows.lower_bound) : Json()},
               {"bytes", inputs.num_bytes},
               {"bytes_by_kind", inputs.block_bytes},
               {"stations", StationsJson(rows)},
               {"regions", RegionsJson(rows)},
               {"landmarks", LandmarksJson(rows)},
               {"images", ImagesJson(rows)},
               {"views", ViewsJson(rows.views)},
               {"drops", DropsJson(rows.findings)},
               {"promise", PromiseJson(rows)},
               {"changed_places", ChangedPlacesJson(rows)},
               {"self_test", rows.self_test},
               {"advice", AdviceJson(inputs.advice)},
               {"poor_localized_ratio", kPoorLocalizedRatio},
               {"pareto", ParetoJson(inputs.pareto)},
               {"options", rows.stage_options}};
  std::map<int64_t, int> errors;  // tenths of a pixel
  for (const double error : inputs.reprojection_errors_px) ++errors[std::llround(10 * error)];
  json["reprojection_errors"] = Json::array();
  for (const auto& [tenths, count] : errors) json["reprojection_errors"].push_back({tenths, count});
  if (inputs.build_report != nullptr) json["stages"] = BuildJson(*inputs.build_report);
  if (inputs.check != nullptr) {
    json["held_out"] = HeldOutJson(*inputs.check, rows);
    json["held_out_is_self_test"] = !rows.self_test.empty() && IsCheckOf(*inputs.check, rows);
  }
  if (inputs.reconstruction != nullptr) json["reconstruction"] = ReconstructionJson(*inputs.reconstruction);
  if (inputs.drive != nullptr) json["drive"] = DriveJson(*inputs.drive);
  if (inputs.compared != nullptr) json["changes"] = ChangesJson(inputs);
  return json;
}

}  // namespace cairn::pipeline
