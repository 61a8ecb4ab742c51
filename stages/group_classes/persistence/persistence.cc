#include "stages/group_classes/persistence/persistence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/base/parallel.h"
#include "core/structure/points.h"
#include "stages/group_classes/persistence/changes.h"
#include "stages/group_classes/persistence/sightings.h"
#include "stages/group_classes/persistence/surroundings.h"

namespace cairn::group_classes {
namespace {

constexpr int kNumIterations = 10;
// Before anything is seen of a session: the share of classes that is there.
constexpr double kInitialThereRatio = 0.8;
// Shapes of the gamma distribution, and shares of spoilt classes, that are tried.
constexpr std::array<double, 7> kGammaShapes = {0.3, 0.6, 1.2, 2.5, 5, 10, 20};
constexpr double kSpoiltStep = 0.02;
constexpr int kNumSpoiltSteps = 41;
// A class that is gone is seen all the same, by wrong matches, with this probability; twice with its square.
constexpr double kFalseSighting = 0.02;
// An image's yield is drawn to its session's by this many expected sightings.
constexpr double kYieldPrior = 20;
constexpr double kMaxYield = 1.5;
// An image that sees as many classes as its session's on the median is not blind: it has at least this part
// of their yield, or a room of which everything was exchanged would be one where nobody can see.
constexpr double kMinYieldRatio = 0.5;
// What the neighbours of a class say: those within this part of the distance from which classes are seen on
// the median, at most so many, the nearest ones, weighted by a Gaussian that falls to e^-2 at the farthest.
// They are not independent: however many they are they count as so many.  What one of them says is bounded,
// or a wrong match would outweigh all that is missed around it.
constexpr double kNeighbourRadius = 0.15;
constexpr size_t kMaxNumNeighbours = 80;
// Mostly there are as many within this part of the radius: then none is looked for beyond it.
constexpr double kNearRatio = 0.5;
constexpr double kNumIndependent = 10;
constexpr double kMaxLogRatio = 3;
// Then they say again what each thinks by now, in so many rounds: so the edge of what is gone comes to lie
// where it is, and not where a sighting, which says more than a miss, pushes it.  A vote grows with the
// square of its logarithm of odds up to that of the sure: kNumIndependent who agree make themselves surer
// beyond 3.2, below less sure, so that weak evidence is not amplified by being repeated.
constexpr int kNumRounds = 2;
constexpr double kSure = 8;
constexpr double kMaxVote = 2;
constexpr double kMaxPrior = 0.999, kMinPrior = 0.001;

// One class that one session could have seen.
struct Known {
  int class_idx = 0;
  std::vector<std::pair<int, float>> views;  // image, visibility
  int num_seen = 0;
  double expected = 0;  // with the yields of the images
  double there = kInitialThereRatio;
  double prior = kInitialThereRatio;  // what its neighbours say
  double likelihood_ratio = 1;        // of being there to being gone
};

// How classes that are there are missed.
struct MissModel {
  double shape = 1;   // of the gamma distribution
  double spoilt = 0;  // share of classes that no image of this session can see, whatever is expected
};

double MissedProbability(double expected, const MissModel& model) {
  return model.spoilt + (1 - model.spoilt) * std::pow(1 + expected / model.shape, -model.shape);
}

// Likelihoods of what was seen of a class, up to a common factor.
struct Likelihoods {
  double there = 1, gone = 1;
};
Likelihoods LikelihoodsOf(const Known& known, const MissModel& model) {
  const double missed = MissedProbability(known.expected, model);
  if (known.num_seen == 0) return {missed, 1};
  return {1 - missed, std::pow(kFalseSighting, std::min(known.num_seen, 3))};
}

double ProbabilityOf(double likelihood_ratio, double prior) {
  return prior * likelihood_ratio / (prior * likelihood_ratio + 1 - prior);
}

double VoteOf(double log_odds) {
  const double part = std::clamp(log_odds / kSure, -1.0, 1.0);
  return kMaxVote * part * std::abs(part);
}

// The mixture of one session.
class SessionMixture {
 public:
  SessionMixture(const Classes& classes, const Surroundings& surroundings, int session, double radius,
                 int num_threads)
      : classes_(classes),
        surroundings_(surroundings),
        session_(session),
        yields_(classes.images.size(), 1),
        radius_(radius),
        num_threads_(num_threads) {}

