#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Which landmarks each of some images sees, ascending.
using SightLists = std::vector<std::vector<int32_t>>;

// The lists range coded (range_coder.h), each by those of the images before that see much the same:
// schemas/FORMAT.md draws the bytes.  REQUIRES: strictly ascending numbers >= 0
std::string PackSights(const SightLists& lists);
// Fills in `lists`, which has one per image.  False where the bytes make no sense, name landmarks from
// `num_landmarks` on, or give an image more than `max_num_seen`, or all together more than `*num_left`, from
// which it takes them: a few bytes can stand for millions.
bool UnpackSights(std::string_view bytes, int64_t num_landmarks, size_t max_num_seen, int64_t* num_left,
                  SightLists* lists);

}  // namespace cairn
