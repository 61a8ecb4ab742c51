#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/options/options.h"
#include "core/plan/views.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/appearance.h"
#include "core/world/decomposition.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "stages/emit_map/choose/make_promises.h"
#include "stages/emit_map/previous/match_previous.h"

namespace cairn::emit_map {

// Puts together what a robot needs to localize: the landmarks that the regions keep, the regions and survey
// images in which each of them is seen, and the visual words that lead from a view to survey images.  Before:
// group_classes, filter_visibility, decompose_regions, build_vocabulary.  After: check_map.  A landmark is a
// feature class that a robot needs to be localized as if it had them all, or one that some region keeps
// ([Sala06 §III]).
struct EmitMapOptions {
  // "fewest": the fewest with which left-out survey images are localized as with all (ChooseFewest in
  // choose/fit_size.h); "regions": the classes that regions keep; "all": every class.
  std::string landmarks = "fewest";
  // Most bytes of the sealed map, 0: no limit.  Of the classes that could become landmarks ("fewest": of
  // all), the map keeps those with which left-out survey images are localized best (choose/fit_size.h).
  // REQUIRES: >= 0
  int max_bytes = 0;
  // A left-out image counts as localized within this distance of its place, metres (the map's units where
  // they are arbitrary), and this angle of its rotation, degrees.  REQUIRES: > 0
  double left_out_max_error_m = 0.1;
  double left_out_max_error_deg = 5;
  // "fewest": of the left-out images that all landmarks localize, the part that must stay localized, and the
  // largest growth of their errors, a geometric mean.  REQUIRES: in [0, 1]; >= 1
  double min_recall_ratio = 0.99;
  double max_error_ratio = 1.1;
  // Errors below this part of left_out_max_error_m count as it: no landmarks are spent on what no robot
  // notices.  REQUIRES: in (0, 1]
  double least_error_ratio = 0.01;
  // What maps promise whose landmarks are chosen by trial, at every place and heading of the survey: that
  // with this probability, so many landmarks are matched and the pose is within the limits above
  // (core/promise). REQUIRES: >= 1; in (0, 1)
  int promise_matches = 10;
  double promise_probability = 0.95;
  // Most landmarks of a region of such a map; more where one place needs them.  REQUIRES: >= 1
  int max_region_landmarks = 500;
  // Bits in which a value of a landmark's descriptor is stored; 8: unchanged.  "fewest" and max_bytes take
  // fewer where that serves them.  REQUIRES: in [1, 8]
  int descriptor_bits = 5;
  // How they are stored: by levels of the values, "levels"; by levels of a transform's coefficients, packed
  // together with all else of landmarks, "transform" (core/features/transform_code.h), which takes less than
  // half as many bytes and is not read by programs before format 2.6; or, "auto", by a transform where
  // left-out images try the map: "fewest" and max_bytes.
  std::string descriptor_code = "auto";
  // A map with at least this many landmarks gets a vocabulary; in a smaller one every landmark is its own
  // word.  REQUIRES: >= 0
  int min_num_landmarks_for_words = 16384;
  // Most landmarks of a word that could be split, and most words.  REQUIRES: >= 1
  double landmarks_per_word = 40;
  int max_num_words = 65536;
  // What a word's inverted file counts: "landmarks" that an image sees, or, "survey", all features of survey
  // images [Mariottini11 §IV]: a larger map that recognises places better, for robots that localize
  // themselves without a fix (runtime/drive/place_model.h).
  std::string words = "landmarks";
  // Survey images that retrieval finds: "all", or "kept": those of the connected dominating set alone.
  std::string documents = "all";
  // Whether the map gets a model of how every landmark looks from different places, for localization without
  // 3-D points and calibration (runtime/visual_map/visual_map.h).
  bool visual_map = false;
  // Most sights that the models of a landmark store: 5 bytes each.  REQUIRES: in [16, 512]
  int max_num_sights = 96;
  // Models whose errors of left-out sights have a larger standard deviation are marked and count less, px.
  // REQUIRES: >= 0
  double bad_model_px = 20;
  // Whether a map with a floor plan has its view-invariant regions too, some 50 bytes each.  Without, it has
  // the walls alone: what locates scans by beams; the regions are derived where they are asked for.
  bool view_regions = false;
  // An earlier map of the same survey, which the new one differs from as little as what was added allows
  // (choose/choose_after.h, previous/settle_rows.h); empty: made anew.
  std::string previous;
};
OptionTable DescribeOptions(EmitMapOptions* options);

// Landmarks are ordered by the first region that has them (of no region: last), then by the first image that
// sees them, then by class: a region's landmarks lie together.  `vocabulary` is a tree over the survey's
// features, with its inverted files for words = "survey".  `appearance` may be null: the map then has no
// links between images.  Images of `appearance` that `classes` lacks are left out.  `keep`, where given,
// marks the classes that may be landmarks; a region then has all of them that can be seen from all of its
// stations.  `promises`, where given, replaces the decomposition's regions by its own.
// `previous`, where given, is an earlier map of the place, which this one is to differ from as little as what
// the survey now says allows (previous/settle_rows.h); where the descriptors of one have a code and those of
// the other none, its rows are not taken.  The result has no
// name, seed, options or hashes: those are the caller's.  Pure. O(observations).  Errors: InvalidArgument
// (inputs that do not belong together: a region's feature, a feature's class or a station's image does not
// exist; documents = "kept" without kept images; landmarks = "fewest" without `keep`: which these are is
// found by trials, choose/fit_size.h), NoData (no class is kept).
Result<MapRows> EmitMap(const Classes& classes, const World& world, const Decomposition& decomposition,
                        const Vocabulary& vocabulary, const EmitMapOptions& options,
                        const Appearance* appearance = nullptr, const std::vector<char>* keep = nullptr,
                        const Promises* promises = nullptr, const PreviousMap* previous = nullptr);

// Per class, whether a map may keep it: one of regions with landmarks = "regions", else every one.  Errors:
// as EmitMap.
Result<std::vector<char>> KeptClasses(const Classes& classes, const World& world,
                                      const Decomposition& decomposition, const EmitMapOptions& options);

// Puts where the place changed into a map that has its sessions already, to a thousandth of its unit.
// Changes of sessions that the map does not name, and those too far away to be landmarks, are left out.
void AddChanges(const Classes& classes, MapRows* rows);

// Puts a floor plan and its regions, floor frame, into a map.  Errors: InvalidArgument where the map's unit
// is not the metre: plans are in metres.
Status AddViews(Views views, bool regions, MapRows* rows);

}  // namespace cairn::emit_map
