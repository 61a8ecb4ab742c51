#include "stages/match_features/pairs/neighbourhood.h"

#include <algorithm>
#include <utility>

#include "core/base/parallel.h"

namespace cairn::match_features {

Neighbourhood::Neighbourhood(const MatchedRays& matched, size_t first_new_pair, int64_t max_num_bytes)
    : matched_(matched),
      first_new_pair_(first_new_pair),
      max_num_bytes_(max_num_bytes),
      first_pair_(matched.num_views() + 2, 0),
      pair_of_(2 * matched.pairs().size()),
      has_new_pair_(matched.num_views(), 0),
      needs_(matched.num_views(), kNothing),
      slot_of_(matched.num_views(), -1) {
  for (const MatchedRays::Pair& pair : matched.pairs()) {
    ++first_pair_[pair.view1 + 2];
    ++first_pair_[pair.view2 + 2];
  }
  for (size_t i = 2; i < first_pair_.size(); ++i) first_pair_[i] += first_pair_[i - 1];
  for (size_t i = 0; i < matched.pairs().size(); ++i) {
    const MatchedRays::Pair& pair = matched.pairs()[i];
    for (const int view : {pair.view1, pair.view2}) {
      pair_of_[first_pair_[view + 1]++] = static_cast<uint32_t>(i);
      if (i >= first_new_pair) has_new_pair_[view] = 1;
    }
  }
  for (int view = 0; view < matched.num_views(); ++view) {
    std::sort(pair_of_.begin() + static_cast<int64_t>(first_pair_[view]),
              pair_of_.begin() + static_cast<int64_t>(first_pair_[view + 1]), [&](uint32_t a, uint32_t b) {
                return std::pair(OtherView(a, view), a) < std::pair(OtherView(b, view), b);
              });
  }
}

bool Neighbourhood::HasNewChain(int view) const {
  if (has_new_pair_[view] != 0) return true;
  const auto pairs = PairsOf(view);
  return std::any_of(pairs.begin(), pairs.end(),
                     [&](uint32_t pair) { return has_new_pair_[OtherView(pair, view)] != 0; });
}

int64_t Neighbourhood::NumBytesOfLinks(int view) const {
  uint64_t num_links = 0;
  for (const uint32_t pair : PairsOf(view)) num_links += matched_.NumMatches(pair);
  return static_cast<int64_t>(num_links * sizeof(Link) +
                              (matched_.NumFeatures(view) + 1) * (sizeof(uint32_t) + sizeof(char)));
}

int64_t Neighbourhood::AddNeeds(int image) {
  int64_t num_bytes = 0;
  const auto need_rays = [&](int view) {
    if (needs_[view] != kNothing) return;
    needs_[view] = kRays;
    views_.push_back(view);
    num_bytes += static_cast<int64_t>(matched_.NumFeatures(view) * sizeof(Eigen::Vector3f));
  };
  const auto need_links = [&](int view) {
    need_rays(view);
    if (needs_[view] == kLinks) return;
    needs_[view] = kLinks;
    num_bytes += NumBytesOfLinks(view);
    for (const uint32_t pair : PairsOf(view)) need_rays(OtherView(pair, view));
  };
  need_links(image);
  for (const uint32_t pair : PairsOf(image)) need_links(OtherView(pair, image));
  return num_bytes;
}

Result<std::unique_ptr<Neighbourhood::LinkedView>> Neighbourhood::Load(int view) const {
  auto loaded = std::make_unique<LinkedView>();
  CAIRN_ASSIGN_OR_RETURN(loaded->rays, matched_.ReadRays(view));
  if (needs_[view] != kLinks) return loaded;
  // The feature of the image first.
  std::vector<std::pair<uint32_t, Link>> links;
  std::vector<uint32_t>& first_link = loaded->first_link;
  first_link.resize(loaded->rays.size() + 2, 0);
  loaded->has_new_link.resize(loaded->rays.size(), 0);
  for (const uint32_t pair : PairsOf(view)) {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Match> matches, matched_.ReadMatches(pair));
    const bool is_first = matched_.pairs()[pair].view1 == view;
    const int other = slot_of_[OtherView(pair, view)];
    const bool is_new = pair >= first_new_pair_;
    for (const Match& match : matches) {
      const uint32_t feature = is_first ? match.idx1 : match.idx2;
      ++first_link[feature + 2];
      links.push_back({feature, {other, is_first ? match.idx2 : match.idx1, is_new ? 1U : 0U}});
      if (is_new) loaded->has_new_link[feature] = 1;
    }
  }
  for (size_t f = 2; f < first_link.size(); ++f) first_link[f] += first_link[f - 1];
  loaded->links.resize(links.size());
  for (const auto& [feature, link] : links) loaded->links[first_link[feature + 1]++] = link;
  first_link.pop_back();
  return loaded;
}

Result<size_t> Neighbourhood::MoveTo(const std::vector<int>& images, size_t begin, int num_threads) {
  for (const int view : std::exchange(views_, {})) needs_[view] = kNothing;
  size_t end = begin;
  for (int64_t num_bytes = 0; end < images.size() && (end == begin || num_bytes < max_num_bytes_); ++end)
    num_bytes += AddNeeds(images[end]);
  // Links that stay keep their slots: what they lead to stays as well.
  std::vector<int> free;
  for (int slot = 0; slot < num_slots(); ++slot) {
    auto& [view, linked] = slots_[slot];
    if (view >= 0 && needs_[view] == kNothing) {
      slot_of_[view] = -1;
      view = -1;
    }
    if (view < 0) free.push_back(slot);
    if (view < 0 || (needs_[view] == kRays) != linked->first_link.empty()) linked.reset();
  }
  for (const int view : views_) {
    if (slot_of_[view] >= 0) continue;
    if (free.empty()) {
      free.push_back(num_slots());
      slots_.emplace_back();
    }
    slot_of_[view] = free.back();
    slots_[free.back()].view = view;
    free.pop_back();
  }
  std::vector<Status> statuses(slots_.size());
  ParallelFor(num_slots(), num_threads, [&](int64_t i) {
    auto& [view, linked] = slots_[i];
    if (view < 0 || linked) return;
    auto loaded = Load(view);
    if (loaded.ok()) {
      linked = std::move(loaded).value();
    } else {
      statuses[i] = loaded.error();
    }
  });
  for (Status& status : statuses) CAIRN_RETURN_IF_ERROR(status);
  return end;
}

}  // namespace cairn::match_features
