#include "runtime/interpretation_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "core/pose.h"
#include "core/vector_geometry.h"
#include "runtime/pairing.h"
#include "runtime/rank_interpretations.h"
#include "runtime/view_order.h"

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
      : index_(index), plan_(index.views().plan), segments_(segments), options_(options) {
    const int num_segments = static_cast<int>(segments.size());
    order_.resize(num_segments);
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](int a, int b) { return segments[a].Length() > segments[b].Length(); });
    max_nulls_ = static_cast<int>(std::floor(options.max_null_ratio * num_segments));
    labels_.assign(num_segments, kOpen);
    used_.assign(plan_.num_labels(), false);
    for (const ScanSegment& segment : segments) {
      angle_tolerance_.push_back(options.num_sigmas * segment.sigma_angle_rad);
      // The line's offset at the robot, where its angle counts with the distance along it.
      const Vec2 along = (segment.end - segment.start).normalized();
      const double lever = std::abs(along.dot(segment.Middle()));
      place_tolerance_.push_back(options.num_sigmas *
                                 std::hypot(segment.sigma_offset_m, lever * segment.sigma_angle_rad));
    }
    MakePairings();
  }

  Result<InterpretationTreeResult> Run() {
    if (options_.search == "vir") {
      SearchCandidates();
    } else {
      all_labels_.resize(plan_.num_labels());
      std::iota(all_labels_.begin(), all_labels_.end(), 0);
      Descend(0, 0, nullptr, all_labels_);
    }
    RankInterpretations(plan_, segments_, options_, &result_.solutions);
    return std::move(result_);
  }

 private:
  void MakePairings() {
    pairings_.resize(segments_.size() * plan_.num_labels());
    for (size_t i = 0; i < segments_.size(); ++i) {
      for (LabelIdx label = 0; label < plan_.num_labels(); ++label) {
        const ScanSegment& segment = segments_[i];
        pairings_[i * plan_.num_labels() + label] =
            MakePairing(plan_, segment, label, options_.length_tolerance_m);
      }
    }
  }

  const Pairing& PairingOf(int segment, LabelIdx label) const {
    return pairings_[static_cast<size_t>(segment) * plan_.num_labels() + label];
  }

  // Whether two pairings can both be true.
  bool Agree(int a, LabelIdx label_a, int b, LabelIdx label_b) const {
    const Pairing &pa = PairingOf(a, label_a), &pb = PairingOf(b, label_b);
    const double angle =
        std::hypot(angle_tolerance_[a], angle_tolerance_[b]) + RadFromDeg(options_.angle_tolerance_deg);
    if (std::abs(WrapAngle(pa.heading - pb.heading)) > angle) return false;
    const double place = std::hypot(place_tolerance_[a], place_tolerance_[b]) + options_.position_tolerance_m;
    return LineToLine(pa, pb) <= place;
  }

  bool AgreesWithAll(int depth, int segment, LabelIdx label) const {
    for (int i = 0; i < depth; ++i) {
      const int other = order_[i];
      if (labels_[other] >= 0 && !Agree(segment, label, other, labels_[other])) return false;
    }
    return true;
  }

  // Index functions (a) and (b), the number of walls by length, and the spread of their directions.
  FaceSet Candidates(std::vector<std::pair<double, FaceIdx>>* ranked) {
    const Views& views = index_.views();
    const auto num = static_cast<double>(segments_.size());
    double observed = 0;
    ViewSearchIndex::LengthCounts longer{};
    std::vector<double> angles;
    for (const ScanSegment& segment : segments_) {
      angles.push_back(segment.Angle());
      observed += segment.Length();
      for (size_t i = 0; i < longer.size(); ++i)
        longer[i] += segment.Length() - options_.length_tolerance_m >= ViewSearchIndex::kLengths[i];
    }
    const double least = std::floor(num * (1 - options_.max_null_ratio)),
                 most = std::ceil(num / (1 - options_.max_missing_ratio));
    spectrum_ = DirectionSpectrum(angles);
    blur_ = std::accumulate(angle_tolerance_.begin(), angle_tolerance_.end(), 0.0) +
            RadFromDeg(num * options_.angle_tolerance_deg);
    FaceSet set;
    for (FaceIdx face = 0; face < views.num_faces(); ++face) {
      const ViewIndex& values = views.index[face];
      if (values.wall_length_m < (1 - options_.max_null_ratio) * observed - num * options_.length_tolerance_m)
        continue;
      bool fits = true;
      if (options_.one_segment_per_wall) {
        fits = values.num_labels >= least && values.num_labels <= most;
        const ViewSearchIndex::LengthCounts& walls = index_.WallsByLength(face);
        for (size_t i = 0; i < longer.size() && fits; ++i) fits = walls[i] + max_nulls_ >= longer[i];
        const double others = NumOthers(face);
        const ViewSearchIndex::Spectrum& expected = index_.SpectrumOf(face);
        for (int m = 0; m < ViewSearchIndex::kNumHarmonics && fits; ++m)
          fits = std::abs(std::abs(expected[m]) - std::abs(spectrum_[m])) <= others + (m + 1) * blur_ + 1e-3;
      }
      if (!fits) continue;
      set.Add(face);
      const double ratio =
          std::log(std::max(1e-3, static_cast<double>(values.visible_length_m)) / std::max(1e-3, observed));
      ranked->push_back({std::abs(ratio), face});
    }
    return set;
  }

  // Segments of no wall, and walls without a segment, at most.
  double NumOthers(FaceIdx face) const {
    return 2.0 * max_nulls_ +
           std::max(0.0, index_.views().index[face].num_labels - static_cast<double>(segments_.size()));
  }

  // Candidates that see a label and can hold the robot if a segment is its: some of the pairing's places lie
  // in the region's box, and with its heading the directions of all segments are those of the region's
  // labels.
  FaceSet Seeing(const FaceSet& candidates, int segment, LabelIdx label) const {
    const Pairing& pairing = PairingOf(segment, label);
    const double reach = place_tolerance_[segment] + options_.position_tolerance_m;
    FaceSet left = Intersection(candidates, index_.FacesOf(label));
    for (FaceSet::Word& word : left.words) {
      for (uint64_t bits = word.bits; bits != 0; bits &= bits - 1) {
        const int bit = std::countr_zero(bits);
        const FaceIdx face = word.block * 64 + bit;
        if (!Touches(index_.BoxOf(face), pairing, reach) || !HasDirections(face, pairing.heading))
          word.bits &= ~(uint64_t{1} << bit);
      }
    }
    std::erase_if(left.words, [](const FaceSet::Word& word) { return word.bits == 0; });
    return left;
  }

  bool HasDirections(FaceIdx face, double heading) const {
    if (!options_.one_segment_per_wall) return true;
    const ViewSearchIndex::Spectrum& expected = index_.SpectrumOf(face);
    const double others = NumOthers(face);
    for (int m = 0; m < ViewSearchIndex::kNumHarmonics; ++m) {
      const auto turn = std::polar(1.0F, static_cast<float>((m + 1) * heading));
      // The heading itself is uncertain too.
      if (std::abs(expected[m] - turn * spectrum_[m]) > others + 2 * (m + 1) * blur_ + 1e-3) return false;
    }
    return true;
  }

  void SearchCandidates() {
    std::vector<std::pair<double, FaceIdx>> ranked;
    const FaceSet all = Candidates(&ranked);
    result_.num_candidates = static_cast<int64_t>(ranked.size());
    if (ranked.empty()) return;
    if (options_.rank_growth == 1) {
      SearchGroup(all);
      return;
    }
    std::stable_sort(ranked.begin(), ranked.end());
    size_t size = 1;
    for (size_t share = ranked.size(); share > 64; share /= options_.rank_growth)
      size = ranked.size() / share;
    for (size_t first = 0; first < ranked.size() && !done_;) {
      const size_t end = std::min(ranked.size(), first + size);
      std::vector<FaceIdx> faces;
      for (size_t i = first; i < end; ++i) faces.push_back(ranked[i].second);
      std::sort(faces.begin(), faces.end());
      FaceSet group;
      for (const FaceIdx face : faces) group.Add(face);
      SearchGroup(group);
      first = end;
      size *= options_.rank_growth;
    }
  }

  void SearchGroup(const FaceSet& all) {
    const bool all_walls =
        options_.one_segment_per_wall && max_nulls_ == 0 && options_.max_missing_ratio == 0;
    FaceSet candidates = all;
    if (all_walls) candidates = SearchInOrder(all);
    if (candidates.empty() || done_) return;
    std::vector<LabelIdx> labels;
    for (LabelIdx label = 0; label < plan_.num_labels(); ++label) {
      if (Intersects(candidates, index_.FacesOf(label))) labels.push_back(label);
    }
    Descend(0, 0, &candidates, labels);
  }

  // Where every visible wall has a segment, only labels in the order in which a candidate sees them; returns
  // the candidates whose order cannot tell.
  FaceSet SearchInOrder(const FaceSet& candidates) {
    const std::vector<int> order = SegmentsInOrder(segments_);
    const double tolerance =
        RadFromDeg(options_.angle_tolerance_deg) +
        std::sqrt(2.0) * *std::max_element(angle_tolerance_.begin(), angle_tolerance_.end());
    FaceSet others;
    std::set<OrderedLabels> ways;
    for (const FaceSet::Word& word : candidates.words) {
      for (uint64_t bits = word.bits; bits != 0; bits &= bits - 1) {
        const FaceIdx face = word.block * 64 + std::countr_zero(bits);
        const auto labels =
            LabelsInOrder(index_.views(), face, segments_, order, tolerance,
                          [&](int segment, LabelIdx label) { return PairingOf(segment, label).possible; });
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
      Finish();
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
      Finish();
      return;
    }
    if (options_.fix_pose_early && FixesPose(depth)) {
      PairAtPose(depth, num_nulls, labels);
      return;
    }
    const int segment = order_[depth];
    for (const LabelIdx label : labels) {
      if (options_.one_segment_per_wall && used_[label]) continue;
      if (!CountNode()) return;
      if (!PairingOf(segment, label).possible || !AgreesWithAll(depth, segment, label)) continue;
      ++result_.num_expanded;
      labels_[segment] = label;
      used_[label] = true;
      if (candidates == nullptr) {
        Descend(depth + 1, num_nulls, nullptr, labels);
      } else {
        const FaceSet left = Seeing(*candidates, segment, label);
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

  // Two pairings that are not parallel.
  bool FixesPose(int depth) const {
    int num_paired = 0;
    bool crossing = false;
    Vec2 first = Vec2::Zero();
    for (int i = 0; i < depth; ++i) {
      if (labels_[order_[i]] < 0) continue;
      const ScanSegment& segment = segments_[order_[i]];
      const Vec2 along = (segment.end - segment.start).normalized();
      if (num_paired++ == 0) first = along;
      crossing = crossing || std::abs(Cross(first, along)) > kMinCrossing;
    }
    return crossing && num_paired >= 2;
  }

  // How far a segment lies from a label's wall at a pose, in units of what is allowed: > 1 is too far.
  double Misfit(const Interpretation& found, int segment, LabelIdx label) const {
    const ScanSegment& seen = segments_[segment];
    const Vec2 start = LabelStart(plan_, label), end = LabelEnd(plan_, label);
    const Vec2 along = (end - start).normalized(), normal(-along.y(), along.x());
    const double angle = WrapAngle(std::atan2(along.y(), along.x()) - seen.Angle() - found.pose.heading_rad);
    const double angle_sigma = std::hypot(seen.sigma_angle_rad, std::sqrt(found.covariance(2, 2)));
    const double angle_allowed = options_.num_sigmas * angle_sigma + RadFromDeg(options_.angle_tolerance_deg);
    const Vec2 middle = found.pose.FloorFromRobot(seen.Middle()), arm = middle - found.pose.position;
    const auto allowed = [&](const Vec2& direction) {
      const Eigen::Vector3d row(direction.x(), direction.y(), direction.dot(Vec2(-arm.y(), arm.x())));
      const double variance = row.dot(found.covariance * row) + std::pow(seen.sigma_offset_m, 2);
      return options_.num_sigmas * std::sqrt(variance) + options_.position_tolerance_m;
    };
    const double offset = std::abs(normal.dot(middle - start)) / allowed(normal);
    const double half = 0.5 * seen.Length(), place = along.dot(middle - start), length = (end - start).norm();
    const double beyond =
        std::max({0.0, half - place, place + half - length}) / (allowed(along) + options_.length_tolerance_m);
    return std::max({std::abs(angle) / angle_allowed, offset, beyond});
  }

  // The label of each further segment that fits best at the pose so far, or none.
  void PairAtPose(int depth, int num_nulls, const std::vector<LabelIdx>& labels) {
    Interpretation found;
    found.labels = labels_;
    FitPose(plan_, segments_, &found);
    for (int i = depth; i < static_cast<int>(order_.size()) && num_nulls <= max_nulls_; ++i) {
      const int segment = order_[i];
      LabelIdx best = kNull;
      double best_misfit = 1;
      for (const LabelIdx label : labels) {
        if (!CountNode()) return;
        if (!PairingOf(segment, label).possible) continue;
        const double misfit = Misfit(found, segment, label);
        if (misfit >= best_misfit) continue;
        best = label;
        best_misfit = misfit;
      }
      found.labels[segment] = best;
      if (best == kNull) {
        ++num_nulls;
        continue;
      }
      ++result_.num_expanded;
      FitPose(plan_, segments_, &found);
    }
    if (num_nulls > max_nulls_) return;
    const std::vector<LabelIdx> before = labels_;
    labels_ = found.labels;
    Finish();
    labels_ = before;
  }

  // Accepts a complete interpretation whose walls are seen from its pose.
  void Finish() {
    Interpretation found;
    found.labels = labels_;
    FitPose(plan_, segments_, &found);
    if (found.num_matched < std::min<int>(2, static_cast<int>(segments_.size()))) return;
    if (found.determined && !SeesItsWalls(found)) return;
    for (Interpretation& other : result_.solutions) {
      if (other.determined != found.determined ||
          (other.pose.position - found.pose.position).norm() > 2 * options_.position_tolerance_m ||
          std::abs(WrapAngle(other.pose.heading_rad - found.pose.heading_rad)) >
              RadFromDeg(2 * options_.angle_tolerance_deg)) {
        continue;
      }
      if (found.matched_length_m > other.matched_length_m + 1e-6 ||
          (found.matched_length_m > other.matched_length_m - 1e-6 && found.rms_m < other.rms_m)) {
        other = std::move(found);
      }
      return;
    }
    result_.solutions.push_back(std::move(found));
    if (options_.first_only) done_ = true;
  }

  // Matched segments lie on their walls, and of each some point is seen with nothing before it.
  bool SeesItsWalls(const Interpretation& found) const {
    for (size_t i = 0; i < segments_.size(); ++i) {
      if (found.labels[i] < 0) continue;
      if (Misfit(found, static_cast<int>(i), found.labels[i]) > 1) return false;
      bool seen = false;
      for (double share = 0.1; share < 1 && !seen; share += 0.2) {
        const Vec2 point = segments_[i].start + share * (segments_[i].end - segments_[i].start);
        seen =
            SeesPoint(plan_, found.pose, found.pose.FloorFromRobot(point), 2 * options_.position_tolerance_m);
      }
      if (!seen) return false;
    }
    return true;
  }

  const ViewSearchIndex& index_;
  const FloorPlan& plan_;
  const std::vector<ScanSegment>& segments_;
  const InterpretationTreeOptions& options_;
  std::vector<int> order_;  // of segments: longest first
  std::vector<double> angle_tolerance_, place_tolerance_;
  std::vector<Pairing> pairings_;
  int max_nulls_ = 0;
  ViewSearchIndex::Spectrum spectrum_{};  // of the segments
  double blur_ = 0;                       // what tolerances of angle may change in its first harmonic
  std::vector<LabelIdx> all_labels_;
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
    return MakeError(ErrorCode::kNoData,
                     "{} straight stretches of walls; a pose needs at least two that are not parallel",
                     segments.size());
  }
  return TreeSearch(index, segments, options).Run();
}

}  // namespace cairn
