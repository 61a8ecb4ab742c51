#include "core/base/pooled.h"

#include <algorithm>
#include <array>
#include <bit>
#include <new>
#include <utility>

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

// Sanitizers see what is used after it was given back only where it goes back to them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
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
      num_bytes_ -= BytesOf(at);
      return block;
    }
    return nullptr;
  }

  // False: enough is kept.
  bool Keep(Block* block) {
    const size_t num_bytes = BytesOf(block->size);
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

// Null while a thread ends, when there may be objects that outlive its pool.
thread_local bool is_gone = false;

Pool* PoolOfThread() {
  if (is_gone) return nullptr;
  thread_local Pool pool;
  return &pool;
}

Pool::~Pool() {
  is_gone = true;
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
    if (Pool* const pool = PoolOfThread()) block = pool->Take(size);
  }
  if (block == nullptr) block = new (operator new(sizeof(Block) + num_bytes, kAlignment)) Block{.size = size};
  return block + 1;
}

void GivePooled(void* memory) noexcept {
  Block* const block = static_cast<Block*>(memory) - 1;
  if (block->size < kNumSizes) {
    if (Pool* const pool = PoolOfThread(); pool != nullptr && pool->Keep(block)) return;
  }
  operator delete(block, kAlignment);
}

size_t PooledSize(size_t num_bytes) {
  return sizeof(Block) + (num_bytes <= kLargestBytes ? BytesOf(SizeFor(num_bytes)) : num_bytes);
}

}  // namespace cairn
