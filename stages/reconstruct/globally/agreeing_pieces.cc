#include "stages/reconstruct/globally/agreeing_pieces.h"

#include <algorithm>
#include <map>
#include <queue>
#include <tuple>

namespace cairn::reconstruct {
namespace {

struct Piece {
  std::vector<int> images;
  std::map<int, double> links;  // by the other piece: the sum of weights
  int version = 0;
};

// By its average weight; of equal ones the first.
struct Candidate {
  double mean_weight = 0;
  int piece1 = 0, piece2 = 0, version1 = 0, version2 = 0;

  bool operator<(const Candidate& other) const {
    return std::tie(mean_weight, other.piece1, other.piece2) < std::tie(other.mean_weight, piece1, piece2);
  }
};

class Joining {
 public:
  Joining(int num_images, const std::vector<SignedLink>& links, double min_mean_weight)
      : min_mean_weight_(min_mean_weight), pieces_(num_images) {
    for (int i = 0; i < num_images; ++i) pieces_[i].images = {i};
    for (const SignedLink& link : links) {
      pieces_[link.image1].links[link.image2] += link.weight;
      pieces_[link.image2].links[link.image1] += link.weight;
    }
    for (int i = 0; i < num_images; ++i) {
      for (const auto& [other, weight] : pieces_[i].links) {
        if (i < other) Offer(i, other, weight);
      }
    }
  }

  std::vector<std::vector<int>> Join() {
    while (!candidates_.empty()) {
      const Candidate best = candidates_.top();
      candidates_.pop();
      if (best.version1 == pieces_[best.piece1].version && best.version2 == pieces_[best.piece2].version)
        Merge(best.piece1, best.piece2);
    }
    std::vector<std::vector<int>> joined;
    for (Piece& piece : pieces_) {
      if (piece.images.empty()) continue;
      std::sort(piece.images.begin(), piece.images.end());
      joined.push_back(std::move(piece.images));
    }
    std::sort(joined.begin(), joined.end(), [](const std::vector<int>& a, const std::vector<int>& b) {
      return a.size() != b.size() ? a.size() > b.size() : a[0] < b[0];
    });
    return joined;
  }

 private:
  void Offer(int a, int b, double weight) {
    const auto num_links = static_cast<double>(pieces_[a].images.size() * pieces_[b].images.size());
    if (!(weight > min_mean_weight_ * num_links)) return;
    candidates_.push({weight / num_links, a, b, pieces_[a].version, pieces_[b].version});
  }

  void Merge(int to, int from) {
    if (pieces_[to].images.size() < pieces_[from].images.size()) std::swap(to, from);
    Piece &kept = pieces_[to], &gone = pieces_[from];
    kept.images.insert(kept.images.end(), gone.images.begin(), gone.images.end());
    for (const auto& [other, weight] : gone.links) {
      pieces_[other].links.erase(from);
      if (other == to) continue;
      kept.links[other] += weight;
      pieces_[other].links[to] += weight;
    }
    gone.images.clear();
    gone.links.clear();
    ++gone.version;
    ++kept.version;
    for (const auto& [other, weight] : kept.links) Offer(std::min(to, other), std::max(to, other), weight);
  }

  double min_mean_weight_;
  std::vector<Piece> pieces_;
  std::priority_queue<Candidate> candidates_;
};

}  // namespace

std::vector<std::vector<int>> AgreeingPieces(int num_images, const std::vector<SignedLink>& links,
                                             double min_mean_weight) {
  return Joining(num_images, links, min_mean_weight).Join();
}

}  // namespace cairn::reconstruct