  void Add(int class_idx, const ClassViews& views, const ImageSessions& images) {
    Known known{.class_idx = class_idx};
    double sum = 0;
    for (const ExpectedView& view : views) {
      if (images.session[view.image] != session_) continue;
      known.num_seen += view.seen ? 1 : 0;
      if (view.visibility > 0) known.views.emplace_back(view.image, view.visibility);
      if (view.visibility > 0 && view.seen) seen_views_.emplace_back(known_.size(), view.image);
      sum += view.visibility;
    }
    if (sum > 0) known_.push_back(std::move(known));
  }

  // A class that this session is the first to see, and what earlier ones say of it (a likelihood ratio, of
  // having been there to not): where it is new, what was there may be gone.
  void AddNew(int class_idx, double likelihood_ratio) { new_.emplace_back(class_idx, likelihood_ratio); }

  SessionPersistence Solve() {
    SessionPersistence findings{.num_known = static_cast<int64_t>(known_.size())};
    std::vector<int> indices;
    for (const Known& known : known_) indices.push_back(known.class_idx);
    for (const auto& [class_idx, likelihood_ratio] : new_) indices.push_back(class_idx);
    for (const int i : indices) {
      points_.push_back(classes_.classes[i].position);
      sides_.push_back(surroundings_.sides[i]);
    }
    FindNeighbours();
    double ratio = kInitialThereRatio;
    for (int iteration = 0; iteration < kNumIterations && !known_.empty(); ++iteration) {
      findings.yield = EstimateYields();
      Expect();
      EstimateMisses();
      for (Known& known : known_) {
        const Likelihoods likelihoods = LikelihoodsOf(known, model_);
        known.likelihood_ratio = likelihoods.there / likelihoods.gone;
      }
      AskNeighbours(ratio);
      double there = 0, evidence = 0;
      for (Known& known : known_) {
        known.there = ProbabilityOf(known.likelihood_ratio, known.prior);
        const double weight = EvidenceOf(known);
        there += weight * known.there;
        evidence += weight;
      }
      ratio = std::clamp(evidence > 0 ? there / evidence : ratio, kMinPrior, kMaxPrior);
    }
    findings.there_ratio = known_.empty() ? 1 : ratio;
    for (const Known& known : known_) findings.num_seen += known.num_seen > 0 ? 1 : 0;
    return findings;
  }

  const std::vector<Known>& known() const { return known_; }

 private:
  double EvidenceOf(const Known& known) const {
    return known.num_seen > 0 ? 1 : 1 - MissedProbability(known.expected, model_);
  }

  // Each image's, and the session's.
  double EstimateYields() {
    std::vector<double> expected(yields_.size(), 0), seen(yields_.size(), 0);
    for (const Known& known : known_) {
      for (const auto& [image, visibility] : known.views) expected[image] += known.there * visibility;
    }
    for (const auto& [k, image] : seen_views_) seen[image] += known_[k].there;
    double all_expected = 0, all_seen = 0;
    for (size_t i = 0; i < yields_.size(); ++i) {
      all_expected += expected[i];
      all_seen += seen[i];
    }
    const double yield = std::min(all_expected > 0 ? all_seen / all_expected : 0, kMaxYield);
    for (size_t i = 0; i < yields_.size(); ++i) {
      const double least = kMinYieldRatio * surroundings_.sight_ratio[i] * yield;
      yields_[i] =
          std::clamp((seen[i] + kYieldPrior * yield) / (expected[i] + kYieldPrior), least, kMaxYield);
    }
    return yield;
  }

