#pragma once

#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/features/features.h"
#include "core/geometry/pose.h"
#include "core/options/options.h"
#include "core/vocabulary/rerank_places.h"

namespace cairn {

class Map;             // runtime/map/map.h
struct Query;          // runtime/localize/measurement.h
struct AppearanceMap;  // runtime/map/appearance_map.h

struct PlaceModelOptions {
  // p_j = s_j^score_exponent / sum_k s_k^score_exponent, that of the map's own entropies
  // (kScoreExponent in core/vocabulary/document_scores.h says why).  REQUIRES: > 0
  double score_exponent = 4;
};
OptionTable DescribeOptions(PlaceModelOptions* options);

// What an image says about where it was taken, before anything is matched, as scores of the nodes of the
// appearance graph.
struct PlaceScores {
  std::vector<double> scores;  // per node: the best of its images' scores, in [0, 1]; all 0: no shared words
  std::vector<double>
      probabilities;  // p(X = node | image) [Mariottini11 §IV]: sums to 1; all equal where all scores are 0
};

// What geometric verification reads of a survey image: the landmarks in it, with their directions and
// descriptors.  Errors: as Map::Landmarks.
Result<PlaceView> ViewOfImage(const Map& map, int32_t image);

// Scores images against the places of a map by its visual words [Mariottini11 §IV].  Holds the whole
// vocabulary and its inverted files: unlike a Localizer it uses the whole map for every image.  Immutable,
// shareable between threads; a copy shares all of it, and the map may be closed.
class PlaceModel {
 public:
  // Errors: NotFound (a map without appearance graph or without words: says how to get one), InvalidArgument
  // (an option), Corrupt.
  static Result<PlaceModel> Make(const Map& map, const PlaceModelOptions& options = {});

  int num_nodes() const;
  const AppearanceMap& appearance() const;
  // Of the places, as NodePoses of the map (runtime/drive/route.h).
  const std::vector<Pose>& node_poses() const;
  // The node of a survey image, by its index; -1: in no node, or no such image.
  NodeIdx NodeOfImage(int32_t image) const;
  // The survey images of a place, ascending, at least one.  REQUIRES: a node
  const std::vector<int32_t>& ImagesOfNode(NodeIdx node) const;

  // Scores an image by its descriptors (n x 128); without any, nothing is known.  Reads shared words only.
  PlaceScores Look(const DescriptorMatrix& descriptors) const;
  // A closer look, for a robot that stands still because it is lost: the images that score best by their
  // words are verified (core/vocabulary/rerank_places.h), and the verified ones get that score instead, the
  // others 0.  Where none is verified, the same as Look.  Costs one matching of descriptors for each of them.
  // `map`: the map that the model was made from, best with all landmarks.  Errors: InvalidArgument (an
  // option), and as Map::Landmarks.  No exception leaves it.
  Result<PlaceScores> LookCloser(const Map& map, const Query& query, const RerankOptions& options = {}) const;
  // h' = p(X | Z of a node) [Mariottini11 eq. 6]: what a robot at the node expects to get, the mean over
  // its images.  REQUIRES: a node
  std::vector<double> Expected(NodeIdx node) const;

 private:
  struct Impl;
  explicit PlaceModel(std::shared_ptr<const Impl> impl);

  std::shared_ptr<const Impl> impl_;
};

}  // namespace cairn
