#include "runtime/laser/candidate_regions.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/geometry/pose.h"

namespace cairn {
namespace {

template <typename Keep>
void KeepIf(FaceSet* set, const Keep& keep) {
  for (FaceSet::Word& word : set->words) {
    for (uint64_t bits = word.bits; bits != 0; bits &= bits - 1) {
      const int bit = std::countr_zero(bits);
      if (!keep(static_cast<FaceIdx>(word.block * 64 + bit))) word.bits &= ~(uint64_t{1} << bit);
    }
  }
  std::erase_if(set->words, [](const FaceSet::Word& word) { return word.bits == 0; });
}

}  // namespace

CandidateRegions::CandidateRegions(const ViewSearchIndex& index, const std::vector<ScanSegment>& segments,
                                   const InterpretationTreeOptions& options)
    : index_(index), segments_(segments), options_(options) {
  const auto num = static_cast<double>(segments.size());
  max_nulls_ = MaxNumNulls(segments.size(), options);
  std::vector<double> angles;
  blur_ = RadFromDeg(num * options.angle_tolerance_deg);
  for (const ScanSegment& segment : segments) {
    angles.push_back(segment.Angle());
    observed_m_ += segment.Length();
    blur_ += options.num_sigmas * segment.sigma_angle_rad;
  }
  spectrum_ = DirectionSpectrum(angles);
}

std::vector<std::pair<double, FaceIdx>> CandidateRegions::Find() const {
  const Views& views = index_.views();
  const auto num = static_cast<double>(segments_.size());
  ViewSearchIndex::LengthCounts longer{};
  for (const ScanSegment& segment : segments_) {
    for (size_t i = 0; i < longer.size(); ++i)
      longer[i] += segment.Length() - options_.length_tolerance_m >= ViewSearchIndex::kLengths[i];
  }
  const double least = std::floor(num * (1 - options_.max_null_ratio)),
               most = std::ceil(num / (1 - options_.max_missing_ratio));
  std::vector<std::pair<double, FaceIdx>> found;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    const ViewIndex& values = views.index[face];
    // [Simsarian96 §2.3] the second index function: significantly less total length than observed
    if (values.wall_length_m <
        (1 - options_.max_null_ratio) * observed_m_ - num * options_.length_tolerance_m) {
      continue;
    }
    bool fits = true;
    if (options_.one_segment_per_wall) {
      // [Simsarian96 §2.3] the first: N_v edges, within a range where segments may be missing or of no wall
      fits = values.num_labels >= least && values.num_labels <= most;
      const ViewSearchIndex::LengthCounts& walls = index_.WallsByLength(face);
      for (size_t i = 0; i < longer.size() && fits; ++i) fits = walls[i] + max_nulls_ >= longer[i];
      const double others = NumOthers(face);
      const ViewSearchIndex::Spectrum& expected = index_.SpectrumOf(face);
      for (int m = 0; m < ViewSearchIndex::kNumHarmonics && fits; ++m)
        fits = std::abs(std::abs(expected[m]) - std::abs(spectrum_[m])) <= others + (m + 1) * blur_ + 1e-3;
    }
    if (!fits) continue;
    // [Simsarian96 §3] the visible perimeter: it ranks candidates, where the source filters by it
    const double ratio =
        std::log(std::max(1e-3, static_cast<double>(values.visible_length_m)) / std::max(1e-3, observed_m_));
    found.emplace_back(std::abs(ratio), face);
  }
  return found;
}

// Largest number of segments without a wall and walls without a segment.
double CandidateRegions::NumOthers(FaceIdx face) const {
  return 2.0 * max_nulls_ +
         std::max(0.0, index_.views().index[face].num_labels - static_cast<double>(segments_.size()));
}

bool CandidateRegions::HasDirections(FaceIdx face, double heading) const {
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

FaceSet CandidateRegions::Seeing(const FaceSet& candidates, const PairingTable& table, int segment,
                                 LabelIdx label) const {
  const Pairing& pairing = table.Of(segment, label);
  const double reach = table.PlaceTolerance(segment) + options_.position_tolerance_m;
  // [Simsarian96 §2.3] regions whose label sets do not contain the edge are removed
  FaceSet left = Intersection(candidates, index_.FacesOf(label));
  KeepIf(&left, [&](FaceIdx face) {
    return Touches(index_.BoxOf(face), pairing, reach) && HasDirections(face, pairing.heading);
  });
  return left;
}

FaceSet CandidateRegions::SeeingBoth(const FaceSet& candidates, LabelIdx a, LabelIdx b,
                                     const PlanarPose& pose, double reach) const {
  const Eigen::Array2f margin = Eigen::Array2f::Constant(static_cast<float>(reach));
  const Eigen::Array2f place = pose.position.cast<float>().array();
  const Eigen::AlignedBox2f around((place - margin).matrix(), (place + margin).matrix());
  FaceSet near = Intersection(index_.BlocksNear(around, index_.FacesOf(a)), index_.FacesOf(b));
  near = Intersection(near, candidates);
  KeepIf(&near, [&](FaceIdx face) {
    return index_.BoxOf(face).intersects(around) && HasDirections(face, pose.heading_rad);
  });
  return near;
}

}  // namespace cairn
