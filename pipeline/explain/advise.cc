#include "pipeline/explain/advise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "core/world/drop_reason.h"
#include "pipeline/explain/station_losses.h"
#include "pipeline/explain/station_text.h"
#include "stages/check_map/promise_figures.h"

namespace cairn::pipeline {
namespace {

// Entropy of a place that looks the same as one other place; a larger entropy means several look-alikes.
constexpr double kAmbiguousEntropy = std::numbers::ln2;
// A map counts as smaller if this map has at least this many times its bytes, and as localizing more if by at
// least this part of the images.
constexpr double kOtherSizeFactor = 1.5;
constexpr double kMoreLocalized = 0.01;
// Errors that one rotation, scale and shift reduces to this part come from different frames; fewer images
// than kMinAligned cannot show it.
constexpr double kAlignedErrors = 0.7;
constexpr size_t kMinAligned = 10;
constexpr double kLeastFromWallM = 0.2;
constexpr int kMaxNames = 6;
constexpr size_t kMaxPoorerPlaces = 3;  // of which the last survey found less than was there
// Part of the poses within 10 cm and 5 degrees that is good enough.
constexpr double kManyWithin = 0.8;
constexpr double kPoorScaleRatio = 0.03;  // standard deviation of a scale that is worth a word

std::vector<std::vector<StationIdx>> Neighbours(const MapRows& rows) {
  std::vector<std::vector<StationIdx>> neighbours(rows.stations.size());
  for (const auto& [u, v] : rows.station_edges) {
    neighbours[u].push_back(v);
    neighbours[v].push_back(u);
  }
  return neighbours;
}

// Connected sets of these stations (ascending), largest first.
std::vector<std::vector<StationIdx>> Components(const std::vector<StationIdx>& stations,
                                                const std::vector<std::vector<StationIdx>>& neighbours) {
  std::set<StationIdx> left(stations.begin(), stations.end());
  std::vector<std::vector<StationIdx>> components;
  while (!left.empty()) {
    std::vector<StationIdx> component = {*left.begin()};
    left.erase(left.begin());
    for (size_t i = 0; i < component.size(); ++i) {
      for (const StationIdx next : neighbours[component[i]]) {
        if (left.erase(next) > 0) component.push_back(next);
      }
    }
    std::sort(component.begin(), component.end());
    components.push_back(std::move(component));
  }
  std::stable_sort(components.begin(), components.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return components;
}

// Whether a camera can stand there: not in a wall of the floor plan, nor right at one.
bool IsFree(const Eigen::Vector2d& place, const Views& views) {
  return std::none_of(views.plan.walls.begin(), views.plan.walls.end(), [&](const PlanWall& wall) {
    const Eigen::Vector2d along = wall.end - wall.start;
    const double squared = along.squaredNorm();
    const double at = squared > 0 ? std::clamp((place - wall.start).dot(along) / squared, 0.0, 1.0) : 0;
    return (wall.start + at * along - place).norm() < kLeastFromWallM;
  });
}

// Half way to the neighbouring places, looking as the stations do: from there, what these stations see is
// seen from one more place.  Those nearest the middle of the stations first.
std::vector<Advice::View> ViewsBetween(const MapRows& rows, const std::vector<StationIdx>& stations,
                                       const std::vector<std::vector<StationIdx>>& neighbours) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const StationIdx station : stations) middle += rows.stations[station].position / stations.size();
  std::map<std::array<int64_t, 3>, Advice::View> views;  // by place (mm) and heading: no view twice
  for (const StationIdx station : stations) {
    const MapStation& here = rows.stations[station];
    for (const StationIdx next : neighbours[station]) {
      if ((rows.stations[next].position - here.position).norm() < 0.01) continue;  // another heading
      const Eigen::Vector2d place = (here.position + rows.stations[next].position) / 2;
      if (!IsFree(place, rows.views)) continue;
      const std::array<int64_t, 3> key = {std::llround(place.x() * 1e3), std::llround(place.y() * 1e3),
                                          std::llround(here.heading_deg.value_or(0))};
      views.emplace(key, Advice::View{place, here.heading_deg});
    }
  }
  std::vector<Advice::View> list;
  for (const auto& [key, view] : views) list.push_back(view);
  std::stable_sort(list.begin(), list.end(), [&](const Advice::View& a, const Advice::View& b) {
    return (a.position - middle).norm() < (b.position - middle).norm();
  });
  if (list.size() > Advice::kMaxViews) list.resize(Advice::kMaxViews);
  return list;
}

// "4 stations around station 57 (2.00, 1.25, 90 deg)": the one nearest their middle.
std::string WhereText(const MapRows& rows, const std::vector<StationIdx>& stations) {
  if (stations.size() == 1) return StationText(rows, stations[0]);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const StationIdx station : stations) middle += rows.stations[station].position / stations.size();
  const StationIdx center =
      *std::min_element(stations.begin(), stations.end(), [&](StationIdx a, StationIdx b) {
        return (rows.stations[a].position - middle).norm() < (rows.stations[b].position - middle).norm();
      });
  return fmt::format("{} stations around {}", stations.size(), StationText(rows, center));
}

