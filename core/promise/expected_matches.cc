#include "core/promise/expected_matches.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

#include <Eigen/Cholesky>

#include "core/base/parallel.h"
#include "core/geometry/pose.h"
#include "core/promise/promise_nodes.h"

namespace cairn {
namespace {

using FeatureVector = Eigen::Matrix<double, kNumMatchFeatures, 1>;

// Sights weigh exp(-d^2 / 2 h^2), d = distance of views, h = this many views' radii.
constexpr double kKernelWidth = 1.5;
// Less than a ten thousandth is nothing.
constexpr double kLeastWeight = 1e-4;
// A priori as good as this many matches.
constexpr double kPriorWeight = 0.5;
// Nothing is certain.
constexpr double kLeastRate = 0.01;
// A class is looked for in images within these of one that saw it.
constexpr double kMaxAngleDeg = 60;
constexpr double kMaxDistanceFactor = 2.5;
// Moving to another place in the same view turns the ray, and changes the distance, by this.
constexpr double kShiftDeg = 5;
constexpr double kShiftLogRatio = 0.1;
constexpr int64_t kMaxNumPairs = 60'000;
constexpr size_t kMaxNumNear = 64;
constexpr size_t kMaxImagesInTable = 4096;
constexpr int kMinNumShared = 5;
// Images agree on what they see from this many views' radii at most, and from another view.
constexpr double kAgreeReach = 3;
// What was rather not there teaches nothing by not being seen.
constexpr double kLeastPresence = 0.5;
constexpr double kLeastDistance = 1e-9;
// Features of the nearest sight: its angle and its octaves are counted in these.
constexpr double kAngleUnitDeg = 20;
constexpr double kOctavesUnit = 0.5;
// An image taken anywhere may find what this many of the survey's images nearest to it saw.
constexpr size_t kMaxNumNearest = 32;
// Bodies that need room for each image take so many classes, images or looks at a time.
constexpr int64_t kClassesAtOnce = 256, kImagesAtOnce = 32, kLooksAtOnce = 16;

// Of a sight from a view at this square of a distance.
double WeightAt(double squared) { return std::exp(-squared / (2 * kKernelWidth * kKernelWidth)); }

// From there on sights weigh less than kLeastWeight: sessions and presence only make weights less.
const double kMostSquared = -2.01 * kKernelWidth * kKernelWidth * std::log(kLeastWeight);

struct View {
  Pose cam_from_world;
  Eigen::Vector3d center;
  const Camera* camera = nullptr;
  std::vector<int32_t> near;  // images that share classes with it, and itself, ascending
};

class Learner {
 public:
  Learner(const Classes& classes, const ViewOptions& options, int num_threads)
      : classes_(classes), distance_(classes, options), evidence_(classes) {
    std::unordered_map<CameraId, const Camera*> cameras;
    for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
    std::unordered_map<ImageId, int32_t> index;
    for (const SurveyImage& image : classes.images) {
      index[image.image_id] = static_cast<int32_t>(views_.size());
      const auto camera = cameras.find(image.camera_id);
      views_.push_back({image.cam_from_world,
                        image.cam_from_world.Center(),
                        camera == cameras.end() ? nullptr : camera->second,
                        {}});
    }
    seen_by_.resize(classes.classes.size());
    seen_in_.resize(views_.size());
    for (size_t i = 0; i < classes.classes.size(); ++i) {
      for (const Observation& observation : classes.classes[i].observations) {
        const auto image = index.find(observation.image_id);
        if (image == index.end()) continue;
        seen_by_[i].push_back(image->second);
        seen_in_[image->second].push_back(static_cast<uint32_t>(i));
      }
    }
    ParallelForRuns(static_cast<int64_t>(views_.size()), kImagesAtOnce, num_threads,
                    [&](int64_t first, int64_t last) { FindNear(first, last); });
    if (views_.size() > kMaxImagesInTable) return;
    weights_.resize(views_.size() * views_.size());
    ParallelFor(static_cast<int64_t>(views_.size()), num_threads, [&](int64_t a) {
      for (size_t b = 0; b < views_.size(); ++b)
        weights_[a * views_.size() + b] = static_cast<float>(WeightAt(distance_.Squared(a, b)));
    });
  }

