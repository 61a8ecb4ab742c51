#pragma once

#include "core/atlas/atlas_file.h"

namespace cairn {

// An atlas of two maps with an image that looks alike in both and a lift between them.
inline AtlasRows TwoFloors() {
  AtlasRows atlas;
  atlas.name = "campus";
  atlas.epoch = 7;
  for (int bit = 0; bit < kNumCodeBits; ++bit) {
    atlas.code_book.coefficients[bit] = static_cast<uint8_t>(3 * bit);
    atlas.code_book.medians[bit] = static_cast<int16_t>(bit % 2 == 0 ? 100 * bit : -100 * bit);
  }
  atlas.maps.push_back({.name = "floor 1",
                        .file = "floor1.cairn",
                        .fingerprint = {1, 2, 3},
                        .num_bytes = 100'000,
                        .num_images = 40,
                        .places = {{0, 1, 0xffffffff}, {}, {5, 1u << 31}}});
  atlas.maps.push_back({.name = "floor 2", .file = "../floor2.cairn", .num_images = 9, .places = {{77}}});
  atlas.look_alikes = {{{0, 39}, {1, 8}}};
  atlas.passages = {{.name = "lift", .from = {0, 3}, .to = {1, 0}, .cost = 12.5}};
  return atlas;
}

}  // namespace cairn