int LeastOf(const std::vector<StationIdx>& stations, const auto& number) {
  int least = number(stations[0]);
  for (const StationIdx station : stations) least = std::min(least, number(station));
  return least;
}

Advice AboutUncovered(const MapRows& rows, const StationLosses& losses, std::vector<StationIdx> stations,
                      const std::vector<std::vector<StationIdx>>& neighbours) {
  Advice advice;
  const std::string where = WhereText(rows, stations);
  const char* verb = stations.size() == 1 ? "is" : "are";
  const int num_visible = LeastOf(stations, [&](StationIdx i) { return losses.NumVisible(i); });
  const int num_seldom = LeastOf(stations, [&](StationIdx i) { return losses.NumSeenTooSeldom(i); });
  const int num_alike = LeastOf(stations, [&](StationIdx i) { return losses.NumAlike(i); });
  const std::optional<DropReason> reason = losses.WhyUncovered(stations[0]);
  if (!reason) {
    advice.text = fmt::format("{} {} not covered.", where, verb);
  } else if (*reason == DropReason::kLeftOver) {
    advice.text = fmt::format(
        "{} {} not covered, though {} features are in view, k = {} are needed: the algorithm left {} over. "
        "[decompose_regions] algorithm = \"best\" or a smaller rho (now {}) covers more.",
        where, verb, num_visible, rows.k, stations.size() == 1 ? "it" : "them", rows.rho);
  } else if (*reason == DropReason::kFewCommonFeatures) {
    advice.text = fmt::format(
        "{} {} not covered: {} features are in view, but fewer than k = {} of them also from all stations "
        "within tau = {} hops. Images between them, or a smaller tau, would help.",
        where, verb, num_visible, rows.k, rows.tau);
    advice.images_to_take = ViewsBetween(rows, stations, neighbours);
  } else if (num_seldom >= std::max(1, rows.k - num_visible) && num_seldom >= num_alike) {
    advice.text = fmt::format(
        "{} {} not covered: only {} features are in view, k = {} are needed, but {} more were seen from too "
        "few places. Take images around there.",
        where, verb, num_visible, rows.k, num_seldom);
    advice.images_to_take = ViewsBetween(rows, stations, neighbours);
  } else if (num_alike > num_seldom) {
    advice.text = fmt::format(
        "{} {} not covered: only {} features are in view, k = {} are needed, and {} look like others "
        "elsewhere. More images will not help; something distinctive on the walls there would.",
        where, verb, num_visible, rows.k, num_alike);
  } else {
    advice.text = fmt::format(
        "{} {} not covered: only {} features are in view, k = {} are needed, and hardly more were found in "
        "the images (blank walls, darkness, blur). A smaller k, a camera that sees more, or something with "
        "texture there would help.",
        where, verb, num_visible, rows.k);
  }
  advice.stations = std::move(stations);
  return advice;
}

bool Concerns(const std::vector<StationIdx>& stations, const std::vector<StationIdx>& about) {
  if (about.empty()) return true;
  return std::any_of(stations.begin(), stations.end(), [&](StationIdx station) {
    return std::binary_search(about.begin(), about.end(), station);
  });
}