  // Which sights of a class count, and from how far.
  enum class Sights {
    kOfOtherViews,  // those of the image's own view do not
    kFromThere,     // all
    kFromNearby,    // all, and the image is taken about a view's radius farther away
  };
  // From where a class is seen.
  struct Direction {
    float log_distance;   // base 2
    Eigen::Vector3f ray;  // unit vector from the class
  };
  Direction DirectionTo(size_t i, const Eigen::Vector3d& center) const {
    const Eigen::Vector3d ray = center - classes_.classes[i].position;
    const double distance = std::max(ray.norm(), kLeastDistance);
    return {static_cast<float>(std::log2(distance)), (ray / distance).cast<float>()};
  }
  // The sights of a class: the images that look at it, those that see it first, ascending each.
  struct Lookers {
    std::vector<int32_t> images;
    std::vector<Direction> seen_from;  // of those that see it
    // Of each, the probability that it could see the class: it was there; 1 where the image sees it.  Empty:
    // 1 of each, there are no sessions.
    std::vector<float> could_see;
  };
  // `is_candidate`: per image 0, before and after; it is used.
  Lookers LookersOf(size_t i, std::vector<char>* is_candidate) const {
    Lookers lookers{.images = Looking(i, is_candidate), .seen_from = {}, .could_see = {}};
    const auto sees = [&](int32_t image) {
      return std::binary_search(seen_by_[i].begin(), seen_by_[i].end(), image);
    };
    const auto rest = std::stable_partition(lookers.images.begin(), lookers.images.end(), sees);
    lookers.seen_from.reserve(static_cast<size_t>(rest - lookers.images.begin()));
    for (auto image = lookers.images.begin(); image != rest; ++image)
      lookers.seen_from.push_back(DirectionTo(i, views_[*image].center));
    if (!evidence_.HasSeveral()) return lookers;
    lookers.could_see.resize(lookers.images.size(), 1);
    for (size_t j = lookers.seen_from.size(); j < lookers.images.size(); ++j)
      lookers.could_see[j] = static_cast<float>(evidence_.There(i, lookers.images[j]));
    return lookers;
  }

  // What is known of a class from the sights of it, for an image of this session that looks at it from there.
  // `weight(image)`: WeightAt of the image's view and a survey image's.  False where no sight is left or all
  // are far.
  template <class Weight>
  bool Describe(const Lookers& lookers, const Direction& from, int session, double prior, Sights which,
                const Weight& weight_of, FeatureVector* features) const {
    const double own_view = WeightAt(1), farther = which == Sights::kFromNearby ? WeightAt(1) : 1.0;
    const double unit_rad = RadFromDeg(kAngleUnitDeg);
    const size_t num_that_see = lookers.seen_from.size();
    double sum = 0, seen = 0, least = std::numeric_limits<double>::infinity(), nearest_deg = 180,
           nearest_octaves = 10;
    double num_looking = 0, num_that_saw = 0;  // counted by how much they tell
    int num_seen = 0;
    for (size_t other = 0; other < lookers.images.size(); ++other) {
      double weight = weight_of(lookers.images[other]);
      const double tells = Tells(lookers, other, session);
      num_looking += tells;
      if (which == Sights::kOfOtherViews && weight > own_view) continue;
      weight *= farther * tells;
      if (weight < kLeastWeight) weight = 0;
      sum += weight;
      if (other >= num_that_see) continue;
      seen += weight;
      num_that_saw += tells;
      ++num_seen;
      const Direction& there = lookers.seen_from[other];
      const double octaves = std::abs(from.log_distance - there.log_distance);
      const double octaves2 = octaves * octaves / (kOctavesUnit * kOctavesUnit);
      const double chord2 = (from.ray - there.ray).squaredNorm();
      // An angle is at least as long as its chord.
      if (chord2 / (unit_rad * unit_rad) + octaves2 >= least) continue;
      const double angle_deg = DegFromRad(2 * std::asin(std::min(1.0, std::sqrt(chord2) / 2)));
      const double far = angle_deg * angle_deg / (kAngleUnitDeg * kAngleUnitDeg) + octaves2;
      if (far < least) least = far, nearest_deg = angle_deg, nearest_octaves = octaves;
    }
    if (num_seen == 0 || nearest_deg > kMaxAngleDeg || nearest_octaves > std::log2(kMaxDistanceFactor))
      return false;
    if (which == Sights::kOfOtherViews && num_seen < 2) return false;
    if (which == Sights::kFromNearby) {
      nearest_deg = std::sqrt(nearest_deg * nearest_deg + kShiftDeg * kShiftDeg);
      nearest_octaves = std::sqrt(nearest_octaves * nearest_octaves + kShiftLogRatio * kShiftLogRatio);
    }
    const double rate =
        std::clamp((seen + kPriorWeight * prior) / (sum + kPriorWeight), kLeastRate, 1 - kLeastRate);
    *features << 1, std::log(rate / (1 - rate)), std::log1p(sum), std::log(num_that_saw),
        nearest_deg / kAngleUnitDeg, nearest_octaves / kOctavesUnit, num_that_saw / num_looking;
    return true;
  }
  // For the j-th image that looks at class i.
  bool DescribeAtImage(size_t i, const Lookers& lookers, size_t j, double prior, Sights which,
                       FeatureVector* features) const {
    const int32_t image = lookers.images[j];
    const Direction from =
        j < lookers.seen_from.size() ? lookers.seen_from[j] : DirectionTo(i, views_[image].center);
    return Describe(
        lookers, from, evidence_.SessionOf(image), prior, which,
        [&](int32_t other) { return Weight(image, other); }, features);
  }
  static double CouldSee(const Lookers& lookers, size_t j) {
    return lookers.could_see.empty() ? 1 : lookers.could_see[j];
  }
  // How much what the j-th image sees counts for an image of this session.
  double Tells(const Lookers& lookers, size_t j, int session) const {
    if (!evidence_.HasSeveral()) return 1;
    return evidence_.Weight(session, evidence_.SessionOf(lookers.images[j])) * CouldSee(lookers, j);
  }
  // From the pairs of images, of different views that are near each other, that look at one of these classes.
  void LearnEvidence(std::span<const Lookers> of_classes, size_t step) {
    const double most = WeightAt(1), least = WeightAt(kAgreeReach * kAgreeReach);
    for (size_t i = 0; i < of_classes.size(); i += step) {
      const Lookers& lookers = of_classes[i];
      for (size_t a = 0; a < lookers.images.size(); ++a) {
        for (size_t b = 0; b < a; ++b) {
          const double weight = Weight(lookers.images[a], lookers.images[b]);
          if (weight > most || weight < least) continue;
          evidence_.Count({evidence_.SessionOf(lookers.images[a]), a < lookers.seen_from.size()},
                          {evidence_.SessionOf(lookers.images[b]), b < lookers.seen_from.size()},
                          CouldSee(lookers, a) * CouldSee(lookers, b));
        }
      }
    }
    evidence_.Learn();
  }
  const SessionEvidence& evidence() const { return evidence_; }

