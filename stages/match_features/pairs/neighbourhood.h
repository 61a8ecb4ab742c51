#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "stages/match_features/pairs/matched_rays.h"

namespace cairn::match_features {

// What chains of two matches that begin in some images pass: the links of these images and of those that they
// are matched with, and the rays of all to which these are linked.  Moves from one stretch of images to the
// next and keeps what both have in common.  Images that follow each other had better see the same.
class Neighbourhood {
 public:
  // Another feature that a feature is matched with.
  struct Link {
    int32_t slot;  // of its image
    uint32_t feature : 31;
    uint32_t is_new : 1;  // of a pair from first_new_pair on
  };
  struct LinkedView {
    std::vector<Eigen::Vector3f> rays;
    std::vector<uint32_t> first_link;  // of each feature; then the number of all.  Empty: links are not here
    std::vector<Link> links;
    std::vector<char> has_new_link;  // of each feature

    // By ascending views.
    std::span<const Link> LinksOf(uint32_t feature) const {
      return {links.data() + first_link[feature], links.data() + first_link[feature + 1]};
    }
  };

  // `matched` is to outlive this, and no pair is to be added meanwhile.  Memory: `max_num_bytes`, or what
  // one image needs; 8 bytes per pair, 28 per image.
  Neighbourhood(const MatchedRays& matched, size_t first_new_pair, int64_t max_num_bytes);

  // Whether a chain that begins in the image may have a new pair.
  bool HasNewChain(int view) const;
  // Moves to images[begin, end) and returns `end`: as many as memory allows, at least one.  Errors: Io.
  Result<size_t> MoveTo(const std::vector<int>& images, size_t begin, int num_threads);

  // An image of the neighbourhood has a slot, a small number, for as long as it belongs to it.
  int num_slots() const { return static_cast<int>(slots_.size()); }
  int SlotOf(int view) const { return slot_of_[view]; }
  // -1: the slot is free.
  int ViewOf(int slot) const { return slots_[slot].view; }
  // REQUIRES: the slot is not free.
  const LinkedView& At(int slot) const { return *slots_[slot].linked; }

 private:
  enum Need : char { kNothing, kRays, kLinks };

  // Pairs of an image, by ascending other images.
  std::span<const uint32_t> PairsOf(int view) const {
    return {pair_of_.data() + first_pair_[view], pair_of_.data() + first_pair_[view + 1]};
  }
  int OtherView(uint32_t pair, int view) const {
    const MatchedRays::Pair& of = matched_.pairs()[pair];
    return of.view1 == view ? of.view2 : of.view1;
  }
  struct Slot {
    int view = -1;
    std::unique_ptr<LinkedView> linked;
  };

  // Adds what an image needs; returns its bytes.
  int64_t AddNeeds(int image);
  int64_t NumBytesOfLinks(int view) const;
  Result<std::unique_ptr<LinkedView>> Load(int view) const;

  const MatchedRays& matched_;
  size_t first_new_pair_;
  int64_t max_num_bytes_;
  std::vector<uint64_t> first_pair_;  // of each image, in pair_of_
  std::vector<uint32_t> pair_of_;
  std::vector<char> has_new_pair_;  // of each image
  std::vector<Need> needs_;         // of each image
  std::vector<int> views_;          // that are needed
  std::vector<int> slot_of_;        // of each image; -1: none
  std::vector<Slot> slots_;
};

}  // namespace cairn::match_features