void AddPoorRegions(const MapRows& rows, const std::vector<StationIdx>& about,
                    const std::vector<std::vector<StationIdx>>& neighbours, std::vector<Advice>* advice) {
  std::vector<const RegionSelfTest*> poor;
  for (const RegionSelfTest& test : rows.findings.self_test_regions) {
    if (test.region != kOutsideRegions && test.num_held_out > 0 &&
        test.LocalizedRatio() < kPoorLocalizedRatio && Concerns(rows.regions[test.region].stations, about)) {
      poor.push_back(&test);
    }
  }
  std::stable_sort(poor.begin(), poor.end(), [](const RegionSelfTest* a, const RegionSelfTest* b) {
    return a->num_held_out - a->num_localized > b->num_held_out - b->num_localized;
  });
  for (const RegionSelfTest* test : poor) {
    const MapRegion& region = rows.regions[test->region];
    advice->push_back(
        {.text = fmt::format(
             "Region {} ({}) localizes {} of {} {} image{} with its {} landmarks. {}mages between its "
             "stations would help.",
             test->region, WhereText(rows, region.stations), test->num_localized, test->num_held_out,
             TriedWord(rows), test->num_held_out == 1 ? "" : "s", region.landmarks.size(),
             rows.k > 0 ? "A larger k, or i" : "I"),
         .stations = region.stations,
         .region = test->region,
         .images_to_take = ViewsBetween(rows, region.stations, neighbours)});
  }
}

// Stations where the promise is not kept, neighbours together.
void AddBrokenPromises(const MapRows& rows, const std::vector<StationIdx>& about,
                       const std::vector<std::vector<StationIdx>>& neighbours, std::vector<Advice>* advice) {
  if (!rows.findings.promise) return;
  const MapPromise& promise = *rows.findings.promise;
  std::map<std::string, std::set<StationIdx>> stations_of;  // by reason, without numbers
  std::map<StationIdx, const NodePromise*> worst;
  for (const NodePromise& node : promise.nodes) {
    if (node.probability >= promise.terms.probability) continue;
    const StationIdx station = rows.images[node.image].station;
    if (station < 0) continue;
    stations_of[node.most_probable >= promise.terms.probability ? "budget" : "survey"].insert(station);
    const auto [at, is_new] = worst.try_emplace(station, &node);
    if (!is_new && node.probability < at->second->probability) at->second = &node;
  }
  for (const auto& [reason, of_reason] : stations_of) {
    for (std::vector<StationIdx>& stations :
         Components(std::vector<StationIdx>(of_reason.begin(), of_reason.end()), neighbours)) {
      if (!Concerns(stations, about)) continue;
      const NodePromise& node =
          *worst.at(*std::min_element(stations.begin(), stations.end(), [&](StationIdx a, StationIdx b) {
            return worst.at(a)->probability < worst.at(b)->probability;
          }));
      advice->push_back({.text = fmt::format(
                             "The promise is not kept at {}: an image there is localized with a probability "
                             "of {:.0f} %, where {:.0f} % are promised: {}.",
                             WhereText(rows, stations), 100 * node.probability,
                             100 * promise.terms.probability, check_map::WhyNotPromised(node, promise)),
                         .stations = stations,
                         .images_to_take = reason == "survey" ? ViewsBetween(rows, stations, neighbours)
                                                              : std::vector<Advice::View>()});
    }
  }
}

// Places of which the last survey says that more is gone than new, those that lost most first: what is there
// now is not well known.
void AddPoorerPlaces(const MapRows& rows, const std::vector<StationIdx>& about,
                     const std::vector<std::vector<StationIdx>>& neighbours, std::vector<Advice>* advice) {
  std::vector<const MapChange*> poorer;
  for (const MapChange& change : rows.findings.changes) {
    if (change.session + 1 == static_cast<int>(rows.sessions.size()) &&
        change.num_appeared < change.num_vanished)
      poorer.push_back(&change);
  }
  std::stable_sort(poorer.begin(), poorer.end(), [](const MapChange* a, const MapChange* b) {
    return a->num_vanished - a->num_appeared > b->num_vanished - b->num_appeared;
  });
  size_t num_places = 0;
  for (const MapChange* change : poorer) {
    const int32_t image = change->image_after >= 0 ? change->image_after : change->image_before;
    std::vector<StationIdx> stations;
    if (image >= 0 && rows.images[image].station >= 0) stations = {rows.images[image].station};
    if (!Concerns(stations, about)) continue;
    if (++num_places > kMaxPoorerPlaces) return;
    const Eigen::Vector3d place = rows.floor_from_world * change->position;
    Advice entry{
        .text = fmt::format(
            "Survey here next: around {:.2f}, {:.2f} (radius {:.2g} {}) session {} finds {} features "
            "gone and {} new{}.",
            place.x(), place.y(), change->radius_m, LengthUnit(rows.frame), rows.sessions[change->session],
            change->num_vanished, change->num_appeared,
            image >= 0 ? fmt::format(" ({})", rows.images[image].name) : ""),
        .stations = stations,
        .is_weakness = false};
    if (!stations.empty()) entry.images_to_take = ViewsBetween(rows, stations, neighbours);
    advice->push_back(std::move(entry));
  }
}