  const ViewDistance& distance() const { return distance_; }
  const std::vector<int32_t>& seen_by(size_t i) const { return seen_by_[i]; }
  const std::vector<uint32_t>& seen_in(int32_t image) const { return seen_in_[image]; }

 private:
  double Weight(int32_t a, int32_t b) const {
    return weights_.empty() ? WeightAt(distance_.tree().SquaredUpTo(kMostSquared, a, b))
                            : weights_[a * views_.size() + b];
  }

  // Images that look at a class, ascending: those that see it and those near them in whose view it lies.
  std::vector<int32_t> Looking(size_t i, std::vector<char>* is_candidate) const {
    std::vector<int32_t> candidates;
    const auto add = [&](int32_t image) {
      if ((*is_candidate)[image] == 0) candidates.push_back(image);
      (*is_candidate)[image] = 1;
    };
    for (const int32_t image : seen_by_[i])
      std::for_each(views_[image].near.begin(), views_[image].near.end(), add);
    for (const int32_t image : candidates) (*is_candidate)[image] = 0;
    std::erase_if(candidates, [&](int32_t image) {
      return !std::binary_search(seen_by_[i].begin(), seen_by_[i].end(), image) && !LooksAt(image, i);
    });
    std::sort(candidates.begin(), candidates.end());
    return {candidates.begin(), candidates.end()};  // without the room of all candidates
  }

  bool LooksAt(int32_t image, size_t i) const {
    const View& view = views_[image];
    return view.camera != nullptr &&
           IsInView(*view.camera, view.cam_from_world, classes_.classes[i].position);
  }

  // Of the images [first, last).
  void FindNear(int64_t first, int64_t last) {
    std::vector<int> num_shared(views_.size(), 0);
    std::vector<int32_t> sharing;
    std::vector<std::pair<int, int32_t>> order;
    for (int64_t a = first; a < last; ++a) {
      sharing.clear();
      for (const uint32_t i : seen_in_[a]) {
        for (const int32_t b : seen_by_[i]) {
          if (num_shared[b]++ == 0) sharing.push_back(b);
        }
      }
      order.clear();
      for (const int32_t b : sharing) {
        if (b != a && num_shared[b] >= kMinNumShared) order.emplace_back(-num_shared[b], b);
        num_shared[b] = 0;
      }
      const size_t num = std::min(kMaxNumNear, order.size());
      std::partial_sort(order.begin(), order.begin() + static_cast<ptrdiff_t>(num), order.end());
      std::vector<int32_t>& near = views_[a].near;
      near.reserve(num + 1);
      near.push_back(static_cast<int32_t>(a));
      for (size_t n = 0; n < num; ++n) near.push_back(order[n].second);
      std::sort(near.begin(), near.end());
    }
  }