  void Expect() {
    for (Known& known : known_) {
      known.expected = 0;
      for (const auto& [image, visibility] : known.views) known.expected += yields_[image] * visibility;
    }
  }

  // The most likely model of what is there; what is expected is counted in bins of 5 %.
  void EstimateMisses() {
    constexpr double kBin = 0.05, kSmallest = 1e-3;
    struct Bin {
      double seen = 0, missed = 0;
    };
    std::map<int, Bin> bins;
    for (const Known& known : known_) {
      Bin& bin = bins[static_cast<int>(std::floor(std::log(std::max(known.expected, kSmallest)) / kBin))];
      (known.num_seen > 0 ? bin.seen : bin.missed) += known.there;
    }
    double best = -1e300;
    for (const double shape : kGammaShapes) {
      for (int step = 0; step < kNumSpoiltSteps; ++step) {
        const MissModel model{shape, kSpoiltStep * step};
        double sum = 0;
        for (const auto& [number, bin] : bins) {
          const double missed = MissedProbability(std::exp(kBin * (number + 0.5)), model);
          sum += bin.seen * std::log(1 - missed) + bin.missed * std::log(missed);
        }
        if (sum > best) {
          best = sum;
          model_ = model;
        }
      }
    }
  }

  struct Neighbour {
    int32_t point = 0;
    float weight = 0;
  };

  // Of each point.
  void FindNeighbours() {
    const PointGrid grid(points_, radius_), near_grid(points_, kNearRatio * radius_);
    neighbours_.resize(points_.size());
    ForPoints([&](int64_t k) {
      std::vector<std::pair<double, int>> near;
      const auto add = [&](int other, double distance) {
        if (other != k && sides_[k].dot(sides_[other]) > kMinSideCosine)
          near.emplace_back(distance * distance, other);
      };
      near_grid.ForNear(points_[k], add);
      if (near.size() < kMaxNumNeighbours) {
        near.clear();
        grid.ForNear(points_[k], add);
      }
      if (near.size() > kMaxNumNeighbours) {
        std::nth_element(near.begin(), near.begin() + kMaxNumNeighbours, near.end());
        near.resize(kMaxNumNeighbours);
      }
      std::sort(near.begin(), near.end());
      double farthest = 1e-12 * radius_ * radius_, weights = 0;
      if (!near.empty()) farthest = std::max(farthest, near.back().first);
      const auto weight_of = [&](double squared) { return std::exp(-2 * squared / farthest); };
      for (const auto& [squared, other] : near) weights += weight_of(squared);
      const double independent = std::min(1.0, kNumIndependent / std::max(weights, 1e-12));
      for (const auto& [squared, other] : near)
        neighbours_[k].push_back({other, static_cast<float>(independent * weight_of(squared))});
    });
  }

  // What the neighbours of each point say, of `votes` per point.
  std::vector<double> Smooth(const std::vector<double>& votes) const {
    std::vector<double> smooth(points_.size());
    ForPoints([&](int64_t k) {
      for (const Neighbour& neighbour : neighbours_[k])
        smooth[k] += neighbour.weight * votes[neighbour.point];
    });
    return smooth;
  }

  template <typename Body>
  void ForPoints(const Body& body) const {
    constexpr int64_t kBlock = 512;
    const auto num = static_cast<int64_t>(points_.size());
    ParallelFor((num + kBlock - 1) / kBlock, num_threads_, [&](int64_t block) {
      for (int64_t k = block * kBlock; k < std::min(num, (block + 1) * kBlock); ++k) body(k);
    });
  }

  void AskNeighbours(double ratio) {
    std::vector<double> own(known_.size());
    for (size_t k = 0; k < known_.size(); ++k)
      own[k] = std::clamp(std::log(known_[k].likelihood_ratio), -kMaxLogRatio, kMaxLogRatio);
    for (const auto& [class_idx, likelihood_ratio] : new_)
      own.push_back(std::clamp(std::log(likelihood_ratio), -kMaxLogRatio, 0.0));
    std::vector<double> said = Smooth(own);
    for (int round = 0; round < kNumRounds; ++round) {
      std::vector<double> votes(own.size());
      for (size_t k = 0; k < own.size(); ++k) votes[k] = VoteOf(own[k] + said[k]);
      said = Smooth(votes);
    }
    for (size_t k = 0; k < known_.size(); ++k)
      known_[k].prior = std::clamp(ProbabilityOf(std::exp(said[k]), ratio), kMinPrior, kMaxPrior);
  }

