#include "stages/reconstruct/globally/misplaced_part.h"

#include <algorithm>
#include <array>
#include <map>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

#include "core/base/parallel.h"
#include "core/geometry/pose.h"
#include "core/geometry/rotations.h"

namespace cairn::reconstruct {
namespace {

constexpr size_t kMinNumFitted = 10;  // points that say how two sides stand
// Of two pieces: pairs of images, or points, that are asked; turns that so many pairs must agree on; shifts
// of each; and places that are looked at more closely, of them and of all pieces.
constexpr size_t kMaxNumAsked = 300, kMinNumAgreeing = 5, kMaxNumTurns = 4, kMaxNumShifts = 2,
                 kMaxNumPlaces = 4, kMaxNumPlacesOfAll = 40;
constexpr double kSameTurnDeg = 5, kSameShift = 10, kSamePlace = 5;  // the latter two in tolerances
constexpr int kMaxNumRefined = 10;

using Relation = Eigen::Isometry3d;  // where the first has what the second has
using Points = std::vector<SharedPoint>;
using Cell = std::array<int, 3>;

Relation FitRelation(const Points& points) {
  Eigen::Matrix3Xd in1(3, std::ssize(points)), in2(3, std::ssize(points));
  for (Eigen::Index k = 0; k < in1.cols(); ++k) {
    in1.col(k) = points[k].in1;
    in2.col(k) = points[k].in2;
  }
  Relation relation;
  relation.matrix() = Eigen::umeyama(in2, in1, false);
  return relation;
}

Points InliersOf(const Points& points, const Relation& relation, double tolerance) {
  Points inliers;
  for (const SharedPoint& point : points) {
    if ((relation * point.in2 - point.in1).norm() < tolerance) inliers.push_back(point);
  }
  return inliers;
}

bool AreAlike(const Relation& a, const Relation& b, double tolerance) {
  return Eigen::Quaterniond(a.linear()).angularDistance(Eigen::Quaterniond(b.linear())) <
             RadFromDeg(kSameTurnDeg) &&
         (a.translation() - b.translation()).norm() < kSamePlace * tolerance;
}

// Of those that hold points which the relation makes one.
int NumCells(const Points& points, const Relation& relation, double tolerance) {
  std::vector<Cell> cells;
  for (const SharedPoint& point : points) {
    if ((relation * point.in2 - point.in1).norm() >= tolerance) continue;
    const Eigen::Vector3d cell = (point.in1 / tolerance).array().floor();
    cells.push_back({static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z())});
  }
  std::sort(cells.begin(), cells.end());
  return static_cast<int>(std::unique(cells.begin(), cells.end()) - cells.begin());
}

// Another place of a piece beside another one.
struct OtherPlace {
  int num_cells = 0;
  int piece1 = 0, piece2 = 0;
  Relation relation = Relation::Identity();  // piece1 from piece2
};

using Turns = std::vector<SharedTurn>;

// A turn that pairs agree on, and their images.
struct CommonTurn {
  Eigen::Quaterniond turn;
  std::set<std::pair<int, int>> images;
};

// Those of the most pairs first.
std::vector<CommonTurn> CommonTurns(Turns turns) {
  std::vector<CommonTurn> common;
  while (common.size() < kMaxNumTurns && turns.size() >= kMinNumAgreeing) {
    const size_t stride = std::max<size_t>(1, turns.size() / kMaxNumAsked);
    size_t best = 0;
    std::ptrdiff_t most = 0;
    const auto agree = [](const SharedTurn& a, const SharedTurn& b) {
      return a.turn.angularDistance(b.turn) < RadFromDeg(kSameTurnDeg);
    };
    for (size_t t = 0; t < turns.size(); t += stride) {
      const auto num = std::count_if(turns.begin(), turns.end(),
                                     [&](const SharedTurn& other) { return agree(turns[t], other); });
      if (num <= most) continue;
      most = num;
      best = t;
    }
    if (most < std::ptrdiff_t{kMinNumAgreeing}) break;
    const SharedTurn seed = turns[best];
    CommonTurn found;
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Turns left;
    for (const SharedTurn& turn : turns) {
      if (!agree(turn, seed)) {
        left.push_back(turn);
        continue;
      }
      sum += turn.turn.toRotationMatrix();
      found.images.emplace(turn.image1, turn.image2);
    }
    found.turn = Eigen::Quaterniond(NearestRotation(sum));
    common.push_back(std::move(found));
    turns = std::move(left);
  }
  return common;
}

// The places of the second piece beside the first that most speaks for: turned as pairs agree, where most of
// their points come to lie on each other.
std::vector<OtherPlace> OtherPlaces(int piece1, int piece2, const Turns& turns, const Points& points,
                                    double tolerance) {
  std::vector<OtherPlace> places;
  for (const CommonTurn& common : CommonTurns(turns)) {
    Points seen;
    for (const SharedPoint& point : points) {
      if (common.images.count({point.image1, point.image2}) > 0) seen.push_back(point);
    }
    if (seen.size() < kMinNumFitted) continue;
    std::vector<std::pair<size_t, Relation>> shifts;
    const size_t stride = std::max<size_t>(1, seen.size() / kMaxNumAsked);
    for (size_t k = 0; k < seen.size(); k += stride) {
      Relation relation = Relation::Identity();
      relation.linear() = common.turn.toRotationMatrix();
      relation.translation() = seen[k].in1 - common.turn * seen[k].in2;
      shifts.emplace_back(NumCells(seen, relation, 2 * tolerance), relation);
    }
    std::stable_sort(shifts.begin(), shifts.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<Relation> tried;
    for (const auto& [num, shift] : shifts) {
      if (tried.size() >= kMaxNumShifts) break;
      const auto is_near = [&, &shift = shift](const Relation& other) {
        return (other.translation() - shift.translation()).norm() < kSameShift * tolerance;
      };
      if (std::any_of(tried.begin(), tried.end(), is_near)) continue;
      tried.push_back(shift);
      Relation refined = shift;
      for (const double reach : {4.0, 3.0, 2.0}) {
        const Points inliers = InliersOf(seen, refined, reach * tolerance);
        if (inliers.size() >= kMinNumFitted) refined = FitRelation(inliers);
      }
      if (!AreAlike(refined, Relation::Identity(), tolerance))
        places.push_back({NumCells(points, refined, tolerance), piece1, piece2, refined});
    }
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const OtherPlace& a, const OtherPlace& b) { return a.num_cells > b.num_cells; });
  if (places.size() > kMaxNumPlaces) places.resize(kMaxNumPlaces);
  return places;
}

// Of each image: others, and how strongly it is linked to them.
using Neighbourhood = std::vector<std::vector<std::pair<int, double>>>;

// The map in two, each side around a piece: images join the side that they are most strongly linked to.  0 or
// 1 per image; -1: neither.
std::vector<int> GrowSides(const Neighbourhood& neighbours, const std::vector<int>& piece1,
                           const std::vector<int>& piece2) {
  std::vector<int> side(neighbours.size(), -1);
  std::priority_queue<std::tuple<double, int, int>> open;  // weight, - image, side
  const auto join = [&](int image, int to) {
    side[image] = to;
    for (const auto& [other, weight] : neighbours[image]) {
      if (side[other] < 0) open.emplace(weight, -other, to);
    }
  };
  for (const int i : piece1) join(i, 0);
  for (const int i : piece2) join(i, 1);
  while (!open.empty()) {
    const auto [weight, negative, to] = open.top();
    open.pop();
    if (side[-negative] < 0) join(-negative, to);
  }
  return side;
}

// Cut where less holds the sides together: images join the side to which more links them, links within a
// cluster not counted; none if negative.
void RefineSides(const Neighbourhood& neighbours, const std::vector<int>& cluster_of,
                 std::vector<int>* side) {
  for (int k = 0; k < kMaxNumRefined; ++k) {
    bool changed = false;
    for (size_t i = 0; i < side->size(); ++i) {
      std::array<double, 2> sum = {0, 0};
      for (const auto& [other, weight] : neighbours[i]) {
        const bool counts = cluster_of.empty() || cluster_of[other] != cluster_of[i];
        if ((*side)[other] >= 0 && counts) sum[(*side)[other]] += weight;
      }
      if (sum[0] == sum[1]) continue;
      const int better = sum[1] > sum[0] ? 1 : 0;
      changed |= better != (*side)[i];
      (*side)[i] = better;
    }
    if (!changed) break;
  }
}

std::vector<int> GroupOf(size_t num_images, const std::vector<std::vector<int>>& groups) {
  std::vector<int> group_of(num_images);
  for (size_t k = 0; k < groups.size(); ++k) {
    for (const int i : groups[k]) group_of[i] = static_cast<int>(k);
  }
  return group_of;
}

// The other way round.
SharedPoint Reversed(const SharedPoint& point) { return {point.image2, point.image1, point.in2, point.in1}; }
SharedTurn Reversed(const SharedTurn& turn) { return {turn.image2, turn.image1, turn.turn.conjugate()}; }

struct Shared {
  Turns turns;
  Points points;
};

// What pieces share, by two of them, the lower first.
std::map<std::pair<int, int>, Shared> SharedBetween(const std::vector<int>& piece_of,
                                                    const PairEvidence& evidence) {
  std::map<std::pair<int, int>, Shared> between;
  const auto add = [&](const auto& shared, auto member) {
    const int piece1 = piece_of[shared.image1], piece2 = piece_of[shared.image2];
    if (piece1 < piece2) (between[{piece1, piece2}].*member).push_back(shared);
    if (piece1 > piece2) (between[{piece2, piece1}].*member).push_back(Reversed(shared));
  };
  for (const SharedTurn& turn : evidence.turns) add(turn, &Shared::turns);
  for (const SharedPoint& point : evidence.points) add(point, &Shared::points);
  return between;
}

// Of all pieces, those first that most speaks for.
std::vector<OtherPlace> OtherPlacesOfAll(const std::map<std::pair<int, int>, Shared>& between,
                                         double tolerance, int num_threads) {
  std::vector<std::pair<std::pair<int, int>, const Shared*>> tasks;
  for (const auto& [pieces, shared] : between) tasks.emplace_back(pieces, &shared);
  std::vector<std::vector<OtherPlace>> found(tasks.size());
  ParallelFor(std::ssize(tasks), num_threads, [&](int64_t k) {
    const auto& [pieces, shared] = tasks[k];
    found[k] = OtherPlaces(pieces.first, pieces.second, shared->turns, shared->points, tolerance);
  });
  std::vector<OtherPlace> all;
  for (const std::vector<OtherPlace>& some : found) all.insert(all.end(), some.begin(), some.end());
  std::stable_sort(all.begin(), all.end(),
                   [](const OtherPlace& a, const OtherPlace& b) { return a.num_cells > b.num_cells; });
  if (all.size() > kMaxNumPlacesOfAll) all.resize(kMaxNumPlacesOfAll);
  return all;
}

Neighbourhood AgreeingNeighbours(size_t num_images, const std::vector<SignedLink>& links) {
  Neighbourhood neighbours(num_images);
  for (const SignedLink& link : links) {
    if (!(link.weight > 0)) continue;
    neighbours[link.image1].emplace_back(link.image2, link.weight);
    neighbours[link.image2].emplace_back(link.image1, link.weight);
  }
  return neighbours;
}

// The map cut in two, and what the sides share where they are and where else one may be.
struct Cut {
  std::vector<int> side;  // per image: 0, 1 or -1
  Relation relation = Relation::Identity();
  int num_here = 0, num_there = 0;
};

void CountCells(const Points& points, const Relation& relation, double tolerance, Cut* cut) {
  Points across;
  for (const SharedPoint& point : points) {
    const int side1 = cut->side[point.image1], side2 = cut->side[point.image2];
    if (side1 == 0 && side2 == 1) across.push_back(point);
    if (side1 == 1 && side2 == 0) across.push_back(Reversed(point));
  }
  const Points inliers = InliersOf(across, relation, 2 * tolerance);
  cut->relation = inliers.size() < kMinNumFitted ? relation : FitRelation(inliers);
  cut->num_here = NumCells(across, Relation::Identity(), tolerance);
  cut->num_there = NumCells(across, cut->relation, tolerance);
}

// The side of fewer images is moved.
MisplacedPart SmallerSide(const Cut& cut) {
  const auto num_first = std::count(cut.side.begin(), cut.side.end(), 0),
             num_second = std::count(cut.side.begin(), cut.side.end(), 1);
  const int moved = num_second <= num_first ? 1 : 0;
  MisplacedPart part{.images = {},
                     .move = moved == 1 ? cut.relation : cut.relation.inverse(),
                     .num_cells_here = cut.num_here,
                     .num_cells_there = cut.num_there};
  for (size_t i = 0; i < cut.side.size(); ++i) {
    if (cut.side[i] == moved) part.images.push_back(static_cast<int>(i));
  }
  return part;
}

}  // namespace

