#pragma once

#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {

// A map with rows in every table and a block of every kind.
inline MapRows FullRows() {
  const EmitExample example = MakeEmitExample();
  MapRows rows = *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                    {.landmarks = "regions",
                                     .min_num_landmarks_for_words = 0,
                                     .landmarks_per_word = 1,
                                     .documents = "kept"},
                                    &example.appearance);
  EXPECT_TRUE(emit_map::AddViews(MakeExampleViews(), /*regions=*/true, &rows).ok());
  rows.visual_map = MakeExampleVisualMap();
  rows.name = "example";
  rows.writer = "cairn test";
  rows.sessions = {"day1", "day2"};
  rows.stage_options = {{"emit_map", "k = 3\n"}, {"check_map", "x = 1\n"}};
  rows.input_hashes = {{"world.db", "0123"}, {"classes.db", "4567"}};
  rows.self_test = {{"num_localized", 3}, {"num_queries", 4}};
  rows.camera_from_given.translation = {0.1, -0.2, 0.3};
  Camera camera = rows.cameras[0];
  camera.camera_id = 9;
  camera.width = 300;
  rows.cameras.push_back(camera);
  rows.findings.promise = {.radius_m = 0.5,
                           .radius_deg = 15,
                           .landmarks_lower_bound = 2,
                           .nodes = {{0, 0, 1, 0.875, 25.5, 0.125, 0.875}, {1, 0, 0, 1, 30, 0.5, 1}},
                           .left_out = {{0.95, 30, 29, 0.999}},
                           .held_out = {{0.98, 1, 1, 0.981}}};
  rows.findings.self_test_regions = {{kOutsideRegions, 2, 0, 0, {}},
                                     {1, 4, 3, 1, RegionSelfTest::Errors{0.03, 0.3, 0.8, 8}}};
  rows.findings.drops = {{44, "decompose_regions", "station", "left_over", "not covered", 200, {0, 200, 1}}};
  rows.findings.changes = {{1, {0.5, -1.25, 2}, 0.25, 20, 3, 0, 1}};
  return rows;
}

}  // namespace cairn