  const Classes& classes_;
  const ViewDistance distance_;
  SessionEvidence evidence_;
  std::vector<View> views_;
  std::vector<std::vector<int32_t>> seen_by_;   // per class: images
  std::vector<std::vector<uint32_t>> seen_in_;  // per image: classes
  std::vector<float> weights_;                  // of all pairs; empty: too many images
};

// Maximum likelihood of logistic regression by Newton's method, with a weak pull to 0.
FeatureVector FitLogistic(const std::vector<FeatureVector>& rows, const std::vector<char>& seen) {
  FeatureVector weights = FeatureVector::Zero();
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix<double, kNumMatchFeatures, kNumMatchFeatures> hessian =
        Eigen::Matrix<double, kNumMatchFeatures, kNumMatchFeatures>::Identity();
    FeatureVector gradient = -weights;
    for (size_t i = 0; i < rows.size(); ++i) {
      const double p = 1 / (1 + std::exp(-weights.dot(rows[i])));
      gradient += ((seen[i] ? 1.0 : 0.0) - p) * rows[i];
      hessian += p * (1 - p) * rows[i] * rows[i].transpose();
    }
    const FeatureVector step = hessian.ldlt().solve(gradient);
    weights += step;
    if (step.cwiseAbs().maxCoeff() < 1e-8) break;
  }
  return weights;
}

double Probability(const FeatureVector& weights, const FeatureVector& features) {
  return 1 / (1 + std::exp(-weights.dot(features)));
}

}  // namespace

class MatchModel::Impl {
 public:
  Impl(const Classes& classes, const ViewOptions& options, int num_threads)
      : classes_(classes), learner_(classes, options, num_threads), lookers_(classes.classes.size()) {
    const auto num_classes = static_cast<int64_t>(lookers_.size());
    ParallelForRuns(static_cast<int64_t>(lookers_.size()), kClassesAtOnce, num_threads,
                    [&](int64_t first, int64_t last) {
                      std::vector<char> is_candidate(classes.images.size(), 0);
                      for (int64_t i = first; i < last; ++i)
                        lookers_[i] = learner_.LookersOf(i, &is_candidate);
                    });
    int64_t num_looking = 0, num_seen = 0;
    for (int64_t i = 0; i < num_classes; ++i) {
      num_looking += static_cast<int64_t>(lookers_[i].images.size());
      num_seen += static_cast<int64_t>(learner_.seen_by(i).size());
    }
    if (num_looking == 0) return;
    prior_ = static_cast<double>(num_seen) / static_cast<double>(num_looking);

    const int64_t step = std::max<int64_t>(1, num_looking / kMaxNumPairs);
    if (learner_.evidence().HasSeveral()) learner_.LearnEvidence(lookers_, step);
    std::vector<std::vector<std::pair<FeatureVector, char>>> learnt(num_classes);
    ParallelFor((num_classes + step - 1) / step, num_threads, [&](int64_t n) {
      const int64_t i = n * step;
      for (size_t j = 0; j < lookers_[i].images.size(); ++j) {
        FeatureVector features;
        if (learner_.CouldSee(lookers_[i], j) < kLeastPresence) continue;
        if (learner_.DescribeAtImage(i, lookers_[i], j, prior_, Learner::Sights::kOfOtherViews, &features))
          learnt[i].emplace_back(features, j < lookers_[i].seen_from.size());
      }
    });
    std::vector<FeatureVector> rows;
    std::vector<char> seen;
    for (const auto& list : learnt) {
      for (const auto& [features, is_seen] : list) rows.push_back(features), seen.push_back(is_seen);
    }
    num_learnt_from_ = static_cast<int64_t>(rows.size());
    weights_ = FitLogistic(rows, seen);
  }

