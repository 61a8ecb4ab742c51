#include "pipeline/explain/explain_place.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "core/base/quantiles.h"
#include "core/blocks/node_poses.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"
#include "pipeline/explain/station_losses.h"
#include "pipeline/explain/station_text.h"
#include "stages/check_map/promise_figures.h"

namespace cairn::pipeline {
namespace {

// Stations closer together than this are headings of one place.
constexpr double kSamePlaceM = 0.01;
constexpr size_t kMaxImageNames = 12;
constexpr size_t kMaxLookAlikes = 5;

// The distance from a place of the survey to the next one, on the median; 1 m where there is only one.
double Spacing(const MapRows& rows) {
  std::vector<double> distances;
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    double nearest = std::numeric_limits<double>::max();
    for (size_t j = 0; j < rows.stations.size(); ++j) {
      const double distance = (rows.stations[i].position - rows.stations[j].position).norm();
      if (distance > kSamePlaceM) nearest = std::min(nearest, distance);
    }
    if (nearest < std::numeric_limits<double>::max()) distances.push_back(nearest);
  }
  return distances.empty() ? 1 : UpperMedian(std::move(distances));
}

std::vector<RegionIdx> RegionsOf(const MapRows& rows, StationIdx station) {
  std::vector<RegionIdx> regions;
  for (size_t region = 0; region < rows.regions.size(); ++region) {
    const std::vector<StationIdx>& stations = rows.regions[region].stations;
    if (std::binary_search(stations.begin(), stations.end(), station))
      regions.push_back(static_cast<RegionIdx>(region));
  }
  return regions;
}

std::vector<int32_t> ImagesAt(const MapRows& rows, StationIdx station) {
  std::vector<int32_t> images;
  for (size_t image = 0; image < rows.images.size(); ++image) {
    if (rows.images[image].station == station) images.push_back(static_cast<int32_t>(image));
  }
  return images;
}

// The number of its landmarks that the images taken at the station see.
int NumSeenOf(const MapRows& rows, const MapRegion& region, const std::vector<int32_t>& images) {
  std::set<LandmarkIdx> seen;
  for (const int32_t image : images) {
    std::set_intersection(rows.images[image].landmarks.begin(), rows.images[image].landmarks.end(),
                          region.landmarks.begin(), region.landmarks.end(), std::inserter(seen, seen.end()));
  }
  return static_cast<int>(seen.size());
}

const RegionSelfTest* SelfTestOf(const MapRows& rows, RegionIdx region) {
  for (const RegionSelfTest& test : rows.findings.self_test_regions) {
    if (test.region == region) return &test;
  }
  return nullptr;
}

std::string SelfTestText(const RegionSelfTest& test, const std::string& tried) {
  std::string text =
      fmt::format("{} of {} {} images localized", test.num_localized, test.num_held_out, tried);
  if (test.num_gross_errors > 0) text += fmt::format(", {} of them wrong", test.num_gross_errors);
  if (test.errors)
    text += fmt::format(", median error {:.1f} cm, {:.2f} deg", 100 * test.errors->median_m,
                        test.errors->median_deg);
  return text;
}

// The appearance node of an image; -1: none.
int32_t NodeOf(const MapRows& rows, int32_t image) {
  for (size_t node = 0; node < rows.appearance.size(); ++node) {
    const std::vector<int32_t>& images = rows.appearance[node].images;
    if (std::binary_search(images.begin(), images.end(), image)) return static_cast<int32_t>(node);
  }
  return -1;
}

// Nodes that look like this one, the most alike first.
std::vector<MapAppearanceNode::LookAlike> LookAlikesOf(const MapRows& rows, int32_t node) {
  std::vector<MapAppearanceNode::LookAlike> look_alikes = rows.appearance[node].look_alikes;
  for (int32_t other = 0; other < node; ++other) {
    for (const auto& look_alike : rows.appearance[other].look_alikes) {
      if (look_alike.node == node) look_alikes.push_back({other, look_alike.score});
    }
  }
  std::stable_sort(look_alikes.begin(), look_alikes.end(),
                   [](const auto& a, const auto& b) { return a.score > b.score; });
  return look_alikes;
}

std::string NamesText(const MapRows& rows, const std::vector<int32_t>& images) {
  std::string text;
  for (size_t i = 0; i < images.size() && i < kMaxImageNames; ++i)
    text += (i > 0 ? ", " : "") + rows.images[images[i]].name;
  if (images.size() > kMaxImageNames) text += fmt::format(" and {} more", images.size() - kMaxImageNames);
  return text;
}

std::string LookAlikesText(const MapRows& rows, int32_t node) {
  std::string text;
  const auto look_alikes = LookAlikesOf(rows, node);
  for (size_t i = 0; i < look_alikes.size() && i < kMaxLookAlikes; ++i) {
    const std::vector<int32_t>& images = rows.appearance[look_alikes[i].node].images;
    text +=
        fmt::format("  looks like {} (score {:.2f})\n", rows.images[images[0]].name, look_alikes[i].score);
  }
  if (look_alikes.size() > kMaxLookAlikes)
    text += fmt::format("  and like {} more\n", look_alikes.size() - kMaxLookAlikes);
  return text;
}

std::string CoverageText(const MapRows& rows, const StationLosses& losses, StationIdx station,
                         const std::vector<RegionIdx>& regions, const std::vector<int32_t>& images) {
  std::string text;
  if (regions.empty()) {
    text = "covered: no, it is in no region";
  } else if (!rows.stations[station].is_covered) {
    text = fmt::format("covered: no, no region has all stations within tau = {} hops of it", rows.tau);
  } else {
    text = "covered: yes";
  }
  if (const auto reason = losses.WhyUncovered(station))
    text += fmt::format(": {}", DescribeDropReason(*reason).text);
  text += fmt::format("\nin view: {} features that a robot can expect to see", losses.NumVisible(station));
  text += rows.k > 0 ? fmt::format("; k = {}\n", rows.k) : "\n";
  text += fmt::format("landmarks seen from here: {}\n", losses.NumLandmarks(station));
  for (const RegionIdx region : regions) {
    const MapRegion& row = rows.regions[region];
    text += fmt::format("  region {}: {} of its {} landmarks; {} stations", region,
                        NumSeenOf(rows, row, images), row.landmarks.size(), row.stations.size());
    const RegionSelfTest* test = SelfTestOf(rows, region);
    text += test ? "; self-test: " + SelfTestText(*test, TriedWord(rows)) + "\n"
                 : "; no " + TriedWord(rows) + " image\n";
  }
  return text;
}

// What the map promises to images taken at the station, by heading.
std::string PromisesText(const MapRows& rows, StationIdx station) {
  if (!rows.findings.promise) return "";
  const MapPromise& promise = *rows.findings.promise;
  const std::vector<Pose> poses = NodePoses(rows);
  std::string text;
  for (size_t i = 0; i < poses.size(); ++i) {
    const NodePromise& node = promise.nodes[i];
    if (rows.images[node.image].station != station && rows.images[node.other_image].station != station)
      continue;
    text += fmt::format("  looking towards {:>4.0f} deg: {:.1f} %, {:.0f} matches to expect, region {}\n",
                        FloorPoseOf(poses[i], rows.floor_from_world).heading_deg, 100 * node.probability,
                        node.num_matches, node.region);
    if (const std::string why = check_map::WhyNotPromised(node, promise); !why.empty())
      text += "    not kept: " + why + "\n";
  }
  const PromiseTerms& terms = promise.terms;
  if (text.empty()) return "promise: no place or heading of the survey's views is here\n";
  return fmt::format("promise: an image is localized within {:.3g} {}, {:.3g} deg by {} landmarks at least\n",
                     terms.max_error_m, LengthUnit(rows.frame), terms.max_error_deg, terms.min_matches) +
         text;
}

nlohmann::ordered_json PromisesJson(const MapRows& rows, StationIdx station) {
  const std::vector<Pose> poses = NodePoses(rows);
  auto json = nlohmann::ordered_json::array();
  for (size_t i = 0; i < poses.size(); ++i) {
    const NodePromise& node = rows.findings.promise->nodes[i];
    if (rows.images[node.image].station != station && rows.images[node.other_image].station != station)
      continue;
    json.push_back({{"heading_deg", FloorPoseOf(poses[i], rows.floor_from_world).heading_deg},
                    {"probability", node.probability},
                    {"most_probable", node.most_probable},
                    {"num_matches", node.num_matches},
                    {"sigma_m", node.sigma_m},
                    {"region", node.region}});
  }
  return json;
}

std::string LossesText(const MapRows& rows, StationIdx station) {
  if (rows.findings.drops.empty())
    return "what the stages dropped is not in this map (made before format 2.1)\n";
  std::string text = "dropped here\n";
  for (const DropCount& drop : rows.findings.drops) {
    if (drop.at_stations.empty() || drop.at_stations[station] == 0) continue;
    const int num = drop.at_stations[station];
    text += fmt::format("  {:<18} {:<20} {:>7} {:<9} {}\n", drop.stage, drop.name, num,
                        drop.kind + (num == 1 ? "" : "s"), drop.text);
  }
  return text;
}

}  // namespace