void AddAmbiguousRegions(const MapRows& rows, const std::vector<StationIdx>& about,
                         std::vector<Advice>* advice) {
  std::vector<const RegionEntropy*> ambiguous;
  for (const RegionEntropy& entry : rows.findings.region_entropies) {
    if (entry.entropy >= kAmbiguousEntropy && Concerns(rows.regions[entry.region].stations, about))
      ambiguous.push_back(&entry);
  }
  std::stable_sort(ambiguous.begin(), ambiguous.end(),
                   [](const auto* a, const auto* b) { return a->entropy > b->entropy; });
  for (const RegionEntropy* entry : ambiguous) {
    const std::vector<StationIdx>& stations = rows.regions[entry->region].stations;
    advice->push_back(
        {.text =
             fmt::format("Region {} ({}) looks like other places: {:.2f} nats, as {:.1f} places alike. A "
                         "robot that starts there has to move before it knows where it is; something "
                         "distinctive on its walls would help.",
                         entry->region, WhereText(rows, stations), entry->entropy, std::exp(entry->entropy)),
         .stations = stations,
         .region = entry->region});
  }
}

// About options, from the map as a whole.
void AddOptions(const MapRows& rows, std::vector<Advice>* advice) {
  const auto localized = rows.self_test.find("localized_ratio");
  int64_t num_not_chosen = 0;
  for (const DropCount& drop : rows.findings.drops) {
    if (drop.reason_id == static_cast<int>(DropReason::kNotChosen)) num_not_chosen = drop.num_dropped;
  }
  if (localized != rows.self_test.end() && localized->second < 0.95 && num_not_chosen > 0 &&
      rows.landmark_choice == "regions") {
    advice->push_back(
        {.text = fmt::format(
             "{:.1f} % of the {} images are localized, and {} features that regions could keep "
             "were not chosen: [decompose_regions] k above {} keeps more of them, about in proportion "
             "in bytes; [emit_map] landmarks = \"all\" keeps every one.",
             100 * localized->second, TriedWord(rows), num_not_chosen, rows.k)});
  }
  const auto nees = rows.self_test.find("mean_nees"), nees_high = rows.self_test.find("nees_high");
  if (nees != rows.self_test.end() && nees_high != rows.self_test.end() && nees->second > nees_high->second) {
    advice->push_back(
        {.text = fmt::format(
             "Poses are less exact than the map says: their errors are {:.1f} times what the covariances "
             "state (mean normalised error squared {:.1f}, at most {:.1f} where they are right). Check the "
             "survey's poses against those of the {} images; [check_map] covariance_scale widens "
             "what is stated.",
             std::sqrt(nees->second / 6), nees->second, nees_high->second, TriedWord(rows))});
  }
  const auto within = rows.self_test.find("within_10cm_5deg_ratio");
  if (IsMetric(rows.frame) && localized != rows.self_test.end() && within != rows.self_test.end() &&
      within->second < kManyWithin * localized->second) {
    advice->push_back(
        {.text = fmt::format(
             "Of the {:.1f} % of {} images that are localized, only {:.0f} % lie within 10 cm and 5 "
             "degrees of where they were taken. Causes are landmarks far away, few images around, or inexact "
             "poses of the survey; [group_classes] refine_poses = \"always\" improves poses.",
             100 * localized->second, TriedWord(rows), 100 * within->second / localized->second)});
  }
  if (rows.frame.scale_sigma_ratio > kPoorScaleRatio) {
    advice->push_back(
        {.text = fmt::format(
             "The map's metres are known to {:.1f} % only ({}): what is 10 m away may be {:.2f} m "
             "nearer or farther. odometry.txt or imu.csv in the capture, or more and longer known distances "
             "([reconstruct] distances), give the scale better.",
             100 * rows.frame.scale_sigma_ratio, rows.frame.source, 10 * rows.frame.scale_sigma_ratio)});
  }
  if (rows.self_test.empty()) {
    advice->push_back({.text = "No images tried the map: queries = \"queries.txt\" in the capture, or "
                               "[leave_out] hold_out = \"auto\" for a survey of twelve images or more, shows "
                               "how well it localizes."});
  }
}

