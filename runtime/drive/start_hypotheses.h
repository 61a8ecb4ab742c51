#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/drive/place_model.h"
#include "runtime/drive/route.h"

namespace cairn {

struct StartHypothesesOptions {
  // Nodes that score at least this part of the best score may be the start [Mariottini11 fn 4: a
  // percentage of the maximum, not given].  REQUIRES: in (0, 1]
  double min_score_ratio = 0.7;
  // Most starts that are considered, the best-scoring ones; the source has no limit.  REQUIRES: >= 1
  int max_num_hypotheses = 10;
  // Links that a robot may have passed between two images [Mariottini11 fn 5: 2].  Of candidates so near to
  // each other only the best one is a hypothesis: they are one place.  REQUIRES: >= 1
  int reach_links = 2;
  // Over which bins images are compared [Mariottini11 eq. 7: leaves it open]: "all" nodes, or those
  // "reachable" within reach_links by some hypothesis.
  std::string compared_nodes = "reachable";
  // For JeffreyDivergence, so that an empty bin proves nothing.  REQUIRES: in (0, 1]
  double uniform_ratio = 0.02;
  // Margin of posterior by which another start must lead before the robot turns back for
  // it.  REQUIRES: in [0, 1]
  double switch_margin = 0.1;
  // Whether it turns back at all; if not, the first choice is followed to its end.
  bool switching = true;
  // What it then does: "retrace" to the start over the images it came by, and follow that hypothesis's way
  // [Mariottini11]; or "replan" from where it would be by now, which the source rejects.
  std::string on_switch = "retrace";
  // Which start is followed first: that of the least "entropy" of its way [Mariottini11], or of the
  // best "score".  With weights other than "entropy", that of the least cost; with "risk" ways and costs are
  // those of all starts together (joint_way.h).
  std::string first_choice = "entropy";
  // Ways are compared by their "total" cost [Mariottini11], or by the "mean" of their links, which does not
  // penalise long ones.
  std::string way_cost = "total";
  // Smallest probability, by an image, of the places within reach of some hypothesis; with less, the robot
  // was carried away.  0: not checked.  REQUIRES: in [0, 1]
  double min_reachable_ratio = 0.1;
  RouteOptions route{.weight = "entropy"};
};
OptionTable DescribeOptions(StartHypothesesOptions* options);

// Where the robot may have started, and the way from there.
struct StartHypothesis {
  NodeIdx start = 0;
  double score = 0;      // of the first image
  double posterior = 0;  // p(X_0 = start | Z_0 ... Z_T)
  NodePath path;         // from the start to the goal
};

// What to do after an image.
enum class HypothesisVerdict {
  kFollow,  // go on
  kSwitch,  // another start is followed from now on
  kLost,    // no hypothesis explains the image: localize again
};
// "follow", "switch", "lost".
const char* VerdictName(HypothesisVerdict verdict);

// Which of several places a lost robot started at, found out while it is under way to a goal [Mariottini11
// §VI]. Image by image, over nodes of the appearance graph:
//   p(X_0 | Z_0:T) ~ p(X_0 | Z_0) sum_{X_1} p(Z_1 | X_1) p(X_1 | X_0) ...        [Mariottini11 eq. 3-5]
// summed forward instead of backward, which gives the same; p(X_0 | Z_0) is uniform over the candidates, p(X'
// | X) over the nodes within reach, X itself among them.
//   p(Z | X) = exp(-J^2 / 2) / sqrt(2 pi),  J = D(h || h') + D(h' || h)          [Mariottini11 eq. 6-8]
// of what the image says, h, and what an image at X would, h'.
class StartHypotheses {
 public:
  // From the first image.  Shares the model, which need not be kept.  Errors: InvalidArgument (an option, no
  // such goal), NoData (the first image shares nothing with the map; nothing is said about the scores),
  // NotFound (no way leads from any candidate to the goal; RouteOptions).
  static Result<StartHypotheses> Make(const PlaceModel& model, const PlaceScores& first, NodeIdx goal,
                                      const StartHypothesesOptions& options = {});

  // An image at the next node of the way.  REQUIRES: as many probabilities as the model has nodes
  HypothesisVerdict Observe(const PlaceScores& image);
  // The robot does not see what the next image of the followed way shows, so it did not start there.  Follows
  // the likeliest other start; false where there is none.
  bool Refute();
  // The robot is back at its start: what it has learnt about starts is kept.
  void Restart();

  const std::vector<StartHypothesis>& hypotheses() const { return hypotheses_; }  // best score first
  int followed() const { return followed_; }                                      // index of the one
  int num_images() const { return num_images_; }  // T: since the first one, or the last Restart()
  // Where the robot most likely is by now if it started there.
  NodeIdx Whereabouts(int hypothesis) const;
  // From there to the goal; nothing where no way leads.
  std::optional<NodePath> Replan(int hypothesis) const;

 private:
  StartHypotheses(const PlaceModel& model, NodeIdx goal, const StartHypothesesOptions& options)
      : model_(model), goal_(goal), options_(options) {}
  using Belief = std::map<NodeIdx, double>;  // sums to the hypothesis's posterior
  // Plans the hypotheses' ways where starts are planned for together.  Per hypothesis what following it first
  // costs.
  std::vector<double> PlanWays();
  const std::vector<NodeIdx>& Reach(NodeIdx node);
  // `seen`: an image's probabilities of `bins`; without bins, of all nodes.
  double LogLikelihood(const std::vector<double>& seen, NodeIdx node, const std::vector<NodeIdx>& bins);
  Belief Predict(const Belief& belief);
  void Normalise();

  PlaceModel model_;
  NodeIdx goal_;
  StartHypothesesOptions options_;
  std::vector<StartHypothesis> hypotheses_;
  std::vector<Belief> beliefs_;
  int followed_ = 0;
  int num_images_ = 0;
  std::map<NodeIdx, std::vector<NodeIdx>> reach_;    // found so far
  std::map<NodeIdx, std::vector<double>> expected_;  // computed so far
};

}  // namespace cairn