Result<std::vector<StationIdx>> StationsAt(const MapRows& rows, const AskedPlace& place) {
  if (rows.stations.empty()) return MakeError(ErrorCode::kNoData, "map '{}' has no stations", rows.name);
  const auto distance_to = [&](const MapStation& station) {
    return (station.position - place.position).norm();
  };
  StationIdx nearest = 0;
  Eigen::Vector2d low = rows.stations[0].position, high = low;
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    if (distance_to(rows.stations[i]) < distance_to(rows.stations[nearest]))
      nearest = static_cast<StationIdx>(i);
    low = low.cwiseMin(rows.stations[i].position);
    high = high.cwiseMax(rows.stations[i].position);
  }
  const double distance = distance_to(rows.stations[nearest]);
  if (!(distance <= 2 * Spacing(rows))) {
    return MakeError(
        ErrorCode::kNotFound,
        "{:.2f}, {:.2f} lies outside of what was surveyed: the nearest is {}, {:.2f} m away; the "
        "survey spans x from {:.2f} to {:.2f} m and y from {:.2f} to {:.2f} m. To cover it, take images "
        "from there to here, about {:.2f} m apart",
        place.position.x(), place.position.y(), StationText(rows, nearest), distance, low.x(), high.x(),
        low.y(), high.y(), Spacing(rows));
  }
  std::vector<StationIdx> stations;
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    if ((rows.stations[i].position - rows.stations[nearest].position).norm() <= kSamePlaceM)
      stations.push_back(static_cast<StationIdx>(i));
  }
  if (!place.heading_deg || !rows.stations[nearest].heading_deg) return stations;
  const auto turn = [&](StationIdx station) {
    return AngleBetweenDeg(*rows.stations[station].heading_deg, *place.heading_deg);
  };
  return std::vector<StationIdx>{*std::min_element(
      stations.begin(), stations.end(), [&](StationIdx a, StationIdx b) { return turn(a) < turn(b); })};
}