std::string BytesText(double bytes) {
  return bytes >= 1e6 ? fmt::format("{:.2f} MB", bytes / 1e6) : fmt::format("{:.0f} kB", bytes / 1e3);
}

}  // namespace

std::vector<Advice> Advise(const MapRows& rows, const std::vector<StationIdx>& about) {
  std::vector<Advice> advice;
  const StationLosses losses(rows);
  const auto neighbours = Neighbours(rows);
  // Neighbouring stations with the same reason are one piece of advice.
  std::map<int, std::vector<StationIdx>> uncovered;
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    const auto station = static_cast<StationIdx>(i);
    const std::optional<DropReason> reason = losses.WhyUncovered(station);
    if (!rows.stations[i].is_covered || reason)
      uncovered[reason ? static_cast<int>(*reason) : 0].push_back(station);
  }
  for (const auto& [reason, stations] : uncovered) {
    for (std::vector<StationIdx>& component : Components(stations, neighbours)) {
      if (Concerns(component, about))
        advice.push_back(AboutUncovered(rows, losses, std::move(component), neighbours));
    }
  }
  std::stable_sort(advice.begin(), advice.end(),
                   [](const Advice& a, const Advice& b) { return a.stations.size() > b.stations.size(); });
  AddBrokenPromises(rows, about, neighbours, &advice);
  AddPoorRegions(rows, about, neighbours, &advice);
  AddPoorerPlaces(rows, about, neighbours, &advice);
  AddAmbiguousRegions(rows, about, &advice);
  AddOptions(rows, &advice);
  return advice;
}

void AddSizes(const MapRows& rows, int64_t num_bytes, const std::vector<ParetoPoint>& sizes,
              std::vector<Advice>* advice) {
  const auto localized = rows.self_test.find("localized_ratio");
  const auto within = rows.self_test.find("within_10cm_5deg_ratio");
  if (localized == rows.self_test.end() || within == rows.self_test.end()) return;
  const auto bytes = static_cast<double>(num_bytes);
  const ParetoPoint *smaller = nullptr, *better = nullptr;
  for (const ParetoPoint& size : sizes) {
    if (size.localized_ratio < localized->second || size.within_10cm_5deg_ratio < within->second) continue;
    if (static_cast<double>(size.num_bytes) * kOtherSizeFactor <= bytes &&
        (smaller == nullptr || size.num_bytes < smaller->num_bytes))
      smaller = &size;
    if (size.localized_ratio >= localized->second + kMoreLocalized &&
        (better == nullptr || size.num_bytes < better->num_bytes))
      better = &size;
  }
  const auto text = [&](const ParetoPoint& size) {
    const std::string error =
        size.median_error_m ? fmt::format(", median error {:.2f} cm", 100 * *size.median_error_m) : "";
    const std::string limit = size.max_bytes > 0 ? fmt::format(", max_bytes = {}", size.max_bytes) : "";
    return fmt::format(
        "a map of {} ([emit_map] landmarks = \"all\"{}) localizes {:.1f} % of the {} images{}; "
        "this one of {} {:.1f} %.",
        BytesText(static_cast<double>(size.num_bytes)), limit, 100 * size.localized_ratio, TriedWord(rows),
        error, BytesText(bytes), 100 * localized->second);
  };
  if (better != nullptr) {
    advice->insert(advice->begin(), {.text = "A map that localizes more is possible: " + text(*better)});
  } else if (smaller != nullptr) {
    advice->insert(advice->begin(), {.text = "A smaller map is enough: " + text(*smaller)});
  }
}

