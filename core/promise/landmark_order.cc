#include "core/promise/landmark_order.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/parallel.h"
#include "core/promise/pose_information.h"

namespace cairn {
namespace {

// Far from underflow: a factor is 1e-12 at least.
constexpr double kLeastProduct = 1e-200;

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
    size_t num_kept = 0, num_sights = 0;
    while (num_kept < pool_.size() &&
           num_sights + matches_.of_class[pool_[num_kept]].size() <= options.max_num_kept_sights)
      num_sights += matches_.of_class[pool_[num_kept++]].size();
    kept_sights_.resize(num_kept);
    ParallelFor(static_cast<int64_t>(num_kept), num_threads_,
                [&](int64_t n) { kept_sights_[n] = SightsOf(pool_[n]); });
    TakeFirst(options.first);
  }

  std::vector<size_t> First(size_t num) {
    num = std::min(num, pool_.size());
    while (order_.size() < num) TakeNext();
    return {order_.begin(), order_.begin() + static_cast<ptrdiff_t>(num)};
  }

 private:
  void TakeFirst(const std::vector<size_t>& first) {
    std::vector<char> is_taken(pool_.size(), 0);
    for (const size_t i : first) {
      const auto n = static_cast<size_t>(std::lower_bound(pool_.begin(), pool_.end(), i) - pool_.begin());
      Take(n);
      order_.push_back(i);
      is_taken[n] = 1;
    }
    std::erase_if(heap_, [&](const Candidate& candidate) { return is_taken[candidate.n] != 0; });
  }

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
                  [&](int64_t i) { heap_[i].bound = Gain(heap_[i].n); });
      std::make_heap(heap_.begin(), heap_.end(), Worse);
      next_refresh_ = 2 * order_.size() + 1;
    }
    while (true) {
      std::pop_heap(heap_.begin(), heap_.end(), Worse);
      heap_.back().bound = Gain(heap_.back().n);
      if (heap_.size() == 1 || !Worse(heap_.back(), heap_.front())) break;
      std::push_heap(heap_.begin(), heap_.end(), Worse);
    }
    Take(heap_.back().n);
    order_.push_back(pool_[heap_.back().n]);
    heap_.pop_back();
  }

  // A sight, and how much it adds to a view that has nothing yet.  There are many: no byte of padding.
  struct Sight {
    int32_t view;
    float first_gain;
    Eigen::Matrix<float, 2, 6, Eigen::DontAlign> root;  // NaN: none
    bool has_root() const { return !std::isnan(root(0, 0)); }
  };
  static_assert(sizeof(Sight) == 56);

  // Of exp(-m_v / e), by a match more.
  double Shrinkage(const ExpectedMatch& match) const { return std::exp(-match.probability / enough_); }

  std::vector<Sight> SightsOf(size_t i) const {
    std::vector<Sight> sights;
    sights.reserve(matches_.of_class[i].size());
    for (const ExpectedMatch& match : matches_.of_class[i]) {
      Sight sight{.view = match.view, .first_gain = static_cast<float>(enough_ * (1 - Shrinkage(match)))};
      const View& view = views_[match.view];
      const auto root = sights_.Root(i, view.cam_from_world, view.focal, match.probability);
      if (root) {
        sight.root = root->cast<float>();
      } else {
        sight.root(0, 0) = std::numeric_limits<float>::quiet_NaN();
      }
      sights.push_back(sight);
    }
    return sights;
  }

  // Calls with the sights of the n-th of the pool.
  template <class Body>
  void WithSights(size_t n, const Body& body) const {
    if (n < kept_sights_.size()) {
      body(kept_sights_[n]);
    } else {
      body(SightsOf(pool_[n]));
    }
  }

  double Gain(size_t n) const {
    double gain = 0, ratio = 1;  // of the views' variances, multiplied: one logarithm for many
    WithSights(n, [&](const std::vector<Sight>& sights) {
      for (const Sight& sight : sights) {
        gain += sight.first_gain * lack_[sight.view];
        if (!sight.has_root()) continue;
        ratio *= information_.PlaceRatio(sight.view, sight.root.cast<double>());
        if (ratio < kLeastProduct) {
          gain -= std::log(ratio);
          ratio = 1;
        }
      }
    });
    return gain - std::log(ratio);
  }

  void Take(size_t n) {
    for (const ExpectedMatch& match : matches_.of_class[pool_[n]]) lack_[match.view] *= Shrinkage(match);
    std::vector<SightInformation> seen;
    WithSights(n, [&](const std::vector<Sight>& sights) {
      for (const Sight& sight : sights) {
        if (sight.has_root()) seen.push_back({static_cast<size_t>(sight.view), sight.root.cast<double>()});
      }
    });
    information_.Add(seen);
  }

  ExpectedMatches matches_;
  std::vector<size_t> pool_;
  double enough_;
  int num_threads_;
  LandmarkSights sights_;
  std::vector<View> views_;
  std::vector<double> lack_;  // per view: exp(-m_v / e)
  PoseInformation information_;
  std::vector<std::vector<Sight>> kept_sights_;  // of the first of the pool
  std::vector<Candidate> heap_;                  // of those not yet taken
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
