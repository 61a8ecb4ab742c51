#include "stages/group_classes/persistence/moves.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include <Eigen/Geometry>

#include "core/base/random.h"
#include "core/features/descriptor_matcher.h"

namespace cairn::group_classes {
namespace {

// So many classes must be found again, and this part of what could be.  It is a small part: what looks the
// same at two places was often matched from one to the other, and its tracks were given up.
constexpr int kMinNumMoved = 10;
constexpr double kMinMovedRatio = 0.03;
// As parts of the distance from which classes are seen: they are placed as exactly as this, and what moved
// less has not moved.
constexpr double kMaxError = 0.015;
constexpr double kMinMotion = 0.03;
constexpr int kNumTrials = 300;

// A class that vanished, and one that looks the same and appeared.
struct Pair {
  Eigen::Vector3d before, after;
};

int NumThatFollow(const Eigen::Isometry3d& motion, const std::vector<Pair>& pairs, double max_error) {
  return static_cast<int>(std::count_if(pairs.begin(), pairs.end(), [&](const Pair& pair) {
    return (motion * pair.before - pair.after).norm() < max_error;
  }));
}

// The rigid motion of three pairs, of which no two are one.
Eigen::Isometry3d MotionOf(const std::vector<Pair>& pairs, const std::array<size_t, 3>& three) {
  Eigen::Matrix3d before, after;
  for (int i = 0; i < 3; ++i) {
    before.col(i) = pairs[three[i]].before;
    after.col(i) = pairs[three[i]].after;
  }
  return Eigen::Isometry3d(Eigen::umeyama(before, after, /*with_scaling=*/false));
}

// How many pairs the best rigid motion explains; 0 where it is hardly one.
int NumMoved(const std::vector<Pair>& pairs, double typical_distance) {
  if (pairs.size() < kMinNumMoved) return 0;
  Random random(1);
  int most = 0;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    std::array<size_t, 3> three;
    for (size_t& i : three)
      i = static_cast<size_t>(random.UniformInt(0, static_cast<int64_t>(pairs.size()) - 1));
    if (three[0] == three[1] || three[0] == three[2] || three[1] == three[2]) continue;
    const Eigen::Isometry3d motion = MotionOf(pairs, three);
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const size_t i : three) middle += pairs[i].before / 3;
    if ((motion * middle - middle).norm() < kMinMotion * typical_distance) continue;
    most = std::max(most, NumThatFollow(motion, pairs, kMaxError * typical_distance));
  }
  return most;
}

// The classes of one kind of all changes, one after the other: which they are and of which change.
struct Listed {
  std::vector<std::pair<int, int>> change_and_class;
  DescriptorMatrix descriptors;
};
Listed List(const Classes& classes, std::span<const ChangedClasses> members,
            std::vector<int> ChangedClasses::*kind) {
  Listed listed;
  for (size_t change = 0; change < members.size(); ++change) {
    for (const int i : members[change].*kind)
      listed.change_and_class.emplace_back(static_cast<int>(change), i);
  }
  listed.descriptors.resize(static_cast<Eigen::Index>(listed.change_and_class.size()),
                            classes.descriptor_kind.num_values);
  for (size_t n = 0; n < listed.change_and_class.size(); ++n) {
    listed.descriptors.row(static_cast<Eigen::Index>(n)) =
        classes.classes[listed.change_and_class[n].second].descriptor;
  }
  return listed;
}

}  // namespace

void FindMoves(const Classes& classes, std::span<const ChangedClasses> members, int first,
               double typical_distance, std::span<PlaceChange> changes) {
  const Listed before = List(classes, members, &ChangedClasses::vanished);
  const Listed after = List(classes, members, &ChangedClasses::appeared);
  if (before.change_and_class.empty() || after.change_and_class.empty()) return;
  std::map<std::pair<int, int>, std::vector<Pair>> pairs;  // by the changes from and to which
  for (const Match& match :
       MatchDescriptors(before.descriptors, after.descriptors, classes.descriptor_kind.space(), {})) {
    const auto& [from, vanished] = before.change_and_class[match.idx1];
    const auto& [to, appeared] = after.change_and_class[match.idx2];
    pairs[{from, to}].push_back({classes.classes[vanished].position, classes.classes[appeared].position});
  }
  for (const auto& [from_to, list] : pairs) {
    const auto& [from, to] = from_to;
    const int num_moved = NumMoved(list, typical_distance);
    const auto could_be =
        static_cast<double>(std::min(members[from].vanished.size(), members[to].appeared.size()));
    if (num_moved < kMinNumMoved || num_moved < kMinMovedRatio * could_be) continue;
    if (num_moved <= changes[from].num_moved) continue;
    changes[from].moved_to = first + to;
    changes[from].num_moved = num_moved;
  }
}

}  // namespace cairn::group_classes
