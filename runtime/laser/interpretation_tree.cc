#include "runtime/laser/interpretation_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/laser/candidate_regions.h"
#include "runtime/laser/found_interpretations.h"
#include "runtime/laser/place_support.h"
#include "runtime/laser/view_order.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
// Two walls at less than this are parallel: they do not fix a place.
constexpr double kMinCrossing = 0.26;  // sine of 15 degrees
constexpr LabelIdx kNull = -1, kOpen = -2;

class TreeSearch {
 public:
  TreeSearch(const ViewSearchIndex& index, const std::vector<ScanSegment>& segments,
             const InterpretationTreeOptions& options)
      : index_(index),
        plan_(index.views().plan),
        segments_(segments),
        options_(options),
        table_(plan_, segments, options),
        regions_(index, segments, options),
        found_(plan_, segments, options) {
    const int num_segments = static_cast<int>(segments.size());
    order_.resize(num_segments);
    std::iota(order_.begin(), order_.end(), 0);
    // [Simsarian96 §3] the source orders edges by heuristics of works it cites; here segments, longest first
    std::stable_sort(order_.begin(), order_.end(),
                     [&](int a, int b) { return segments[a].Length() > segments[b].Length(); });
    max_nulls_ = MaxNumNulls(segments.size(), options);
    labels_.assign(num_segments, kOpen);
    used_.assign(plan_.num_labels(), false);
  }

  Result<InterpretationTreeResult> Run() {
    if (options_.search == "vir") {
      SearchCandidates();
    } else {
      // [Simsarian96 §2.3] the standard search branches over all edges of the map
      std::vector<LabelIdx> all(plan_.num_labels());
      std::iota(all.begin(), all.end(), 0);
      Search(nullptr, all);
    }
    result_.solutions = found_.TakeRanked();
    return std::move(result_);
  }

 private:
  bool AgreesWithAll(int depth, int segment, LabelIdx label) const {
    for (int i = 0; i < depth; ++i) {
      const int other = order_[i];
      if (labels_[other] >= 0 && !table_.Agree(segment, label, other, labels_[other])) return false;
    }
    return true;
  }

  void SearchCandidates() {
    std::vector<std::pair<double, FaceIdx>> ranked = regions_.Find();
    result_.num_candidates = static_cast<int64_t>(ranked.size());
    size_t size = ranked.size();
    if (options_.rank_growth > 1) {
      std::stable_sort(ranked.begin(), ranked.end());
      size = 1;
      for (size_t share = ranked.size(); share > 64; share /= options_.rank_growth)
        size = ranked.size() / share;
    }
    for (size_t first = 0; first < ranked.size() && !done_; first += size, size *= options_.rank_growth) {
      const size_t end = std::min(ranked.size(), first + size);
      std::vector<FaceIdx> faces;
      for (size_t i = first; i < end; ++i) faces.push_back(ranked[i].second);
      std::sort(faces.begin(), faces.end());
      FaceSet group;
      for (const FaceIdx face : faces) group.Add(face);
      SearchGroup(group);
    }
  }

  // Null candidates: the standard search.
  void Search(const FaceSet* candidates, const std::vector<LabelIdx>& labels) {
    if (options_.fix_pose_early) {
      SearchPairs(candidates, labels);
    } else {
      Descend(0, 0, candidates, labels);
    }
  }

  void SearchGroup(const FaceSet& all) {
    const bool all_walls =
        options_.one_segment_per_wall && max_nulls_ == 0 && options_.max_missing_ratio == 0;
    FaceSet candidates = all;
    if (all_walls) candidates = SearchInOrder(all);
    if (candidates.empty() || done_) return;
    // [Simsarian96 §2.3] the VIR search branches over the union of the candidates' label sets
    std::vector<LabelIdx> labels;
    for (LabelIdx label = 0; label < plan_.num_labels(); ++label) {
      if (Intersects(candidates, index_.FacesOf(label))) labels.push_back(label);
    }
    Search(&candidates, labels);
  }

  double LargestAngleTolerance() const {
    double largest = 0;
    for (const int segment : order_) largest = std::max(largest, table_.AngleTolerance(segment));
    return largest;
  }

