#include "pipeline/explain/station_text.h"

namespace cairn::pipeline {

std::string PlaceText(const MapStation& station) {
  const std::string place = fmt::format("{:.2f}, {:.2f}", station.position.x(), station.position.y());
  return station.heading_deg ? fmt::format("{}, {:.0f} deg", place, *station.heading_deg) : place;
}

std::string StationText(const MapRows& rows, StationIdx station) {
  return fmt::format("station {} ({})", station, PlaceText(rows.stations[station]));
}

}  // namespace cairn::pipeline