std::optional<MisplacedPart> FindMisplacedPart(const std::vector<std::vector<int>>& pieces,
                                               const std::vector<std::vector<int>>& clusters,
                                               const PairEvidence& evidence,
                                               const MisplacedPartOptions& options, int num_threads,
                                               const std::function<bool(const MisplacedPart&)>& may_stand) {
  size_t num_images = 0;
  for (const std::vector<int>& piece : pieces) num_images += piece.size();
  const std::vector<OtherPlace> places =
      OtherPlacesOfAll(SharedBetween(GroupOf(num_images, pieces), evidence), options.tolerance, num_threads);
  const Neighbourhood neighbours = AgreeingNeighbours(num_images, evidence.links);
  // Images that look at the look-alike from both places hold on to each other, not to their sides: cut by all
  // links, by those that leave clusters, and by these and then all.
  const std::vector<int> cluster_of = GroupOf(num_images, clusters);
  constexpr int kNumWays = 3;
  std::vector<Cut> cuts(kNumWays * places.size());
  ParallelFor(std::ssize(cuts), num_threads, [&](int64_t k) {
    const OtherPlace& place = places[k / kNumWays];
    const int64_t way = k % kNumWays;
    cuts[k].side = GrowSides(neighbours, pieces[place.piece1], pieces[place.piece2]);
    if (way != 0) RefineSides(neighbours, cluster_of, &cuts[k].side);
    if (way != 1) RefineSides(neighbours, {}, &cuts[k].side);
    CountCells(evidence.points, place.relation, options.tolerance, &cuts[k]);
  });
  std::erase_if(cuts, [&](const Cut& cut) {
    return cut.num_there < options.min_num_cells || cut.num_there < options.min_gain * cut.num_here;
  });
  std::stable_sort(cuts.begin(), cuts.end(), [](const Cut& a, const Cut& b) {
    return a.num_there - a.num_here > b.num_there - b.num_here;
  });
  for (const Cut& cut : cuts) {
    MisplacedPart part = SmallerSide(cut);
    if (may_stand(part)) return part;
  }
  return std::nullopt;
}

}  // namespace cairn::reconstruct
