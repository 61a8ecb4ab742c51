#pragma once

#include <memory>
#include <vector>

#include "core/document_scores.h"
#include "core/error.h"
#include "core/options.h"
#include "runtime/map.h"

namespace cairn {

struct PlaceModelOptions {
  // Of ProbabilitiesOfScores.  REQUIRES: > 0
  double score_exponent = kScoreExponent;
};
OptionTable DescribeOptions(PlaceModelOptions* options);

// What an image says about where it was taken, before anything is matched: of the nodes of the appearance
// graph.
struct PlaceScores {
  std::vector<double> scores;  // per node: the best of its images', in [0, 1]; zeros: nothing is shared
  std::vector<double>
      probabilities;  // p(X = node | image) [Mariottini11 §IV]: sums to 1, all alike for zeros
};

// Scores images against the places of a map by its visual words [Mariottini11 §IV].  Holds the whole
// vocabulary and its inverted files: unlike a Localizer it looks at all of the map for every image.
// Immutable, shareable between threads.
class PlaceModel {
 public:
  // Errors: NotFound (a map without appearance graph or without words: says how to get one), InvalidArgument
  // (an option), Corrupt.
  static Result<PlaceModel> Make(const Map& map, const PlaceModelOptions& options = {});

  int num_nodes() const { return static_cast<int>(appearance_->is_kept.size()); }
  const AppearanceMap& appearance() const { return *appearance_; }

  // Of an image's descriptors (n x 128); none: nothing is known.  Touches shared words only.
  PlaceScores Look(const DescriptorMatrix& descriptors) const;
  // h' = p(X | Z of a node) [Mariottini11 eq. 7]: what a robot at the node expects to get, the mean over its
  // images.
  std::vector<double> Expected(NodeIdx node) const;

 private:
  PlaceModel() = default;
  PlaceScores Score(const BagOfWords& bag) const;

  std::shared_ptr<const AppearanceMap> appearance_;
  Vocabulary vocabulary_;  // documents: the map's images, by index
  std::vector<BagOfWords> bags_;
  PlaceModelOptions options_;
};

}  // namespace cairn
