#pragma once

namespace cairn::pipeline {

// A stage of the line, from a capture to a map.
struct LineStage {
  const char* name;  // its folder, recipe table, options file and part of a build report
  const char* file;  // what it makes in the build folder; "map": the map itself, beside its stamp there
};

// In the order in which they run (map.mk has their rules).
inline constexpr LineStage kLine[] = {{"simulate", "capture"},
                                      {"import", "film"},
                                      {"join_captures", "capture"},
                                      {"extract_features", "features.db"},
                                      {"match_features", "matches.db"},
                                      {"reconstruct", "poses"},
                                      {"group_classes", "classes.db"},
                                      {"filter_visibility", "world.db"},
                                      {"decompose_regions", "regions.db"},
                                      {"build_vocabulary", "vocabulary.db"},
                                      {"link_appearance", "appearance.db"},
                                      {"decompose_views", "views.db"},
                                      {"emit_map", "unsealed.cairn"},
                                      {"leave_out", "left_out"},
                                      {"check_map", "map"}};

}  // namespace cairn::pipeline