std::string ExplainStationText(const MapRows& rows, StationIdx station) {
  const StationLosses losses(rows);
  const std::vector<int32_t> images = ImagesAt(rows, station);
  std::string text = StationText(rows, station) + "\n";
  text += CoverageText(rows, losses, station, RegionsOf(rows, station), images);
  text += PromisesText(rows, station);
  text += fmt::format("survey images: {}{}{}\n", images.size(), images.empty() ? "" : ": ",
                      NamesText(rows, images));
  std::set<int32_t> nodes;
  for (const int32_t image : images) {
    if (const int32_t node = NodeOf(rows, image); node >= 0 && rows.appearance[node].entropy)
      nodes.insert(node);
  }
  for (const int32_t node : nodes) {
    text += fmt::format("by looks: {:.2f} nats, as {:.1f} places alike\n", *rows.appearance[node].entropy,
                        std::exp(*rows.appearance[node].entropy));
    text += LookAlikesText(rows, node);
  }
  return text + LossesText(rows, station);
}

nlohmann::ordered_json ExplainStationJson(const MapRows& rows, StationIdx station) {
  const StationLosses losses(rows);
  const MapStation& row = rows.stations[station];
  const std::vector<int32_t> images = ImagesAt(rows, station);
  nlohmann::ordered_json json = {{"station", station},
                                 {"position", {row.position.x(), row.position.y()}},
                                 {"heading_deg", nullptr},
                                 {"is_covered", row.is_covered},
                                 {"why_uncovered", nullptr},
                                 {"num_features_in_view", losses.NumVisible(station)},
                                 {"num_landmarks_seen", losses.NumLandmarks(station)},
                                 {"regions", nlohmann::ordered_json::array()},
                                 {"images", nlohmann::ordered_json::array()},
                                 {"dropped", nlohmann::ordered_json::array()}};
  if (row.heading_deg) json["heading_deg"] = *row.heading_deg;
  if (const auto reason = losses.WhyUncovered(station))
    json["why_uncovered"] = DescribeDropReason(*reason).name;
  for (const RegionIdx region : RegionsOf(rows, station)) {
    json["regions"].push_back({{"region", region},
                               {"num_landmarks", rows.regions[region].landmarks.size()},
                               {"num_landmarks_seen", NumSeenOf(rows, rows.regions[region], images)}});
    if (const RegionSelfTest* test = SelfTestOf(rows, region)) {
      json["regions"].back()["num_held_out"] = test->num_held_out;
      json["regions"].back()["num_localized"] = test->num_localized;
    }
  }
  for (const int32_t image : images) json["images"].push_back(rows.images[image].name);
  if (rows.findings.promise) json["promises"] = PromisesJson(rows, station);
  for (const DropCount& drop : rows.findings.drops) {
    if (drop.at_stations.empty() || drop.at_stations[station] == 0) continue;
    json["dropped"].push_back({{"stage", drop.stage},
                               {"kind", drop.kind},
                               {"name", drop.name},
                               {"num", drop.at_stations[station]}});
  }
  return json;
}

