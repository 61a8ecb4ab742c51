#include "stages/emit_map/count_drops.h"

#include <algorithm>
#include <map>
#include <string_view>
#include <unordered_map>

#include "core/colmap/colmap_database.h"

namespace cairn::emit_map {
namespace {

template <typename... Args>
Error Foreign(const DroppedItem& item, fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument,
                   "emit_map: dropped as {}: {}; the stages' files do not belong together: compile again",
                   DescribeDropReason(item.reason).name, fmt::format(format, std::forward<Args>(args)...));
}

// Finds the stations of dropped items.
class StationFinder {
 public:
  StationFinder(const Classes& classes, const World& world) : classes_(classes), world_(world) {
    for (size_t station = 0; station < world.station_images.size(); ++station) {
      for (const ImageId image_id : world.station_images[station])
        station_of_.emplace(image_id, static_cast<StationIdx>(station));
    }
  }

  // The stations at which an item counts: ascending; each once, except for keypoints and views.
  Result<std::vector<StationIdx>> StationsOf(const DroppedItem& item) const {
    std::vector<StationIdx> stations;
    const DropReasonEntry& reason = DescribeDropReason(item.reason);
    switch (reason.kind) {
      case DropKind::kImage:
        AddImage(item.item_id, &stations);
        break;
      case DropKind::kPair: {
        const auto [image1, image2] = ImageIdsFromPairId(item.item_id);
        AddImage(image1, &stations);
        AddImage(image2, &stations);
        break;
      }
      case DropKind::kFeature:
        CAIRN_RETURN_IF_ERROR(AddFeature(item, reason.stage, &stations));
        break;
      case DropKind::kKeypoint:
        AddKeypoints(item, &stations);
        return stations;
      case DropKind::kView:
        for (const uint32_t station : item.seen_at)
          CAIRN_RETURN_IF_ERROR(AddStation(item, station, &stations));
        return stations;
      case DropKind::kStation:
        CAIRN_RETURN_IF_ERROR(AddStation(item, item.item_id, &stations));
        break;
    }
    std::sort(stations.begin(), stations.end());
    stations.erase(std::unique(stations.begin(), stations.end()), stations.end());
    return stations;
  }

 private:
  void AddImage(int64_t image_id, std::vector<StationIdx>* stations) const {
    const auto station = station_of_.find(static_cast<ImageId>(image_id));
    if (station != station_of_.end()) stations->push_back(station->second);
  }

  void AddKeypoints(const DroppedItem& item, std::vector<StationIdx>* stations) const {
    for (size_t i = 0; i < item.seen_at.size(); i += 2) AddImage(item.seen_at[i], stations);
  }

  Status AddStation(const DroppedItem& item, int64_t station, std::vector<StationIdx>* stations) const {
    if (station >= world_.num_stations())
      return Foreign(item, "station {} of {}", station, world_.num_stations());
    stations->push_back(static_cast<StationIdx>(station));
    return Ok();
  }

  Status AddFeature(const DroppedItem& item, std::string_view stage,
                    std::vector<StationIdx>* stations) const {
    if (stage == "group_classes") {
      AddKeypoints(item, stations);
    } else if (stage == "filter_visibility" || stage == "emit_map") {
      const auto found = std::lower_bound(
          classes_.classes.begin(), classes_.classes.end(), item.item_id,
          [](const FeatureClass& feature_class, int64_t id) { return feature_class.class_id < id; });
      if (found == classes_.classes.end() || found->class_id != item.item_id)
        return Foreign(item, "class {} is not among the classes", item.item_id);
      for (const Observation& observation : found->observations) AddImage(observation.image_id, stations);
    } else {
      if (item.item_id >= world_.num_features())
        return Foreign(item, "feature {} of {}", item.item_id, world_.num_features());
      *stations = world_.areas[item.item_id];
    }
    return Ok();
  }

  const Classes& classes_;
  const World& world_;
  std::unordered_map<ImageId, StationIdx> station_of_;
};

// How many things an item stands for.
int64_t NumDropped(const DroppedItem& item) {
  const DropKind kind = DescribeDropReason(item.reason).kind;
  const auto num = static_cast<int64_t>(item.seen_at.size());
  return kind == DropKind::kKeypoint ? num / 2 : kind == DropKind::kView ? num : 1;
}

}  // namespace

Result<std::vector<DropCount>> CountDrops(const Classes& classes, const World& world,
                                          const std::vector<DroppedItem>& items) {
  const StationFinder finder(classes, world);
  std::map<DropReason, DropCount> counts;
  for (const DroppedItem& item : items) {
    DropCount& count = counts[item.reason];
    if (count.num_dropped == 0) {
      const DropReasonEntry& reason = DescribeDropReason(item.reason);
      count = {.reason_id = static_cast<int>(item.reason),
               .stage = reason.stage,
               .kind = DropKindName(reason.kind),
               .name = reason.name,
               .text = reason.text,
               .at_stations = std::vector<int32_t>(world.num_stations(), 0)};
    }
    CAIRN_ASSIGN_OR_RETURN(const std::vector<StationIdx> stations, finder.StationsOf(item));
    count.num_dropped += NumDropped(item);
    for (const StationIdx station : stations) ++count.at_stations[station];
  }
  std::vector<DropCount> result;
  for (auto& [reason, count] : counts) {
    if (std::count(count.at_stations.begin(), count.at_stations.end(), 0) == world.num_stations())
      count.at_stations.clear();
    result.push_back(std::move(count));
  }
  return result;
}

}  // namespace cairn::emit_map