  const Classes& classes_;
  const Surroundings& surroundings_;
  const int session_;
  std::vector<Known> known_;
  std::vector<std::pair<size_t, int>> seen_views_;  // of known_; image
  std::vector<std::pair<int, double>> new_;
  std::vector<Eigen::Vector3d> points_, sides_;  // of known_, then of new_
  std::vector<std::vector<Neighbour>> neighbours_;
  std::vector<double> yields_;
  MissModel model_;
  const double radius_;
  const int num_threads_;
};

}  // namespace

OptionTable DescribeOptions(PersistenceOptions* o) {
  return {
      {.name = "min_presence",
       .value = &o->min_presence,
       .help =
           "least probability that a class is still there, for it to stay; of several captures only; 0: all "
           "stay",
       .min = 0,
       .max = 1}};
}

Persistence EstimatePersistence(const Classes& classes, const ImageSessions& images, int num_sessions,
                                int num_threads) {
  const std::vector<ClassViews> views = FindExpectedViews(classes, images, num_threads);
  Persistence persistence;
  persistence.ages.resize(classes.classes.size());
  for (size_t c = 0; c < views.size(); ++c) {
    persistence.ages[c].sessions.resize(num_sessions);
    for (const ExpectedView& view : views[c]) {
      if (view.seen) ++persistence.ages[c].sessions[images.session[view.image]].num_seen;
    }
  }
  const Surroundings surroundings = SurroundingsOf(classes, images);
  const double radius = kNeighbourRadius * surroundings.typical_distance;
  // Of the sessions since a class was last seen: what they say together, and the last prior.
  std::vector<double> likelihood_ratio(classes.classes.size(), 1);
  std::vector<int> first_seen(classes.classes.size(), -1), last_seen(classes.classes.size(), -1);
  // Of the sessions before it was first seen: what they say together.
  std::vector<double> earlier_ratio(classes.classes.size(), 1);
  for (size_t c = 0; c < views.size(); ++c) {
    for (int session = 0; session < num_sessions; ++session) {
      if (persistence.ages[c].sessions[session].num_seen == 0) continue;
      if (first_seen[c] < 0) first_seen[c] = session;
      last_seen[c] = session;
    }
  }
  for (int session = 0; session < num_sessions; ++session) {
    SessionMixture mixture(classes, surroundings, session, radius, num_threads);
    for (size_t c = 0; c < views.size(); ++c) mixture.Add(static_cast<int>(c), views[c], images);
    for (size_t c = 0; c < views.size(); ++c) {
      if (first_seen[c] == session && session > 0) mixture.AddNew(static_cast<int>(c), earlier_ratio[c]);
    }
    persistence.sessions.push_back(mixture.Solve());
    for (const Known& known : mixture.known()) {
      SessionSightings& sightings = persistence.ages[known.class_idx].sessions[session];
      sightings.expected = static_cast<float>(known.expected);
      sightings.there = static_cast<float>(known.there);
      if (session < first_seen[known.class_idx]) earlier_ratio[known.class_idx] *= known.likelihood_ratio;
      if (session <= last_seen[known.class_idx]) continue;
      likelihood_ratio[known.class_idx] *= known.likelihood_ratio;
      persistence.ages[known.class_idx].presence =
          static_cast<float>(ProbabilityOf(likelihood_ratio[known.class_idx], known.prior));
    }
  }
  persistence.changes = FindChanges(classes, persistence.ages, views, images, surroundings);
  return persistence;
}

}  // namespace cairn::group_classes