  // Where every visible wall has a segment, tries only labels in the order in which a candidate sees them;
  // returns the candidates whose order is not usable.
  FaceSet SearchInOrder(const FaceSet& candidates) {
    const std::vector<int> order = SegmentsInOrder(segments_);
    const double tolerance =
        RadFromDeg(options_.angle_tolerance_deg) + std::sqrt(2.0) * LargestAngleTolerance();
    FaceSet others;
    std::set<OrderedLabels> ways;
    for (const FaceSet::Word& word : candidates.words) {
      for (uint64_t bits = word.bits; bits != 0; bits &= bits - 1) {
        const FaceIdx face = word.block * 64 + std::countr_zero(bits);
        const auto labels =
            LabelsInOrder(index_.views(), face, segments_, order, tolerance,
                          [&](int segment, LabelIdx label) { return table_.Of(segment, label).possible; });
        if (labels) {
          ways.insert(labels->begin(), labels->end());
        } else {
          others.Add(face);
        }
      }
    }
    std::vector<const OrderedLabels*> all;
    for (const OrderedLabels& way : ways) all.push_back(&way);
    DescendInOrder(0, all);
    return others;
  }

  // `ways`: those in which the segments so far have their labels.
  void DescendInOrder(int depth, const std::vector<const OrderedLabels*>& ways) {
    if (depth == static_cast<int>(order_.size())) {
      Finish(labels_);
      return;
    }
    const int segment = order_[depth];
    std::map<LabelIdx, std::vector<const OrderedLabels*>> by_label;
    for (const OrderedLabels* way : ways) by_label[(*way)[segment]].push_back(way);
    for (const auto& [label, left] : by_label) {
      if (!CountNode()) return;
      if (!AgreesWithAll(depth, segment, label)) continue;
      ++result_.num_expanded;
      labels_[segment] = label;
      DescendInOrder(depth + 1, left);
      labels_[segment] = kOpen;
      if (done_) return;
    }
  }

  bool CountNode() {
    if (static_cast<double>(++result_.num_nodes) > options_.max_num_nodes) {
      done_ = true;
      result_.complete = false;
    }
    return !done_;
  }

  // `labels`: the union of the candidates' label sets, or all.
  void Descend(int depth, int num_nulls, const FaceSet* candidates, const std::vector<LabelIdx>& labels) {
    if (depth == static_cast<int>(order_.size())) {
      Finish(labels_);
      return;
    }
    // [Simsarian96 §2.3] a level of the tree for each observed segment, a branch for each edge: in this form
    // only without fix_pose_early
    const int segment = order_[depth];
    for (const LabelIdx label : labels) {
      if (options_.one_segment_per_wall && used_[label]) continue;
      if (!CountNode()) return;
      if (!table_.Of(segment, label).possible || !AgreesWithAll(depth, segment, label)) continue;
      ++result_.num_expanded;
      labels_[segment] = label;
      used_[label] = true;
      if (candidates == nullptr) {
        Descend(depth + 1, num_nulls, nullptr, labels);
      } else {
        // [Simsarian96 §2.3] candidates without the edge are out below it, and the union shrinks
        const FaceSet left = regions_.Seeing(*candidates, table_, segment, label);
        std::vector<LabelIdx> beside;
        for (const LabelIdx other : labels) {
          if (index_.SeenTogether(label, other) && Intersects(left, index_.FacesOf(other)))
            beside.push_back(other);
        }
        if (!left.empty()) Descend(depth + 1, num_nulls, &left, beside);
      }
      labels_[segment] = kOpen;
      used_[label] = false;
      if (done_) return;
    }
    if (num_nulls < max_nulls_ && CountNode()) {
      labels_[segment] = kNull;
      Descend(depth + 1, num_nulls + 1, candidates, labels);
      labels_[segment] = kOpen;
    }
  }

  // Two pairings that cross, the first with the longest segment that has a wall, fix the pose.
  void SearchPairs(const FaceSet* candidates, const std::vector<LabelIdx>& labels) {
    std::vector<bool> may_be(plan_.num_labels(), false);
    for (const LabelIdx label : labels) may_be[label] = true;
    const int num_segments = static_cast<int>(order_.size());
    for (int num_nulls = 0; num_nulls <= max_nulls_ && num_nulls < num_segments && !done_; ++num_nulls) {
      const int segment = order_[num_nulls];
      for (const LabelIdx label : labels) {
        if (!CountNode()) break;
        if (!table_.Of(segment, label).possible) continue;
        labels_[segment] = label;
        BranchAlongPlaces(num_nulls, candidates, may_be);
        if (done_) break;
      }
      labels_[segment] = kNull;
    }
    labels_.assign(num_segments, kOpen);
  }

