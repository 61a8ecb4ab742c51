#pragma once

#include <cstddef>

namespace cairn {

// Memory for levels, which a thread uses again for its next image: a good part of a first image's time is the
// system's, which clears pages.  In large pages where the system has them, as the rows around a keypoint are
// on a page each otherwise, which costs a tenth of the time.
class SiftMemory {
 public:
  SiftMemory() = default;
  ~SiftMemory() { Free(); }
  SiftMemory(const SiftMemory&) = delete;
  SiftMemory& operator=(const SiftMemory&) = delete;

  // Room for so many floats, from a page's beginning: zeros, or what was left there; all finite if all that
  // was written was.  What was taken before is no longer valid.  Throws: bad_alloc.
  float* Take(size_t num);
  // Gives the memory back if it is more than that.
  void Trim(size_t max_num);

 private:
  void Free();

  void* mapped_ = nullptr;
  size_t num_mapped_bytes_ = 0;
  float* floats_ = nullptr;
  size_t num_ = 0;
};

}  // namespace cairn
