#include "core/promise/landmark_order.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/parallel.h"
#include "core/promise/pose_information.h"

namespace cairn {
namespace {

// All gains are computed anew when the number taken has doubled, until so many are taken: later ones hardly
// grow.
constexpr size_t kMaxTakenAtRefresh = 512;

}  // namespace

class LandmarkOrder::Impl {
 public:
  Impl(const Classes& classes, ExpectedMatches matches, std::vector<size_t> pool,
       const LandmarkOrderOptions& options, int num_threads)
      : matches_(std::move(matches)),
        pool_(std::move(pool)),
        enough_(options.enough_matches),
        num_threads_(num_threads),
        sights_(classes, options.keypoints),
        lack_(matches_.views.size(), 1),
        information_(PoseInformation::Rough(matches_.views.size(), matches_.depth)),
        heap_(pool_.size()) {
    for (const int32_t image : matches_.views) {
      const SurveyImage& row = classes.images[image];
      views_.push_back({row.cam_from_world, sights_.FocalOf(row.image_id)});
    }
    for (size_t n = 0; n < pool_.size(); ++n) heap_[n].n = n;
  }

  std::vector<size_t> First(size_t num) {
    num = std::min(num, pool_.size());
    while (order_.size() < num) TakeNext();
    return {order_.begin(), order_.begin() + static_cast<ptrdiff_t>(num)};
  }

 private:
  struct View {
    Pose cam_from_world;
    double focal;  // px
  };
  struct Candidate {
    double bound = 0;
    size_t n = 0;  // in pool_
  };

  static bool Worse(const Candidate& a, const Candidate& b) {
    return a.bound != b.bound ? a.bound < b.bound : a.n > b.n;
  }

  void TakeNext() {
    // Gains hardly grow: an earlier value is nearly a bound [Minoux, "Accelerated greedy algorithms", 1978].
    // Those that did grow are found whenever as many again have been taken.
    if (order_.size() >= next_refresh_) {
      ParallelFor(static_cast<int64_t>(heap_.size()), num_threads_,
                  [&](int64_t i) { heap_[i].bound = Gain(pool_[heap_[i].n]); });
      std::make_heap(heap_.begin(), heap_.end(), Worse);
      next_refresh_ = order_.size() <= kMaxTakenAtRefresh / 2 ? 2 * order_.size() + 1
                                                              : std::numeric_limits<size_t>::max();
    }
    while (true) {
      std::pop_heap(heap_.begin(), heap_.end(), Worse);
      heap_.back().bound = Gain(pool_[heap_.back().n]);
      if (heap_.size() == 1 || !Worse(heap_.back(), heap_.front())) break;
      std::push_heap(heap_.begin(), heap_.end(), Worse);
    }
    Take(pool_[heap_.back().n]);
    order_.push_back(pool_[heap_.back().n]);
    heap_.pop_back();
  }

  double Gain(size_t i) const {
    double gain = 0;
    for (const ExpectedMatch& match : matches_.of_class[i]) {
      gain += enough_ * lack_[match.view] * (1 - std::exp(-match.probability / enough_));
      if (const auto sight = SightOf(i, match)) gain += information_.PlaceGain(*sight);
    }
    return gain;
  }

  void Take(size_t i) {
    std::vector<SightInformation> sights;
    for (const ExpectedMatch& match : matches_.of_class[i]) {
      lack_[match.view] *= std::exp(-match.probability / enough_);
      if (const auto sight = SightOf(i, match)) sights.push_back(*sight);
    }
    information_.Add(sights);
  }

  std::optional<SightInformation> SightOf(size_t i, const ExpectedMatch& match) const {
    const View& view = views_[match.view];
    const auto root = sights_.Root(i, view.cam_from_world, view.focal, match.probability);
    if (!root) return std::nullopt;
    return SightInformation{static_cast<size_t>(match.view), *root};
  }

  ExpectedMatches matches_;
  std::vector<size_t> pool_;
  double enough_;
  int num_threads_;
  LandmarkSights sights_;
  std::vector<View> views_;
  std::vector<double> lack_;  // per view: exp(-m_v / e)
  PoseInformation information_;
  std::vector<Candidate> heap_;  // of those not yet taken
  std::vector<size_t> order_;
  size_t next_refresh_ = 0;
};

LandmarkOrder::LandmarkOrder(const Classes& classes, ExpectedMatches matches, std::vector<size_t> pool,
                             const LandmarkOrderOptions& options, int num_threads)
    : impl_(std::make_unique<Impl>(classes, std::move(matches), std::move(pool), options, num_threads)) {}
LandmarkOrder::~LandmarkOrder() = default;
LandmarkOrder::LandmarkOrder(LandmarkOrder&&) noexcept = default;
LandmarkOrder& LandmarkOrder::operator=(LandmarkOrder&&) noexcept = default;

std::vector<size_t> LandmarkOrder::First(size_t n) { return impl_->First(n); }

}  // namespace cairn