void AddFailedImages(const MapHead& head, const std::vector<FailedImage>& failed,
                     std::vector<Advice>* advice) {
  std::map<size_t, std::vector<Advice::View>> views;  // by advice
  Advice elsewhere;
  std::set<StationIdx> stations;
  std::string names;
  int num_elsewhere = 0;
  for (const FailedImage& image : failed) {
    bool is_told = false;
    for (size_t i = 0; image.station && i < advice->size(); ++i) {
      const std::vector<StationIdx>& about = (*advice)[i].stations;
      if (!std::binary_search(about.begin(), about.end(), *image.station)) continue;
      views[i].push_back(image.view);
      is_told = true;
    }
    if (is_told) continue;
    if (image.station) stations.insert(*image.station);
    if (++num_elsewhere <= kMaxNames) names += (names.empty() ? "" : ", ") + image.name;
    if (elsewhere.images_to_take.size() < Advice::kMaxViews) elsewhere.images_to_take.push_back(image.view);
  }
  for (const auto& [i, added] : views) {
    std::vector<Advice::View>& to_take = (*advice)[i].images_to_take;
    to_take.insert(to_take.begin(), added.begin(), added.end());
    if (to_take.size() > Advice::kMaxViews) to_take.resize(Advice::kMaxViews);
  }
  if (num_elsewhere == 0) return;
  elsewhere.stations.assign(stations.begin(), stations.end());
  elsewhere.text = fmt::format(
      "{} {} image{} failed where most are localized ({}{}). {} taken there, looking the same way, would "
      "help.",
      num_elsewhere, TriedWord(head), num_elsewhere == 1 ? "" : "s", names,
      num_elsewhere > kMaxNames ? ", ..." : "",
      head.self_test.contains(kLeftOutRunsFigure) ? "More survey images" : "Survey images");
  // Advice about the map as a whole stays last.
  const auto place = std::find_if(advice->begin(), advice->end(),
                                  [](const Advice& entry) { return entry.stations.empty(); });
  advice->insert(place, std::move(elsewhere));
}

void AddMisalignment(const std::vector<PlacedImage>& images, std::vector<Advice>* advice) {
  if (images.size() < kMinAligned) return;
  const auto num = static_cast<double>(images.size());
  using Complex = std::complex<double>;
  const auto complex = [](const Eigen::Vector2d& place) { return Complex(place.x(), place.y()); };
  Complex middle = 0, found_middle = 0;
  for (const PlacedImage& image : images) {
    middle += complex(image.taken) / num;
    found_middle += complex(image.found) / num;
  }
  // The rotation and scale that take `taken` to `found` with the least squares, about their centres.
  Complex covariance = 0;
  double spread = 0, squares = 0;
  for (const PlacedImage& image : images) {
    const Complex taken = complex(image.taken) - middle;
    covariance += std::conj(taken) * (complex(image.found) - found_middle);
    spread += std::norm(taken);
    squares += (image.found - image.taken).squaredNorm();
  }
  // Images at one place determine neither of them.
  if (spread < 100 * squares || spread <= 0) return;
  const Complex turned = covariance / spread;
  double squares_left = 0;
  for (const PlacedImage& image : images)
    squares_left += std::norm(turned * (complex(image.taken) - middle) + found_middle - complex(image.found));
  // The fit used up four of the 2 n numbers.
  const double before = std::sqrt(squares / num), after = std::sqrt(squares_left / (num - 2));
  if (after > kAlignedErrors * before) return;
  advice->push_back(
      {.text = fmt::format(
           "Errors of the held-out images are not noise: shifted by {:.1f} cm, turned by {:.2f} degrees and "
           "scaled by {:+.2f} %, the map's poses fit theirs to {:.1f} cm instead of {:.1f} cm (root mean "
           "square). The survey and these images are probably not measured in quite the same frame or scale, "
           "or a camera's focal length is off.",
           100 * std::abs(found_middle - middle), std::abs(std::arg(turned)) * 180 / std::numbers::pi,
           100 * (1 / std::abs(turned) - 1), 100 * after, 100 * before)});
}

std::string AdviceText(const std::vector<Advice>& advice) {
  std::string text;
  for (size_t i = 0; i < advice.size(); ++i) {
    text += fmt::format("  {}. {}\n", i + 1, advice[i].text);
    for (const Advice::View& view : advice[i].images_to_take) {
      text += fmt::format("       image at {:.2f}, {:.2f}", view.position.x(), view.position.y());
      text += view.heading_deg ? fmt::format(" looking towards {:.0f} deg\n", *view.heading_deg) : "\n";
    }
  }
  return text;
}

}  // namespace cairn::pipeline