  ExpectedMatches OfViews(int num_threads) const {
    ExpectedMatches matches;
    std::vector<int32_t> all(classes_.images.size());
    std::iota(all.begin(), all.end(), 0);
    matches.views = ImagesApart(distance(), all, kViewSpacing);
    matches.depth = learner_.distance().depth();
    matches.num_learnt_from = num_learnt_from_;
    for (int f = 0; f < kNumMatchFeatures; ++f) matches.weights[f] = weights_[f];
    matches.of_class.resize(lookers_.size());
    std::vector<int32_t> view_of_image(classes_.images.size(), -1);
    for (size_t view = 0; view < matches.views.size(); ++view)
      view_of_image[matches.views[view]] = static_cast<int32_t>(view);
    ParallelFor(static_cast<int64_t>(lookers_.size()), num_threads, [&](int64_t i) {
      for (size_t j = 0; j < lookers_[i].images.size(); ++j) {
        FeatureVector features;
        const int32_t view = view_of_image[lookers_[i].images[j]];
        if (view < 0 ||
            !learner_.DescribeAtImage(i, lookers_[i], j, prior_, Learner::Sights::kFromNearby, &features))
          continue;
        matches.of_class[i].push_back({view, FoundAgain(i, features)});
      }
    });
    return matches;
  }

  std::vector<std::vector<ClassMatch>> At(const std::vector<Look>& looks, Where where,
                                          int num_threads) const {
    std::vector<std::vector<ClassMatch>> matches(looks.size());
    ParallelForRuns(static_cast<int64_t>(looks.size()), kLooksAtOnce, num_threads,
                    [&](int64_t first, int64_t last) {
                      std::vector<double> weights(classes_.images.size(), kUnknown);
                      for (int64_t n = first; n < last; ++n) matches[n] = AtOne(looks[n], where, &weights);
                    });
    return matches;
  }

  const ViewDistance& distance() const { return learner_.distance(); }
  const SessionEvidence& evidence() const { return learner_.evidence(); }

 private:
  static constexpr double kUnknown = -1;

  // `weights`: per image kUnknown, before and after; it is used.
  std::vector<ClassMatch> AtOne(const Look& look, Where where, std::vector<double>* weights) const {
    std::vector<uint32_t> candidates;
    for (const int32_t image : distance().tree().Nearest(look.cam_from_world, kMaxNumNearest))
      candidates.insert(candidates.end(), learner_.seen_in(image).begin(), learner_.seen_in(image).end());
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());

    const Eigen::Vector3d center = look.cam_from_world.Center();
    const auto which = where == Where::kThere ? Learner::Sights::kFromThere : Learner::Sights::kFromNearby;
    std::vector<int32_t> weighed;
    const auto weight_of = [&](int32_t image) {
      double& weight = (*weights)[image];
      if (weight == kUnknown) {
        weight = WeightAt(distance().tree().SquaredFrom(look.cam_from_world.rotation, center, image));
        weighed.push_back(image);
      }
      return weight;
    };
    std::vector<ClassMatch> matches;
    for (const uint32_t i : candidates) {
      if (!IsInView(*look.camera, look.cam_from_world, classes_.classes[i].position)) continue;
      FeatureVector features;
      if (learner_.Describe(lookers_[i], learner_.DirectionTo(i, center), look.session, prior_, which,
                            weight_of, &features))
        matches.push_back({i, FoundAgain(i, features)});
    }
    for (const int32_t image : weighed) (*weights)[image] = kUnknown;
    return {matches.begin(), matches.end()};  // without the room of more
  }

  // What is gone is found by nobody.
  float FoundAgain(size_t i, const FeatureVector& features) const {
    return classes_.classes[i].age.presence * static_cast<float>(Probability(weights_, features));
  }

  const Classes& classes_;
  Learner learner_;
  std::vector<Learner::Lookers> lookers_;  // per class
  double prior_ = 0;                       // share of those that look at a class which see it
  FeatureVector weights_ = FeatureVector::Zero();
  int64_t num_learnt_from_ = 0;
};

MatchModel::MatchModel(const Classes& classes, const ViewOptions& options, int num_threads)
    : impl_(std::make_unique<Impl>(classes, options, num_threads)) {}
MatchModel::~MatchModel() = default;
MatchModel::MatchModel(MatchModel&&) noexcept = default;
MatchModel& MatchModel::operator=(MatchModel&&) noexcept = default;

ExpectedMatches MatchModel::OfViews(int num_threads) const { return impl_->OfViews(num_threads); }

std::vector<std::vector<ClassMatch>> MatchModel::At(const std::vector<Look>& looks, Where where,
                                                    int num_threads) const {
  return impl_->At(looks, where, num_threads);
}

const ViewDistance& MatchModel::distance() const { return impl_->distance(); }

const SessionEvidence& MatchModel::evidence() const { return impl_->evidence(); }

ExpectedMatches LearnMatches(const Classes& classes, const ViewOptions& options, int num_threads) {
  return MatchModel(classes, options, num_threads).OfViews(num_threads);
}

}  // namespace cairn
