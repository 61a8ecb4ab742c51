// The options of emit_map: what each means, its range and when it is read.
#include "core/world/visual_map.h"
#include "stages/emit_map/emit_map.h"

namespace cairn::emit_map {

OptionTable DescribeOptions(EmitMapOptions* options) {
  OptionTable table = {
      {.name = "landmarks",
       .value = &options->landmarks,
       .help = "classes that become landmarks: the fewest that localize left-out survey images as all do, "
               "those that regions keep, or all",
       .choices = {"fewest", "regions", "all"}},
      {.name = "max_bytes",
       .value = &options->max_bytes,
       .help = "most bytes of the sealed map, which keeps the landmarks with which left-out survey images "
               "are localized best; 0: no limit",
       .min = 0},
      {.name = "left_out_max_error_m",
       .value = &options->left_out_max_error_m,
       .help = "choosing landmarks: a left-out survey image counts as localized within this distance of its "
               "place, m",
       .min = 1e-6},
      {.name = "left_out_max_error_deg",
       .value = &options->left_out_max_error_deg,
       .help = "choosing landmarks: and within this angle of its rotation, degrees",
       .min = 1e-6},
      {.name = "min_recall_ratio",
       .value = &options->min_recall_ratio,
       .help = "fewest landmarks: part of the left-out images that all localize that must stay localized",
       .min = 0,
       .max = 1},
      {.name = "max_error_ratio",
       .value = &options->max_error_ratio,
       .help = "fewest landmarks: how many times as large errors of left-out images may be as with all of "
               "them, geometric mean",
       .min = 1},
      {.name = "least_error_ratio",
       .value = &options->least_error_ratio,
       .help = "fewest landmarks: errors below this part of left_out_max_error_m count as it",
       .min = 1e-6,
       .max = 1},
      {.name = "promise_matches",
       .value = &options->promise_matches,
       .help = "what the map promises at every place and heading: at least so many matched landmarks, within "
               "left_out_max_error_m and _deg",
       .min = 1},
      {.name = "promise_probability",
       .value = &options->promise_probability,
       .help = "with this probability",
       .min = 0.01,
       .max = 0.999},
      {.name = "max_region_landmarks",
       .value = &options->max_region_landmarks,
       .help = "most landmarks of a region that keeps the promise by itself; more where one place needs them",
       .min = 1},
      {.name = "descriptor_bits",
       .value = &options->descriptor_bits,
       .help = "most bits in which a value of a landmark's descriptor is stored; 8: unchanged",
       .min = 1,
       .max = 8},
      {.name = "descriptor_code",
       .value = &options->descriptor_code,
       .help =
           "how descriptors are stored: levels of their values, levels of a transform's coefficients, all "
           "packed in fewer bytes, or auto: a transform where left-out survey images try the map",
       .choices = {"auto", "levels", "transform"}},
      {.name = "min_num_landmarks_for_words",
       .value = &options->min_num_landmarks_for_words,
       .help = "fewest landmarks of a map with a vocabulary; in a smaller one every landmark is a word",
       .min = 0},
      {.name = "landmarks_per_word",
       .value = &options->landmarks_per_word,
       .help = "most landmarks of a word that could be split",
       .min = 1},
      {.name = "max_num_words",
       .value = &options->max_num_words,
       .help = "approximate maximum number of words",
       .min = 1},
      {.name = "words",
       .value = &options->words,
       .help = "what words count: landmarks that an image sees, or all features of survey images (a larger "
               "map that recognises places better)",
       .choices = {"landmarks", "survey"}},
      {.name = "documents",
       .value = &options->documents,
       .help = "survey images that retrieval finds: all, or those that link_appearance keeps",
       .choices = {"all", "kept"}},
      {.name = "visual_map",
       .value = &options->visual_map,
       .help = "store how every landmark looks from different places: the visual map, for localization "
               "without 3-D points"},
      {.name = "max_num_sights",
       .value = &options->max_num_sights,
       .help = "most sights that the models of a landmark store",
       .min = 16,
       .max = kMaxNumSights},
      {.name = "bad_model_px",
       .value = &options->bad_model_px,
       .help = "models that predict left-out sights worse than this count less, px",
       .min = 0},
      {.name = "view_regions",
       .value = &options->view_regions,
       .help = "of a floor plan, store the view-invariant regions besides the walls, from which they are "
               "derived otherwise, where they are needed"},
      {.name = "previous",
       .value = &options->previous,
       .help = "map of the same survey before a session was added: what still holds of it stays as it is, so "
               "that robots that have it are sent little (cairn update delta); absolute or relative to the "
               "recipe; empty: the map is made anew"}};
  AddCondition({"landmarks", {"fewest"}}, {"min_recall_ratio", "max_error_ratio", "least_error_ratio"},
               &table);
  AddCondition({"max_bytes", {"0"}}, {"min_recall_ratio", "max_error_ratio", "least_error_ratio"}, &table);
  AddCondition({"visual_map", {"true"}}, {"max_num_sights", "bad_model_px"}, &table);
  return table;
}

}  // namespace cairn::emit_map