  // Below the first pairing, that of segment order_[num_nulls].
  void BranchAlongPlaces(int num_nulls, const FaceSet* candidates, const std::vector<bool>& may_be) {
    const int first = order_[num_nulls];
    const LabelIdx label = labels_[first];
    const std::vector<int> others(order_.begin() + num_nulls + 1, order_.end());
    const auto beside = [&](LabelIdx other) {
      ++result_.num_bound_tests;
      return may_be[other] && (candidates == nullptr || index_.SeenTogether(label, other)) &&
             !(options_.one_segment_per_wall && other == label);
    };
    std::vector<PlaceStretch> stretches = StretchesAlong(table_, first, label, others, beside);
    const int least = std::max(2, static_cast<int>(order_.size()) - max_nulls_) - 1;
    const std::vector<SupportedPlaces> places = PlacesWithSupport(stretches, least);
    if (places.empty()) return;
    ++result_.num_expanded;
    int num_crossing = 0;
    for (const int other : others) {
      if (!Crosses(first, other)) continue;
      if (num_nulls + num_crossing++ > max_nulls_) continue;
      for (const PlaceStretch& stretch : stretches) {
        const auto overlaps = [&](const SupportedPlaces& place) {
          return stretch.low <= place.high && place.low <= stretch.high;
        };
        if (stretch.segment != other || std::none_of(places.begin(), places.end(), overlaps)) continue;
        if (!CountNode()) return;
        labels_[other] = stretch.label;
        PairRestOf(first, other, num_nulls, candidates);
        labels_[other] = kOpen;
        if (done_) return;
      }
    }
    if (num_nulls + num_crossing > max_nulls_) return;
    std::erase_if(stretches, [&](const PlaceStretch& stretch) { return Crosses(first, stretch.segment); });
    PairParallels(num_nulls, stretches, least, candidates);
  }

  double SineBetween(int a, int b) const {
    const Vec2 u = segments_[a].end - segments_[a].start, v = segments_[b].end - segments_[b].start;
    return std::abs(Cross(u, v)) / (u.norm() * v.norm());
  }
  bool Crosses(int a, int b) const { return SineBetween(a, b) > kMinCrossing; }

  // All other segments at the pose of two pairings; the VIR search among what a region near it sees.
  void PairRestOf(int first, int second, int num_nulls, const FaceSet* candidates) {
    const LabelIdx a = labels_[first], b = labels_[second];
    if (found_.HasBoth(first, a, second, b)) return;
    ++result_.num_expanded;
    Interpretation found;
    found.labels = labels_;
    FitPose(plan_, segments_, &found);
    std::vector<LabelIdx> labels;
    if (candidates == nullptr) {
      labels.resize(plan_.num_labels());
      std::iota(labels.begin(), labels.end(), 0);
    } else {
      const double variance = found.covariance.topLeftCorner<2, 2>().trace();
      const double reach =
          options_.num_sigmas * std::sqrt(variance) + table_.LoosePlaceTolerance(first, second);
      const FaceSet left = regions_.SeeingBoth(*candidates, a, b, found.pose, reach);
      if (left.empty()) return;
      for (LabelIdx label = 0; label < plan_.num_labels(); ++label) {
        if (index_.SeenTogether(a, label) && index_.SeenTogether(b, label) &&
            Intersects(left, index_.FacesOf(label)))
          labels.push_back(label);
      }
    }
    PairAtPose(std::move(found), num_nulls, labels);
  }

  // Gives each open segment the label that fits best at the pose so far, or none; then all segments at the
  // pose that follows.
  void PairAtPose(Interpretation found, int num_nulls, const std::vector<LabelIdx>& labels) {
    for (const int segment : order_) {
      if (found.labels[segment] != kOpen) continue;
      found.labels[segment] = BestLabel(found, segment, labels, found.labels);
      if (done_) return;
      if (found.labels[segment] == kNull) {
        if (++num_nulls > max_nulls_) return;
        continue;
      }
      ++result_.num_expanded;
      FitPose(plan_, segments_, &found);
    }
    std::vector<LabelIdx> again(segments_.size(), kOpen);
    for (const int segment : order_) {
      again[segment] = BestLabel(found, segment, labels, again);
      if (done_) return;
    }
    const auto nulls = [](const std::vector<LabelIdx>& of) {
      return std::count(of.begin(), of.end(), kNull);
    };
    // Where each wall has one segment, one that was left out before may take another's.
    const bool is_no_worse =
        nulls(again) <= (options_.one_segment_per_wall ? nulls(found.labels) : max_nulls_);
    Finish(is_no_worse ? again : found.labels);
  }

