#pragma once

#include <vector>

#include "core/options/options.h"
#include "core/world/feature_class.h"
#include "stages/group_classes/persistence/surroundings.h"

namespace cairn::group_classes {

// Which classes are still there.  A place is surveyed in several sessions, in the order of time; of each
// class it is known how often a session's images could have seen it (sightings.h) and how often they did.  In
// the manner of the persistence filter [Rosen, Mason & Leonard, "Towards lifelong feature-based mapping in
// semi-static environments", ICRA 2016]: P(there now | sightings), with misses of the detector modelled apart
// from disappearance.  Differs from it:
//   - time is counted in sessions, and how many classes vanish between two of them is learnt from them;
//   - the probability of detection is not one number.  It is how readily near images of other sessions saw
//     the class, times the yield of each image (darkness, blur, another camera), times a factor of the class
//     in this session of gamma distribution; and some classes the session's light spoils altogether.  A class
//     of which E views are expected is missed by all with s + (1 - s) (1 + E / k)^-k; s and k are learnt;
//   - things vanish as a whole: the prior of a class is what its neighbours on the same surface say, those
//     that the session sees again, those that it misses, and those that it is the first to see.
// One mixture per session, solved by expectation maximisation.
struct PersistenceOptions {
  // Classes that are there now with less than this probability leave the map; 0 keeps all.
  // REQUIRES: in [0, 1]
  double min_presence = 0.5;
};
OptionTable DescribeOptions(PersistenceOptions* options);

struct SessionPersistence {
  int64_t num_known = 0;   // classes of other sessions that this one could have seen
  int64_t num_seen = 0;    // and saw
  double yield = 0;        // how readily its images see what is there, as part of the other sessions'
  double there_ratio = 1;  // share of the classes that are there, of those that it could have seen
};

struct Persistence {
  std::vector<ClassAge> ages;  // per class
  std::vector<SessionPersistence> sessions;
  std::vector<PlaceChange> changes;  // changes.h
};

// `num_sessions` at least 2; sessions are in the order of time.  Pure; the same for any number of threads.
Persistence EstimatePersistence(const Classes& classes, const ImageSessions& images, int num_sessions,
                                int num_threads);

}  // namespace cairn::group_classes