std::string StationSummaryText(const MapRows& rows, const std::vector<StationIdx>& stations) {
  const StationLosses losses(rows);
  std::string text;
  for (const StationIdx station : stations) {
    const auto reason = losses.WhyUncovered(station);
    text += fmt::format("  {}: {} landmarks, {} regions, {}\n", StationText(rows, station),
                        losses.NumLandmarks(station), RegionsOf(rows, station).size(),
                        reason ? fmt::format("not covered: {}", DescribeDropReason(*reason).name)
                        : rows.stations[station].is_covered ? "covered"
                                                            : "not covered");
  }
  return text;
}

std::string ExplainImageText(const MapRows& rows, int32_t image) {
  const MapImage& row = rows.images[image];
  const FloorPose floor = FloorPoseOf(row.cam_from_world, rows.floor_from_world);
  std::string text =
      fmt::format("image {} (id {}), taken at {:.2f}, {:.2f} looking towards {:.0f} deg\n", row.name,
                  row.image_id, floor.position.x(), floor.position.y(), floor.heading_deg);
  text += fmt::format("sees {} landmarks", row.landmarks.size());
  std::vector<std::pair<int, RegionIdx>> of_regions;
  for (size_t region = 0; region < rows.regions.size(); ++region) {
    const int num_seen = NumSeenOf(rows, rows.regions[region], {image});
    if (num_seen > 0) of_regions.emplace_back(-num_seen, static_cast<RegionIdx>(region));
  }
  std::sort(of_regions.begin(), of_regions.end());
  for (size_t i = 0; i < of_regions.size() && i < kMaxLookAlikes; ++i)
    text += fmt::format("{} {} of region {}", i == 0 ? ":" : ",", -of_regions[i].first, of_regions[i].second);
  text += "\n";
  if (const int32_t node = NodeOf(rows, image); node < 0) {
    text += "appearance graph: not in it\n";
  } else {
    text += fmt::format("appearance graph: {}\n", rows.appearance[node].is_kept
                                                      ? "kept: robots find their way over it"
                                                      : "not kept: a linked image stands for it");
    if (rows.appearance[node].entropy) {
      text += fmt::format("by looks: {:.2f} nats, as {:.1f} places alike\n", *rows.appearance[node].entropy,
                          std::exp(*rows.appearance[node].entropy));
    }
    text += LookAlikesText(rows, node);
  }
  if (row.station < 0) text += "station: none: it counts for no region\n";
  return text;
}

nlohmann::ordered_json ExplainImageJson(const MapRows& rows, int32_t image) {
  const MapImage& row = rows.images[image];
  const FloorPose floor = FloorPoseOf(row.cam_from_world, rows.floor_from_world);
  nlohmann::ordered_json json = {{"image", row.name},
                                 {"image_id", row.image_id},
                                 {"position", {floor.position.x(), floor.position.y()}},
                                 {"heading_deg", floor.heading_deg},
                                 {"num_landmarks", row.landmarks.size()},
                                 {"station", nullptr},
                                 {"is_kept", nullptr}};
  if (row.station >= 0) json["station"] = row.station;
  if (const int32_t node = NodeOf(rows, image); node >= 0) {
    json["is_kept"] = rows.appearance[node].is_kept;
    if (rows.appearance[node].entropy) json["entropy_nat"] = *rows.appearance[node].entropy;
    json["look_alikes"] = nlohmann::ordered_json::array();
    for (const auto& look_alike : LookAlikesOf(rows, node)) {
      json["look_alikes"].push_back({{"image", rows.images[rows.appearance[look_alike.node].images[0]].name},
                                     {"score", look_alike.score}});
    }
  }
  return json;
}

}  // namespace cairn::pipeline
