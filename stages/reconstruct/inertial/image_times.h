#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace cairn::reconstruct {

// When an image was taken, nanoseconds, by its name (without folders): seconds with a point, as films and
// bags are imported and TUM's data sets have it ("0000000010.050000000.png", "000012.345.jpg"), or an integer
// of nanoseconds of ten digits at least, as EuRoC's ("1403636579763555584.png").  None: its name is no time.
std::optional<int64_t> TimeOfImageNs(const std::string& name);

}  // namespace cairn::reconstruct
