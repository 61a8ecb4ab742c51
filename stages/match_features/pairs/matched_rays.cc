#include "stages/match_features/pairs/matched_rays.h"

namespace cairn::match_features {

void MatchedRays::AddView(std::span<const Eigen::Vector3f> rays) {
  rays_.Append(rays);
  first_ray_.push_back(rays_.size());
}

void MatchedRays::AddPair(int view1, int view2, std::span<const Match> matches) {
  pairs_.push_back({view1, view2, matches_.size()});
  matches_.Append(matches);
}

uint64_t MatchedRays::NumMatches(size_t pair) const {
  const uint64_t end = pair + 1 < pairs_.size() ? pairs_[pair + 1].first_match : matches_.size();
  return end - pairs_[pair].first_match;
}

Result<std::vector<Eigen::Vector3f>> MatchedRays::ReadRays(int view) const {
  std::vector<Eigen::Vector3f> rays(NumFeatures(view));
  CAIRN_RETURN_IF_ERROR(rays_.Read(first_ray_[view], rays));
  return rays;
}

Result<std::vector<Match>> MatchedRays::ReadMatches(size_t pair) const {
  std::vector<Match> matches(NumMatches(pair));
  CAIRN_RETURN_IF_ERROR(matches_.Read(pairs_[pair].first_match, matches));
  return matches;
}

}  // namespace cairn::match_features
