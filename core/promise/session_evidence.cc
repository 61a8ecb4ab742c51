#include "core/promise/session_evidence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/capture/sessions.h"

namespace cairn {
namespace {

// Two sessions agree as any two do, until so many pairs of their images say otherwise.
constexpr double kPriorPairs = 100;
// Any session tells a little.
constexpr double kLeastWeight = 0.02;
constexpr double kMaxSquaredCorrelation = 0.99;

}  // namespace

SessionEvidence::SessionEvidence(const Classes& classes)
    : classes_(classes), num_sessions_(classes.sessions.size()) {
  for (const SurveyImage& image : classes.images)
    session_of_.push_back(HasSeveral() ? SessionOfImage(classes.sessions, image.name) : -1);
  if (HasSeveral()) counts_.resize(num_sessions_ * num_sessions_);
}

double SessionEvidence::There(size_t i, int32_t image) const {
  const std::vector<SessionSightings>& sessions = classes_.classes[i].age.sessions;
  const int session = session_of_[image];
  return session < 0 || static_cast<size_t>(session) >= sessions.size() ? 1 : sessions[session].there;
}

void SessionEvidence::Count(Look a, Look b, double weight) {
  if (a.session < 0 || b.session < 0) return;
  if (a.session > b.session) std::swap(a, b);
  Agreement& agreement = counts_[Pair(a.session, b.session)];
  (a.sees   ? b.sees ? agreement.both : agreement.earlier
   : b.sees ? agreement.later
            : agreement.none) += weight;
}

void SessionEvidence::Agreement::Add(const Agreement& other, double factor) {
  both += factor * other.both;
  earlier += factor * other.earlier;
  later += factor * other.later;
  none += factor * other.none;
}

double SessionEvidence::Agreement::Told() const {
  const double variances = (both + earlier) * (later + none) * (both + later) * (earlier + none);
  if (!(variances > 0)) return 0;
  const double correlation = std::max(0.0, both * none - earlier * later) / std::sqrt(variances);
  const double squared = std::min(correlation * correlation, kMaxSquaredCorrelation);
  return squared / (1 - squared);
}

void SessionEvidence::Learn() {
  if (!HasSeveral()) return;
  const int num_sessions = static_cast<int>(num_sessions_);
  Agreement same, different;
  for (int s = 0; s < num_sessions; ++s) {
    for (int t = s; t < num_sessions; ++t) (s == t ? same : different).Add(counts_[Pair(s, t)], 1);
  }
  if (!(same.Told() > 0) || !(different.Total() > 0)) return;
  weights_.assign(counts_.size(), 1);
  for (int s = 0; s < num_sessions; ++s) {
    for (int t = s + 1; t < num_sessions; ++t) {
      Agreement pair = counts_[Pair(s, t)];
      pair.Add(different, kPriorPairs / different.Total());
      weights_[Pair(s, t)] = weights_[Pair(t, s)] = std::clamp(pair.Told() / same.Told(), kLeastWeight, 1.0);
    }
  }
}

}  // namespace cairn
