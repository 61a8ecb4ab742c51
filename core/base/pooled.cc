#include "core/base/pooled.h"

#include <algorithm>
#include <array>
#include <bit>
#include <new>
#include <utility>

#include "core/threads/of_thread.h"

namespace cairn {
namespace {

// Before the memory that is given out, a cache line as that is.
struct alignas(64) Block {
  int size = 0;           // index of its size
  Block* next = nullptr;  // of those that are kept
};
constexpr std::align_val_t kAlignment{alignof(Block)};

// Sizes of blocks: eight steps to each doubling.
constexpr int kSteps = 8;
constexpr size_t kLeastBytes = 64;
constexpr int kNumDoublings = 17;
constexpr int kNumSizes = kSteps * kNumDoublings + 1;
constexpr size_t kLargestBytes = kLeastBytes << kNumDoublings;  // 8 MiB
constexpr size_t kMaxKeptBytes = size_t{16} << 20;

// The smallest that is enough.  REQUIRES: at most kLargestBytes
int SizeFor(size_t num_bytes) {
  if (num_bytes <= kLeastBytes) return 0;
  const size_t last = num_bytes - 1;
  const int doubling = std::bit_width(last / kLeastBytes) - 1;
  const size_t whole = kLeastBytes << doubling;
  return kSteps * doubling + static_cast<int>((last - whole) / (whole / kSteps)) + 1;
}

size_t BytesOf(int size) {
  const size_t whole = kLeastBytes << (size / kSteps);
  return whole + whole / kSteps * (size % kSteps);
}

size_t WholeBytesOf(int size) { return sizeof(Block) + BytesOf(size); }

// Of sanitizers g++ tells by macros, clang by a question.
#if defined(__has_feature)
#define CAIRN_HAS_FEATURE(feature) __has_feature(feature)
#else
#define CAIRN_HAS_FEATURE(feature) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || CAIRN_HAS_FEATURE(address_sanitizer) || \
    CAIRN_HAS_FEATURE(thread_sanitizer)
constexpr bool kKeeps = false;
#else
constexpr bool kKeeps = true;
#endif

// The blocks that a thread keeps.
class Pool {
 public:
  Pool() = default;
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;
  ~Pool();

  // One of this size or up to twice as large, as what a loop takes varies; null: none is kept.
  Block* Take(int size) {
    const int end = std::min(size + kSteps + 1, kNumSizes);
    for (int at = size; at < end; ++at) {
      Block* const block = blocks_[at];
      if (block == nullptr) continue;
      blocks_[at] = block->next;
      num_bytes_ -= WholeBytesOf(at);
      return block;
    }
    return nullptr;
  }

  // False: enough is kept.  Larger blocks make room for it: a large search must not keep what repeats from
  // being kept.
  bool Keep(Block* block) {
    const size_t num_bytes = WholeBytesOf(block->size);
    for (int at = kNumSizes - 1; at > block->size && num_bytes_ + num_bytes > kMaxKeptBytes; --at) {
      while (blocks_[at] != nullptr && num_bytes_ + num_bytes > kMaxKeptBytes) {
        num_bytes_ -= WholeBytesOf(at);
        operator delete(std::exchange(blocks_[at], blocks_[at]->next), kAlignment);
      }
    }
    if (num_bytes_ + num_bytes > kMaxKeptBytes) return false;
    num_bytes_ += num_bytes;
    block->next = blocks_[block->size];
    blocks_[block->size] = block;
    return true;
  }

 private:
  std::array<Block*, kNumSizes> blocks_{};  // of each size
  size_t num_bytes_ = 0;
};

Pool::~Pool() {
  for (Block* first : blocks_) {
    while (first != nullptr) operator delete(std::exchange(first, first->next), kAlignment);
  }
}

}  // namespace

void* TakePooled(size_t num_bytes) {
  Block* block = nullptr;
  int size = kNumSizes;  // none
  if (kKeeps && num_bytes <= kLargestBytes) {
    size = SizeFor(num_bytes);
    num_bytes = BytesOf(size);
    if (Pool* const pool = OfThread<Pool>()) block = pool->Take(size);
  }
  if (block == nullptr) block = new (operator new(sizeof(Block) + num_bytes, kAlignment)) Block{.size = size};
  return block + 1;
}

void GivePooled(void* memory) noexcept {
  Block* const block = static_cast<Block*>(memory) - 1;
  if (block->size < kNumSizes) {
    if (Pool* const pool = OfThread<Pool>(); pool != nullptr && pool->Keep(block)) return;
  }
  operator delete(block, kAlignment);
}

bool KeepsPooled() { return kKeeps; }

size_t PooledSize(size_t num_bytes) {
  return sizeof(Block) + (num_bytes <= kLargestBytes ? BytesOf(SizeFor(num_bytes)) : num_bytes);
}

}  // namespace cairn
