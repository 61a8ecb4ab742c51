#include "stages/group_classes/persistence/changes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "core/structure/disjoint_sets.h"
#include "core/structure/points.h"
#include "stages/group_classes/persistence/moves.h"

namespace cairn::group_classes {
namespace {

// Changed classes this close, as part of the distance from which classes are seen on the median, are
// neighbours; one with so many neighbours joins them to one change.
constexpr double kNeighbourDistance = 0.06;
constexpr int kMinNumNeighbours = 5;
// Fewer classes are no change.
constexpr size_t kMinNumClasses = 30;
// Not there before, or no longer.
constexpr float kMaxThere = 0.5;

// A class of which one session says that it is new, or gone.
struct ChangedClass {
  int class_idx = 0;
  bool is_new = false;
};

// Per session: what it shows to have changed.
std::vector<std::vector<ChangedClass>> ClassesThatChanged(const std::vector<ClassAge>& ages) {
  std::vector<std::vector<ChangedClass>> changed(ages.empty() ? 0 : ages.front().sessions.size());
  for (size_t c = 0; c < ages.size(); ++c) {
    const std::vector<SessionSightings>& sessions = ages[c].sessions;
    // Whether the latest session that could tell had it; unknown before the first.
    std::optional<bool> was_there;
    for (size_t s = 0; s < sessions.size(); ++s) {
      const bool seen = sessions[s].num_seen > 0;
      if (!seen && sessions[s].expected == 0) continue;
      const bool there = seen || sessions[s].there >= kMaxThere;
      if (was_there && *was_there != there && (seen || !there))
        changed[s].push_back({static_cast<int>(c), there});
      was_there = there;
    }
  }
  return changed;
}

// The image with the largest number; of equal ones the first.  0: none.
ImageId Largest(const Classes& classes, const std::map<int, double>& weights) {
  ImageId best = 0;
  double largest = 0;
  for (const auto& [image, weight] : weights) {
    if (weight > largest) {
      largest = weight;
      best = classes.images[image].image_id;
    }
  }
  return best;
}

PlaceChange Describe(const Classes& classes, const std::vector<ClassViews>& views,
                     const ImageSessions& images, int session, const std::vector<ChangedClass>& members) {
  PlaceChange change{.session = session};
  for (const ChangedClass& member : members) {
    change.position += classes.classes[member.class_idx].position / static_cast<double>(members.size());
    ++(member.is_new ? change.num_appeared : change.num_vanished);
  }
  // An image before the change shows what vanished; one after it what appeared, or where it should be.
  std::map<int, double> before, after;
  double squared = 0;
  for (const ChangedClass& member : members) {
    squared += (classes.classes[member.class_idx].position - change.position).squaredNorm();
    for (const ExpectedView& view : views[member.class_idx]) {
      const int other = images.session[view.image];
      if (other == session) {
        after[view.image] += member.is_new ? (view.seen ? 1 : 0) : view.visibility;
      } else if (other < session) {
        before[view.image] += member.is_new ? view.visibility : (view.seen ? 1 : 0);
      }
    }
  }
  change.radius_m = std::sqrt(squared / static_cast<double>(members.size()));
  change.image_before = Largest(classes, before);
  change.image_after = Largest(classes, after);
  return change;
}

}  // namespace

std::vector<PlaceChange> FindChanges(const Classes& classes, const std::vector<ClassAge>& ages,
                                     const std::vector<ClassViews>& views, const ImageSessions& images,
                                     const Surroundings& surroundings) {
  std::vector<PlaceChange> changes;
  const std::vector<std::vector<ChangedClass>> changed = ClassesThatChanged(ages);
  for (size_t session = 1; session < changed.size(); ++session) {
    const std::vector<ChangedClass>& members = changed[session];
    std::vector<Eigen::Vector3d> points;
    for (const ChangedClass& member : members) points.push_back(classes.classes[member.class_idx].position);
    const PointGrid grid(points, kNeighbourDistance * surroundings.typical_distance);
    std::vector<std::vector<int>> neighbours(points.size());
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d& side = surroundings.sides[members[i].class_idx];
      grid.ForNear(points[i], [&](int other, double) {
        if (other != static_cast<int>(i) &&
            side.dot(surroundings.sides[members[other].class_idx]) > kMinSideCosine)
          neighbours[i].push_back(other);
      });
    }
    DisjointSets sets(static_cast<int>(points.size()));
    for (size_t i = 0; i < points.size(); ++i) {
      if (static_cast<int>(neighbours[i].size()) < kMinNumNeighbours) continue;
      for (const int other : neighbours[i]) sets.Join(static_cast<int>(i), other);
    }
    std::map<int, std::vector<ChangedClass>> clusters;
    for (size_t i = 0; i < points.size(); ++i) clusters[sets.Find(static_cast<int>(i))].push_back(members[i]);
    std::vector<std::vector<ChangedClass>> largest_first;
    for (auto& [root, cluster] : clusters) {
      if (cluster.size() >= kMinNumClasses) largest_first.push_back(std::move(cluster));
    }
    std::stable_sort(largest_first.begin(), largest_first.end(),
                     [](const auto& a, const auto& b) { return a.size() > b.size(); });
    const size_t first = changes.size();
    std::vector<ChangedClasses> classes_of_changes;
    for (const std::vector<ChangedClass>& cluster : largest_first) {
      changes.push_back(Describe(classes, views, images, static_cast<int>(session), cluster));
      ChangedClasses& of_change = classes_of_changes.emplace_back();
      for (const ChangedClass& member : cluster)
        (member.is_new ? of_change.appeared : of_change.vanished).push_back(member.class_idx);
    }
    FindMoves(classes, classes_of_changes, static_cast<int>(first), surroundings.typical_distance,
              std::span(changes).subspan(first));
  }
  return changes;
}

}  // namespace cairn::group_classes