  // Whether a label has a segment already, of which it may have no more.
  bool IsTaken(LabelIdx label, const std::vector<LabelIdx>& so_far) const {
    return options_.one_segment_per_wall && std::find(so_far.begin(), so_far.end(), label) != so_far.end();
  }

  // `so_far`: of the other segments.
  LabelIdx BestLabel(const Interpretation& found, int segment, const std::vector<LabelIdx>& labels,
                     const std::vector<LabelIdx>& so_far) {
    LabelIdx best = kNull;
    double best_misfit = 1;
    for (const LabelIdx label : labels) {
      if (!CountNode()) return kNull;
      if (!table_.Of(segment, label).possible || IsTaken(label, so_far)) continue;
      const double misfit = found_.Misfit(found, segment, label);
      if (misfit >= best_misfit) continue;
      best = label;
      best_misfit = misfit;
    }
    return best != kNull && found_.IsSeen(found, segment) ? best : kNull;
  }

  // Walls of one direction: at the place along them where most segments have a wall, each gets the wall that
  // lies there.  Walls that are not quite parallel still fix the pose.
  void PairParallels(int num_nulls, const std::vector<PlaceStretch>& stretches, int least,
                     const FaceSet* candidates) {
    const std::vector<SupportedPlaces> places = BestSupported(PlacesWithSupport(stretches, least));
    if (places.empty()) return;
    const int first = order_[num_nulls];
    if (candidates != nullptr && regions_.Seeing(*candidates, table_, first, labels_[first]).empty()) return;
    for (const SupportedPlaces& place : places) {
      std::vector<PlaceStretch> over = StretchesOver(stretches, 0.5 * (place.low + place.high));
      if (options_.one_segment_per_wall) {
        // The longest ones choose first.
        const auto rank = [&](const PlaceStretch& stretch) {
          return std::find(order_.begin(), order_.end(), stretch.segment);
        };
        std::sort(over.begin(), over.end(), [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
      }
      Interpretation found;
      found.labels = labels_;
      int widest = over.front().segment;  // whose wall is free: it is not the first pairing's
      for (const PlaceStretch& stretch : over) {
        if (!CountNode()) return;
        if (IsTaken(stretch.label, found.labels)) continue;
        found.labels[stretch.segment] = stretch.label;
        if (SineBetween(first, stretch.segment) > SineBetween(first, widest)) widest = stretch.segment;
      }
      FitPose(plan_, segments_, &found);
      if (found.determined) {
        labels_[widest] = found.labels[widest];
        PairRestOf(first, widest, num_nulls, candidates);
        labels_[widest] = kOpen;
      } else {
        std::replace(found.labels.begin(), found.labels.end(), kOpen, kNull);
        Finish(found.labels);
      }
      if (done_) return;
    }
  }

  void Finish(const std::vector<LabelIdx>& labels) {
    // [Simsarian96 §2.3] "The search continues until a complete interpretation is found", or all are
    if (found_.Add(labels) && options_.first_only) done_ = true;
  }

  const ViewSearchIndex& index_;
  const FloorPlan& plan_;
  const std::vector<ScanSegment>& segments_;
  const InterpretationTreeOptions& options_;
  PairingTable table_;
  CandidateRegions regions_;
  FoundInterpretations found_;
  std::vector<int> order_;  // of segments: longest first
  int max_nulls_ = 0;
  std::vector<LabelIdx> labels_;  // per segment, on the way down
  std::vector<bool> used_;        // per label
  bool done_ = false;
  InterpretationTreeResult result_;
};

}  // namespace

Result<InterpretationTreeResult> SearchInterpretations(const ViewSearchIndex& index,
                                                       const std::vector<ScanSegment>& segments,
                                                       const InterpretationTreeOptions& options) {
  InterpretationTreeOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (segments.size() < 2) {
    return MakeError(ErrorCode::kNoData, "{} of a wall seen; a pose needs at least two that are not parallel",
                     segments.empty() ? "no straight stretch" : "only one straight stretch");
  }
  std::vector<ScanSegment> uncertain = segments;
  for (ScanSegment& segment : uncertain)
    segment.sigma_end_m = std::hypot(segment.sigma_end_m, options.sigma_wall_m);
  return TreeSearch(index, uncertain, options).Run();
}

}  // namespace cairn
