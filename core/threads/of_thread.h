#pragma once

#include <pthread.h>

#include <memory>
#include <new>
#include <type_traits>

namespace cairn {

namespace internal {

// A key of POSIX threads, with `destroy` for each thread's value at its end.
class ThreadKey {
 public:
  explicit ThreadKey(void (*destroy)(void*)) : is_made_(pthread_key_create(&key_, destroy) == 0) {}
  // Where the program ends: what threads still have stays.
  ~ThreadKey() {
    if (is_made_) pthread_key_delete(key_);
  }
  ThreadKey(const ThreadKey&) = delete;
  ThreadKey& operator=(const ThreadKey&) = delete;

  // False: no memory, or no key.
  bool Set(const void* value) const { return is_made_ && pthread_setspecific(key_, value) == 0; }

 private:
  pthread_key_t key_ = 0;
  bool is_made_;
};

}  // namespace internal

// The T of the calling thread: made where it is first asked for, destroyed when the thread ends (the main
// thread's is not), after its thread_locals.  Null: there is no memory.  A thread_local with a destructor
// would end the program then (glibc's __cxa_thread_atexit_impl), and wait for the lock of the loader.
// REQUIRES: T() throws nothing.
template <typename T>
T* OfThread() noexcept {
  static_assert(std::is_nothrow_default_constructible_v<T>);
  static thread_local T* mine = nullptr;
  static const internal::ThreadKey key([](void* value) {
    mine = nullptr;  // what T's destructor asks for is another, destroyed after it
    delete static_cast<T*>(value);
  });
  if (mine != nullptr) return mine;
  std::unique_ptr<T> made(new (std::nothrow) T);
  if (made == nullptr || !key.Set(made.get())) return nullptr;
  return mine = made.release();
}

// The same, where work cannot go on without.  Throws: bad_alloc.
template <typename T>
T& RequiredOfThread() {
  T* const mine = OfThread<T>();
  if (mine == nullptr) throw std::bad_alloc();
  return *mine;
}

}  // namespace cairn
