#include "core/delta/renumbering.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "core/packing/map_codes.h"

namespace cairn {
namespace {

bool IsSame(const MapRows& a, int32_t i, const MapRows& b, int32_t j) {
  const MapLandmark& of_a = a.landmarks[i];
  const MapLandmark& of_b = b.landmarks[j];
  return of_a.class_id == of_b.class_id && of_a.position == of_b.position &&
         of_a.covariance == of_b.covariance && of_a.scale_m == of_b.scale_m &&
         of_a.num_observations == of_b.num_observations && a.descriptors.row(i) == b.descriptors.row(j);
}

std::tuple<double, double, double> KeyOf(const MapStation& station) {
  constexpr double kNoHeading = 1000;  // degrees: no station has it
  return {station.position.x(), station.position.y(), station.heading_deg.value_or(kNoHeading)};
}

// Per element of `to`, the first element of `from` with its key that no other one has.
template <class Key>
std::vector<int32_t> FindByKey(const std::vector<Key>& from, const std::vector<Key>& to) {
  std::multimap<Key, int32_t> left;  // equal keys in the order in which they are put in
  for (size_t i = 0; i < from.size(); ++i) left.emplace(from[i], static_cast<int32_t>(i));
  std::vector<int32_t> found;
  for (const Key& key : to) {
    const auto place = left.lower_bound(key);
    const bool is_there = place != left.end() && place->first == key;
    found.push_back(is_there ? place->second : Renumbering::kNew);
    if (is_there) left.erase(place);
  }
  return found;
}

template <class T, class KeyOfElement>
auto Keys(const std::vector<T>& elements, const KeyOfElement& key_of) {
  std::vector<decltype(key_of(elements[0]))> keys;
  for (const T& element : elements) keys.push_back(key_of(element));
  return keys;
}

// The inverse: per element of the first map, its index in the other, or kNew.
std::vector<int32_t> Inverse(const std::vector<int32_t>& origins, size_t num_from) {
  std::vector<int32_t> inverse(num_from, Renumbering::kNew);
  for (size_t i = 0; i < origins.size(); ++i) {
    if (origins[i] != Renumbering::kNew) inverse[origins[i]] = static_cast<int32_t>(i);
  }
  return inverse;
}

// The numbers of those that the other map has, ascending.
std::vector<int32_t> Translated(const std::vector<int32_t>& numbers, const std::vector<int32_t>& inverse) {
  std::vector<int32_t> translated;
  for (const int32_t number : numbers) {
    if (inverse[number] != Renumbering::kNew) translated.push_back(inverse[number]);
  }
  std::sort(translated.begin(), translated.end());
  return translated;
}

// Links and look-alikes under other numbers stand at the smaller node again.
template <class Edge>
void AddTranslated(const std::vector<Edge>& edges, int32_t node, const std::vector<int32_t>& inverse,
                   std::vector<Edge> MapAppearanceNode::*list, std::vector<MapAppearanceNode>* nodes) {
  for (Edge edge : edges) {
    const int32_t other = inverse[edge.node];
    if (other == Renumbering::kNew) continue;
    edge.node = std::max(node, other);
    ((*nodes)[std::min(node, other)].*list).push_back(edge);
  }
}

std::vector<MapAppearanceNode> RenumberedNodes(const MapRows& from, const Renumbering& renumbering,
                                               const std::vector<int32_t>& new_images) {
  const std::vector<int32_t> new_nodes = Inverse(renumbering.nodes, from.appearance.size());
  std::vector<MapAppearanceNode> nodes(renumbering.nodes.size());
  // All nodes of a map have an entropy, or none has.
  if (!from.appearance.empty() && from.appearance[0].entropy) {
    for (MapAppearanceNode& node : nodes) node.entropy = 0;
  }
  for (size_t i = 0; i < from.appearance.size(); ++i) {
    const int32_t node = new_nodes[i];
    if (node == Renumbering::kNew) continue;
    const MapAppearanceNode& old = from.appearance[i];
    nodes[node].images = Translated(old.images, new_images);
    nodes[node].is_kept = old.is_kept;
    nodes[node].entropy = old.entropy;
    AddTranslated(old.links, node, new_nodes, &MapAppearanceNode::links, &nodes);
    AddTranslated(old.look_alikes, node, new_nodes, &MapAppearanceNode::look_alikes, &nodes);
  }
  const auto by_node = [](const auto& a, const auto& b) { return a.node < b.node; };
  for (MapAppearanceNode& node : nodes) {
    std::sort(node.links.begin(), node.links.end(), by_node);
    std::sort(node.look_alikes.begin(), node.look_alikes.end(), by_node);
  }
  return nodes;
}

// Runs of elements that follow each other in the first map, and of new ones: a varint of 2 * length + (1 if
// they are new) each, and for those that are not, the zigzag of how far their first is from the one after the
// run before.
void WriteOrigins(const std::vector<int32_t>& origins, BlobWriter* writer) {
  writer->Varint(origins.size());
  int64_t next = 0;
  for (size_t begin = 0, end = 0; begin < origins.size(); begin = end) {
    const bool is_new = origins[begin] == Renumbering::kNew;
    const auto goes_on = [&](size_t i) {
      return is_new ? origins[i] == Renumbering::kNew
                    : origins[i] == origins[begin] + static_cast<int64_t>(i - begin);
    };
    for (end = begin + 1; end < origins.size() && goes_on(end);) ++end;
    writer->Varint(2 * (end - begin) + (is_new ? 1 : 0));
    if (is_new) continue;
    writer->Varint(ZigZag(origins[begin] - next));
    next = origins[end - 1] + int64_t{1};
  }
}

std::vector<int32_t> ReadOrigins(size_t num_from, int64_t max_num_elements, BlobReader* reader) {
  const uint64_t num = reader->Varint();
  std::vector<int32_t> origins;
  if (num > static_cast<uint64_t>(max_num_elements)) {
    reader->Fail();
    return origins;
  }
  std::vector<char> is_taken(num_from, 0);
  int64_t next = 0;
  while (reader->ok() && origins.size() < num) {
    const uint64_t code = reader->Varint();
    const uint64_t length = code / 2;
    if (length == 0 || length > num - origins.size()) {
      reader->Fail();
    } else if (code % 2 == 1) {
      origins.insert(origins.end(), length, Renumbering::kNew);
    } else {
      next += UnZigZag(reader->Varint());  // a varint has 63 bits at most
      const auto limit = static_cast<int64_t>(num_from);
      for (uint64_t i = 0; i < length && reader->ok(); ++i, ++next) {
        if (next < 0 || next >= limit || is_taken[next] != 0) {
          reader->Fail();
          break;
        }
        is_taken[next] = 1;
        origins.push_back(static_cast<int32_t>(next));
      }
    }
  }
  return origins;
}

}  // namespace

Renumbering FindSame(const MapRows& from, const MapRows& to) {
  Renumbering same;
  // Ids are given once: a landmark whose other numbers differ is a new one.
  same.landmarks =
      FindByKey(Keys(from.landmarks, [](const MapLandmark& landmark) { return landmark.class_id; }),
                Keys(to.landmarks, [](const MapLandmark& landmark) { return landmark.class_id; }));
  for (size_t i = 0; i < to.landmarks.size(); ++i) {
    int32_t& origin = same.landmarks[i];
    if (origin != Renumbering::kNew && !IsSame(from, origin, to, static_cast<int32_t>(i)))
      origin = Renumbering::kNew;
  }
  const auto image_id = [](const MapImage& image) { return image.image_id; };
  same.images = FindByKey(Keys(from.images, image_id), Keys(to.images, image_id));
  same.stations = FindSameStations(from, to);
  const auto first_image = [](const MapRows& rows) {
    return [&rows](const MapAppearanceNode& node) { return rows.images[node.images[0]].image_id; };
  };
  same.nodes = FindByKey(Keys(from.appearance, first_image(from)), Keys(to.appearance, first_image(to)));
  return same;
}

std::vector<int32_t> FindSameStations(const MapRows& from, const MapRows& to) {
  return FindByKey(Keys(from.stations, KeyOf), Keys(to.stations, KeyOf));
}

MapRows Renumbered(const MapRows& from, const Renumbering& renumbering) {
  const std::vector<int32_t> new_landmarks = Inverse(renumbering.landmarks, from.landmarks.size());
  const std::vector<int32_t> new_images = Inverse(renumbering.images, from.images.size());
  const std::vector<int32_t> new_stations = Inverse(renumbering.stations, from.stations.size());
  MapRows rows;
  rows.images.resize(renumbering.images.size());
  for (size_t i = 0; i < rows.images.size(); ++i) {
    if (renumbering.images[i] == Renumbering::kNew) continue;
    rows.images[i] = from.images[renumbering.images[i]];
    rows.images[i].landmarks = Translated(rows.images[i].landmarks, new_landmarks);
    StationIdx& station = rows.images[i].station;
    station = station < 0 ? -1 : new_stations[station];
  }
  rows.stations.resize(renumbering.stations.size());
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    if (renumbering.stations[i] != Renumbering::kNew)
      rows.stations[i] = from.stations[renumbering.stations[i]];
  }
  for (const auto& [u, v] : from.station_edges) {
    if (new_stations[u] != Renumbering::kNew && new_stations[v] != Renumbering::kNew)
      rows.station_edges.push_back(std::minmax({new_stations[u], new_stations[v]}));
  }
  std::sort(rows.station_edges.begin(), rows.station_edges.end());
  for (const MapRegion& region : from.regions) {
    rows.regions.push_back(
        {Translated(region.stations, new_stations), Translated(region.landmarks, new_landmarks)});
  }
  rows.appearance = RenumberedNodes(from, renumbering, new_images);
  return rows;
}

void WriteRenumbering(const Renumbering& renumbering, BlobWriter* writer) {
  for (const std::vector<int32_t>* origins :
       {&renumbering.landmarks, &renumbering.images, &renumbering.stations, &renumbering.nodes})
    WriteOrigins(*origins, writer);
}

Renumbering ReadRenumbering(const MapRows& from, int64_t max_num_elements, BlobReader* reader) {
  Renumbering renumbering;
  renumbering.landmarks = ReadOrigins(from.landmarks.size(), max_num_elements, reader);
  renumbering.images = ReadOrigins(from.images.size(), max_num_elements, reader);
  renumbering.stations = ReadOrigins(from.stations.size(), max_num_elements, reader);
  renumbering.nodes = ReadOrigins(from.appearance.size(), max_num_elements, reader);
  return renumbering;
}

}  // namespace cairn
